"""A grid-following converter: a phase-locked loop gives its frame, and it injects controlled current."""
