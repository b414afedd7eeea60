"""Records of WECC's generic plants in a PSS/E dynamics file (DYR) → parameters of `regca1_phasor` and its variant."""

from fmus.synchronous_generator.dyr_fields import records_beside

PLANT_RECORDS = records_beside(__file__)
"""By PSS/E's name: the kind ``converter`` is the current source and its model, ``electrical`` says what it feeds, and
``plant`` sets the references; ``part`` of the plant's controller is the model with it."""
