"""Case files: what to couple, from which operating point, in which scenarios."""
