"""Records of induction machines in a PSS/E dynamics file (DYR) → parameters of our models."""

from fmus.synchronous_generator.dyr_fields import records_beside

MOTOR_RECORDS = records_beside(__file__)
"""By the beginning of PSS/E's name, which `SUBSYSTEMS` end: the kind ``load`` is of loads, and ``part`` its model."""

SUBSYSTEMS = ("BL", "OW", "ZN", "AR", "AL")
"""Ends of the names of a load's records, the narrower first: of a load, an owner, a zone, an area, of all loads."""
