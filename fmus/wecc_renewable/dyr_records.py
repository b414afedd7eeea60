"""Records of WECC's generic plants in a PSS/E dynamics file (DYR) → parameters of `wecc_plant_phasor` and its like."""

from fmus.toolchain.dyr_form import records_beside

_RECORDS = records_beside(__file__)
_OF_BUS = "plants"  # kind of a controller of several units, whose record is of a bus

_SAME = {"REPCTA1": "REPCA1"}
"""Names of records that are another by its fields and its model: PSS/E has REPCTA1 beside wind turbines of type 3."""


def model_of_record(name: str) -> str:
    """Return the name under which a plant's model is known here, by PSS/E's name of a record of it."""
    return _SAME.get(name, name)


PLANT_RECORDS = {
    name: record
    for own, record in _RECORDS.items()
    if record.kind != _OF_BUS
    for name in (own, *(other for other, same in _SAME.items() if same == own))
}
"""By PSS/E's name: the kind ``converter`` is the current source and its model, ``electrical`` says what it feeds,
``plant`` sets the references, and the others are of a wind turbine; ``part`` of the plant's controller is the model
with it."""

PLANT_MODEL = "wecc_plant_phasor"
"""The model that is made of any of these records."""

ELSEWHERE = "elsewhere"
"""Word among its records that says that the plant's controller measures at another point of the network."""

CONTROLLER = "PLNTBU1"
"""PSS/E's name of the controller of several units, which is of a bus."""

CONTROLLER_RECORD = _RECORDS[CONTROLLER]

AT_A_UNIT = ("REAX3BU1", "REAX4BU1")
"""Its parts at units, as records of these."""

TYPE_3 = ("WT3G1", "WT3E1", "WT3T1")
"""Records of a turbine of type 3 of the first generation, which go together: converter, control and shaft."""

PITCH_OF_TYPE_3 = "WT3P1"
"""Its pitch control, which may lack."""

TYPE_4 = ("WT4G1", "WT4E1")
"""Records of a turbine of type 4 of the first generation: converter and control."""

FIRST_GENERATION = ((TYPE_3, (PITCH_OF_TYPE_3,)), (TYPE_4, ()))
"""Turbines of the first generation: records that go together, and those that may lack."""

OF_FIRST_GENERATION = frozenset({*TYPE_3, PITCH_OF_TYPE_3, *TYPE_4})
