"""Records of induction machines in a PSS/E dynamics file (DYR) → parameters of our models."""

from fmus.toolchain.dyr_form import records_beside

_RECORDS = records_beside(__file__)

MOTOR_RECORDS = {name: record for name, record in _RECORDS.items() if record.kind == "load"}
"""By the beginning of PSS/E's name, which `SUBSYSTEMS` end: the kind ``load`` is of loads, and ``part`` its model."""

INDUCTION_RECORDS = {name: record for name, record in _RECORDS.items() if record.kind != "load"}
"""By PSS/E's name: records of generators that are induction machines."""

SUBSYSTEMS = ("BL", "OW", "ZN", "AR", "AL")
"""Ends of the names of a load's records, the narrower first: of a load, an owner, a zone, an area, of all loads."""
