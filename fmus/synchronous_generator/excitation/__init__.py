"""Excitation systems with ceilings that `synchronous_generator` can be made of (IEEE 421.5)."""
