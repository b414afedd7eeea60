"""The process that computes for the page: a line of JSON for each question, lines of JSON for its answer.

It has a process of its own so that an FMU that dies or hangs ends a computation, and not the page."""

import json
import os
import sys
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fmus.toolchain.temporary import remove_own
from orchestrator.cases.flow.sharing import SharingRule
from orchestrator.cases.form.schema import Value
from orchestrator.cases.questions.idle_values import switches_of, why_idle
from orchestrator.cases.scenario.service import in_service
from orchestrator.cases.settings.layers import OptionValues
from orchestrator.core.arrays import Complex
from orchestrator.core.errors import CosimError, InputError, StartError, few
from orchestrator.core.interrupts import calls
from orchestrator.core.late import optimize
from orchestrator.core.question_kinds import by_kind
from orchestrator.core.spelling import as_options
from orchestrator.face.api.case import Case, load
from orchestrator.face.api.results import Modes
from orchestrator.face.api.scenario import Scenario, rows_of_parameters
from orchestrator.face.explore.copied import copied, events_of, explored, saved
from orchestrator.face.explore.diagram import diagram
from orchestrator.face.explore.movers import movers
from orchestrator.face.explore.responses import linear, plotted, recorded, simulated
from orchestrator.studies.modes.modes import modes_of
from orchestrator.studies.operating_points.bench import PointBench
from orchestrator.studies.operating_points.item import Item
from orchestrator.studies.operating_points.line_ends import lines_with_ends
from orchestrator.studies.operating_points.preparation import ItemPreparation
from orchestrator.studies.runs.answer_of_modes import swing_in_words

_SHOWN = 3  # lines that a message names
_CHANGE = 2e-3  # of the parameter, in parts of its value, or of 1 where that is 0
# an eigenvalue that moves by more than this part of itself is no longer known to be the same
_FAR = 0.05
_WIDER = 1.5  # the range in which changed modes are looked for, beyond that which is shown


def slopes(
    scenario_with: Callable[[Mapping[str, Value]], Scenario],
    values: Mapping[str, Value],
    parameter: str,
    frequencies: tuple[float, float],
    say: Callable[[dict[str, Any]], None],
    computed: Callable[[Scenario, tuple[float, float]], Modes] = Scenario.modes,
) -> dict[str, Any]:
    """``value``, ``eigenvalues`` there, and ``slopes``, each a list of [real, imag]; None where no slope is known.

    The operating point moves with the parameter, and the FMUs are started and linearised at both sides of its value."""
    here = scenario_with(values)
    component, _, variable = parameter.partition(".")
    plan = here.prepared.system.components.get(component)
    if plan is None or variable not in plan.description.variables:
        raise InputError(f"there is no parameter {parameter!r} in scenario {here.name!r}")
    info, value = plan.description.variables[variable], plan.value(variable)
    if info.type != "Real" or isinstance(value, str | bool) or value is None:
        raise InputError(
            f"{parameter} is of type {info.type}, by which nothing can be differentiated"
        )
    change = _CHANGE * (abs(value) or 1.0)
    least, most = (
        -np.inf if info.minimum is None else info.minimum,
        np.inf if info.maximum is None else info.maximum,
    )
    ends = [min(max(end, least), most) for end in (value - change, value + change)]
    say({"progress": "modes at the value itself"})
    base = eigenvalues(computed(here, frequencies))
    wider = (frequencies[0] / _WIDER, frequencies[1] * _WIDER)
    say({"progress": f"modes at both sides of {parameter} = {value:.5g}"})
    beside = (scenario_with({**values, parameter: end}) for end in ends)
    moved = [matched(base, eigenvalues(computed(one, wider))) for one in beside]
    width = ends[1] - ends[0]
    found = (moved[1] - moved[0]) / width if width > 0 else np.full(base.shape, np.nan + 0j)
    slopes = [[x.real, x.imag] if np.isfinite(x) else None for x in found.tolist()]
    return {
        "parameter": parameter,
        "value": value,
        "eigenvalues": [[x.real, x.imag] for x in base.tolist()],
        "slopes": slopes,
    }


def eigenvalues(modes: Modes) -> Complex:
    return np.array([mode.eigenvalue for mode in modes], dtype=np.complex128)


def matched(base: Complex, other: Complex) -> Complex:
    """Return for each eigenvalue the one that it moved to; nan where none is near."""
    found = np.full(base.shape, np.nan + 0j)
    if base.size and other.size:
        apart = np.abs(base[:, None] - other[None]) / np.maximum(np.abs(base[:, None]), 1e-9)
        rows, columns = optimize.linear_sum_assignment(apart)
        near = apart[rows, columns] < _FAR
        found[rows[near]] = other[columns[near]]
    return found


Say = Callable[[dict[str, Any]], None]

_FOLDER = Path("results") / "explore"
_UNEXPECTED = (
    ArithmeticError,
    AttributeError,
    LookupError,
    MemoryError,
    RuntimeError,
    TypeError,
    ValueError,
)


class Desk:
    """Answers the questions about one case, which it reads again where its file has changed."""

    def __init__(
        self, word: str, trust_fmus: bool, recorded: Mapping[str, str] | None = None
    ) -> None:
        self._word, self._trust, self._recorded = word, trust_fmus, recorded or {}
        self._case: Case | None = None
        self._stamp: list[float] = []
        # with its points' numbers
        self._prepared: tuple[str, ItemPreparation, dict[str, int]] | None = None
        # the next question's FMUs are those of the last one, where they can be and their files have not changed
        self._bench, self._files = PointBench(remember=True), dict[Path, list[float]]()

    def answer(self, question: Mapping[str, Any], say: Say) -> dict[str, Any]:
        """Answer what is asked for under ``ask``: open, cell, parameters, modes, movers, slopes, first, response,
        recorded, run, save."""
        ask = str(question["ask"])
        original = self._read()
        if ask == "open":
            return {**_titles(original), "stamp": self._stamp}
        changed, events = original, question.get("events")
        if events is not None:
            changed = original.with_(scenarios={question["scenario"]: {"events": events}})
        name = str(question["scenario"])
        values: dict[str, Value] = dict(question.get("values") or {})
        if ask == "cell":
            there = self._values_of(changed, question, values)
            scenario = partial(changed.scenario, name, step=question.get("step"))
            answer: dict[str, Any] = {"values": there | self._wider(scenario, there, values)}
        elif ask == "save":
            file = explored(changed.file, name, values, question.get("places"))
            answer = {"file": str(saved(original.file, file, _FOLDER))}
        else:
            answer = self._of_scenario(ask, changed, values, question, say)
        return {**answer, "stamp": self._stamp}

    def _of_scenario(
        self,
        ask: str,
        changed: Case,
        values: dict[str, Value],
        question: Mapping[str, Any],
        say: Say,
    ) -> dict[str, Any]:
        """The answer to a question about a scenario with the values that the page has set."""
        name = str(question["scenario"])
        scenario = partial(changed.scenario, name, step=question.get("step"))
        low, high = question.get("range") or (0.1, 2.0)
        signals = question.get("signals") or ()
        match ask:
            case "parameters":
                return _parameters(changed, scenario(values))
            case "modes":
                return self._modes(changed, scenario(values), values, (low, high), question)
            case "slopes":
                parameter = str(question["parameter"])
                return slopes(scenario, values, parameter, (low, high), say, self._computed)
            case "movers":
                components, names = question.get("components") or {}, question.get("names") or ()
                return movers(scenario(values), components, (low, high), names, say)
            case "response":
                return linear(scenario(values), signals)
            case "first":
                return linear(scenario(values), ())
            case "recorded":
                place = self._recorded.get(name, self._recorded.get("", ""))
                return recorded(place, scenario(values), signals)
            case "run":
                return simulated(scenario(values), signals, lambda part: say({"part": part}))
        raise KeyError(ask)

    def _read(self) -> Case:
        stamp = _stamp(self._case.file.path) if self._case else []
        if self._case is None or stamp != self._stamp:
            self._case = load(self._word, trust_fmus=self._trust)
            self._stamp = _stamp(self._case.file.path)
        return self._case

    def _values_of(
        self, case: Case, question: Mapping[str, Any], values: dict[str, Value]
    ) -> dict[str, Value]:
        """Values by which the case is at a cell of a study: at an operating point, with its outage."""
        own, lost = ([str(name) for name in question.get(key) or ()] for key in ("own", "lost"))
        if not own and not lost:
            return values
        opening = sorted(lines_with_ends((*own, *lost)))
        if opening:
            raise InputError(
                f"{few(opening, _SHOWN)} open at one end in this cell, which a case that is explored live shows only "
                "as an event: add a line_trip with 'at' to [[events]] of the case"
            )
        rule, base, step = question.get("sharing"), question.get("base"), question.get("step")
        network = case.file.table.network
        if question.get("move_controls") and lost and not (network and network.move_controls):
            raise InputError(
                "the study let taps and switched shunts move (--move-controls), and the case holds them; write "
                "move_controls = true in [network] of the case, and compute the study anew"
            )
        key = json.dumps([self._stamp, question["scenario"], rule, base, step])
        if (
            self._prepared is None or self._prepared[0] != key
        ):  # the base case serves all cells of a study
            sharing = None if rule is None else SharingRule(rule)
            layers = [OptionValues.of(base)] if base else ()
            made = ItemPreparation(case.file, question["scenario"], layers, step, sharing=sharing)
            self._prepared = key, made, {}
        _, preparation, points = self._prepared
        point = points.setdefault(json.dumps([values, own], sort_keys=True), len(points))
        lost = [name for name in lost if name not in own]
        return preparation.live(Item(point, int(bool(lost)), values, (*own, *lost), tuple(lost)))

    def _wider(
        self,
        scenario: Callable[[Mapping[str, Value]], Scenario],
        there: Mapping[str, Value],
        varied: Mapping[str, Value],
    ) -> dict[str, float]:
        """Limits of exciters and governors with which alone a cell starts, by which its study computed it.

        ``there``: all values of the cell; ``varied``: those of its row and column, which stay."""
        try:
            self._bench.master(in_service(scenario(there).prepared))
        except StartError as error:
            return {} if error.wider.keys() & varied.keys() else error.wider
        except CosimError:  # the question about its modes tells it
            return {}
        return {}

    def _computed(self, scenario: Scenario, frequencies: tuple[float, float]) -> Modes:
        prepared = scenario.prepared
        files = {
            path: _stamp(path)
            for plan in prepared.system.components.values()
            if (path := plan.description.path)
        }
        if files != self._files:
            self._bench.close()
            self._files = files
        with self._bench.serving(in_service(prepared)) as master:
            return Modes(modes_of(prepared, master, frequencies))

    def _modes(
        self,
        case: Case,
        scenario: Scenario,
        values: Mapping[str, Value],
        frequencies: tuple[float, float],
        question: Mapping[str, Any],
    ) -> dict[str, Any]:
        """The JSON of ``gfor modes``, the verdict in its words, and what reproduces it."""
        modes, system = self._computed(scenario, frequencies), scenario.prepared.system
        hidden = modes.result.hidden
        idle = {}
        for key in values:
            component, _, variable = key.partition(".")
            if component in system.components:
                idle[key] = why_idle(system, component, variable)
        return {
            "modes": modes.as_json(),
            "title": scenario.title,
            "verdict": modes.stability.sentence(),
            "outside": None if hidden is None else hidden.sentence(remedy=False),
            "rated_hz": hidden and hidden.rated_hz,
            "warnings": [*_questions(scenario), *modes.result.unasked],
            "idle": idle,
            "swings": [swing_in_words(modes.result, mode) for mode in modes],
            "copied": copied(
                case.file,
                self._word,
                scenario=scenario.name,
                values=values,
                frequencies=frequencies,
                events=question.get("events"),
                places=question.get("places"),
                step=question.get("step"),
            ),
        }


def _titles(case: Case) -> dict[str, Any]:
    """Names and titles of a case and its scenarios, by which the page begins."""
    scenarios = case.file.scenarios
    return {
        "case": case.name,
        "title": case.file.table.title or case.name,
        "scenarios": {name: table.title or name for name, table in scenarios.items()},
        # equal where scenarios differ in their events alone
        "systems": {
            name: table.model_dump_json(exclude={"title", "events"})
            for name, table in scenarios.items()
        },
    }


def _parameters(case: Case, scenario: Scenario) -> dict[str, Any]:
    """The parameters that a slider or a switch can set, the signals that can be drawn, and the diagram."""
    listed = rows_of_parameters(scenario.prepared)
    shown = [row for row in listed if row["type"] in ("Real", "Integer", "Boolean")]
    return {
        "parameters": [row | {"switches": _switches(scenario, row["parameter"])} for row in shown],
        "signals": list(scenario.prepared.record),
        "plotted": plotted(scenario),
        "events": events_of(case.file, scenario.name),
        "diagram": diagram(scenario),
    }


def _questions(scenario: Scenario) -> list[str]:
    """Return what is asked about the scenario's data, without the options that the page does not have."""
    idle = set(scenario.prepared.idle.values())
    asked = {
        question.text
        if question in idle
        else str(replace(question, place=question.place.removeprefix("--set "))): question
        for question in scenario.prepared.questions
    }
    return [*by_kind(asked).values()]


def _switches(scenario: Scenario, parameter: str) -> list[str]:
    """The parameters that switch a parameter's part on and off."""
    name, _, variable = parameter.partition(".")
    known = scenario.prepared.system.components[name].description.variables
    keys = switches_of(known, variable)
    return [f"{name}.{key}" for key in keys if known[key].type == "Boolean"]


def _stamp(path: Path) -> list[float]:
    return [path.stat().st_mtime, path.stat().st_size] if path.is_file() else []


def main() -> None:
    """Answer line by line until nobody asks any more; what FMUs print goes to standard error."""
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    given = json.loads(sys.stdin.readline())
    desk = Desk(given["case"], given["trust_fmus"], given["recorded"])

    def say(content: dict[str, Any]) -> None:
        out.write(json.dumps(content) + "\n")
        out.flush()

    warnings.simplefilter("ignore")  # the answers have them
    for line in sys.stdin:
        try:
            say({"answer": desk.answer(json.loads(line), say)})
        except CosimError as error:
            say({"error": str(error), "kind": error.kind})
        except _UNEXPECTED as error:
            say(
                {
                    "error": f"it failed in a way that nobody expected: {error!r}; the command may say more",
                    "kind": "",
                }
            )


def serve() -> None:
    """Do so, and end where it is told to or where nobody reads the answers."""
    with calls.terminable(ending=True), as_options():
        try:
            main()
        except (KeyboardInterrupt, BrokenPipeError):
            remove_own()  # which the end below leaves out
            os._exit(1)


if __name__ == "__main__":
    serve()
