"""A constant current at a constant power factor: the neutral stand-in of a converter, with hardly any dynamics."""
