"""Record REGFMB1 of a PSS/E dynamics file (DYR) → parameters of `regfm_b1_phasor`."""

from fmus.toolchain.dyr_form import records_beside

REGFM_B1_RECORDS = records_beside(__file__)
"""By PSS/E's name: the kind ``converter`` is a whole component, and ``part`` its model."""
