"""Read what a DLL declares, and try how it keeps its state. Run as a process of its own: foreign code may do anything.

``python -m fmus.vendor_dll.reading FILE ANSWER`` writes JSON to the file ANSWER; the DLL may print what it likes. With
a third word, values of text parameters as JSON, the DLL is tried."""

import ctypes as c
import json
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from fmus.vendor_dll.answer_file import MOST_TEXT, TEXTS
from fmus.vendor_dll.asking import note_beside
from fmus.vendor_dll.interface import CALLS, DATA_TYPES, DllInterface, DllParameter, Number, Signal
from fmus.vendor_dll.memory import Library, LocalLibrary, Note
from fmus.vendor_dll.state_trial import Trial, tried

_MOST = 100_000  # more signals or parameters than this are taken for a structure of another layout
_NOTE = 80  # size of a note [bytes]

_Text = Callable[[int | None], str]
_Row = TypeVar("_Row", bound=c.Structure)


class _Value(c.Union):
    _fields_ = (
        *(("char", c.c_int8), ("c_string", c.c_void_p), ("int8", c.c_int8), ("uint8", c.c_uint8)),
        *(
            ("int16", c.c_int16),
            ("uint16", c.c_uint16),
            ("int32", c.c_int32),
            ("uint32", c.c_uint32),
        ),
        *(("real32", c.c_float), ("real64", c.c_double)),
    )


class _Signal(c.Structure):
    _fields_ = (
        *((name, c.c_void_p) for name in ("name", "description", "unit")),
        ("data_type", c.c_int),
        ("width", c.c_int32),
    )


class _Parameter(c.Structure):
    _fields_ = (
        *((name, c.c_void_p) for name in ("name", "group", "description", "unit")),
        ("data_type", c.c_int),
        ("fixed", c.c_int32),
        *((name, _Value) for name in ("default", "minimum", "maximum")),
    )


class _ModelInfo(c.Structure):
    _fields_ = (
        ("interface_version", c.c_uint8 * 4),
        *((name, c.c_void_p) for name in TEXTS),
        ("sample_time", c.c_double),
        ("mode", c.c_uint8),
        *(("n_inputs", c.c_int32), ("inputs", c.c_void_p)),
        *(("n_outputs", c.c_int32), ("outputs", c.c_void_p)),
        *(("n_parameters", c.c_int32), ("parameters", c.c_void_p)),
        *((name, c.c_int32) for name in ("int_states", "float_states", "double_states")),
    )


def read_interface(library: Library) -> DllInterface:
    if not library.has("Model_GetInfo"):
        raise ValueError("it has no function Model_GetInfo, so it is no IEEE/CIGRE DLL")
    found = library.call("Model_GetInfo")
    if not found:
        raise ValueError("Model_GetInfo returns no model information")

    def text(address: int | None) -> str:
        found = library.text(address)
        if len(found) > MOST_TEXT:
            raise ValueError(
                f"it declares a text of {len(found)} bytes; at most {MOST_TEXT} are read"
            )
        return found.decode("utf-8", "replace").strip()

    def rows(kind: type[_Row], address: int | None, count: int) -> list[_Row]:
        size = c.sizeof(kind)
        return [
            kind.from_buffer_copy(library.read((address or 0) + k * size, size))
            for k in range(count)
        ]

    info = _ModelInfo.from_buffer_copy(library.read(found, c.sizeof(_ModelInfo)))
    for name in ("n_inputs", "n_outputs", "n_parameters"):
        if not 0 <= getattr(info, name) <= _MOST:
            raise ValueError(
                f"Model_GetInfo tells {getattr(info, name)} {name[2:]}; its structure is of another layout"
            )
    inputs = rows(_Signal, info.inputs, info.n_inputs)
    outputs = rows(_Signal, info.outputs, info.n_outputs)
    parameters = rows(_Parameter, info.parameters, info.n_parameters)
    calls = tuple(name for name in CALLS if library.has(f"Model_{name}"))
    return DllInterface(
        texts={name: text(getattr(info, name)) for name in TEXTS},
        interface_version=tuple(info.interface_version),
        sample_time=info.sample_time,
        mode=info.mode,
        inputs=_signals(inputs, text),
        outputs=_signals(outputs, text),
        parameters=tuple(_parameter(row, text) for row in parameters),
        states=(info.int_states, info.float_states, info.double_states),
        calls=calls,
    )


def _signals(rows: Iterable[_Signal], text: _Text) -> tuple[Signal, ...]:
    return tuple(_signal(row, text) for row in rows)


def _signal(row: _Signal, text: _Text) -> Signal:
    return Signal(text(row.name), text(row.description), text(row.unit), row.data_type, row.width)


def _parameter(row: _Parameter, text: _Text) -> DllParameter:
    kind = DATA_TYPES.get(row.data_type)
    words = kind is None or kind.kind == "String"

    def bound(value: _Value) -> Number | None:
        number: Number = getattr(value, kind.name) if kind else 0
        return number

    bounds = (None, None) if words else (bound(row.minimum), bound(row.maximum))
    if bounds == (0, 0):  # the author wrote none
        bounds = (None, None)
    if not words:
        default: str | Number = bound(row.default) or 0
    else:
        default = text(row.default.c_string) if kind else ""
    return DllParameter(
        text(row.name),
        text(row.group),
        text(row.description),
        text(row.unit),
        row.data_type,
        bool(row.fixed),
        default,
        *bounds,
    )


def read(library: Library, texts: Mapping[str, str] | None) -> dict[str, Any]:
    """A DLL's declarations and, where texts are given, how it keeps its state with them [JSON]."""
    interface = read_interface(library)
    trial = (
        Trial("not tried")
        if texts is None or interface.faults()
        else tried(library, interface.with_defaults(texts))
    )
    return {"interface": interface.as_json(), "trial": trial.as_json()}


def _noting(path: Path) -> Note:
    """Writes into a file, which is there from the first word on, and whole at any time."""
    files: list[Any] = []

    def note(doing: str) -> None:
        if not files:
            files.append(path.open("wb", buffering=0))
        files[0].seek(0)
        files[0].write(doing.encode().ljust(_NOTE))

    return note


def answer_for(
    load: Callable[[Note], Library], answer: Path, texts: Mapping[str, str] | None
) -> None:
    """Write what `read` finds into a file, or the error."""
    found: dict[str, Any]
    try:
        found = read(load(_noting(note_beside(answer))), texts)
    except (OSError, ValueError) as error:
        found = {"error": str(error)}
    answer.write_text(json.dumps(found), encoding="utf-8")


def texts_in(words: Sequence[str]) -> dict[str, str] | None:
    """Values of text parameters in the words of a command; None where nothing is to be tried."""
    found: dict[str, str] | None = json.loads(words[3]) if len(words) > 3 else None
    return found


if __name__ == "__main__":
    answer_for(
        lambda note: LocalLibrary(Path(sys.argv[1]), note), Path(sys.argv[2]), texts_in(sys.argv)
    )
