"""Results of an earlier day."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from orchestrator.core.asked import path as path_of
from orchestrator.core.errors import InputError
from orchestrator.core.late import pd
from orchestrator.output.report.html.chapters.chapter import Chapter
from orchestrator.output.report.html.chapters.folders import chapters_in
from orchestrator.output.report.notebook import headline, page
from orchestrator.output.results.manifest import MANIFEST, checked
from orchestrator.output.results.recording_reader import open_whole


class NoSuchFileError(InputError, KeyError):
    """A folder of results holds no file of a name."""


class Saved(Mapping[str, Any]):
    """Content of a folder of results, by file; each is read, and compared with its manifest, where it is asked for.

    A ``.nc`` is an `xarray.Dataset`, a ``.csv`` a DataFrame, a ``.json`` what JSON makes of it.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __iter__(self) -> Iterator[str]:
        found = (
            file
            for file in sorted(self.folder.rglob("*.*"))
            if file.suffix in (".nc", ".csv", ".json")
        )
        return (file.relative_to(self.folder).as_posix() for file in found if file.name != MANIFEST)

    def __len__(self) -> int:
        return len(list(iter(self)))

    def __getitem__(self, name: str) -> Any:
        if name not in list(self):
            raise NoSuchFileError(
                f"{self.folder}: it holds no {name!r}; it holds: {', '.join(self)}"
            )
        file = self.folder / name
        if (file.parent / MANIFEST).is_file():
            checked(file.parent, [file.name])
        if file.suffix == ".json":
            return json.loads(file.read_text(encoding="utf-8"))
        if file.suffix == ".nc":
            return open_whole(file)
        try:
            return pd.read_csv(file)
        except pd.errors.EmptyDataError:
            return pd.DataFrame()

    @property
    def provenance(self) -> dict[str, Any]:
        """Date, version, command, and hashes of code and inputs, as far as they were kept; a recording has its own in
        its ``attrs``."""
        file = self.folder / MANIFEST
        return dict(json.loads(file.read_text(encoding="utf-8"))) if file.is_file() else {}

    def _repr_html_(self) -> str:
        """Return the answers of the studies in the folder, what made them, and the files."""
        try:
            told = [verdict for one in chapters_in(self.folder) for verdict in _verdicts(one)]
        except InputError as error:
            told = [(str(error), False)]
        origin = self.provenance
        made = (origin.get(name) for name in ("date", "command"))
        lines = [text for text in (*made, ", ".join(self)) if text]
        verdicts = "".join(headline(text, good) for text, good in told)
        return page(str(self.folder), lines, verdict=verdicts)

    def __repr__(self) -> str:
        return f"<Saved {self.folder}: {', '.join(self)}>"


def _verdicts(chapter: Chapter) -> list[tuple[str, bool | None]]:
    """Return a study's answer and if it is good: one of each scenario where it judges several."""
    lines = [(line.words, line.stable) for line in chapter.lines]
    return lines or [(chapter.answer, chapter.good)]


def open(folder: str | Path) -> Saved:
    """Read what an earlier study left in a folder.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> folder = gfor.load("two_area_rms").scenario("gfor").modes().save("today")
    >>> gfor.open(folder)["modes.csv"]["frequency [Hz]"].size > 0
    True
    """
    place = path_of(folder, "folder", "folder")
    if not place.is_dir() or not len(saved := Saved(place)):
        raise InputError(
            f"folder = {str(place)!r}: there are no results; give a folder that a study wrote"
        )
    return saved
