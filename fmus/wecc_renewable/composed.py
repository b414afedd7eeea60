"""The plant whose records are chosen by name: `wecc_plant_phasor`."""

from collections.abc import Mapping
from dataclasses import replace

from fmus.toolchain.model import Model
from fmus.wecc_renewable.behind_impedance import REGCB1, REGCC1
from fmus.wecc_renewable.converters import REGCA1, Kind
from fmus.wecc_renewable.dyr_records import (
    AT_A_UNIT,
    ELSEWHERE,
    FIRST_GENERATION,
    OF_FIRST_GENERATION,
    PITCH_OF_TYPE_3,
    TYPE_3,
)
from fmus.wecc_renewable.electrical import Reeca1
from fmus.wecc_renewable.electrical_blocking import Reecd1
from fmus.wecc_renewable.electrical_storage import Reecc1
from fmus.wecc_renewable.model import Makeup, composed, type_3, type_4
from fmus.wecc_renewable.turbine import TurbineParts

CONVERTERS: dict[str, Kind] = {"REGCA1": REGCA1, "REGCB1": REGCB1, "REGCC1": REGCC1}
CONTROLS: dict[str, type[Reeca1]] = {
    "REECA1": Reeca1,
    "REECB1": Reeca1,
    "REECC1": Reecc1,
    "REECD1": Reecd1,
}
PLANT = "REPCA1"
SHAFT = "WTDTA1"
ON_SHAFT = ("WTARA1", "WTPTA1", "WTTQA1")


def wecc_plant_phasor(records: str = "REGCC1 REECD1") -> Model:
    """Plant of WECC's generic models, phasor type.

    Parameters
    ----------
    records
        PSS/E's names of its records, in any order: one of `CONVERTERS` and one of `CONTROLS`; REPCA1, with the word
        ``elsewhere`` if it measures at another point of the network, or one of `AT_A_UNIT`, if a component of
        `plant_controller_phasor` sets the references of several units; WTDTA1, and with it some of `ON_SHAFT`. Or those
        of one turbine of `FIRST_GENERATION`.

    Raises
    ------
    ValueError
        If a name is none of these, a kind lacks, or there are two of one kind.
    """
    given = records.split()
    if {*given} & OF_FIRST_GENERATION:
        return _of_first_generation(records)
    converter = _one_of("converter", CONVERTERS, given)
    control = _one_of("control", CONTROLS, given)
    known = {*CONVERTERS, *CONTROLS, PLANT, ELSEWHERE, *AT_A_UNIT, SHAFT, *ON_SHAFT}
    for name in given:
        if name not in known or given.count(name) > 1:
            what = "stands twice" if name in known else f"is none of {', '.join(sorted(known))}"
            raise ValueError(f"records = {records!r}: {name!r} {what}")
    needed = {ELSEWHERE: PLANT, **dict.fromkeys(ON_SHAFT, SHAFT)}
    for name, other in needed.items():
        if name in given and other not in given:
            raise ValueError(f"records = {records!r}: {name!r} needs {other!r} beside it")
    plants = [name for name in given if name in (PLANT, *AT_A_UNIT)]
    if len(plants) > 1:
        raise ValueError(f"records = {records!r}: {' and '.join(plants)}: a unit has one of them")
    turbine = TurbineParts(*(name in given for name in ON_SHAFT)) if SHAFT in given else None
    makeup = Makeup(
        CONVERTERS[converter],
        CONTROLS[control],
        has_plant=PLANT in given,
        measures_elsewhere=ELSEWHERE in given,
        is_one_of_several=any(name in given for name in AT_A_UNIT),
        turbine=turbine,
    )
    rest = [name for name in (PLANT, ELSEWHERE, *AT_A_UNIT, SHAFT, *ON_SHAFT) if name in given]
    name = "_".join(["wecc_plant", *(n.lower() for n in (converter, control, *rest)), "phasor"])
    title = f"Plant of {', '.join(n for n in (converter, control, *rest) if n != ELSEWHERE)}"
    return replace(composed(name, f"{title} (phasor type)", makeup), of_parts=True)


def _of_first_generation(records: str) -> Model:
    """A turbine of the first generation."""
    given = records.split()
    needed, more = next(own for own in FIRST_GENERATION if {*given} & {*own[0], *own[1]})
    if not {*needed} <= {*given} <= {*needed, *more} or len({*given}) < len(given):
        beside = f", with {' or '.join(more)} or without," if more else ""
        raise ValueError(
            f"records = {records!r}: {' '.join(needed)} go together{beside} and nothing else beside them"
        )
    names = [name for name in (*needed, *more) if name in given]
    name = "_".join(["wecc_plant", *(n.lower() for n in names), "phasor"])
    title = f"Wind turbine of {', '.join(names)} (phasor type)"
    if needed != TYPE_3:
        return replace(type_4(name, title), of_parts=True)
    return replace(type_3(name, title, has_pitch=PITCH_OF_TYPE_3 in names), of_parts=True)


def _one_of(kind: str, choices: Mapping[str, object], given: list[str]) -> str:
    found = [name for name in given if name in choices]
    if len(found) != 1:
        many = "more than one" if found else "no"
        raise ValueError(
            f"records = {' '.join(given)!r}: {many} {kind}; name one of {', '.join(choices)}"
        )
    return found[0]
