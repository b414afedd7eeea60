"""Governors and turbines that `synchronous_generator` can be made of."""
