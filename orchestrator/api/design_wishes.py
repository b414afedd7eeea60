"""What a caller asks of a design, checked before anything is computed; the command line keeps the same rules."""

from collections.abc import Mapping
from math import isfinite
from typing import Any

from orchestrator.api.values import damping_ratio, flag, plain_value, text_or_none, whole_number
from orchestrator.errors import InputError

_MAY_BE_NONE = ("component", "mode", "damping", "stages")


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
            case "damping" | "damping_increment" | "least_damping":
                _ratio(value, name)
            case "delta_gain":
                _gain(value)
            case "gain_bounds":
                own[name] = _bounds(value)
            case "stages":
                whole_number(value, name, 0, 10)
            case _:
                flag(value, name)
    return own


def _ratio(value: Any, name: str) -> None:
    if value is None:
        raise InputError(f"{name} = None; it is a damping ratio between 0 and 1, such as 0.2 for 20 %, or is left out")
    damping_ratio(value, name)


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
