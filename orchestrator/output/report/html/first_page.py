"""The first page of a report: the answer of every study, how sure it is and what it does not judge."""

from collections import Counter
from collections.abc import Sequence
from html import escape

from orchestrator.output.report.html.chapters.chapter import Chapter
from orchestrator.output.report.html.elements import SHADES, table, verdict_paragraph
from orchestrator.output.report.html.origins import given_in
from orchestrator.output.report.html.verdict_lines import verdicts
from orchestrator.output.report.short_texts import short

_NOTHING = "nothing was left out"

_OPEN = 4
"""So many doubts of a study stand on the first page, and so many sentences about what it did not judge; the others are
counted."""

_LONGEST = 240
"""Characters of each of them in a table of several studies: three lines of the page."""

_LONGEST_OF_ONE = 1200
"""Characters of each of them below the answer of a single study: the longest questions have 900."""


def first_page(chapters: Sequence[Chapter], title: str = "") -> str:
    """Return the verdicts by scenario, then the answers of all other studies: one as a sentence, several in a table.

    ``title``: the page's, which stands above; a question that it asks is not asked again."""
    told = ({*one.not_judged, *one.doubts} for one in chapters)
    open_ = Counter(text for texts in told for text in sorted(texts))
    shared = [text for text, count in open_.items() if count > 1]
    notes = {text: f"note {k}" for k, text in enumerate(shared, start=1)}
    by_scenario = "".join(_of_scenarios(one, notes, title) for one in chapters if one.lines)
    in_short = _short_answers([one for one in chapters if not one.lines], notes, title)
    below = "".join(
        f"<p>{name[0].upper()}{name[1:]}: {escape(short(text, _LONGEST))}</p>"
        for text, name in notes.items()
    )
    return f'<div class="answers">{by_scenario}{in_short}{below}</div>'


def _short_answers(chapters: Sequence[Chapter], notes: dict[str, str], title: str) -> str:
    match chapters:
        case []:
            return ""
        case [alone]:
            shade, answer = SHADES[alone.good], escape(_as_sentence(alone.answer))
            return _answer_with_notes(alone, verdict_paragraph(shade, answer), notes, title)
        case _:
            columns = ["Question", "Answer", "How sure", "Not judged"]
            return table("In short", columns, [_row(one, notes) for one in chapters], left=4)


def _as_sentence(text: str) -> str:
    """Begin a text with a capital letter, unless its first word is an identifier, such as ``bus_29``."""
    first = text.split(maxsplit=1)[0].rstrip(",:;") if text else ""
    return f"{text[0].upper()}{text[1:]}" if first.isalpha() else text


def _of_scenarios(chapter: Chapter, notes: dict[str, str], title: str) -> str:
    beside = "".join(f"<p>{escape(text)}</p>" for text in chapter.beside)
    return _answer_with_notes(chapter, f"{verdicts(chapter.lines)}{beside}", notes, title)


def _answer_with_notes(chapter: Chapter, answer: str, notes: dict[str, str], title: str) -> str:
    """Return a study's question, its answer, and in short notes below how sure that is."""
    below = [
        ("How sure", escape(short(chapter.sure, _LONGEST_OF_ONE))),
        ("Doubts", "; ".join(_sentences(chapter.doubts, notes, _LONGEST_OF_ONE))),
        ("Not judged", "; ".join(_not_judged(chapter, notes, _LONGEST_OF_ONE))),
        ("Results", escape(", made by ".join(_places_and_options(chapter)))),
    ]
    told = "".join(f"<li>{name}: {text}</li>" for name, text in below if text)
    asked = chapter.question == title
    question = "" if asked else f'<p class="question">{escape(chapter.question)}</p>'
    return f'{question}{answer}<ul class="soft">{told}</ul>'


def _row(chapter: Chapter, notes: dict[str, str]) -> list[str]:
    given = "".join(f"<br>{escape(text)}" for text in _places_and_options(chapter))
    return [
        f'{escape(chapter.question)}<span class="soft">{given}</span>',
        f'<span class="{SHADES[chapter.good]}">{escape(chapter.answer)}</span>',
        "<br>".join(_sure_and_doubts(chapter, notes)),
        "<br>".join(_not_judged(chapter, notes)),
    ]


def _places_and_options(chapter: Chapter) -> list[str]:
    """List where the results lie and what the command was given."""
    return [text for text in (str(chapter.source), given_in(chapter.origin)) if text]


def _sure_and_doubts(chapter: Chapter, notes: dict[str, str]) -> list[str]:
    doubts = [f"doubt: {text}" for text in _sentences(chapter.doubts, notes)]
    return [escape(short(chapter.sure, 2 * _LONGEST)), *doubts]


def _not_judged(chapter: Chapter, notes: dict[str, str], longest: int = _LONGEST) -> list[str]:
    return _sentences(chapter.not_judged, notes, longest) or [_NOTHING]


def _sentences(texts: Sequence[str], notes: dict[str, str], longest: int = _LONGEST) -> list[str]:
    """Shorten a study's sentences, and count those beyond a few; one of several studies is a note below them."""
    told = [escape(notes.get(text) or short(text, longest)) for text in texts]
    return [*told[:_OPEN], *_more(len(told))]


def _more(count: int) -> list[str]:
    return [f"and {count - _OPEN} more"] if count > _OPEN else []
