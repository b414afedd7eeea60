"""A foreign library in a process of its own, closed off from the rest of the machine and kept within limits."""
