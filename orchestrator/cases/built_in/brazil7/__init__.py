"""The Brazilian equivalent of seven buses, a benchmark of the IEEE PES."""
