"""Answers as a saved page holds them: what it draws, with the digits that it shows."""

from collections.abc import Callable, Mapping, Sequence
from decimal import ROUND_05UP, Context
from typing import Any

_DIGITS = 6  # significant ones of a number, as many as the page shows
_OF_MODES = 10
"""Significant digits of a mode's figures, which the page rounds to those of the command: twice rounded is wrong."""
_FIGURES = ("real", "imag", "frequency_hz", "damping_percent")
_OF_SHARES = Context(prec=4, rounding=ROUND_05UP)
"""Significant digits of participations and shapes, one more than the page shows. Cut off, with a last digit that tells
of what was cut: the page then rounds as it does the figure itself, where 65.47 % in three digits became 66 %."""
_STATES = 7  # of a mode's participation; the page has bars for eight at most
_COMPONENTS = 6  # of a mode's participation
_SEEN = 0.02  # an arrow shorter than this part of the longest is not drawn
_OF_SCENARIO = ("name", "stable", "warnings", "power_flow", "modes")
_OF_ANSWER = (
    "title",
    "verdict",
    "outside",
    "rated_hz",
    "warnings",
    "idle",
    "swings",
    "copied",
    "stamp",
)
_UNDRAWN = "areas"  # of a mode: the page draws participations by component and by state
_LISTED = 1000  # parameters up to which a page lists all of them


def smaller_answer(answer: Mapping[str, Any], flows: list[Any]) -> dict[str, Any]:
    """Keep what the page draws of an answer to ``modes``. Its power flow becomes a place in ``flows``, to which it is
    added where it is not there yet: most sliders move none."""
    scenarios = [_smaller_scenario(one, flows) for one in answer["modes"]["scenarios"]]
    kept = {key: answer[key] for key in _OF_ANSWER if key in answer}
    return {**rounded(kept), "modes": {"scenarios": scenarios}}


def _smaller_scenario(one: Mapping[str, Any], flows: list[Any]) -> dict[str, Any]:
    kept = {key: one[key] for key in _OF_SCENARIO if key in one and key != "modes"}
    flow = rounded(one.get("power_flow"))
    if flow not in flows:
        flows.append(flow)
    modes = [_smaller_mode(mode) for mode in one["modes"]]
    return {**rounded(kept), "modes": modes, "power_flow": flows.index(flow)}


def _smaller_mode(mode: Mapping[str, Any]) -> dict[str, Any]:
    shape = mode.get("shape", [])
    least = _SEEN * max((one["magnitude"] for one in shape), default=0.0)
    components = [*mode.get("components", {}).items()]
    drawn = {
        "participation": mode.get("participation", [])[:_STATES],
        "components": dict(components[:_COMPONENTS]),
        "shape": [one for one in shape if one["magnitude"] > least],
    }
    figures = {key: mode[key] for key in _FIGURES if key in mode}
    others = {key: one for key, one in mode.items() if key != _UNDRAWN}
    return {**rounded(others), **rounded(figures, _OF_MODES), **_rewritten(drawn, _cut)}


def _cut(share: float) -> float:
    return float(_OF_SHARES.create_decimal_from_float(share))


def rounded(content: Any, digits: int = _DIGITS) -> Any:
    """The same content, each number with as many digits as a page needs."""
    return _rewritten(content, lambda number: float(f"{number:.{digits}g}"))


def _rewritten(content: Any, write: Callable[[float], float]) -> Any:
    if isinstance(content, float):
        return write(content)
    if isinstance(content, Mapping):
        return {key: _rewritten(one, write) for key, one in content.items()}
    if isinstance(content, list | tuple):
        return [_rewritten(one, write) for one in content]
    return content


def smaller_parameters(
    answer: Mapping[str, Any], shown: Sequence[str], scenarios: int = 1
) -> dict[str, Any]:
    """Leave out units that are out of service, which no page can put back, and of a large case the parameters that are
    neither ``shown`` nor a switch that is off. Large is what is so with those of all ``scenarios``."""
    rows, diagram = answer.get("parameters", []), answer.get("diagram")
    if diagram is not None:
        off = {row["parameter"] for row in rows if row["value"] is False}
        out = [unit["name"] for unit in diagram["units"] if unit["out"] in off]
        units = [unit for unit in diagram["units"] if unit["name"] not in out]
        answer = {**answer, "diagram": {**diagram, "units": units}}
        rows = [row for row in rows if not _belongs(row["parameter"], out)]
    if len(rows) * scenarios <= _LISTED:
        return {**answer, "parameters": rows}
    switches = {one for row in rows if row["parameter"] in shown for one in row["switches"]}
    wanted = {*shown, *switches}
    return {
        **answer,
        "parameters": [row for row in rows if row["parameter"] in wanted or row["value"] is False],
    }


def _belongs(parameter: str, units: Sequence[str]) -> bool:
    """Return whether a parameter is one of these units, or the network's for one of them."""
    component, *parts = parameter.split(".")
    return component in units or (bool(parts) and parts[0] in units)
