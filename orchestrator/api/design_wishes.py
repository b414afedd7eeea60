"""What a caller asks of a design, checked before anything is computed; the command line keeps the same rules."""

from collections.abc import Mapping
from math import isfinite
from typing import Any

from orchestrator.api.values import flag, plain_value, text_or_none, whole_number
from orchestrator.errors import InputError

_MAY_BE_NONE = ("component", "mode", "damping", "stages")


_IN_PERCENT = ("damping", "damping_increment", "least_damping")


def in_ratios(wanted: Mapping[str, Any]) -> dict[str, Any]:
    """The wishes of a caller in Python, whose dampings are in percent, as on the command line.

    Raises
    ------
    InputError
        If a damping is no number, out of range, or below 1, which looks like a ratio.
    """
    return {name: _ratio(value, name) if name in _IN_PERCENT else value for name, value in wanted.items()}


def check_wishes(wanted: Mapping[str, Any]) -> dict[str, Any]:
    """The wishes, with NumPy's numbers as Python's own.

    Raises
    ------
    InputError
        If one of them is not of its kind or outside of its range; it is named.
    """
    own: dict[str, Any] = {name: plain_value(value) for name, value in wanted.items()}
    for name, value in own.items():
        if value is None and name in _MAY_BE_NONE:
            continue
        match name:
            case "component" | "mode":
                text_or_none(value, name, "give one name, or leave it out")
            case "delta_gain":
                _gain(value)
            case "gain_bounds":
                own[name] = _bounds(value)
            case "stages":
                whole_number(value, name, 0, 10)
            case _ if name not in _IN_PERCENT:
                flag(value, name)
    return own


def _ratio(given: Any, name: str) -> float | None:
    value: Any = plain_value(given)
    rule = "it is in percent between 1 and 90, such as 20, or is left out"
    if value is None and name in _MAY_BE_NONE:
        return None
    if not _is_number(value) or not 0 < value <= 90:
        raise InputError(f"{name} = {given!r}; {rule}")
    if value < 1:
        raise InputError(f"{name} = {given!r}; {rule}: write {100 * value:g} for a damping ratio of {value:g}")
    return float(value) / 100


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _gain(value: Any) -> None:
    if not _is_number(value) or not 0 < value < 1e300:
        raise InputError(f"delta_gain = {value!r}; give a gain above 0 in pu, such as 50.0, or leave it out")


def _bounds(given: Any) -> tuple[float, float]:
    pair: list[Any] = [plain_value(one) for one in given] if isinstance(given, tuple | list) else []
    if len(pair) == 2 and all(map(_is_number, pair)):
        low, high = pair
        if 0 <= low <= high < 1e300 and high > 0 and isfinite(high):
            return float(low), float(high)
    raise InputError(
        f"gain_bounds = {given!r}; give the lowest and the highest gain in pu, such as (200, 400), with 0 ≤ lowest ≤ "
        "highest"
    )
