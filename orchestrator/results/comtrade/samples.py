"""The samples of a COMTRADE recording (``.dat``): text, integers of 16 or 32 bits, or single precision."""

from __future__ import annotations

import io
import warnings

import numpy as np

from orchestrator.arrays import Matrix, Numbers
from orchestrator.errors import InputError
from orchestrator.late import pd
from orchestrator.results.comtrade.configuration import Configuration
from orchestrator.results.manifest import ResultsWarning

_STAMP_MISSING = 0xFFFFFFFF
_TYPES = {"BINARY": ("<i2", -0x8000), "BINARY32": ("<i4", -0x80000000), "FLOAT32": ("<f4", None)}
"""Type of an analog sample, and what stands for one that is missing."""

_MISSING_1991 = -1  # FFFF stood for a missing sample of 16 bits in 1991
_MISSING_TEXT = 99999.0
"""Stands for a missing sample in text, from 1999 on; recorders of 1991's form, which leaves a blank, write it too."""

_NO_FLOAT = 3.4e38  # beyond it a sample in single precision is none: its type ends there


def read_samples(content: bytes, configuration: Configuration, place: str) -> tuple[Numbers, Matrix]:
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


def _text(content: bytes, configuration: Configuration, place: str) -> tuple[Numbers, Numbers, Matrix]:
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
        table = pd.read_csv(io.StringIO("\n".join(lines)), header=None, dtype=float, skipinitialspace=True).to_numpy()
    except (ValueError, OverflowError) as error:
        raise InputError(f"{place}{_first_bad(lines)}: a sample is no number ({error}); correct it") from error
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


def _binary(content: bytes, configuration: Configuration, place: str) -> tuple[Numbers, Numbers, Matrix]:
    kind, missing = _TYPES[configuration.form]
    analog, status = len(configuration.analog), len(configuration.status)
    words = -(-status // 16)
    row = np.dtype([("number", "<u4"), ("stamp", "<u4"), ("analog", kind, (analog,)), ("status", "<u2", (words,))])
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
