"""Power system stabilisers that `synchronous_generator` can be made of (IEEE 421.5)."""
