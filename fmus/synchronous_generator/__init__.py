"""Synchronous generator with exciter and governor, as FMUs."""
