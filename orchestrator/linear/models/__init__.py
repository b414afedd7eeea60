"""Linear models of a coupled system, by perturbation of its components, at its operating point."""
