"""Machines that `synchronous_generator` can be made of."""
