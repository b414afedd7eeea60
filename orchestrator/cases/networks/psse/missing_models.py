"""Models of a DYR file that gfor does not have: what each is, and what leaving it out would change."""

import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from fmus.synchronous_generator.dyr_records import DYR_RECORDS
from orchestrator.cases.form.remedies import replacement_of, without_models
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord
from orchestrator.cases.networks.psse.raw_network import Machine
from orchestrator.core.options import Option

MACHINE = "machine"
DEVICE = "device"
LOAD = "load"
LIMITER = "limiter"

UNKNOWN = "unknown"
OF_MACHINES = (
    MACHINE,
    "exciter",
    "governor",
    "stabilizer",
    "compensator",
    "limiter",
    "supervisor",
    "plant",
    "converter",
)
"""Kinds of models that belong to a machine of the network."""

_STANDS = {
    "exciter": "a constant field voltage, or [units] exciter",
    "governor": "a constant mechanical power, or [units] governor",
    "stabilizer": "none, or [units] stabilizer",
    "compensator": "control of the machine's own voltage",
    "limiter": "none",
    "supervisor": "constant references",
    "plant": "constant references",
    "plants": "constant references",
    "converter": "a converter of ours: [units.parameters], alpha = 1",
    "load": "[network] load_model",
    "device": "its power in the RAW file, constant",
    "relay": "none",
}
"""What stands in the place of a record that is left out, by its kind."""

_MOVES = {
    "exciter": "much: the voltage control gives or takes damping torque",
    "governor": "little: it acts below the electromechanical modes; the slowest of them may move",
    "stabilizer": "much: it is there to damp these modes",
    "compensator": "little: it shifts the point whose voltage is held; a large X_c moves damping",
    "limiter": "not: it acts at limits only",
    "supervisor": "little: it is slower than these modes",
    "plant": "little: it is slower than these modes",
    "plants": "little: it is slower than these modes",
    "converter": "much where converters carry much of the power",
    "load": "some: how loads follow the voltage decides about weak damping",
    "device": "some: its voltage control acts on the modes nearby",
    "relay": "not: it acts on events only",
}
"""How far the electromechanical modes move without a record, and why, by its kind."""


@dataclass(frozen=True, slots=True)
class MissingModel:
    """A model without a counterpart: how many records of machines in service, and their power [MW]."""

    name: str
    kind: str
    records: tuple[DynamicRecord, ...]
    p_mw: float
    is_own: bool  # whether it is what a generator of the RAW file is: a machine, or a static var compensator

    @property
    def may_go(self) -> bool:
        """Return whether its records may be left out; what a generator is itself may not."""
        return not self.is_own

    @property
    def stands(self) -> str:
        return _STANDS.get(self.kind, "what [units] says of that part")

    @property
    def moves(self) -> str:
        return _MOVES.get(self.kind, "not known: gfor does not know what this model is")

    @property
    def row(self) -> tuple[str, ...]:
        """Cells of the table."""
        first = f"line {self.records[0].line}"
        count = str(len(self.records))
        return (self.name, count, f"{self.p_mw:.0f}", first, self.stands, self.moves)


@cache
def _kinds() -> Mapping[str, str]:
    path = Path(__file__).with_name("model_names.toml")
    listed = tomllib.loads(path.read_text(encoding="utf-8"))
    return {name: kind for kind, names in listed.items() for name in str(names).split()}


def kind_of(name: str) -> str:
    """Return what a model is: ``machine``, ``exciter``, …; ``unknown`` if it stands in no list."""
    return _kinds().get(name, UNKNOWN)


_OF_FACTS_DEVICES = ("CSTCNT", "SVSMO3T2", "SVSMO3T3")
"""Models whose records begin with the name of a FACTS device, where those of DC lines have theirs."""


def owner_of(record: DynamicRecord) -> str:
    """Return what a record without a machine is of: those that begin with a name are of DC lines or FACTS devices."""
    if not record.line_of_dc:
        return "bus"
    return "FACTS device" if record.name in _OF_FACTS_DEVICES else "DC line"


@cache
def _reasons(file: str) -> Mapping[str, str]:
    path = Path(__file__).with_name(file)
    listed = tomllib.loads(path.read_text(encoding="utf-8"))
    return {name: reason for reason, names in listed.items() for name in str(names).split()}


def reason_of_device(name: str) -> str:
    """Return why a compensator's or a DC line's record has no model; empty if that is not known."""
    return _reasons("devices_without_model.toml").get(name, "")


def reason_of_limiter(name: str) -> str:
    """Return why a record of a limiter of excitation has no part."""
    return _reasons("limiters_without_model.toml")[name]


def limiter_in_place(name: str, unit: str) -> str:
    """Return what gives a unit one of our limiters in the place of a record, as it is typed."""
    part = "uel=mnlex2" if name.startswith(("MNLEX", "UEL")) else "oel=maxex2"
    return f"{Option.SET} sg{unit}.{part}"


_RELAY = "relay"
_RELAYS_OF_LOADS = ("LVSH", "LDSH", "LVS3", "LDS3", "LDST", "LVDT", "UVUF")
"""How the names of relays begin that shed load."""


def names_load(name: str) -> bool:
    """Return whether the identifier of a model's record is a load's, which may be that of the machine at its bus."""
    kind = kind_of(name)
    return kind == LOAD or (kind == _RELAY and name.startswith(_RELAYS_OF_LOADS))


RESTS = "a limiter of excitation, taken to rest at the operating point"
_RESTING = ("MAXEX", "MNLEX", "UEL", "OEL", "SCL")
"""How the names of limiters of excitation begin, which rest at an operating point within their limits."""


def is_resting(name: str) -> bool:
    """Return whether a model is a limiter of excitation without a part of ours, which is passed over."""
    without = name not in DYR_RECORDS and kind_of(name) == LIMITER
    return without and name.startswith(_RESTING)


def missing_models(
    records: Sequence[DynamicRecord],
    machines: Mapping[tuple[int, str], Machine],
    known: Collection[str],
    bare: Collection[tuple[int, str]],
) -> list[MissingModel]:
    """Models of machines in service that are not known, those behind most power first.

    ``known``: names of models that need no place here; ``bare``: machines without a record of one."""
    found: dict[str, list[DynamicRecord]] = {}
    for record in records:
        is_known = record.name in known or is_resting(record.name)
        if (record.bus, record.machine) in machines and not is_known:
            found.setdefault(record.name, []).append(record)
    missing = [
        MissingModel(
            name, kind_of(name), tuple(own), sum(_power(own, machines)), is_own(name, own, bare)
        )
        for name, own in found.items()
    ]
    return sorted(missing, key=lambda model: (model.may_go, -model.p_mw))


def is_own(name: str, records: Sequence[DynamicRecord], bare: Collection[tuple[int, str]]) -> bool:
    """Return whether records are what generators are themselves.

    ``bare``: machines without a record of one; at others a static var compensator is a shunt beside them."""
    stands_alone = any((record.bus, record.machine) in bare for record in records)
    kind = kind_of(name)
    return kind == MACHINE or (kind == DEVICE and stands_alone)


def _power(
    records: Sequence[DynamicRecord], machines: Mapping[tuple[int, str], Machine]
) -> list[float]:
    keys = dict.fromkeys((record.bus, record.machine) for record in records)
    return [machines[key].p_mw for key in keys]


_HEAD = ("model", "count", "MW", "first", "in its place, if it is left out", "moves these modes")


def in_words(missing: Sequence[MissingModel], labels: Mapping[tuple[int, str], str]) -> list[str]:
    """The table as lines, and what may be done, in the words that are typed.

    ``labels``: of the machines' units, by bus and identifier."""
    if not missing:
        return []
    rows = [_HEAD, *(model.row for model in missing if model.may_go)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(_HEAD))]
    lines = []
    if len(rows) > 1:
        lines.append("no part of ours stands for these models:")
        lines += ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
        names = [model.name for model in missing if model.may_go]
        lines.append(f"to go on without them, write {without_models(names)}")
    for model in missing:
        if not model.may_go:
            first = model.records[0]
            unit = labels[first.bus, first.machine]
            lines.append(
                f"{first.place}: no part of ours stands for {model.name}, the machine itself ({len(model.records)} of "
                f"{model.p_mw:.0f} MW); it cannot be left out: write another record of a machine, or "
                f"{replacement_of(unit)}, and a converter of ours stands there"
            )
    return lines
