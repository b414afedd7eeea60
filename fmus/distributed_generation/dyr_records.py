"""Records of distributed generation in a PSS/E dynamics file (DYR) → parameters of `dera1_phasor` and `pvd1_phasor`."""

from fmus.toolchain.dyr_form import records_beside

DISTRIBUTED_RECORDS = records_beside(__file__)
"""By PSS/E's name: the kind ``converter`` is a whole component, and ``part`` its model."""
