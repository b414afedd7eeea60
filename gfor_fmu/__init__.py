"""The product: a grid-forming converter with its power-oscillation-damping controllers, as an FMU."""
