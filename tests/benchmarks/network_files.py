"""Other people's network files as they lie there: which load, why others do not, how right the voltages are.

python -m tests.benchmarks.network_files FOLDER [--powsybl] [--only WORD] [--out TABLE.md] [--seconds 120]

Every RAW and RAWX file of the folder goes through what ``gfor new FILE --out case.toml --force`` does, in a process of
its own.  The voltages are compared with those that the file holds, and with ``--powsybl`` with a load flow of pypowsybl
(installed beside: it is no dependency of this project).  The files themselves are no part of it.
"""

import argparse
import cmath
import math
import multiprocessing
import re
import sys
import time
import traceback
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from orchestrator.cases.networks.data import bus_name
from orchestrator.cases.networks.psse.raw import read_raw
from orchestrator.cases.new.new_case import write_case
from orchestrator.cases.new.wanted_case import WantedCase
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.scenario.service import in_service
from orchestrator.core.errors import CosimError
from orchestrator.studies.modes.modes import running

LOADS, REFUSED, CRASHES, TOO_LONG = "loads", "refused", "crashes", "takes too long"
SUFFIXES = (".raw", ".rawx")
CLOSE = 1e-4  # deviation of a voltage that needs no cause [pu]
_VM, _VA = 7, 8  # columns of a source's table of buses: magnitude [pu], angle [degrees]
_MISFIT = re.compile(r"beyond what the network takes away, (.*?); look at")
_BUS_OF_POWSYBL = re.compile(r"B(\d+)")


@dataclass(frozen=True)
class Trial:
    """What became of one file.

    ``words``: the message of a refusal; ``voltages``, ``stated``: by the bus' name, as computed here and as the file
    has them [pu]; ``beside_file``, ``beside_powsybl``: largest deviation of a voltage [pu], and the bus; ``misfit``:
    powers that the file's voltages leave, where these are no solution of its data."""

    path: Path
    outcome: str
    words: str = ""
    questions: int = 0
    seconds: float = 0.0
    slack: str = ""
    voltages: Mapping[str, complex] = field(default_factory=dict)
    stated: Mapping[str, complex] = field(default_factory=dict)
    beside_file: tuple[float, str] | None = None
    beside_powsybl: tuple[float, str] | None = None
    misfit: str = ""

    @property
    def cause(self) -> str:
        """The first problem of the message without what differs from file to file."""
        words = re.sub(r"\S*\.(toml|rawx?)\b", "", self.words, flags=re.IGNORECASE)
        problem = re.search(r"- line \d+, (.*)", words)
        first = problem[1] if problem else words.splitlines()[0]
        return re.sub(r"'[^']*'|-?\d[\d.e+-]*", "#", first).lstrip(": ,")[:110]


def files_in(folder: Path, only: str = "") -> list[Path]:
    """The network files below a folder that hold anything."""
    return [
        path
        for path in sorted(folder.rglob("*"))
        if path.suffix.lower() in SUFFIXES and path.stat().st_size and only in str(path)
    ]


def tried(path: Path, seconds: float) -> Trial:
    """Read one file in a process of its own, and end it if that takes too long."""
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe(duplex=False)
    child = context.Process(target=_report, args=(path, there))
    started = time.monotonic()
    child.start()
    there.close()
    try:
        found: Trial = here.recv() if here.poll(seconds) else Trial(path, TOO_LONG)
    except EOFError:
        found = Trial(path, CRASHES, "the process ended without a word")
    child.kill()
    child.join()
    return replace(found, seconds=time.monotonic() - started)


def _report(path: Path, to: Connection) -> None:
    to.send(read_here(path))


def read_here(path: Path) -> Trial:
    """Read one file as ``gfor new`` does."""
    with TemporaryDirectory() as folder:
        try:
            made = write_case(WantedCase((path,), Path(folder) / "case.toml"))
            base = next(x for x in made.scenarios if x.name == "base")
            running(in_service(base)).close()
        except (CosimError, OSError) as error:
            return Trial(path, REFUSED, str(error))
        except Exception:
            return Trial(path, CRASHES, traceback.format_exc().strip().splitlines()[-1])
    return _loaded(path, base)


def _loaded(path: Path, base: PreparedScenario) -> Trial:
    tables = read_raw(path).tables
    stated = {
        bus_name(tables.labels[int(row[0])]): cmath.rect(row[_VM], math.radians(row[_VA]))
        for row in tables.bus
        if row[_VM] > 0
    }
    flow = base.power_flow
    voltages = {} if flow is None else flow.voltages
    slack = "" if flow is None else flow.slack
    is_solved = bool(tables.bus[:, _VA].any())
    beside = deviation(voltages, stated, slack) if is_solved else None
    questions = len(base.questions)
    found = Trial(path, LOADS, "", questions, 0.0, slack, voltages, stated, beside)
    left = (_MISFIT.search(question.text) for question in base.questions)
    return replace(found, misfit=next((words[1] for words in left if words), ""))


def deviation(
    ours: Mapping[str, complex], theirs: Mapping[str, complex], slack: str
) -> tuple[float, str] | None:
    """The largest difference of a voltage with the slack's angles alike [pu], and its bus; None if none is common."""
    common = [bus for bus in ours if bus in theirs]
    if slack not in common:
        return None
    turn = cmath.rect(1.0, cmath.phase(ours[slack]) - cmath.phase(theirs[slack]))
    return max((abs(ours[bus] - turn * theirs[bus]), bus) for bus in common)


def with_powsybl(trial: Trial, powsybl: Any) -> Trial:
    """The trial with what pypowsybl's load flow says, without its controls."""
    try:
        network = powsybl.network.load(str(trial.path))
        parameters = powsybl.loadflow.Parameters(
            distributed_slack=False,
            use_reactive_limits=False,
            transformer_voltage_control_on=False,
            shunt_compensator_voltage_control_on=False,
            phase_shifter_regulation_on=False,
            read_slack_bus=True,
        )
        result = powsybl.loadflow.run_ac(network, parameters)
        if result[0].status_text != "Converged":
            return trial
        buses = network.get_bus_breaker_view_buses(attributes=["v_mag", "v_angle"])
        levels = network.get_voltage_levels(attributes=["nominal_v"])["nominal_v"]
        at = network.get_bus_breaker_view_buses(attributes=["voltage_level_id"])["voltage_level_id"]
    except Exception as error:
        print(f"{trial.path.name}: pypowsybl: {str(error)[:100]}", file=sys.stderr)
        return trial
    theirs = {
        bus_name(number[1]): cmath.rect(row.v_mag / levels[at[name]], math.radians(row.v_angle))
        for name, row in buses.iterrows()
        if (number := _BUS_OF_POWSYBL.fullmatch(str(name))) and row.v_mag > 0
    }
    return replace(trial, beside_powsybl=deviation(trial.voltages, theirs, trial.slack))


def table(trials: Sequence[Trial], folder: Path) -> str:
    """The counts, the causes, and a row for each file, as Markdown."""
    counts = Counter(trial.outcome for trial in trials)
    causes = Counter(trial.cause for trial in trials if trial.outcome != LOADS)
    lines = [f"{len(trials)} files: " + ", ".join(f"{n} {what}" for what, n in counts.items()), ""]
    lines += ["| Files | Cause |", "|---|---|"]
    lines += [f"| {n} | {cause} |" for cause, n in causes.most_common()]
    lines += [
        "",
        "| File | Outcome | Questions | Beside the file [pu] | Beside pypowsybl [pu] | Left by its voltages | s |",
    ]
    lines += ["|---|---|---|---|---|---|---|"]
    lines += [_row(trial, folder) for trial in trials]
    return "\n".join(lines) + "\n"


def _row(trial: Trial, folder: Path) -> str:
    outcome = trial.outcome if trial.outcome == LOADS else f"{trial.outcome}: {trial.words}"
    outcome = outcome.replace(str(trial.path), "").replace("|", "/").replace("\n", " ")
    beside = (_shown(x) for x in (trial.beside_file, trial.beside_powsybl))
    name = trial.path.relative_to(folder)
    shown = (name, outcome, trial.questions, *beside, trial.misfit, f"{trial.seconds:.1f}")
    return f"| {' | '.join(map(str, shown))} |"


def _shown(found: tuple[float, str] | None) -> str:
    if found is None:
        return "–"
    size, bus = found
    return f"{size:.1e}" if size <= CLOSE else f"**{size:.1e}** at {bus}"


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", default="", help="part of the path of the files to take")
    parser.add_argument("--powsybl", action="store_true", help="compare with pypowsybl")
    parser.add_argument("--out", type=Path, help="file for the table; else it is printed")
    parser.add_argument("--seconds", type=float, default=120.0, help="longest time for one file")
    options = parser.parse_args(arguments)
    trials = []
    for path in files_in(options.folder, options.only):
        trials.append(tried(path, options.seconds))
        print(f"{path.name}: {trials[-1].outcome} {trials[-1].words[:150]}", file=sys.stderr)
    if options.powsybl:  # only now: a process that holds a Java machine does not fork well
        import pypowsybl  # type: ignore[import-untyped,unused-ignore]  # noqa: PLC0415

        trials = [with_powsybl(x, pypowsybl) if x.outcome == LOADS else x for x in trials]
    text = table(trials, options.folder)
    if options.out is None:
        print(text)
    else:
        options.out.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
