"""The New England system, taken from pandapower: a case to copy for a network of ones own."""
