"""Three machines at an infinite bus, a benchmark of the IEEE PES."""
