"""Nordic 44, the aggregated Nordic system of TOPS."""
