"""Operating points and outages of a scenario: read from files, prepared, and linearised one after the other."""
