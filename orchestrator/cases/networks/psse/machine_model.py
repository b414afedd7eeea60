"""The model of a generator by its records of dynamics data, and the records that have a part of ours."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

from fmus.regfm_a1.dyr_fields import REGFM_A1_RECORDS
from fmus.static_var.dyr_fields import STATIC_VAR_RECORDS
from fmus.synchronous_generator.dyr_fields import DYR_RECORDS
from fmus.wecc_renewable.dyr_fields import PLANT_RECORDS
from orchestrator.cases.networks.measured_point import MeasuredPoint
from orchestrator.cases.networks.unit_row import DoubtOfRecord

KNOWN_RECORDS = DYR_RECORDS | REGFM_A1_RECORDS | STATIC_VAR_RECORDS | PLANT_RECORDS
WITH_COUPLING_IMPEDANCE = {record.part for record in REGFM_A1_RECORDS.values()}
"""Models whose coupling impedance is ZSORCE of the network data."""

KINDS_OF_CONVERTERS = ("converter", "electrical", "plant")
"""Kinds of records that a converter is made of."""

MEASURING_ELSEWHERE = "regca1_repca1_remote_phasor"
"""The model of a plant whose controller measures at another point of the network."""

MANUAL = "manual"
"""The exciter without a regulator, on which neither a stabiliser nor a compensator acts."""

CLASSICAL = "classical"
WITHOUT_INERTIA = {"machine.H": 0.0, "machine.D": 0.0}
"""Parameters with which a classical machine is an infinite bus."""

COMPENSATION = ("exciter.R_C", "exciter.X_C")
"""Parameters of an exciter that a compensator's record sets."""


@dataclass(frozen=True)
class MachineModel:
    """What a generator is made of, and the parameters that its records set; or the model of a converter.

    ``partial``: a record of it was left out, and the case says what stands for it. ``doubts`` are texts with the
    parameter and the place that they are about; ``replaced`` are lines of records that an approximation stands for,
    with what it leaves out; ``lines`` are the records' by parameter."""

    parts: Mapping[str, str]
    parameters: Mapping[str, float]
    converter: str | None = None
    doubts: tuple[DoubtOfRecord, ...] = ()
    replaced: tuple[tuple[int, str], ...] = ()
    partial: bool = False
    lines: Mapping[str, int] = dataclasses.field(default_factory=dict)
    measured: MeasuredPoint | None = None
