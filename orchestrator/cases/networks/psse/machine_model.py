"""The model of a generator by its records of dynamics data: the parts that it is made of."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

from fmus.wecc_renewable.dyr_records import (
    AT_A_UNIT,
    ELSEWHERE,
    PLANT_MODEL,
    PLANT_RECORDS,
    model_of_record,
)
from orchestrator.cases.networks.measured_point import MeasuredPoint
from orchestrator.cases.networks.unit_row import DoubtOfRecord

ON_SHAFT = ("aerodynamics", "pitch", "torque")
"""Kinds of records of a wind turbine that act on its shaft."""

KINDS_OF_CONVERTERS = ("converter", "electrical", "plant", "shaft", *ON_SHAFT)
"""Kinds of records that a converter is made of."""

OF_PLANTS = tuple(name for name, record in PLANT_RECORDS.items() if record.kind == "plant")
"""Records of controllers of plants, which set the references of a unit."""

SOURCE_IMPEDANCE = {
    "regfm_a1_phasor": ("RL", "XL"),
    "regfm_b1_phasor": ("Re", "XL"),
    "induction_generator_phasor": ("RA",),
    "REGCB1": ("Re", "Xe"),
    "REGCC1": ("Re", "Xe"),
}
"""Parameters that ZSORCE of the network data gives, by the converter's model or record."""

STATIC = "static_generation_phasor"
"""Model of a machine without a record that the case takes as a constant current."""

BY_SPEED = "electrical.PFLAG"
"""Parameter of a control that only a plant with a shaft has."""

PLANT_MODELS = {
    (): "regca1_phasor",
    ("plant",): "regca1_repca1_phasor",
    ("plant", ELSEWHERE): "regca1_repca1_remote_phasor",
}
"""Models of REGCA1 with REECA1 or REECB1, by what they have besides."""

MANUAL = "manual"
"""The exciter without a regulator, on which neither a stabiliser nor a compensator acts."""

CLASSICAL = "classical"
WITHOUT_INERTIA = {"machine.H": 0.0, "machine.D": 0.0}
"""Parameters with which a classical machine is an infinite bus."""

COMPENSATION = ("exciter.R_C", "exciter.X_C")
"""Parameters of an exciter that a compensator's record sets."""


@dataclass(frozen=True)
class MachineModel:
    """Parts of a generator, and the parameters that its records set; or the model of a converter.

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


def plant_of(names: Mapping[str, str], *, elsewhere: bool) -> tuple[str, dict[str, str]]:
    """The model of a plant of WECC's generic models, and the parts that it is made of.

    ``names``: of its records by their kind; ``elsewhere``: whether its controller measures at another point."""
    word = (ELSEWHERE,) if elsewhere else ()
    besides = tuple(kind for kind in names if kind not in ("converter", "electrical")) + word
    first = (names["converter"], names["electrical"])
    is_one_of_several = names.get("plant") in AT_A_UNIT
    if first in _FIRST and besides in PLANT_MODELS and not is_one_of_several:
        return PLANT_MODELS[besides], {}
    order = [model_of_record(names[kind]) for kind in KINDS_OF_CONVERTERS if kind in names]
    return PLANT_MODEL, {"records": " ".join([*order, *word])}


_FIRST = {("REGCA1", "REECA1"), ("REGCA1", "REECB1")}
"""Converters and controls that have models of their own."""
