"""Printing that all commands share: consoles, JSON, progress, warnings."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

from rich.console import Console, RenderableType
from rich.markup import escape

from orchestrator.core.errors import Problem
from orchestrator.core.question_kinds import by_kind, questions_below
from orchestrator.core.safe_files import made_folder
from orchestrator.face.cli.known_questions import new_questions
from orchestrator.face.cli.later import say_last
from orchestrator.output.report.column_table import ColumnTable, ShownTable
from orchestrator.output.report.linearised import exceptions_in_words
from orchestrator.output.report.terminal_tables import PlainTable
from orchestrator.output.results.file_writers import save_json
from orchestrator.output.results.manifest import ResultsWarning
from orchestrator.output.results.staging import new_run_id, staged

if TYPE_CHECKING:
    from orchestrator.cases.networks.element_names import ElementNames
    from orchestrator.cases.scenario.prepare import PreparedScenario
    from orchestrator.studies.modes.modes import ModesResult
    from orchestrator.studies.runs.run import RunResult

_FEW = 2  # known questions from which one line stands for them


class NamingConsole(Console):
    """A console that shows the names of the network's file beside identifiers, in sentences and in tables."""

    def __init__(self, names: ElementNames, **options: Any) -> None:
        super().__init__(**options)
        self._names = names

    def print(self, *objects: Any, **options: Any) -> None:
        """Print sentences and tables, each with the names."""
        super().print(*(self._with_names(one) for one in objects), **options)

    def _with_names(self, one: Any) -> Any:
        if isinstance(one, str):
            return self._names.in_text(one, escape)
        shown = one.__rich__() if isinstance(one, ColumnTable | ShownTable) else one
        return shown.with_texts(self._names.in_text) if isinstance(shown, PlainTable) else shown


def make_console(*, stderr: bool = False, names: ElementNames | None = None) -> Console:
    """A terminal's own width; elsewhere one that lets no table wrap.

    ``names``: of the network's file, which are then shown."""
    make = partial(NamingConsole, names) if names is not None and names.shown else Console
    console = make(stderr=stderr)
    return console if console.is_terminal else make(stderr=stderr, width=160)


def make_errors() -> Console:
    """Standard error, one line for each message."""
    return Console(stderr=True, soft_wrap=True, highlight=False, emoji=False)


def print_json(content: Any) -> None:
    """The only thing on standard output of a command with ``--json``."""
    print(json.dumps(content, indent=1, ensure_ascii=False))


def keep_json(content: Any, folder: Path | None, name: str) -> None:
    """Write what ``--json`` prints into the folder of ``--out``, with a manifest, for ``gfor report``."""
    if folder is not None:
        with staged(made_folder(folder, "--out"), new_run_id()) as staging:
            save_json(content, staging / f"{name}.json")


def print_parts(console: Console, parts: Iterable[RenderableType]) -> None:
    for part in parts:
        console.print(part, soft_wrap=isinstance(part, str), highlight=False)


def say(kind: str, texts: Iterable[str]) -> None:
    """Sentences of a kind, such as ``warning``, on standard error."""
    for text in texts:
        make_errors().print(f"[bold yellow]{kind}:[/bold yellow] {escape(text)}")


def print_named_modes(
    console: Console, results: Sequence[ModesResult], *, shapes: bool = True, details: bool = False
) -> None:
    """The modes that a case names, beside somebody else's figures for them, and who swings in them.

    Figures that the answers show already are not repeated. ``details``: shows the shapes of all modes where none has a
    name."""
    from orchestrator.studies.runs import tables  # noqa: PLC0415 - imports all that a run needs
    from orchestrator.studies.runs.answer_of_modes import name_of_answers  # noqa: PLC0415 - as well

    shaped = shapes and any(r.swing and (r.named or r.modes) for r in results)
    told = shaped and bool(name_of_answers(results))
    if not told and any(r.named or r.unnamed for r in results):
        reference = results[0].prepared.case.table.reference
        console.print(tables.named_modes(results, reference.title if reference else None))
        print_reference(console, results)
        console.print("")
    if shaped:
        console.print(tables.mode_shapes(results, with_values=told, whole=details), "")


def print_reference(console: Console, results: Sequence[ModesResult]) -> None:
    """Where somebody else's figures come from; nothing where there are none."""
    reference = results[0].prepared.case.table.reference
    if reference and any(r.references for r in results):
        text = f"{reference.title}: {reference.source}"
        console.print(escape(text), style="dim", soft_wrap=True, highlight=False)


def print_sources(console: Console, results: Sequence[ModesResult]) -> None:
    """Which linear models do not come from perturbing the running FMUs; nothing where all do."""
    said = {
        r.prepared.title: text
        for r in results
        if (text := exceptions_in_words(r.linearised, r.fit_errors))
    }
    if len(set(said.values())) == 1 and len(said) == len(results):
        said = {"": next(iter(said.values()))}
    for title, text in said.items():
        console.print(
            f"{title}: {text}" if title else text, soft_wrap=True, highlight=False, markup=False
        )


def print_questions(
    scenarios: Sequence[PreparedScenario], *, as_json: bool, whole: bool = False
) -> None:
    """Say what the network's files come to, and below the answer, on standard error and once, questions about data that
    are most unusual.

    Questions of one kind stand in one line. Of a case file that has not changed, questions that an earlier command has
    shown are counted in one line.

    ``whole``: whether all are shown, one by one; with ``as_json`` those of an earlier command are shown again."""
    from orchestrator.cases.case import BUILT_IN  # noqa: PLC0415 - imports the reading of cases
    from orchestrator.cases.scenario.facts import facts_of  # noqa: PLC0415 - as well

    facts = facts_of(scenarios[0]) if scenarios and not as_json else None
    if facts is not None:
        make_console().print(facts.sentence(), soft_wrap=True, highlight=False, markup=False)
    by_text = {str(q): q for prepared in scenarios for q in prepared.questions}
    asked = list(by_text)
    path = scenarios[0].case.path if asked else None
    if path is None or path.is_relative_to(BUILT_IN):
        _ask(asked if whole else by_kind(by_text).values())
        return
    fresh = new_questions(path, asked)
    known = len(asked) - len(fresh)
    command = f"gfor modes {quote(str(path))} --details"
    if whole:
        _ask(asked)
        return
    again = as_json or known < _FEW
    lines = by_kind({text: by_text[text] for text in (asked if again else fresh)}, command).values()
    _ask(lines if as_json else map(scenarios[0].names.in_text, lines))
    if again:
        return
    others = "other " if fresh else ""
    text = f"{known} {others}questions about {path.name} are those of an earlier command"
    _ask([f"{text}; {command} shows them, and --json has them"])


def announced_questions(scenarios: Iterable[PreparedScenario]) -> list[str]:
    """Return a line on the questions that stand below an answer, for its reader; none without any."""
    return questions_below(question for prepared in scenarios for question in prepared.questions)


def with_announced_questions(
    parts: Iterable[RenderableType], scenarios: Iterable[PreparedScenario]
) -> Iterator[RenderableType]:
    """Yield the parts of an answer, with the line on the questions that stand below them all.

    The line follows the sentences with which the answer begins, or the table where it begins with one: below long
    tables nobody who has read the verdict would look for it."""
    told = list(parts)
    tables = [k for k, part in enumerate(told) if not isinstance(part, str)]
    place = tables[0] if tables else len(told)
    while place and told[place - 1] == "":
        place -= 1  # above the empty line that ends the sentences
    place = place or 1
    yield from (*told[:place], *map(escape, announced_questions(scenarios)), *told[place:])


def ask(questions: Iterable[Problem]) -> None:
    """Say questions below the answer, each kind once."""
    _ask(by_kind({str(question): question for question in questions}).values())


def _ask(texts: Iterable[str]) -> None:
    said = list(texts)
    say_last(lambda: say("question", said))


def print_warnings(results: Sequence[ModesResult]) -> None:
    for result in results:
        warn(result.prepared.name, result.unasked)


def warn(scenario: str, texts: Iterable[str]) -> None:
    say("warning", (f"scenario {scenario!r}: {text}" for text in texts))


def print_findings(results: Sequence[RunResult]) -> None:
    """Say on standard error what runs did wrong; a failure is said where the study ends."""
    for result in results:
        known = (str(result.failure), *result.modes.warnings)
        name, found = (
            result.modes.prepared.name,
            [f.message for f in result.findings if f.message not in known],
        )
        say("found", (f"scenario {name!r}: {text}" for text in found))


@contextmanager
def said_stages() -> Iterator[Callable[[str], None]]:
    """Inside, a callback for what is being done: a status on a terminal, else lines, both on standard error."""
    console = make_errors()
    if not console.is_terminal:
        yield lambda text: console.print(text, markup=False)
        return
    with console.status("starting") as status:
        yield lambda text: status.update(escape(text))


@contextmanager
def saying_warnings() -> Iterator[None]:
    """Say on standard error what is to be borne in mind of results that are read."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always", ResultsWarning)
        yield
    say(
        "warning",
        dict.fromkeys(str(w.message) for w in found if issubclass(w.category, ResultsWarning)),
    )
    for other in found:
        if not issubclass(other.category, ResultsWarning):
            warnings.warn_explicit(other.message, other.category, other.filename, other.lineno)
