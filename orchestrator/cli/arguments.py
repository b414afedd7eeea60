"""What the words behind options mean; argparse prints what is wrong with one."""

import argparse
import math
from collections.abc import Callable
from typing import Any

from orchestrator.cores import MOST_THREADS
from orchestrator.coupling.schedule import check_tolerance
from orchestrator.errors import InputError
from orchestrator.units import read_value, to_unit


class Joined(argparse.Action):
    """A list with commas, to which the option adds each time that it is given."""

    def __call__(self, parser: argparse.ArgumentParser, namespace: Any, values: Any, option: str | None = None) -> None:
        before = getattr(namespace, self.dest)
        setattr(namespace, self.dest, f"{before},{values}" if before else values)


def assignment(text: str) -> tuple[str, bool | float | str]:
    """``component.parameter=value`` of a case."""
    key, equals, given = text.partition("=")
    if not equals or "." not in key or not given:
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form component.parameter=value, such as grid.X_L=0.2")
    return key.strip(), read_value(given.strip())


def setting(text: str) -> tuple[str, bool | float | str]:
    """``variable=value`` of one FMU."""
    name, equals, given = text.partition("=")
    if not equals or not name or not given:
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form variable=value, such as pod_p.enabled=true")
    return name.strip(), read_value(given.strip())


def seconds(text: str) -> float:
    """A time above 0 [s], as a number or with a unit."""
    time = _time(text)
    if not (time > 0 and math.isfinite(time)):
        raise argparse.ArgumentTypeError(f"{text!r} must exceed 0 and be finite")
    return time


def seconds_or_none(text: str) -> float:
    """A time [s], as `seconds`, or 0."""
    time = _time(text)
    if not (time >= 0 and math.isfinite(time)):
        raise argparse.ArgumentTypeError(f"{text!r} must be 0 or above and finite")
    return time


def _time(text: str) -> float:
    """Any time [s], as a number or with a unit."""
    value = read_value(text)
    if isinstance(value, bool):
        raise argparse.ArgumentTypeError(f"{text!r} is not a time; write it like 0.5 or '500 ms'")
    try:
        return to_unit(value, "s")
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def quantity(unit: str) -> Callable[[str], float]:
    """Reads a number with or without a unit, in a declared one."""

    def read(text: str) -> float:
        try:
            return to_unit(text, unit)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from error

    return read


def positive(text: str) -> float:
    """A finite number above 0."""
    number = _number(text)
    if not (number > 0 and math.isfinite(number)):
        raise argparse.ArgumentTypeError(f"{text!r} must be a number above 0")
    return number


def tolerance(text: str) -> float:
    """Of the error of a step, such as 1e-4."""
    value = _number(text)
    try:
        check_tolerance(value)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return value


def count(text: str) -> int:
    """A whole number from 1 to 1000."""
    if not text.isdigit() or not 1 <= int(text) <= 1000:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 1 to 1000")
    return int(text)


def whole_from_zero(text: str) -> int:
    """A whole number from 0 to 1000."""
    if not text.isdigit() or not int(text) <= 1000:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 0 to 1000")
    return int(text)


def threads(text: str) -> int:
    """A whole number from 1 to the most threads that step."""
    if not text.isdigit() or not 1 <= int(text) <= MOST_THREADS:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 1 to {MOST_THREADS}")
    return int(text)


def percent(text: str) -> float:
    """Damping [%], as ``20`` or ``20%``, as a ratio; a bare number below 1 looks like a ratio and is refused."""
    number = _number(text.removesuffix("%"))
    if not 0 < number <= 90:
        raise argparse.ArgumentTypeError(f"{text!r} is not a damping in percent between 0 and 90, such as 20")
    if number < 1 and not text.endswith("%"):
        raise argparse.ArgumentTypeError(
            f"{text!r} is read in percent; write {100 * number:g} for a damping ratio of {number:g}, or {text}% if so "
            "little is meant"
        )
    return number / 100


def frequency_range(text: str) -> tuple[float, float]:
    """``LO:HI`` [Hz]."""
    low, colon, high = text.partition(":")
    limits = _number(low), _number(high)
    if not colon or not 0 <= limits[0] < limits[1]:
        raise argparse.ArgumentTypeError(f"{text!r} is not a range; write LO:HI in Hz with 0 ≤ LO < HI, such as 0.1:2")
    return limits


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def reactances(text: str) -> tuple[float, ...]:
    """Different reactances of a line [pu], separated by commas."""
    values = tuple(_number(part) for part in text.split(","))
    if not all(1e-3 <= value <= 10 for value in values) or len(set(values)) < len(values):
        raise argparse.ArgumentTypeError(
            f"{text!r} are no reactances; write different numbers from 0.001 to 10, such as 0.1,0.3"
        )
    return values
