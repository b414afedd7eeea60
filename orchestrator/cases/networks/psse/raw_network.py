"""Contents of a PSS/E RAW file: its tables, its machines in service, and the names of its units."""

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from orchestrator.cases.networks.psse.controls import ShuntRecord, TapRecord
from orchestrator.cases.networks.psse.devices import HeldDevice
from orchestrator.cases.networks.record_use import RecordUse
from orchestrator.cases.networks.sources import SourceTables
from orchestrator.core.errors import Problem

POWER_FACTOR = 0.9  # with which a power tells a rating that is not known
_NO_LETTER = re.compile(r"\W")


@dataclass(frozen=True, slots=True)
class Machine:
    bus: int
    name: str
    line: int
    # p_mw, v_pu: active power [MW], and voltage that it holds at its bus [pu]
    p_mw: float
    v_pu: float
    rating_mva: float  # MBASE [MVA]
    source: complex  # ZSORCE [pu of the rating]
    # q_min_mvar, q_max_mvar, p_min_mw, p_max_mw: limits of reactive and of active power; infinite where the file has
    # none
    q_min_mvar: float
    q_max_mvar: float
    p_min_mw: float = -math.inf
    p_max_mw: float = math.inf
    q_mvar: float = 0.0
    # whether the file has no such machine, and an infinite bus has to feed what is left at its reference
    is_infinite: bool = False

    @property
    def likely_mva(self) -> float:
        """MBASE, or what the machine must be able to feed, by PT or by PG and QG, if that is more [MVA].

        MBASE is the base of the machine's data; PSS/E warns of a power above it."""
        fed = abs(complex(self.p_mw, self.q_mvar))
        if fed <= self.rating_mva:
            return self.rating_mva
        most = self.p_max_mw if math.isfinite(self.p_max_mw) else 0.0
        return max(fed, most) / POWER_FACTOR


def unit_labels(machines: Iterable[Machine]) -> dict[tuple[int, str], str]:
    """Return labels of the machines' units by bus and identifier: the bus, with the identifier where it has several."""
    keys = [(machine.bus, machine.name.strip()) for machine in machines]
    at_bus = Counter(bus for bus, _ in keys)
    return {
        (bus, name): str(bus) if at_bus[bus] == 1 else f"{bus}_{_NO_LETTER.sub('_', name)}"
        for bus, name in keys
    }


def bus_of_unit(name: str, machines: Iterable[Machine]) -> str:
    """Return the bus of a unit or a bus that a case names, ``sg9_1`` or ``bus_9``; the name itself if it is no unit."""
    machines = tuple(machines)
    units = {f"sg{label}": bus for (bus, _), label in unit_labels(machines).items()}
    units |= {f"sg{machine.bus}": machine.bus for machine in machines}
    return f"bus_{units[name]}" if name in units else name


@dataclass(frozen=True)
class FileLoad:
    """One load in service [MW, Mvar], by what a record of dynamics data may name it.

    ``load``: name of the case's load, which all loads of a bus are together that draw, or that feed; ``drawn``: its
    part of that [MW, Mvar], without an admittance that stands there as a shunt; ``v_pu``: the file's voltage."""

    load: str
    bus: int
    name: str
    area: int
    zone: int
    owner: int
    p_mw: float
    q_mvar: float
    drawn: complex = 0j
    v_pu: float = 1.0


@dataclass(frozen=True)
class RawNetwork:
    """A file's tables, its machines in service, and what was taken over in another form.

    ``idle`` has bus and identifier of the machines that are out of service; ``devices`` what feeds or draws by
    controls of its own, such as DC lines."""

    tables: SourceTables
    machines: tuple[Machine, ...]
    changes: tuple[Problem, ...]
    idle: frozenset[tuple[int, str]] = frozenset()
    records: tuple[RecordUse, ...] = ()
    devices: tuple[HeldDevice, ...] = ()
    loads: tuple[FileLoad, ...] = ()
    # what holds a voltage step by step: ratios by the row of their branch, and switched shunts
    taps: Mapping[int, TapRecord] = field(default_factory=dict)
    shunts: tuple[ShuntRecord, ...] = ()
    same: Mapping[int, int] = field(default_factory=dict)  # bus → the one that stands for both
