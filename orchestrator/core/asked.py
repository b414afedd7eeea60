"""Requests of studies: the fields of its request, from which options and keywords come.

A `FieldKind` says twice what a field may be: ``read`` takes the text of an option, ``check`` what Python gives."""

import math
import re
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from orchestrator.core.errors import InputError
from orchestrator.core.units import to_unit

Value = float | bool | str
Request = TypeVar("Request")
Names = str | Sequence[str]  # one name, or several

_ASKED = "asked"
_FOR_COMMANDS = re.compile(
    r" \((default: [^ ;()]+(; with [^()]*)?|repeatable|[\d.:]+)\)|repeatable; (?=default)"
)
_SHOWN = 60  # characters of an overlong path that an error shows
_SEEN = 120  # characters of a wrong value that an error shows
_LARGEST = 10**308  # of a whole number that a floating-point number can hold


@dataclass(frozen=True)
class FieldKind:
    metavar: str
    # from an option's text, or a `ValueError` that says what is wrong with it; None for a switch
    read: Callable[[str], Any] | None
    # from what a caller gives, and the keyword for the `InputError`
    check: Callable[[Any, str], Any]
    several: bool = False  # whether the option is repeatable, and gives a tuple
    joined: bool = False  # whether these are one text with commas
    unit: str = ""  # that Python gives it in
    times: float = 1.0  # the default, as Python has it
    # further options of the same values: name, metavar, help, and how their text is read
    besides: tuple[tuple[str, str, str, Callable[[str], Any]], ...] = ()


@dataclass(frozen=True)
class Asked:
    """A field of a request that a user may set, with its option and its keyword."""

    kind: FieldKind
    help: str
    metavar: str
    option: str | None
    default: Any
    python: str

    @property
    def meaning(self) -> str:
        """Return what the field means to Python, whose signature shows the default."""
        text = self.python or _FOR_COMMANDS.sub("", self.help).replace("%%", "%")
        return (
            text[:1].upper() + text[1:] + (f" [{self.kind.unit}]" if self.kind.unit else "") + "."
        )

    @property
    def shown_default(self) -> Any:
        """The default in the unit in which Python gives the field."""
        return (
            self.default
            if self.kind.times == 1 or self.default is None
            else round(self.kind.times * self.default, 9)
        )


def request_field(
    kind: FieldKind,
    default: Any,
    text: str,
    metavar: str = "",
    *,
    option: str | None = "",
    python: str = "",
) -> Any:
    """A field of a request, whose name is its keyword.

    ``text``: help of the option, and what the field means; ``python``: where Python needs other words.
    ``option``: where it is not spelt as the field is; None for a field that only Python has."""
    return field(
        default=default, metadata={_ASKED: (kind, text, metavar or kind.metavar, option, python)}
    )


def __getattr__(name: str) -> Any:
    """Give `request_field` under its former name, which plug-ins may use."""
    if name != "asked":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    warnings.warn(
        f"{__name__}.asked is now {__name__}.request_field; import that",
        DeprecationWarning,
        stacklevel=2,
    )
    return request_field


def asked_of(request: type) -> dict[str, Asked]:
    found = {}
    for one in fields(request):
        if _ASKED in one.metadata:
            kind, text, metavar, option, python = one.metadata[_ASKED]
            option = f"--{one.name.replace('_', '-')}" if option == "" else option
            found[one.name] = Asked(kind, text, metavar, option, one.default, python)
    return found


def checked(request: type, wanted: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of a request from keywords, of those that it has; None stays where it is the default.

    Raises an `InputError` if one of them is not of its kind or outside of its range; it is named."""
    found = {}
    for name, one in asked_of(request).items():
        if name in wanted:
            given = wanted[name]
            unsaid = given is None and one.default is None
            found[name] = None if unsaid else one.kind.check(given, name)
    return found


def seen(given: Any) -> str:
    """A value as an error shows it: written out where that is one short line, or its type."""
    text = repr(given)
    is_short = len(text) <= _SEEN and "\n" not in text
    return text if is_short else f"something of type {type(given).__name__}"


def require_known(wanted: Iterable[str], known: Iterable[str], who: str) -> None:
    """Refuse keywords that a study does not have; ``who`` is such as ``a design``."""
    unknown = [name for name in wanted if name not in known]
    if unknown:
        raise InputError(
            f"{who} cannot be asked for {', '.join(map(repr, unknown))}, but for {', '.join(known)}"
        )


def plain_value(value: Any) -> Value:
    """A value, as Python's own number where it is one of NumPy."""
    own: Value = (
        value.item() if hasattr(value, "item") and getattr(value, "size", 1) == 1 else value
    )
    if type(own).__name__ == "NAType":
        raise InputError(
            "pandas' NA, which is no value, was given as a value; give a number, or leave it out"
        )
    if isinstance(own, int) and abs(own) > _LARGEST:
        raise InputError(
            "a whole number beyond 1e308 was given as a value; give a number that a float can hold"
        )
    return own


def number_in(given: Any, unit: str, argument: str, rule: str) -> float:
    own = plain_value(given)
    if isinstance(own, bool) or not isinstance(own, int | float | str):
        raise InputError(f"{argument} = {seen(given)}; give {rule.removeprefix('give ')}")
    try:
        return to_unit(own, unit)
    except ValueError as error:
        raise InputError(f"{argument}: {error}") from error
    except OverflowError as error:
        raise InputError(
            f"{argument} is a number beyond 1e308; give {rule.removeprefix('give ')}"
        ) from error


def number_between(
    given: Any, unit: str, argument: str, least: float, most: float, rule: str
) -> float:
    number = number_in(given, unit, argument, rule)
    if not least <= number <= most:
        raise InputError(f"{argument} = {seen(given)}; it must be {rule}")
    return number


def as_number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def flag(given: Any, argument: str) -> bool:
    own = plain_value(given)
    if not isinstance(own, bool):
        raise InputError(f"{argument} = {seen(given)}; give True or False")
    return own


def names(given: Names, argument: str) -> tuple[str, ...]:
    if isinstance(given, str):
        return (given,)
    listed: tuple[Any, ...] = tuple(given) if isinstance(given, Iterable) else (None,)
    if isinstance(given, bytes) or not all(isinstance(name, str) for name in listed):
        raise InputError(f"{argument} = {seen(given)}; give a name, or a list of names")
    return listed


def text_or_none(
    given: Any, argument: str, rule: str = "give one name, or leave it out"
) -> str | None:
    if given is not None and (not isinstance(given, str) or not given):
        raise InputError(f"{argument} = {seen(given)}; {rule}")
    return given


def path(given: Any, argument: str, kind: str = "file") -> Path:
    if not isinstance(given, str | Path) or not str(given):
        raise InputError(f"{argument} = {seen(given)}; give the path of a {kind}")
    _check_length(Path(given), argument)
    return Path(given)


def _check_length(path: Path, argument: str) -> None:
    """Refuse what no file system can hold, before it says so itself."""
    try:
        path.exists()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        shown = str(path) if len(str(path)) <= _SHOWN else f"{str(path)[:_SHOWN]}…"
        raise InputError(
            f"{argument} = {shown!r} is no path that a file can have: {reason}"
        ) from error


def read_range(text: str) -> tuple[float, float]:
    """``LO:HI`` [Hz]."""
    low, colon, high = text.partition(":")
    limits = as_number(low), as_number(high)
    if not colon or not 0 <= limits[0] < limits[1]:
        raise ValueError(
            f"{text!r} is not a range; write LO:HI in Hz with 0 ≤ LO < HI, such as 0.1:2"
        )
    return limits


def frequency_range(given: Any, argument: str = "frequencies") -> tuple[float, float]:
    """Two frequencies [Hz], the lower one first."""
    rule = "give two in Hz, the lower one first, such as (0.1, 2.0)"
    if isinstance(given, str) or not isinstance(given, Sequence | tuple) or len(given) != 2:
        raise InputError(f"{argument} = {seen(given)}; {rule}")
    low, high = (number_in(one, "Hz", argument, rule) for one in given)
    if not 0 <= low < high:
        raise InputError(f"{argument} = {seen(given)}; {rule}")
    return low, high


def read_part(rule: str, least: float, most: float) -> Callable[[str], float]:
    """Give what reads percent, ``20`` or ``20%``, as a ratio; it refuses a bare number below 1, like a ratio."""

    def read(text: str) -> float:
        number = as_number(text.strip().removesuffix("%"))
        if not least <= number <= most:
            raise ValueError(f"{text!r} is not {rule}")
        if 0 < number < 1 and "%" not in text:
            raise ValueError(
                f"{text!r} is read in percent; write {100 * number:g} for a ratio of {number:g}, or {text}% if so "
                "little is meant"
            )
        return number / 100

    return read


def read_percent(text: str, most: float = 90) -> float:
    """Damping [%] as a ratio."""
    return read_part(f"a damping in percent between 0 and {most:g}, such as 20", 1e-9, most)(text)


def percent(given: Any, argument: str, most: float = 90) -> float:
    """A damping [%] as a ratio; a number below 1 looks like a ratio and is refused."""
    own: Any = plain_value(given)
    if not _is_number(own) or not 1 <= own <= most:
        ratio = (
            f": write {100 * own:g} for a damping ratio of {own:g}"
            if _is_number(own) and 0 < own < 1
            else ""
        )
        raise InputError(
            f"{argument} = {seen(given)}; it is in percent between 1 and {most:g}, such as 20{ratio}"
        )
    return float(own) / 100


def share(given: Any, argument: str) -> float:
    own: Any = plain_value(given)
    if not _is_number(own) or not 0 < own <= 0.5:
        raise InputError(
            f"{argument} = {seen(given)}; it must be a share above 0, and at most 0.5: 0.05 is 5 %"
        )
    return float(own)


def read_positive(text: str) -> float:
    number = as_number(text)
    if not (number > 0 and math.isfinite(number)):
        raise ValueError(f"{text!r} must be a number above 0")
    return number


def positive(
    given: Any, argument: str, rule: str = "give a number above 0, or leave it out"
) -> float:
    own: Any = plain_value(given)
    if not _is_number(own) or not 0 < own < 1e300:
        raise InputError(f"{argument} = {seen(given)}; {rule}")
    return float(own)


def one_of(values: Iterable[str]) -> "FieldKind":
    """One of these words, or None; a member where these are an enumeration's."""
    known, words = ", ".join(values), {str(value): value for value in values}

    def read(text: str) -> str:
        if text not in words:
            raise ValueError(f"{text!r} is none of {known}")
        return words[text]

    def check(given: Any, argument: str) -> str | None:
        if given is not None and (not isinstance(given, str) or given not in words):
            raise InputError(f"{argument} = {seen(given)}; give one of {known}")
        return None if given is None else words[given]

    return FieldKind("RULE", read, check)


def _are_bounds(low: Any, high: Any) -> bool:
    return _is_number(low) and _is_number(high) and 0 <= low <= high < 1e300 and high > 0


def read_bounds(text: str) -> tuple[float, float]:
    """``MIN:MAX`` of a gain [pu]."""
    low, _, high = text.partition(":")
    limits = as_number(low), as_number(high)
    if not _are_bounds(*limits):
        raise ValueError(
            f"{text!r} are no bounds; write MIN:MAX in pu with 0 ≤ MIN ≤ MAX, such as 200:400"
        )
    return limits


def bounds(given: Any, argument: str) -> tuple[float, float]:
    pair: list[Any] = [plain_value(one) for one in given] if isinstance(given, tuple | list) else []
    if len(pair) != 2 or not _are_bounds(*pair):
        rule = "give the lowest and the highest gain in pu, such as (200, 400), with 0 ≤ lowest ≤ highest"
        raise InputError(f"{argument} = {seen(given)}; {rule}")
    return float(pair[0]), float(pair[1])


def read_whole(least: int, most: int, what: str = "a whole number") -> Callable[[str], int]:
    def read(text: str) -> int:
        if not text.isdigit() or not least <= int(text) <= most:
            raise ValueError(f"{text!r} is not {what} from {least} to {most}")
        return int(text)

    return read


def whole_number(given: Any, argument: str, least: int, most: int) -> int:
    own = plain_value(given)
    if isinstance(own, bool) or not isinstance(own, int) or not least <= own <= most:
        raise InputError(f"{argument} = {seen(given)}; give a whole number from {least} to {most}")
    return own


def check_callable(given: Any, argument: str) -> Any:
    """Return a function that is told of the work, or None."""
    if given is not None and not callable(given):
        raise InputError(f"{argument} = {seen(given)}; give what can be called, such as print")
    return given


CALLED = FieldKind("", str, check_callable)
FLAG = FieldKind("", None, flag)
NAME = FieldKind("NAME", str, text_or_none)
NAMES = FieldKind("NAME", str, names, several=True)
FREQUENCIES = FieldKind("LO:HI", read_range, frequency_range)
DAMPING = FieldKind("PERCENT", read_percent, percent, unit="%", times=100)
SHARE = FieldKind("PERCENT", read_part("a share in percent up to 50, such as 5", 1e-9, 50), share)
POSITIVE = FieldKind("X", read_positive, positive)
GAIN = FieldKind(
    "DK",
    read_positive,
    partial(positive, rule="give a gain above 0 in pu, such as 50.0, or leave it out"),
)
FILE = FieldKind(
    "FILE", Path, lambda given, argument: None if given is None else path(given, argument)
)
OUTAGES = FieldKind(
    "WHICH",
    str,
    lambda given, argument: None if given is None else ",".join(names(given, argument)),
    several=True,
    joined=True,
)
GAIN_BOUNDS = FieldKind("MIN:MAX", read_bounds, bounds)
STAGES = FieldKind("N_S", read_whole(0, 10), partial(whole_number, least=0, most=10))
RANKED = FieldKind("N", read_whole(0, 1000), partial(whole_number, least=0, most=1000))
