"""Linear models of coupled systems: how they are made, their modes, and doubts about both."""
