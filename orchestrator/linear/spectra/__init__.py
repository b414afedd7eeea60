"""Modes of a linear model: eigenvalues, followed from point to point, and the verdict on stability."""
