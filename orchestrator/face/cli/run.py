"""``gfor run``: steady state, modes and time response of a case's scenarios."""

import argparse
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.asked import read_whole
from orchestrator.core.cores import number_of_cores
from orchestrator.core.errors import (
    INTERRUPTED,
    CosimError,
    InputError,
    ResultsError,
    RunInterruptedError,
)
from orchestrator.core.interrupts import calls
from orchestrator.core.late import import_xarray_alone, xr
from orchestrator.core.safe_files import PARTIAL, made_folder
from orchestrator.face.api.scenario import RunEndedWarning, Scenario
from orchestrator.face.cli import checkpoints, federates, run_request, terminal
from orchestrator.face.cli.arguments import add_options, add_request_arguments, tolerance
from orchestrator.face.cli.case_arguments import add_case_arguments, chosen
from orchestrator.face.cli.interrupted import is_interrupt, saying_how_it_goes_on
from orchestrator.face.cli.progress_lines import progress_lines
from orchestrator.face.cli.run_tables import print_run
from orchestrator.face.cli.side_by_side import Outcome, Report, SideBySide, number_of_workers
from orchestrator.face.cli.verdict import add_details_argument, add_verdict_argument, exit_code
from orchestrator.output.report.progress import progress_bar
from orchestrator.output.results.file_writers import save_dataset
from orchestrator.output.results.lock import hold_folder
from orchestrator.output.results.manifest import read_manifest
from orchestrator.output.results.recording_reader import open_whole
from orchestrator.output.results.recording_writer import (
    FOLDER,
    TRAJECTORY,
    RecordingFolder,
    require_room,
)
from orchestrator.output.results.staging import (
    ScenarioFolder,
    check_free,
    mend,
    new_run_id,
    require_results,
    staged,
    unfinished,
)
from orchestrator.simulation.federates import Federates
from orchestrator.simulation.interop.rules import MASTERS, MasterRules, master_rules
from orchestrator.studies.modes import beside
from orchestrator.studies.modes.all_modes import all_ours
from orchestrator.studies.runs.answer import EarlyEnd
from orchestrator.studies.runs.answer_of_run import of_run
from orchestrator.studies.runs.files import files_of_study, save_run, save_study, summary_of
from orchestrator.studies.runs.like import run_like
from orchestrator.studies.runs.run import RunResult
from orchestrator.studies.runs.run_request import RunRequest
from orchestrator.systems.coupling.observers import Progress


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser, optional=True, schedule=True)
    workers = read_whole(1, 1000)
    add_options(parser, "run", tolerance=tolerance, workers=workers, masters=", ".join(MASTERS))
    add_request_arguments(parser, RunRequest)
    add_verdict_argument(parser)
    add_details_argument(parser)
    run_request.add_arguments(parser)
    federates.add_arguments(parser)


def run(options: argparse.Namespace) -> int:
    """Run the scenarios while no other command works in the folder of the results."""
    with ExitStack() as stack:
        if options.resume is not None and options.resume.is_dir():
            stack.enter_context(hold_folder(options.resume))  # before the request in it is read
        options = run_request.with_request(options)
        stack.enter_context(saying_how_it_goes_on(lambda: run_request.how_it_goes_on(options)))
        rules = _rules_of(options)
        scenarios = chosen(options)
        terminal.ask(
            question for scenario in scenarios for question in scenario.prepared.about_rows
        )
        engine = federates.choice(options, len(scenarios))
        options.checkpoint = run_request.interval(options)
        name = scenarios[0].prepared.case.name
        options.out = options.out or Path("results") / (
            f"{name}_like_{rules.name}" if rules else name
        )
        folder = made_folder(options.out, "--out")
        if options.resume is None:
            stack.enter_context(hold_folder(folder))
        if rules is not None:
            return _run_like(
                [scenario.prepared for scenario in scenarios], rules, folder, options.order
            )
        return _run_all(scenarios, folder, options, engine)


def _run_all(
    scenarios: Sequence[Scenario],
    folder: Path,
    options: argparse.Namespace,
    engine: Federates | None,
) -> int:
    """Run the scenarios; each is written as soon as it is done."""
    _prepare_folder(scenarios, folder, options)
    names = scenarios[0].prepared.names
    console = terminal.make_console(stderr=options.json, names=names)
    kept = checkpoints.StudyCheckpoints(
        [scenario.prepared for scenario in scenarios], folder, options
    )
    workers = _number_of_workers(scenarios, options, engine)
    if options.threads is None and workers > 1 and workers >= number_of_cores():
        options.threads = 1  # each core has its scenario
    with calls:  # all copies of this process have it, and none imports dask
        import_xarray_alone()
    runs = _Runs(scenarios, folder, options, engine=engine, kept=kept, workers=workers)
    for index, outcome in _outcomes(scenarios, runs.run_one, console, workers):
        runs.take(scenarios[index].name, outcome)
    results, stopped = runs.results, runs.stopped
    if stopped and not results:
        error = next(iter(stopped.values()))
        if isinstance(error, CosimError):
            kept.end(whole=False)
        raise error
    runs.save_and_show(console)
    if stopped:
        code = _end(stopped, folder)
        kept.end(whole=False, interrupted=code == INTERRUPTED)
        return code
    calls.over = True
    kept.end(whole=True)
    unsound = options.fail_unstable and not all(of_run(r).good for r in results)
    return int(unsound) or exit_code(options, [r.modes.stability for r in results])


def _prepare_folder(
    scenarios: Sequence[Scenario], folder: Path, options: argparse.Namespace
) -> None:
    """Refuse a folder that has no room, or that holds what is somebody else's; say which runs in it did not end."""
    require_room([scenario.prepared for scenario in scenarios], folder, csv=options.csv)
    mend(folder)
    read_manifest(folder)  # one that is somebody else's is refused
    check_free(folder, files_of_study(scenarios[0].prepared.case))
    for scenario in scenarios:
        require_results(folder / scenario.name)
    if options.resume is None:
        _say_unfinished(folder)


def _number_of_workers(
    scenarios: Sequence[Scenario], options: argparse.Namespace, engine: Federates | None
) -> int:
    """Scenarios that run side by side: foreign FMUs do so if they are asked to, and federates never."""
    alone = engine is not None or not (
        options.workers or all(all_ours(one.prepared) for one in scenarios)
    )
    return 1 if alone else number_of_workers(options.workers, len(scenarios))


@dataclass
class _Runs:
    """The scenarios of a command, and what came of those that were begun.

    ``results``: of all that made steps, in their order.
    ``stopped``: what ended a scenario before its time, by the scenario's name."""

    scenarios: Sequence[Scenario]
    folder: Path
    options: argparse.Namespace
    engine: Federates | None
    kept: checkpoints.StudyCheckpoints
    workers: int
    results: list[RunResult] = field(default_factory=list)
    stopped: dict[str, BaseException] = field(default_factory=dict)

    def run_one(self, index: int, report: Report) -> Outcome:
        """Run a scenario and write what it gives; an error that ends it is the outcome."""
        report(0, 0)
        scenario, options = self.scenarios[index], self.options
        place = ScenarioFolder(self.folder, scenario.name, self.kept.run)
        try:
            result = _run_into(place, scenario, Progress(report), self.kept, options, self.engine)
            if isinstance(result.failure, ResultsError):
                place.discard()
            else:
                save_run(result, place, csv=options.csv)
                # it is read again from the disk
                result.dataset = result.dataset if self.workers == 1 else xr.Dataset()
        except (CosimError, KeyboardInterrupt) as error:
            place.discard()
            return error
        return result

    def take(self, name: str, outcome: Outcome) -> None:
        """Take what came of a scenario, and tell its warnings and findings."""
        if isinstance(outcome, BaseException):
            self.stopped[name] = outcome
            return
        if self.workers > 1 and not isinstance(outcome.failure, ResultsError):
            outcome.dataset = open_whole(self.folder / name / TRAJECTORY)
        self.results.append(outcome)
        terminal.print_warnings([outcome.modes])
        terminal.print_findings([outcome])
        if outcome.failure:
            self.stopped[name] = outcome.failure

    def save_and_show(self, console: Console) -> None:
        """Write the files that are of all scenarios together, and print the results."""
        results, options = self.results, self.options
        early_end = _early_end(self.stopped, self.scenarios, results) if self.stopped else None
        said = [*beside.sentences_beside([r.modes for r in results])]
        plots = _save_together(results, said, self.folder, self.kept.run, self.stopped, early_end)
        if options.json:
            terminal.print_json([summary_of(r) for r in results])
            return
        print_run(console, results, said, early_end, details=options.details)
        written = "trajectories (.nc, .csv)" if options.csv else "trajectories (.nc)"
        words = (
            f"Results in {self.folder}: {written}, modes.csv, participation.csv, mode_shapes.csv, "
            f"step_size.csv, summary.json, {', '.join(p.name for p in plots)}"
        )
        console.print(escape(words), soft_wrap=True)


def _outcomes(
    scenarios: Sequence[Scenario],
    work: Callable[[int, Report], Outcome],
    console: Console,
    workers: int,
) -> Iterator[tuple[int, Outcome]]:
    """Return what came of all scenarios that were begun, in order, each with a bar meanwhile."""
    bar, tasks, steps = progress_bar(console), dict[int, Any](), dict[int, tuple[int, int]]()
    lines = progress_lines(console, "run", "steps")

    def report(index: int, done: int, total: int) -> None:
        steps[index] = done, total
        lines.report(*_steps_of_all(steps.values(), len(scenarios)))
        if index not in tasks:
            tasks[index] = bar.add_task(scenarios[index].title, total=None)
        bar.update(tasks[index], completed=done, total=total or None)

    if workers > 1:
        with SideBySide(workers, work) as copies, lines, bar:
            outcomes = copies.outcomes(len(scenarios), report)
        yield from outcomes
        return
    with lines, bar:
        for index in range(len(scenarios)):
            outcome = work(index, partial(report, index))
            yield index, outcome
            if isinstance(outcome, BaseException) or outcome.failure:
                return


def _steps_of_all(begun: Iterable[tuple[int, int]], number: int) -> tuple[int, int]:
    """Return the steps done and those of all scenarios; one that has not begun is taken for as long as the longest."""
    counts = list(begun)
    totals = [total for _, total in counts if total]
    waiting = number - len(totals)
    return sum(done for done, _ in counts), sum(totals) + waiting * max(totals, default=0)


def _say_unfinished(folder: Path) -> None:
    begun = [path.name for path in unfinished(folder)]
    if begun:
        text = (
            f"{folder} holds recordings of runs that did not end, or still go on: {', '.join(begun)}; "
            "`gfor signal identify` and `compare` read them, and you may delete those that you do not need"
        )
        terminal.say("warning", [text])


def _run_into(
    place: ScenarioFolder,
    scenario: Scenario,
    bar: Progress,
    kept: checkpoints.StudyCheckpoints,
    options: argparse.Namespace,
    engine: Federates | None,
) -> RunResult:
    """Run a scenario; its recording grows in its folder."""
    recording = RecordingFolder(place.path / FOLDER, scenario.prepared, {"run": place.run})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RunEndedWarning)  # it is said at the end
        return scenario.run(
            linear=options.linear,
            observers=[bar],
            recording=recording,
            checkpoints=kept.of(scenario.name, recording, place),
            federates=engine,
            threads=options.threads,
        ).result


def _early_end(
    stopped: Mapping[str, BaseException],
    scenarios: Sequence[Scenario],
    results: Sequence[RunResult],
) -> EarlyEnd:
    begun = {r.modes.prepared.name for r in results} | set(stopped)
    never = {scenario.name: scenario.title for scenario in scenarios if scenario.name not in begun}
    kept = any(
        r.modes.prepared.name in stopped and not isinstance(r.failure, ResultsError)
        for r in results
    )
    places = ", ".join(scenario.title for scenario in scenarios if scenario.name in stopped)
    return EarlyEnd(places, any(map(_is_interrupt, stopped.values())), kept, never)


def _is_interrupt(error: BaseException) -> bool:
    return isinstance(error, RunInterruptedError) or is_interrupt(error)


def _save_together(
    results: Sequence[RunResult],
    said: Sequence[str],
    folder: Path,
    run_id: str,
    stopped: Mapping[str, BaseException],
    early_end: EarlyEnd | None,
) -> list[Path]:
    whole = [r for r in results if not isinstance(r.failure, ResultsError)]
    names = [r.modes.prepared.name for r in whole]
    try:
        with staged(
            folder, run_id, [name for name in names if (folder / name).is_dir()]
        ) as staging:
            return save_study(results, staging, said, early_end)
    except ResultsError:
        if not any(isinstance(error, ResultsError) for error in stopped.values()):
            raise
        return []


def _end(stopped: Mapping[str, BaseException], folder: Path) -> int:
    where = ""
    text = ""
    for scenario, error in stopped.items():
        if isinstance(error, ResultsError):
            begun = [
                path.name for path in unfinished(folder) if path.name.startswith(scenario + PARTIAL)
            ]
            where += f" ({', '.join(begun)})" if begun else ""
        head = "" if _is_interrupt(error) else "[bold red]error:[/bold red] "
        text += f"{head}{escape(f'scenario {scenario!r}: {str(error) or calls.how}')}\n"
    terminal.make_errors().print(
        f"{text}{escape(f'What was computed until then is in {folder}{where}')}"
    )
    return INTERRUPTED if any(map(_is_interrupt, stopped.values())) else 1


def _rules_of(options: argparse.Namespace) -> MasterRules | None:
    if options.order and not options.like:
        raise InputError(
            "--order goes with --like MASTER; our own order stands in the case, under [solver]"
        )
    if options.like and (options.threads or options.workers):
        raise InputError(
            "--like steps as another master does, on one thread; leave out --threads, --workers or --like"
        )
    if options.like and options.tolerance is not None:
        raise InputError(
            "--like steps as another master does, in fixed steps; leave out --tolerance or --like"
        )
    return master_rules(options.like) if options.like else None


def _run_like(
    scenarios: Sequence[PreparedScenario], rules: MasterRules, folder: Path, turns: str | None
) -> int:
    """Run scenarios as another master would; their trajectories are all that is written.

    ``turns`` are components with commas between them, in the order in which they step; the master's own where None."""
    order = turns.split(",") if turns else None
    run_id = new_run_id()
    for prepared in scenarios:
        dataset = run_like(prepared, rules, order)
        path = folder / prepared.name / "trajectory"
        with staged(folder / prepared.name, run_id) as staging:
            save_dataset(dataset, staging / "trajectory")
        print(
            f"{prepared.name} like {rules.title}: {dataset.sizes['time']} rows in {path}.nc and .csv"
        )
    return 0
