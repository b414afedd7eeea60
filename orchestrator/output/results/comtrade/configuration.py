"""The configuration of a COMTRADE recording (``.cfg``): channels, sampling rates and times, as IEEE C37.111 of 1991,
1999 and 2013 writes them."""

import math
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

from orchestrator.core.errors import InputError
from orchestrator.core.foreign_files import visible

FORMS = ("ASCII", "BINARY", "BINARY32", "FLOAT32")  # forms of the samples
# 2001 is IEC's edition of 1999; a file of 1991 names none
REVISIONS = ("1991", "1999", "2001", "2013")
MOST_CHANNELS = 10_000  # of one recording; large stations record some hundred


@dataclass(frozen=True, slots=True)
class Channel:
    name: str  # the name by which it is asked for; no two channels of a recording have the same
    unit: str = ""  # as the file says; empty for a status channel
    # scale, offset: a sample's value is ``scale · x + offset`` [unit], referred to the primary side
    scale: float = 1.0
    offset: float = 0.0
    skew: float = 0.0  # time of this channel's samples after those of the recording [s]
    # whether the file holds the values of the secondary side; ``scale`` and ``offset`` have the ratio in them
    secondary: bool = False


@dataclass(frozen=True)
class Configuration:
    place: str
    station: str
    device: str
    revision: str
    analog: tuple[Channel, ...]
    status: tuple[Channel, ...]
    frequency: float  # frequency of the line [Hz]; 0 where the file leaves it open
    # sampling rate [Hz] and number of the last sample that has it, in order; a rate of 0: the samples carry times
    rates: tuple[tuple[float, int], ...]
    # start, trigger: dates and times as the file writes them
    start: str
    trigger: str
    form: str
    time_unit: float  # of the samples' time stamps [s]

    @property
    def samples(self) -> int:
        return self.rates[-1][1]


class _Lines:
    """Lines of a configuration, each split at its commas."""

    def __init__(self, text: str, place: str) -> None:
        self._lines: Iterator[tuple[int, str]] = enumerate(
            text.replace("\x1a", "").splitlines(), start=1
        )
        self.place, self.number = place, 0

    def next(self, what: str) -> list[str]:
        found = next(self._lines, None)
        if found is None:
            raise InputError(
                f"{self.place}: the file ends after line {self.number}, before {what}; copy it once more"
            )
        self.number = found[0]
        return [field.strip() for field in found[1].split(",")]

    def optional(self) -> list[str]:
        """Fields of the next line; one empty field after the end."""
        found = next(self._lines, None)
        return [field.strip() for field in found[1].split(",")] if found else [""]

    def error(self, text: str) -> InputError:
        return InputError(f"{self.place}, line {self.number}: {text}")

    def number_of(
        self, fields: list[str], index: int, what: str, default: float | None = None
    ) -> float:
        """A finite number in a field; an empty field gives the default."""
        text = fields[index] if index < len(fields) else ""
        if not text and default is not None:
            return default
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise self.error(f"{what} is {text!r}; it must be a number")
        return value

    def count_of(self, text: str, what: str, most: int) -> int:
        if not re.fullmatch(r"\d{1,10}", text) or int(text) > most:
            raise self.error(f"{what} is {text!r}; it must be a whole number from 0 to {most}")
        return int(text)


def read_configuration(text: str, place: str) -> Configuration:
    r"""Read the text of a ``.cfg``.

    Raises an `InputError` if a line is missing or holds something else than the standard says; file, line and field are
    named. Characters that steer a terminal are written out, such as ``\x1b``."""
    lines = _Lines(visible(text), place)
    station, device, revision = (*lines.next("the station's name"), "", "", "")[:3]
    revision = revision or "1991"
    if revision not in REVISIONS:
        raise lines.error(
            f"the revision is {revision!r}; those of {', '.join(REVISIONS)} can be read"
        )
    counts = lines.next("the number of channels")
    analog_count, status_count = (_channel_count(lines, counts, letter) for letter in "AD")
    analog = [_analog(lines, k) for k in range(1, analog_count + 1)]
    status = [
        Channel((*lines.next(f"status channel {k}"), "")[1]) for k in range(1, status_count + 1)
    ]
    frequency = lines.number_of(
        lines.next("the line's frequency"), 0, "the line's frequency [Hz]", 0.0
    )
    rates = _rates(lines)
    start, trigger = (
        "  ".join(lines.next("the time of the first sample and of the trigger")[:2])
        for _ in range(2)
    )
    form = lines.next("the form of the samples")[0].upper()
    if form not in FORMS:
        raise lines.error(f"the form of the samples is {form!r}; known are {', '.join(FORMS)}")
    multiplier = lines.number_of(lines.optional(), 0, "the multiplier of time stamps", 1.0)
    if not multiplier > 0:
        raise lines.error(f"the multiplier of time stamps is {multiplier:g}; it must exceed 0")
    nanoseconds = revision == "2013" and any(
        re.search(r"\.\d{7,}$", time) for time in (start, trigger)
    )
    names = _distinct([*analog, *status], analog_count)
    channels = [
        replace(channel, name=name) for channel, name in zip([*analog, *status], names, strict=True)
    ]
    return Configuration(
        place,
        station,
        device=device,
        revision=revision,
        analog=tuple(channels[:analog_count]),
        status=tuple(channels[analog_count:]),
        frequency=frequency,
        rates=rates,
        start=start,
        trigger=trigger,
        form=form,
        time_unit=multiplier * (1e-9 if nanoseconds else 1e-6),
    )


def _channel_count(lines: _Lines, fields: list[str], letter: str) -> int:
    found = next((f[:-1] for f in fields[1:] if f[-1:].upper() == letter), None)
    if found is None:
        raise lines.error(
            f"the numbers of channels are {', '.join(fields)!r}; expected such as '12,8A,4D'"
        )
    return lines.count_of(found.strip(), f"the number of channels of kind {letter}", MOST_CHANNELS)


def _analog(lines: _Lines, k: int) -> Channel:
    fields = lines.next(f"analog channel {k}")
    if len(fields) < 7:
        raise lines.error(f"analog channel {k} has {len(fields)} fields; at least 10 are needed")
    scale = lines.number_of(fields, 5, f"the scale a of analog channel {k}")
    offset = lines.number_of(fields, 6, f"the offset b of analog channel {k}", 0.0)
    skew = lines.number_of(fields, 7, f"the skew of analog channel {k}", 0.0)
    primary = lines.number_of(fields, 10, f"the primary value of analog channel {k}", 1.0)
    secondary = lines.number_of(fields, 11, f"the secondary value of analog channel {k}", 1.0)
    on_secondary = len(fields) > 12 and fields[12].upper() == "S"
    if on_secondary and not (primary > 0 and secondary > 0):
        raise lines.error(
            f"analog channel {k} holds secondary values with a ratio of {primary:g} to {secondary:g}; both must exceed "
            "0 to refer it to the primary side; correct them, or write P in place of S to take it as it is"
        )
    ratio = primary / secondary if on_secondary else 1.0
    return Channel(fields[1], fields[4], ratio * scale, ratio * offset, 1e-6 * skew, on_secondary)


def _rates(lines: _Lines) -> tuple[tuple[float, int], ...]:
    count = lines.count_of(
        lines.next("the number of sampling rates")[0], "the number of sampling rates", 999
    )
    rates: list[tuple[float, int]] = []
    for _ in range(max(1, count)):
        fields = lines.next("a sampling rate")
        rate = lines.number_of(fields, 0, "the sampling rate [Hz]")
        last = lines.count_of(
            fields[1] if len(fields) > 1 else "", "the number of the last sample", 10**10 - 1
        )
        if rate < 0 or last <= (rates[-1][1] if rates else 0):
            raise lines.error(
                f"{rate:g} Hz until sample {last}: a rate is 0 or more, and last samples must rise"
            )
        if count and rate == 0:
            raise lines.error(
                "a sampling rate is 0; write the number of sampling rates as 0 where samples carry times"
            )
        rates.append((rate if count else 0.0, last))
    return tuple(rates)


def _distinct(channels: list[Channel], analog_count: int) -> list[str]:
    """Names, with a channel's number where several have the same name or none."""
    seen = Counter(channel.name for channel in channels)
    names = []
    for k, channel in enumerate(channels):
        number = f"A{k + 1}" if k < analog_count else f"D{k - analog_count + 1}"
        alone = channel.name and seen[channel.name] == 1 and channel.name != "time"
        numbered = f"{channel.name} ({number})" if channel.name else number
        names.append(channel.name if alone else numbered)
    return names
