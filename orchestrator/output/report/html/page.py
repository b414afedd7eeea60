"""The page as a whole, its first page, and what changed since an older one."""

import json
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from orchestrator.cases.networks.element_names import ElementNames
from orchestrator.core.errors import InputError, few
from orchestrator.core.file_hashes import sha256_of
from orchestrator.core.options import Option
from orchestrator.core.safe_files import write_page
from orchestrator.output.report.html import sections, studies
from orchestrator.output.report.html.chapters.chapter import Chapter
from orchestrator.output.report.html.chapters.files import chapters_of
from orchestrator.output.report.html.chapters.files import sections as sections_of
from orchestrator.output.report.html.chapters.runs import has_fault, of_run
from orchestrator.output.report.html.chapters.studies import of_sweep
from orchestrator.output.report.html.elements import Figures, document, held_data, paragraphs, table
from orchestrator.output.report.html.first_page import first_page
from orchestrator.output.report.html.folder import SUMMARY, Results, read_results, sweeps_of
from orchestrator.output.report.html.least_damped import LeastDamped, other_modes
from orchestrator.output.report.html.origins import given_in, made_of
from orchestrator.output.results.manifest import MANIFEST, ResultsWarning

USED = (
    "run, modes, screen, sweep, site, design, sensitivities, interactions, certify, scr, fmu check, fmu nyquist, "
    "signal identify, signal compare, signal source"
)
"""Commands whose results a report takes."""

_EMPTY_HEADING = re.compile(r"<section[^>]*><h3>[^<]*</h3></section>")

Sections = list[tuple[str, str]]
Answer = Mapping[str, Any]
_PICTURE = (
    r'(?:(?:<ul class="legend">[^\n]*?</ul>)?<svg class="chart".*?</svg>|<img .*?>)'
    r"(?:<figcaption>.*?</figcaption>)?"
)


def write_report(
    folder: Path,
    others: Sequence[Path] = (),
    path: Path | None = None,
    against: Path | None = None,
    title: str | None = None,
    *,
    short: bool = False,
) -> Path:
    """One file that needs no other, by default in the first folder.

    ``against``: an older page, or an older folder of results, of which it says what changed since.
    ``short``: the first page and where all comes from, without the chapters."""
    target = path or (folder if folder.is_dir() else folder.parent) / "report.html"
    write_page(target, page(list(dict.fromkeys([folder, *others])), against, title, short=short))
    return target


def page(
    places: Sequence[Path],
    against: Path | None = None,
    title: str | None = None,
    *,
    short: bool = False,
) -> str:
    told, runs = _tell_origins(places, Figures())
    chapters = [chapter for chapter, _ in told]
    differ = _of_several_studies(chapters)
    if differ:
        warnings.warn(differ, ResultsWarning, stacklevel=2)
    changed = _changed_since(chapters)
    if changed:
        warnings.warn(changed, ResultsWarning, stacklevel=2)
    headings = [heading for _, content in told for heading, _ in content]
    content = [
        (heading if headings.count(heading) == 1 else f"{heading} ({_name(chapter.source)})", text)
        for chapter, found in told
        for heading, text in found
    ]
    picture, content = _with_first_picture_above(content)
    content = [] if short else content
    if against is not None:
        before = (
            [chapter for chapter, _ in _tell_origins([against], Figures())[0]]
            if against.is_dir()
            else None
        )
        content.insert(0, ("What changed since", changes(against, before, chapters)))
    content.append(("Provenance", origins(chapters) + "".join(map(sections.provenance, runs))))
    case = runs[0].case if runs else None
    title = title or (case.table.title or case.name if case else _title_of(places, headings))
    kind = "Small-signal and time-domain study by co-simulation of FMUs"
    first = first_page(chapters, title)
    found = "".join(sections.findings(run, above=first) for run in runs)
    of_all = {
        "question": "Are these results of one study?",
        "source": "",
        "answer": f"NO: {differ}",
    }
    # for `changes` of a later page
    answers = held_data("answers", [*[of_all] * bool(differ), *_answers(chapters)])
    above = "".join(paragraphs(False, [text]) for text in (differ, changed) if text)
    findings = above + first + picture + found + answers
    return document(title, kind, findings, content, names=_names_of(chapters, runs))


def _with_first_picture_above(content: Sections) -> tuple[str, Sections]:
    """Take the first picture out of the sections: returned with the number by which a text there calls it, else a
    sentence says where it went."""
    pictures = (re.search(_PICTURE, text, re.DOTALL) for _, text in content)
    first = next((found for found in pictures if found), None)
    if first is None:
        return "", content
    picture = first[0]
    numbered = re.search(f"<figure id=[^>]*>{re.escape(picture)}</figure>", first.string)
    moved = numbered[0] if numbered else picture
    alone = len(content) == 1
    left = "" if numbered or alone else "<p>Its picture stands at the top of this page.</p>"
    return moved, [
        (heading, _EMPTY_HEADING.sub("", text.replace(moved, left))) for heading, text in content
    ]


def _title_of(places: Sequence[Path], headings: Sequence[str]) -> str:
    """Name a page without a run: by its one study, or by where the results lie."""
    return (
        headings[0]
        if len(headings) == 1
        else f"Report on {', '.join(place.resolve().name for place in places)}"
    )


def _names_of(chapters: Sequence[Chapter], runs: Sequence[Results]) -> ElementNames:
    """Return the names of the networks' files, as far as all results have one name for an identifier."""
    said = [scenario.get("names", {}) for run in runs for scenario in run.scenarios]
    said += [chapter.names for chapter in chapters]
    shown: dict[str, str] = {}
    for name in {name for names in said for name in names}:
        found = {names[name] for names in said if name in names}
        if len(found) == 1:
            shown[name] = found.pop()
    return ElementNames(shown)


def _tell_origins(
    places: Sequence[Path], figures: Figures
) -> tuple[list[tuple[Chapter, Sections]], list[Results]]:
    """The chapters of all places with their sections, and the runs among them."""
    parts = {place: list(_parts(place)) for place in places}
    runs = {
        part: read_results(part)
        for found in parts.values()
        for part in found
        if (part / SUMMARY).is_file()
    }
    scenarios = [s for run in runs.values() for s in run.scenarios]
    told: list[tuple[Chapter, Sections]] = []
    for place, within in parts.items():
        before = len(told)
        for part in within:
            count = len(told)
            run = runs.get(part)
            if run is not None:
                split = (
                    [s for s in run.scenarios if has_fault(s) is faulted]
                    for faulted in (False, True)
                )
                chapters = [of_run(part, some, beside=run.beside) for some in split if some]
                told += zip(chapters, [_of_run(run, figures), *[[]] * len(chapters)], strict=False)
            for sweep in sweeps_of(part):
                shown = studies.sweep(sweep, scenarios, figures)
                told.append(
                    (
                        of_sweep(part, sweep),
                        [(f"Trajectories along {studies.axis_of(sweep)}", shown)],
                    )
                )
            for chapter in chapters_of(part):
                text = sections_of(chapter, len(told) + 1)
                told.append((chapter, [(chapter.title or chapter.question, text)]))
            if part != place and len(told) == count and (part / MANIFEST).is_file():
                warnings.warn(
                    f"{part}: nothing in it can be used for a report", ResultsWarning, stacklevel=2
                )
        if len(told) == before:
            pages = (
                ", ".join(file.name for file in sorted(place.glob("*.html")))
                if place.is_dir()
                else ""
            )
            own = f"it has a page of its own: {pages}; " if pages else ""
            raise InputError(
                f"{place}: nothing in it can be used for a report; {own}a report takes results of {USED}"
            )
    return told, [*runs.values()]


def _parts(place: Path, depth: int = 2) -> Iterator[Path]:
    """A place, and the folders in it; those of a run's scenarios are of the run, and points of their study."""
    if not place.exists():
        raise InputError(f"{place}: there is no such file or folder")
    yield place
    if place.is_dir() and depth and not (place / SUMMARY).is_file():
        for inner in sorted(path for path in place.iterdir() if path.is_dir()):
            if not inner.name.startswith(".") and not inner.name.endswith("points"):
                yield from _parts(inner, depth - 1)


def _of_several_studies(chapters: Sequence[Chapter]) -> str:
    """Files of one name with different content that results were made from, and networks, load models and machines'
    models that differ; "" where none do."""
    files, models = dict[str, list[tuple[str, str]]](), dict[str, list[tuple[str, str]]]()
    for one in chapters:
        inputs = one.origin.get("inputs", {})
        shown = {
            name: name if Path(name).suffix in _RECORDS else Path(name).name for name in inputs
        }
        files[str(one.source)] = [(shown[name], str(content)) for name, content in inputs.items()]
        found = models.setdefault(str(one.source), [])
        for basis in one.bases:
            of = f" of {basis['network']}"
            found += [
                ("network", basis["network"]),
                *[(f"load model{of}", basis["loads"])] * bool(basis["loads"]),
            ]
            found += [(f"model of {unit}{of}", kind) for unit, kind in basis["machines"].items()]
    said = [
        f"{name} differs between {' and '.join(few(at, 2) for at in by.values())}"
        for name, by in _unlike(files)
    ]
    alike: dict[str, list[str]] = {}  # most machines differ in one way
    for what, by in _unlike(models):
        alike.setdefault(
            ", and ".join(f"{kind} in {few(at, 2)}" for kind, at in by.items()), []
        ).append(what)
    said += [f"{few(names, 1)}: {text}" for text, names in alike.items()]
    return f"{'; '.join(said)}; figures are not comparable as one study" if said else ""


def _changed_since(chapters: Sequence[Chapter]) -> str:
    """Files that results were made from and that have another content by now, in the place where they were."""
    found = {}
    for source, origin in _origins(chapters).items():
        inputs, home = origin.get("inputs", {}), Path(origin.get("directory", ""))
        homes = (
            [home, *(home / Path(name).parent for name in inputs if name.endswith(".toml"))]
            if home.name
            else []
        )
        for name, content in inputs.items():
            there = [file for one in homes if (file := one / name).is_file()]
            if there and all(sha256_of(file) != content for file in there):
                found[name] = source
    names = few((f"{name} (of {source})" for name, source in found.items()), 3)
    return (
        f"not as they were when results were made of them: {names}; make the results again"
        if names
        else ""
    )


def _unlike(
    told: Mapping[str, Sequence[tuple[str, str]]],
) -> Iterator[tuple[str, dict[str, list[str]]]]:
    """Yield what differs among what sources tell of one thing each: the thing, and the sources of every value."""
    seen: dict[str, dict[str, list[str]]] = {}
    for source, pairs in told.items():
        for what in dict(pairs):
            values = {value for name, value in pairs if name == what}
            if len(values) == 1:  # else it compares them
                seen.setdefault(what, {}).setdefault(values.pop(), []).append(source)
    return ((what, by) for what, by in seen.items() if len(by) > 1)


def _name(place: Path) -> str:
    return (place if place.is_dir() else place.parent).resolve().name


def _of_run(run: Results, figures: Figures) -> Sections:
    content = [
        ("What was studied", sections.studied(run)),
        ("Operating point", sections.operating_point(run)),
        ("Modes", sections.modes(run, figures)),
    ]
    if run.trajectories:
        content.append(("Time responses", sections.responses(run, figures)))
    if run.step_sizes:
        content.append(("Communication step", sections.step_sizes(run)))
    return content


_RECORDS = {".nc", ".csv", ".cfg", ".dat"}  # of which each folder has one of the same name


def _origins(chapters: Sequence[Chapter]) -> dict[Path, dict[str, Any]]:
    return {one.source: one.origin for one in chapters}


def origins(chapters: Sequence[Chapter]) -> str:
    """Tell of each result when it was made, by which version and code, from what, and the command to repeat it."""
    rows = [
        [escape(cell) for cell in made_of(source, origin)]
        for source, origin in _origins(chapters).items()
    ]
    columns = [
        "Results",
        "Made",
        "Version",
        "Code",
        "Inputs (SHA-256)",
        "Command that makes them again",
    ]
    return table("Where every chapter comes from", columns, rows, left=6)


def changes(old: Path, before: Sequence[Chapter] | None, chapters: Sequence[Chapter]) -> str:
    """``before``: the chapters of older results; None where ``old`` is an older page."""
    then = _by_name(
        _answers(before) if before is not None else _kept_answers(old), _answers(chapters)
    )
    now = _by_name(_answers(chapters), _answers(chapters))
    rows = []
    for key in dict.fromkeys([*then, *now]):
        one, other = then.get(key, {}), now.get(key, {})
        was, is_now = one.get("answer"), other.get("answer")
        if was != is_now:
            cells = (
                key[0],
                key[1] or "its folder",
                was or "not there",
                is_now or "not there any more",
            )
            rows.append([escape(cell) for cell in (*cells, _change_in_words(one, other))])
    if not rows:
        return f"<p>No answer differs from {escape(old.name)}.</p>"
    columns = ["Question", "Of", "Before", "Now", "Figures that moved"]
    return table(f"Answers that differ from {old.name}", columns, rows, left=5)


def _change_in_words(was: Mapping[str, Any], is_now: Mapping[str, Any]) -> str:
    """The figures that differ between two answers that are alike but for them, if these are of the same modes."""
    before, now = was.get("answer", ""), is_now.get("answer", "")
    number = r"(?<![\w.])[-−+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
    if re.sub(number, "#", before) != re.sub(number, "#", now):
        return ""
    if is_now.get("least") and "least" not in was:
        return "not told: the older page does not say which modes its figures are of"
    modes = ([LeastDamped.of(mode) for mode in one.get("least", ())] for one in (was, is_now))
    other = other_modes(*modes)
    if other:
        return "; ".join(other)
    pairs = zip(re.findall(number, before), re.findall(number, now), strict=True)
    moved = [
        (a, b, float(b.replace("−", "-")) - float(a.replace("−", "-"))) for a, b in pairs if a != b
    ]
    return ", ".join(f"{a} to {b} ({by:+.4g})" for a, b, by in moved)


def _kept_answers(page: Path) -> list[Answer]:
    try:
        found = re.search(
            r'id="answers">(.*?)</script>', page.read_text(encoding="utf-8"), re.DOTALL
        )
        kept: list[Answer] | None = json.loads(found[1]) if found else None
    except (OSError, ValueError) as error:
        raise InputError(
            Option.AGAINST + f" {page}: it cannot be read: {error}; give a page of `gfor report`"
        ) from error
    if kept is None:
        raise InputError(
            Option.AGAINST
            + f" {page}: it is no page of `gfor report`; give one that an earlier call wrote"
        )
    return kept


def _answers(chapters: Sequence[Chapter]) -> list[Answer]:
    return list(map(_answer_of, chapters))


def _answer_of(chapter: Chapter) -> Answer:
    source, folder = chapter.source.name, chapter.source.absolute().parent.name
    if chapter.source.is_dir():
        source, folder = "", chapter.source.name
    beside = [f"; not judged: {text}" for text in chapter.not_judged]
    beside += [f"; doubt: {text}" for text in chapter.doubts]
    return {
        "question": chapter.question,
        "source": source,
        "answer": chapter.answer + "".join(beside),
        "given": given_in(chapter.origin),
        "least": [mode.as_json() for mode in chapter.least],
        "folder": folder,
    }


def _by_name(
    answers: Sequence[Answer], others: Sequence[Answer]
) -> dict[tuple[str, str, int], Answer]:
    """Answers by question, file and place: first those of folders that the others have as well, at the same place."""
    found: dict[tuple[str, str, int], Answer] = {}
    known = [(x["question"], x["source"], x.get("folder")) for x in others]
    named = [((x["question"], x["source"], x.get("folder")), x) for x in answers]
    for key, answer in sorted(named, key=lambda one: one[0] not in known):
        alike = [x for x in known if x[:2] == key[:2]]
        place = alike.index(key) if key in alike else 0
        while (*key[:2], place) in found:
            place += 1
        found[*key[:2], place] = answer
    return found
