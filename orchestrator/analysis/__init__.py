"""Analysis of a coupled system: operating point, linear model by perturbation, modes, identification."""
