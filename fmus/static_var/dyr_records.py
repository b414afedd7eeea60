"""Records of static var compensators of a PSS/E dynamics file (DYR) → parameters of our models."""

from fmus.toolchain.dyr_form import records_beside

STATIC_VAR_RECORDS = records_beside(__file__)
"""By PSS/E's name: the kind ``converter`` is a whole component, and ``part`` its model."""
