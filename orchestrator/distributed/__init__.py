"""Many independent computations: one after another, on the cores of a machine, or on a cluster."""
