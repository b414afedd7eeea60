"""Limiters of excitation that `synchronous_generator` can have: of over- and of underexcitation."""
