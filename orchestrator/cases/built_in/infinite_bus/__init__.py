"""A converter on an infinite bus: voltage dip and load step."""
