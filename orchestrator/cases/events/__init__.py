"""Events of a case file: faults, switching, and the parts of a network that they leave alone."""
