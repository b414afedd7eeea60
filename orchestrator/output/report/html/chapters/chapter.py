"""A chapter of a report: the question of a study, its answer in plain words, how sure that is, and its figures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from math import pi
from pathlib import Path
from typing import Any

from orchestrator.output.report.colours import colour
from orchestrator.output.report.html.charts import Mark, complex_plane, legend
from orchestrator.output.report.html.least_damped import LeastDamped
from orchestrator.output.report.html.origins import origin_of
from orchestrator.output.report.html.verdict_lines import VerdictLine

_FASTEST = -5.0
"""Real part [1/s] of the fastest modes on a map: faster ones are over before a swing has begun."""

_KINDS = {"emt": "EMT"}
"""Kinds of models as sentences have them, where a table has another name."""

Content = Mapping[str, Any]
"""A study's JSON."""


@dataclass(frozen=True)
class Chapter:
    """Content of one result; ``page`` is the name of its own page, whose sections are the chapter, in the place of
    ``content``; ``title`` is its heading, in the place of the question."""

    source: Path
    question: str
    answer: str
    good: bool | None
    sure: str = ""
    not_judged: Sequence[str] = ()
    doubts: Sequence[str] = ()  # warnings, and questions that the files raise, of what was judged
    content: str = ""
    page: str = ""
    title: str = ""
    bases: Sequence[Mapping[str, Any]] = ()  # what figures rest on: `PreparedScenario.basis`
    names: Mapping[str, str] = field(default_factory=dict)  # `ElementNames.shown`
    least: Sequence[LeastDamped] = ()  # the modes whose figures the answer gives, in its order
    lines: Sequence[VerdictLine] = ()  # of a study of scenarios: the answer by scenario
    beside: Sequence[str] = ()  # of such a study: the answer's part that is of no scenario

    @cached_property
    def origin(self) -> dict[str, Any]:
        """Return what the result says of itself, as `origin_of` has it."""
        return origin_of(self.source)


def with_models(chapter: Chapter, content: Any) -> Chapter:
    records = [
        one
        for one in (content if isinstance(content, list) else [content])
        if isinstance(one, dict)
    ]
    told = (one.get(key) for one in records for key in ("warnings", "questions"))
    more = chain(*(texts for texts in told if isinstance(texts, list)))
    sure = "; ".join(filter(None, (*kinds_of(records), chapter.sure)))
    bases = [*chapter.bases, *bases_of(records)]
    return replace(
        chapter,
        sure=sure,
        doubts=list(dict.fromkeys([*chapter.doubts, *more])),
        bases=bases,
        names={name: shown for one in records for name, shown in one.get("names", {}).items()},
    )


def bases_of(records: Sequence[Content]) -> list[Content]:
    return [one["basis"] for one in records if one.get("basis")]


def kinds_of(records: Sequence[Content]) -> list[str]:
    """Models of each kind, with what they take loads for."""
    loads = (one.get("basis", {}).get("loads") for one in records)
    return list(
        dict.fromkeys(
            f"{_KINDS.get(one['models'], one['models'])} models" + (f", loads {law}" if law else "")
            for one, law in zip(records, loads, strict=True)
            if one.get("models")
        )
    )


def modes_map(name: str, groups: Mapping[str, Sequence[Content]]) -> str:
    """The eigenvalues of each group, without those that are over at once, where there are any."""
    shades = {label: colour(k) for k, label in enumerate(groups)}
    marks = []
    for label, found in groups.items():
        for z in (z for z in found if z["real"] > _FASTEST):
            hz = abs(z["imag"]) / (2 * pi)
            tip = f"{label}: {hz:.3f} Hz, {z['real']:.3f} 1/s"
            marks.append(Mark(z["real"], hz, shades[label], tip))
    return legend(shades.items()) + complex_plane(name, marks) if marks else ""
