"""Clocks of an FMU of FMI 3.0, and variables that come and go with them, as its file declares them."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from xml.etree import ElementTree

from orchestrator.core.errors import FmuFileError

MOST_CLOCKS = 64  # as many as the adapter has bits for
_VARIABILITIES = ("constant", "fixed", "tunable", "changing", "countdown", "triggered")
_CONTINUOUS = ("Float64", "Float32")


@dataclass(frozen=True, slots=True)
class FmiClock:
    name: str
    reference: int
    causality: str
    # by FMI 3.0: constant, fixed and tunable ones are periodic; changing and countdown ones tell the next interval
    # after events; triggered ones depend on others' clocks
    variability: str
    interval: float | None  # between two ticks [s]; None where the FMU is asked for it
    shift: float  # time of the first tick after the start [s]

    @property
    def periodic(self) -> bool:
        return self.variability in ("constant", "fixed", "tunable")


def clocks_of(root: ElementTree.Element) -> tuple[FmiClock, ...]:
    types = {t.get("name"): t for t in root.iterfind("TypeDefinitions/ClockType")}
    return tuple(
        _clock(e, types.get(e.get("declaredType"))) for e in root.iterfind("ModelVariables/Clock")
    )


def _clock(element: ElementTree.Element, declared: ElementTree.Element | None) -> FmiClock:
    said = {**({} if declared is None else declared.attrib), **element.attrib}
    name, variability = said["name"], said.get("intervalVariability", "")
    if variability not in _VARIABILITIES:
        raise FmuFileError(
            f"clock {name!r} has intervalVariability {variability!r}; FMI knows {', '.join(_VARIABILITIES)}"
        )
    interval = _seconds(said, "interval")
    clock = FmiClock(
        name,
        int(said["valueReference"]),
        said.get("causality", "local"),
        variability,
        interval if variability in ("constant", "fixed", "tunable") else None,
        _seconds(said, "shift") or 0.0,
    )
    if variability == "constant" and interval is None:
        raise FmuFileError(f"clock {name!r} is constant and declares no interval")
    if (interval is not None and not 0 < interval < inf) or not 0 <= clock.shift < inf:
        raise FmuFileError(
            f"clock {name!r} has an interval of {interval} s and a shift of {clock.shift} s"
        )
    return clock


def _seconds(said: Mapping[str, str], what: str) -> float | None:
    """A time in seconds, from the exact fraction where there is one."""
    counter, resolution = said.get(f"{what}Counter"), said.get("resolution")
    if counter is not None and resolution is not None:
        return int(counter) / int(resolution)
    text = said.get(f"{what}Decimal")
    return None if text is None else float(text)


def special_variables(root: ElementTree.Element) -> dict[int, tuple[int, ...]]:
    """References of variables that belong to clocks, with their clocks'; of those whose change is an event."""
    asks = any(c.variability == "tunable" and c.interval is None for c in clocks_of(root))
    found: dict[int, tuple[int, ...]] = {}
    for element in root.iterfind("ModelVariables/*"):
        causality, reference = (
            element.get("causality", "local"),
            int(element.get("valueReference", "-1")),
        )
        usual = "continuous" if element.tag in _CONTINUOUS else "discrete"
        variability = element.get("variability", usual)
        if element.tag == "Clock":
            continue
        if element.get("clocks"):
            found[reference] = tuple(int(text) for text in element.get("clocks", "").split())
        elif (causality == "input" and variability == "discrete") or (
            asks and variability == "tunable"
        ):
            found[reference] = ()
    return found
