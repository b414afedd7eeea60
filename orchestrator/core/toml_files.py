"""TOML files that users write: how they are read, the form of their tables, and the errors that all of them share."""

import sys
import tomllib
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict

from orchestrator.core.errors import InputError
from orchestrator.core.foreign_files import (
    check_regular,
    may_steer,
    steering_in,
    visible,
    why_refused,
)
from orchestrator.core.given_files import ShownFile

MOST_BYTES = 16 * 1024**2  # of one file: a case with 100,000 events has about 12 MB


class Table(BaseModel):
    """A table that knows all its keys."""

    model_config = ConfigDict(extra="forbid", populate_by_name=True)


def read_toml(
    path: Path, subject: str, remedy: str, option: str = "", *, steering: bool = False
) -> tuple[str, dict[str, Any]]:
    """Read a TOML file; its text, and what the text says.

    ``steering``: whether characters that steer a terminal pass, because the caller names each at its place.

    Raises an `InputError` if there is no such file, it cannot be read, it is larger than `MOST_BYTES`, or it is not
    TOML."""
    shown = str(ShownFile.of(path))
    source = option + f" {shown}" if option else shown
    try:
        check_regular(path, option)
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise InputError(
                source
                + f": {subject} has {size} bytes; at most {MOST_BYTES} are read, so move tables of numbers into "
                "files of their own"
            )
        text = path.read_text(encoding="utf-8")
        found = parsed(text)
    except OSError as error:
        raise InputError(
            source + f": {subject} cannot be read: {error.strerror}; {remedy}"
        ) from error
    except tomllib.TOMLDecodeError as error:
        last = f"at the end of line {len(text.rstrip().splitlines())}, the last one"
        said = str(error).replace("at end of document", last)
        raise InputError(
            source
            + f": it is not a TOML file: {said}; write NAME = VALUE, texts in quotes, and close every bracket "
            "and quote"
        ) from error
    except UnicodeDecodeError as error:
        raise InputError(source + f": it is not a TOML file: {error}") from error
    except ValueError as error:  # of `parsed`, or Python's own, which converts at most 4,300 digits
        raise InputError(
            source + ": a whole number in it has too many digits to be read; shorten it"
        ) from error
    except RecursionError as error:
        raise InputError(
            source + f": its brackets nest too deeply to be read; {subject} nests at most five"
        ) from error
    if not steering and may_steer(text):
        _check_characters(source, found)
    return text, found


def _check_characters(source: str, table: dict[str, Any]) -> None:
    for place, character in steering_in(table):
        where = ".".join(map(str, place))
        raise InputError(source + f": {visible(where)}: {why_refused(character)}")


def parsed(text: str) -> dict[str, Any]:
    """Read a text in TOML; ValueError and RecursionError where it cannot be read, or not be computed with."""
    found = tomllib.loads(text)
    _check_whole_numbers(found)
    return found


def _check_whole_numbers(value: Any) -> None:
    if isinstance(value, dict | list):
        for inner in value.values() if isinstance(value, dict) else value:
            _check_whole_numbers(inner)
    elif isinstance(value, int) and abs(value) > sys.float_info.max:
        raise ValueError(
            f"a whole number has {value.bit_length()} bits; it must be one that a computation takes"
        )


def fault_of(detail: Any) -> str:
    """Return what is wrong with an entry, and the remedy, from one of pydantic's errors."""
    match detail["type"]:
        case "extra_forbidden":
            return "this key is unknown; check its spelling, or remove it"
        case "missing":
            return "this key is missing; add it"
        case "string_type":
            return "it must be a text; write it in quotes"
        case "dict_type" | "model_type" | "model_attributes_type":
            return "it must be a table: keys with values, in braces or below a heading of their own"
        case "list_type" | "tuple_type":
            return "it must be a list; write it in square brackets"
        case _:
            return (
                str(detail["msg"])
                .removeprefix("Value error, ")
                .replace("Input should be", "it must be")
            )
