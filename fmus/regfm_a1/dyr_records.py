"""Records REGFMA1 and GDFORM of a PSS/E dynamics file (DYR) → parameters of `regfm_a1_phasor`."""

from fmus.toolchain.dyr_form import records_beside

REGFM_A1_RECORDS = records_beside(__file__)
"""By PSS/E's name: the kind ``converter`` is a whole component, and ``part`` its model."""
