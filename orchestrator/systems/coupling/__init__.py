"""Coupling of FMUs: systems, schedules, the clock, events, observers, and the master that runs them."""
