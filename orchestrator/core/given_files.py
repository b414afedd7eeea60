"""Files that keep what Python was given as tables: errors name them as they were given, and not by their paths."""

import string
from dataclasses import dataclass
from pathlib import Path
from typing import Self

FOLDER = "given"  # of the cache, that holds them
DIGITS = 16  # of the hash that names the folder of each


@dataclass(frozen=True)
class ShownFile:
    """A file as errors name it.

    Attributes
    ----------
    name : str
        Its path as it was written, or ``points`` for what was given as a table of points.
    is_given : bool
        Whether somebody gave tables, so that nobody has seen a file.
    """

    name: str
    is_given: bool = False

    @classmethod
    def of(cls, file: Path | str) -> Self:
        path = Path(file)
        mark = path.parent.name
        is_hash = len(mark) == DIGITS and set(mark) <= set(string.hexdigits)
        if is_hash and path.parent.parent.name == FOLDER:
            return cls(path.stem, is_given=True)
        return cls(str(file))

    def __str__(self) -> str:
        return self.name

    def at_line(self, line: int) -> str:
        """Return the place of a line, of which the first holds the names of columns; of a table it is a row."""
        if not self.is_given:
            return f"{self.name}, line {line}"
        return f"{self.name}, row {line - 1}" if line > 1 else self.name
