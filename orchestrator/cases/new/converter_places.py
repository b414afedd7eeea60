"""Places of new converters in a network, and the units that feed less with them."""

import itertools
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from orchestrator.cases.form.names import close_names
from orchestrator.cases.networks.data import bus_name
from orchestrator.cases.networks.psse.raw_file import read_file
from orchestrator.cases.new.wanted_case import WantedConverter
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import InputError, few
from orchestrator.core.options import Option

_CONVERTER = "gfor"
_INJECTION = "injection"


@dataclass(frozen=True)
class ConverterPlace:
    """Where the converter goes, and what changes with it: machine that feeds less, its power before and now [MW]."""

    wanted: WantedConverter
    bus: str
    v_pu: float
    slack: str
    less: str | None = None
    before_mw: float = 0.0  # less what the converters before this one took over
    rating_mva: float = 1.0
    name: str = _CONVERTER
    injection: str = _INJECTION  # the same power without dynamics

    @property
    def left_mw(self) -> float:
        """Return what the machine still feeds."""
        return self.before_mw - self.wanted.p_mw

    @property
    def changed(self) -> dict[str, str]:
        """Values of every scenario with the converter."""
        if self.wanted.replaces or not self.less:
            return {}
        return {f"{self.less}.P_0": f"{self.left_mw / self.rating_mva:.6f}"}


def with_names(places: Sequence[ConverterPlace]) -> tuple[ConverterPlace, ...]:
    """Several converters bear the names of their buses, ``gfor_9``, those at one bus with numbers, ``gfor_9_1``; one
    is ``gfor``."""
    if len(places) < 2:
        return tuple(places)
    at = Counter(place.bus for place in places)
    seen: Counter[str] = Counter()
    # a bus may be called as a numbered converter of another one is
    taken = {_of_bus(bus) for bus, count in at.items() if count == 1}
    found: list[ConverterPlace] = []
    for place in places:
        name = _of_bus(place.bus)
        if at[place.bus] > 1:
            numbers = itertools.count(seen[place.bus] + 1)
            seen[place.bus] = next(k for k in numbers if f"{name}_{k}" not in taken)
            name = f"{name}_{seen[place.bus]}"
            taken.add(name)
        found.append(replace(place, name=f"{_CONVERTER}_{name}", injection=f"{_INJECTION}_{name}"))
    return tuple(found)


def _of_bus(bus: str) -> str:
    return bus.removeprefix("bus_")


def buses_by_name(files: Sequence[Path]) -> dict[str, list[str]]:
    """The buses by the names that a RAW file gives them."""
    found: dict[str, list[str]] = {}
    raw = [path for path in files if path.suffix.lower() in (".raw", ".rawx")]
    for record in (record for path in raw for record in read_file(path).of("bus")):
        found.setdefault(record.text(1, "").strip(), []).append(
            bus_name(str(record.whole(0, "the bus' number")))
        )
    return found


def place_for(
    wanted: WantedConverter,
    base: PreparedScenario,
    called: Mapping[str, Sequence[str]],
    others: Sequence[ConverterPlace] = (),
) -> ConverterPlace:
    network, flow = base.network, base.power_flow
    if network is None or flow is None:
        raise InputError("the network has no power flow")
    names = {
        wanted.bus,
        bus_name(wanted.bus),
        f"bus_{wanted.bus}",
        *called.get(wanted.bus, ()),
    } & set(network.buses)
    if len(names) != 1:
        hint = close_names(
            bus_name(wanted.bus), [*network.buses, *called], f"there are: {few(network.buses, 8)}"
        )
        raise InputError(Option.CONVERTER + f": the network has no bus {wanted.bus!r}; {hint}")
    (bus,) = names
    plans = base.system.components
    units = {port.name: port.bus for port in network.ports if port.name in plans}
    at_slack = [name for name, place in units.items() if place == flow.slack]
    found = ConverterPlace(wanted, bus, round(abs(flow.voltages[bus]), 5), ", ".join(at_slack))
    if wanted.less is None:
        return found
    there = [unit for unit, place in units.items() if place in called.get(wanted.less, ())]
    if len(there) == 1:
        wanted = replace(wanted, less=there[0])
    if wanted.less not in units:
        known = f"the network's units: {', '.join(units)}"
        raise InputError(
            Option.CONVERTER + f": there is no unit {wanted.less!r} to feed less; "
            f"{close_names(str(wanted.less), units, known)}"
        )
    rating = plans[wanted.less].number("S_n")
    power = flow.powers[wanted.less].real * rating
    sharing = [one for one in others if one.less == wanted.less]
    if sharing and (wanted.replaces or sharing[-1].wanted.replaces):
        raise InputError(
            Option.CONVERTER
            + f": {wanted.less} is replaced, and another converter names it too; write "
            f"'less {wanted.less}' at both, or another machine"
        )
    power -= sum(one.wanted.p_mw for one in sharing)
    if wanted.replaces:
        if wanted.less in at_slack:
            raise InputError(
                Option.CONVERTER
                + f": instead of {wanted.less}: it is at the slack; replace another, or name "
                "another slack by " + Option.SLACK
            )
        return replace(found, less=wanted.less, before_mw=power, rating_mva=rating)
    if wanted.less not in at_slack and abs(wanted.p_mw - power) < 1e-6:
        raise InputError(
            Option.CONVERTER
            + f": {wanted.less} would feed nothing; write 'instead of {wanted.less}'"
        )
    if wanted.p_mw > power + 1e-6:
        most = f"give the converter at most {power:.5g} MW, or leave the rest to the slack without 'less'"
        raise InputError(
            Option.CONVERTER
            + f": {wanted.less} feeds {power:.5g} MW and cannot feed {wanted.p_mw:g} MW "
            f"less; {most}"
        )
    if wanted.less in at_slack:
        return found  # the slack feeds what is left, whatever it is given
    return replace(found, less=wanted.less, before_mw=power, rating_mva=rating)
