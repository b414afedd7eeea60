"""Chapters of a folder or of one file: which study wrote it is seen from the keys of its JSON."""

import json
import re
from collections.abc import Callable
from html import unescape
from pathlib import Path
from typing import Any

from orchestrator.core.errors import InputError
from orchestrator.output.report.html.chapters import devices, recordings, runs, studies
from orchestrator.output.report.html.chapters.chapter import Chapter, with_models
from orchestrator.output.results.manifest import read_manifest

_STUDIES: tuple[tuple[set[str], Callable[[Path, Any], Chapter]], ...] = (
    ({"device", "buses", "confirmed", "answer"}, studies.of_site),
    ({"holds_at", "beyond", "sentence"}, studies.of_limits),
    ({"counted_at_all_frequencies", "failures", "modes"}, studies.of_screening),
    ({"controller", "target_mode", "T_S1", "verdict"}, studies.of_design),
    ({"settings", "verdict", "met", "ranking"}, studies.of_coordinated),
    ({"cells", "codes", "sentence"}, devices.of_matrix),
    ({"sentence", "verdict", "files", "seal"}, devices.of_certificate),
    ({"trusted", "checks", "faults"}, devices.of_check),
    ({"scenarios", "facts", "step_size_s"}, runs.of_modes),
    ({"expression", "deviations", "rms"}, recordings.of_comparison),
    ({"interaction_modes", "pairs", "worst_pair"}, studies.of_interactions),
    ({"derivative", "sensitivities"}, studies.of_sensitivities),
    ({"record", "places", "oscillations"}, recordings.of_sources),
    ({"convention", "scenarios"}, devices.of_strengths),
    ({"amplitude", "doubts"}, recordings.of_identified),
    ({"crossings", "margins", "sentence"}, devices.of_nyquist),
)
"""What the JSON of each study has, and what makes its chapter; the first that fits."""


def chapters_of(place: Path) -> list[Chapter]:
    """Return the chapters of a study's folder or of its JSON; files of others in the folder are passed over."""
    named = place.is_file()
    return [chapter for file in _files(place) for chapter in _chapters(file, named)]


def _files(place: Path) -> list[Path]:
    if place.is_file():
        beside = place.with_suffix(".json")  # of a parameter file, whose design stands beside it
        return [beside if beside.is_file() else place]
    files = sorted(place.glob("*.json"))
    if (place / "sweep.nc").is_file():
        files = [file for file in files if file.name != "limits.json"]  # `of_sweep` tells of it
    manifest = read_manifest(place)
    if manifest is not None:
        manifest.check(file.name for file in files)
    return files


def _chapters(file: Path, named: bool) -> list[Chapter]:
    """Chapters of one file; ``named``: somebody asked for this very file, so it has to be a result."""
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        if named:
            raise InputError(
                f"{file}: it is no study's result; give a study's folder or .json"
            ) from error
        return []
    make = _maker(content)
    if make is None:
        return []
    several = isinstance(content, list) and make is studies.of_sensitivities
    try:
        return [with_models(make(file, one), one) for one in (content if several else [content])]
    except (KeyError, TypeError, IndexError, AttributeError, ValueError) as error:
        raise InputError(
            f"{file}: it is not as its study writes it ({error!r}); run the study again"
        ) from error


def _maker(content: Any) -> Callable[[Path, Any], Chapter] | None:
    """Return what makes the chapter of a study's JSON: of an object, or of a list of objects with the same keys."""
    first = content[0] if isinstance(content, list) and content else content
    keys = set(first) if isinstance(first, dict | list) and first else set()
    return next((make for wanted, make in _STUDIES if wanted <= keys), None)


def sections(chapter: Chapter, number: int) -> str:
    place = chapter.source if chapter.source.is_dir() else chapter.source.parent
    if not chapter.page or not (place / chapter.page).is_file():
        return chapter.content
    found = re.search(
        r"</nav>(.*)</main>", (place / chapter.page).read_text(encoding="utf-8"), re.DOTALL
    )
    text = _without_answer(found[1], chapter.answer) if found else ""
    text = re.sub(r'(id="|href="#)(section|figure)-', rf"\1chapter-{number}-\2-", text)
    text = re.sub(r"(clip-)(\d+)", rf"\g<1>{number}-\2", text)
    return re.sub(r"<(/?)h([23])>", lambda m: f"<{m[1]}h{int(m[2]) + 1}>", text)


def _without_answer(text: str, answer: str) -> str:
    """Leave out the verdict of a result's own page where the report's first page has told it."""
    verdict = re.search(r'<p class="verdict">(.*?)</p>', text, re.DOTALL)
    if verdict is None or not answer.startswith(unescape(re.sub(r"<[^>]*>", "", verdict[1]))):
        return text
    return text.replace(verdict[0], "", 1)
