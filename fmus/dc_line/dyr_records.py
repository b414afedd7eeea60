"""Records of a DC line's control in a PSS/E dynamics file (DYR) → parameters of its stations."""

from fmus.toolchain.dyr_form import records_beside

DC_LINE_RECORDS = records_beside(__file__)
"""By PSS/E's name. The record begins with the name of the line; ``part`` is the rectifier's model."""

RECTIFIER = "lcc_rectifier_phasor"
INVERTER = "lcc_inverter_phasor"

INVERTERS_FIELDS = ("GAMDY",)
"""Parameters of a record that are the inverter's; the others are the rectifier's."""
