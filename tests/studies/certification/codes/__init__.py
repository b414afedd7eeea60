"""Grid codes on the test bench."""
