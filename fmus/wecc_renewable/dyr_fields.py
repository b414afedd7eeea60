"""Records of WECC's generic plants in a PSS/E dynamics file (DYR) → parameters of `wecc_plant_phasor` and its like."""

from fmus.synchronous_generator.dyr_fields import records_beside

PLANT_RECORDS = records_beside(__file__)
"""By PSS/E's name: the kind ``converter`` is the current source and its model, ``electrical`` says what it feeds,
``plant`` sets the references, and the others are of a wind turbine; ``part`` of the plant's controller is the model
with it."""

PLANT_MODEL = "wecc_plant_phasor"
"""The model that is made of any of these records."""

ELSEWHERE = "elsewhere"
"""Word among its records that says that the plant's controller measures at another point of the network."""
