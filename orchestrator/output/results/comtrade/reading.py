"""A COMTRADE recording as a dataset over the time, such as a run gives."""

from __future__ import annotations

import glob
import io
import re
import warnings
from pathlib import Path

import numpy as np

from orchestrator.core.arrays import Matrix, Numbers
from orchestrator.core.errors import InputError
from orchestrator.core.foreign_files import read_bytes
from orchestrator.core.late import pd, xr
from orchestrator.output.results.comtrade.configuration import Configuration, read_configuration
from orchestrator.output.results.manifest import ResultsWarning
from orchestrator.output.results.readers import LINE_FREQUENCY

_STAMP_MISSING = 0xFFFFFFFF
_TYPES = {"BINARY": ("<i2", -0x8000), "BINARY32": ("<i4", -0x80000000), "FLOAT32": ("<f4", None)}
"""Type of an analog sample, and what stands for one that is missing."""

_MISSING_1991 = -1  # FFFF stood for a missing sample of 16 bits in 1991
_MISSING_TEXT = 99999.0
"""Stands for a missing sample in text, from 1999 on; recorders of 1991's form, which leaves a blank, write it too."""

_NO_FLOAT = 3.4e38  # beyond it a sample in single precision is none: its type ends there


def read_samples(
    content: bytes, configuration: Configuration, place: str
) -> tuple[Numbers, Matrix]:
    """Time stamps and values of all channels.

    Returns time stamps [s], shape (n,), NaN where missing; values, shape (n, channels), the analog ones first and
    scaled, NaN where missing."""
    read = _text if configuration.form == "ASCII" else _binary
    numbers, stamps, values = read(content, configuration, place)
    _check_numbers(numbers, configuration, place)
    scales = np.array([channel.scale for channel in configuration.analog])
    offsets = np.array([channel.offset for channel in configuration.analog])
    analog = len(scales)
    values[:, :analog] = values[:, :analog] * scales + offsets
    return stamps * configuration.time_unit, values


def _text(
    content: bytes, configuration: Configuration, place: str
) -> tuple[Numbers, Numbers, Matrix]:
    lines = content.decode("latin-1").replace("\x1a", "").splitlines()
    while lines and not lines[-1].strip():
        lines.pop()
    columns = 2 + len(configuration.analog) + len(configuration.status)
    for k, line in enumerate(lines, start=1):
        if line.count(",") != columns - 1:
            raise InputError(
                f"{place}, line {k}: it has {line.count(',') + 1} columns; {configuration.place} asks for {columns}: "
                "number, time and one for each channel"
            )
    try:
        table = pd.read_csv(
            io.StringIO("\n".join(lines)), header=None, dtype=float, skipinitialspace=True
        ).to_numpy()
    except (ValueError, OverflowError) as error:
        raise InputError(
            f"{place}{_first_bad(lines)}: a sample is no number ({error}); correct it"
        ) from error
    analog = table[:, 2 : 2 + len(configuration.analog)]
    marked = analog == _MISSING_TEXT
    if configuration.revision == "1991" and marked.any():
        row, column = (int(k) for k in np.argwhere(marked)[0])
        warnings.warn(
            f"{place}, line {row + 1}: 99999 is taken as a missing sample ({configuration.analog[column].name}; "
            f"{int(marked.sum())} in the file), as from 1999 on; the form of 1991 leaves a blank for one. Where it is "
            "a value, write 99999.0001 there",
            ResultsWarning,
            stacklevel=5,
        )
    analog[marked] = np.nan
    return table[:, 0], table[:, 1], table[:, 2:]


def _first_bad(lines: list[str]) -> str:
    for k, line in enumerate(lines, start=1):
        for field in line.split(","):
            try:
                float(field or 0)
            except ValueError:
                return f", line {k}"
    return ""


def _binary(
    content: bytes, configuration: Configuration, place: str
) -> tuple[Numbers, Numbers, Matrix]:
    kind, missing = _TYPES[configuration.form]
    analog, status = len(configuration.analog), len(configuration.status)
    words = -(-status // 16)
    row = np.dtype(
        [
            ("number", "<u4"),
            ("stamp", "<u4"),
            ("analog", kind, (analog,)),
            ("status", "<u2", (words,)),
        ]
    )
    rows, rest = divmod(len(content), row.itemsize)
    if rest:
        raise InputError(
            f"{place}: it has {len(content)} bytes, and a sample of {analog} analog and {status} status channels in "
            f"{configuration.form} has {row.itemsize}; the file is cut short, or {configuration.place} is of another "
            "recording"
        )
    table = np.frombuffer(content, row, rows)
    stamps = np.where(table["stamp"] == _STAMP_MISSING, np.nan, table["stamp"].astype(float))
    raw = table["analog"]
    if configuration.form == "FLOAT32":
        none = ~(np.abs(raw) < _NO_FLOAT)
    else:
        none = raw == (_MISSING_1991 if configuration.revision == "1991" else missing)
    values = np.where(none, np.nan, raw.astype(float))
    bits = (table["status"][:, :, None] >> np.arange(16, dtype=np.uint16)) & 1
    flags = bits.reshape(rows, 16 * words)[:, :status].astype(float)
    return table["number"].astype(float), stamps, np.column_stack([values, flags])


def _check_numbers(numbers: Numbers, configuration: Configuration, place: str) -> None:
    """Refuse a recording that lost samples: times would be wrong from there on."""
    if len(numbers) != configuration.samples:
        raise InputError(
            f"{place}: it has {len(numbers)} samples, and {configuration.place} says {configuration.samples}; copy the "
            "files once more, or correct the last sample of the sampling rates if the recorder stopped there"
        )
    jumps = np.flatnonzero(~(np.diff(numbers) == 1))
    if len(jumps):
        k = int(jumps[0])
        raise InputError(
            f"{place}: after sample {numbers[k]:.0f} comes sample {numbers[k + 1]:.0f}; samples between them are "
            "missing, and the times of the rest are not known"
        )


MOST_BYTES = 2_000_000_000  # of a file of samples: an hour of forty channels at 5 kHz
_MOST_TEXT = 20_000_000
_SECTION = re.compile(
    rb"^--- *file type: *(\w+)(?: +(\w+))?(?: *: *(\d+))? *---\s*?\r?$",
    re.IGNORECASE | re.MULTILINE,
)
# part of the whole time by which time stamps may differ from the sampling rates before it is said
_TIMES_DIFFER = 0.01


def read_comtrade(path: Path) -> xr.Dataset:
    """Read a recording.

    ``path``: ``.cfg`` (or ``.dat``) with the other file beside it, or ``.cff``.

    Returns channels by name over the time since the first sample [s], in the file's units, referred to the primary
    side; missing samples are NaN.

    Warns
    -----
    ResultsWarning
        If time stamps contradict the sampling rates, or a channel's skew exceeds a tenth of a sample.
    """
    text, content, places = _joint(path) if path.suffix.lower() == ".cff" else _apart(path)
    configuration = read_configuration(text, places[0])
    stamps, values = read_samples(content, configuration, places[1])
    times = _times(configuration, stamps, places[1])
    _warn_of_skew(configuration, times)
    channels = (*configuration.analog, *configuration.status)
    data = {
        channel.name: (
            "time",
            np.ascontiguousarray(values[:, k]),
            {"units": channel.unit, "long_name": channel.name},
        )
        for k, channel in enumerate(channels)
    }
    attributes = {
        "scenario": str(path),
        "station": configuration.station,
        "device": configuration.device,
        "comtrade_revision": configuration.revision,
        "first_sample": configuration.start,
        "trigger": configuration.trigger,
        "referred_to_primary": ", ".join(channel.name for channel in channels if channel.secondary),
    }
    coordinates = {"time": ("time", times, {"units": "s"}), LINE_FREQUENCY: configuration.frequency}
    return xr.Dataset(data, coords=coordinates, attrs=attributes)


def _apart(path: Path) -> tuple[str, bytes, tuple[str, str]]:
    found = []
    for suffix in (".cfg", ".dat"):
        same = [
            p for p in path.parent.glob(f"{glob.escape(path.stem)}.*") if p.suffix.lower() == suffix
        ]
        if not same:
            missing = path.with_suffix(suffix)
            raise InputError(
                f"{missing}: there is no such file; a recording needs both its .cfg and its .dat"
            )
        found.append(path if path in same else same[0])
    configuration, samples = found
    text = _content(configuration, _MOST_TEXT)
    return _decoded(text), _content(samples, MOST_BYTES), (str(configuration), str(samples))


def _joint(path: Path) -> tuple[str, bytes, tuple[str, str]]:
    """The same from a ``.cff``, which holds all files of a recording."""
    content = _content(path, MOST_BYTES)
    sections: dict[str, bytes] = {}
    position = 0
    while heading := _SECTION.search(content, position):
        kind, begin = heading[1].decode().upper(), heading.end() + 1
        if kind == "DAT" and heading[3]:  # binary: a heading's text could stand among the samples
            position = begin + int(heading[3])
            if position > len(content):
                raise InputError(
                    f"{path}: its samples have fewer bytes than the {int(heading[3])} that it names"
                )
        else:
            following = _SECTION.search(content, begin)
            position = following.start() if following else len(content)
        sections[kind] = content[begin:position]
    missing = [kind for kind in ("CFG", "DAT") if kind not in sections]
    if missing:
        raise InputError(
            f"{path}: it has no part '--- file type: {missing[0]} ---', so it is no recording in one file"
        )
    return _decoded(sections["CFG"]), sections["DAT"], (f"{path} (CFG)", f"{path} (DAT)")


def _content(path: Path, most: int) -> bytes:
    if not path.is_file():
        raise InputError(
            f"{path}: there is no such file; give the .cfg or .cff of a COMTRADE recording"
        )
    size = path.stat().st_size
    if size > most:
        raise InputError(
            f"{path}: it has {size} bytes; at most {most} are read; cut the recording into parts"
        )
    return read_bytes(path, most)


def _decoded(content: bytes) -> str:
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _times(configuration: Configuration, stamps: Numbers, place: str) -> Numbers:
    """Times since the first sample [s]: from the sampling rates, or from time stamps where there are none."""
    if configuration.rates[0][0] == 0:
        rising = np.diff(stamps) > 0
        if not np.isfinite(stamps).all() or not rising.all():
            wrong = int(np.flatnonzero(~rising)[0]) + 2 if not rising.all() else 1
            raise InputError(
                f"{place}: the recording has no sampling rate, and the time stamp of sample {wrong} is missing or not "
                "later than the one before; write the sampling rate into the .cfg"
            )
        return np.asarray(stamps - stamps[0], dtype=float)
    lengths, last = [], 0
    for rate, end in configuration.rates:
        lengths.append(np.full(end - last, 1 / rate))
        last = end
    steps = np.concatenate(lengths)
    times = (
        np.concatenate([[0.0], np.cumsum(steps[1:])])
        if len(configuration.rates) > 1
        else np.arange(last) * steps
    )
    known = np.isfinite(stamps)
    if known.all() and len(stamps) > 1 and stamps[-1] > stamps[0]:
        stamped = stamps[-1] - stamps[0]
        if abs(stamped - times[-1]) > _TIMES_DIFFER * times[-1]:
            text = f"{place}: time stamps span {stamped:.6g} s, the sampling rates {times[-1]:.6g} s; the rates count"
            warnings.warn(text, ResultsWarning, stacklevel=3)
    return np.asarray(times, dtype=float)


def _warn_of_skew(configuration: Configuration, times: Numbers) -> None:
    interval = float(np.diff(times).min()) if len(times) > 1 else np.inf
    late = [c for c in configuration.analog if abs(c.skew) > 0.1 * interval]
    if late:
        shown = ", ".join(f"{c.name} ({c.skew:.3g} s)" for c in late[:5])
        text = f"{configuration.place}: samples are skewed by more than a tenth of a sample: {shown}; the times "
        warnings.warn(f"{text}of all channels are taken as equal", ResultsWarning, stacklevel=3)
