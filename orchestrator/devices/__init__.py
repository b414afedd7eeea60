"""One FMU: how it runs, what its variables mean, whether it can be trusted."""
