"""The eight verbs: each asks one command, and gives of its JSON what an agent needs."""

import math
import os
from collections.abc import Iterable, Mapping
from contextlib import ExitStack, suppress
from itertools import islice
from pathlib import Path
from typing import Any

from orchestrator.cases.case import BUILT_IN, built_in_cases
from orchestrator.cases.form.names import close_names
from orchestrator.core.errors import InputError
from orchestrator.core.units import whole_percent
from orchestrator.face.agents.answers import (
    BusStrengthAnswer,
    CasesAnswer,
    CheckAnswer,
    CheckRowAnswer,
    ExplanationAnswer,
    InfluenceAnswer,
    ModeAnswer,
    ModesAnswer,
    RunSummaryAnswer,
    ScenarioModesAnswer,
    ScreenedModeAnswer,
    ScreeningAnswer,
    SensitivitiesAnswer,
    StrengthsAnswer,
)
from orchestrator.face.agents.guard import is_within
from orchestrator.face.agents.question import Allowance, NoAnswerError, ask
from orchestrator.linear.spectra.modes import ELECTROMECHANICAL_HZ
from orchestrator.output.results.lock import FolderInUseError, hold_folder

VERBS = (
    "cases",
    "modes",
    "run_summary",
    "screen_worst",
    "check",
    "scr",
    "sensitivities",
    "explain",
)
"""The methods of `Verbs` that an agent may call, in the order in which it gets them."""

MOST_ROWS = 20
"""Modes, buses, parameters or states that an answer lists: more than a reader compares, and few enough for an agent."""

MOST_PARTS = 5
"""States and machines of a mode that `modes` lists unless more are asked for: what follows is small."""

USUAL_MODES = 5
"""Modes that `modes` lists unless more are asked for: those that a case names, and the least damped."""

MOST_MODES = 200
"""Modes that it lists at most."""

MOST_DECIDING = 3
"""Growing modes that an explanation names, the least damped first."""

LIKE = 1e-6
"""Part of a growth rate within which two are that of one mode: JSON has all digits of both."""

MOST_FILES = 200
"""Case files that `cases` lists."""

MOST_FOLDERS = 5_000
"""Folders in which `cases` looks for case files: a second of looking."""

MOST_SERVERS = 20
"""Servers that write into one folder of results, each with a folder of its own: one for each open conversation."""

LONGEST_NAME = 1_000
"""Characters of a name or a path."""

Values = Mapping[str, float | bool | str]


class Verbs:
    """The verbs, within allowance.

    Parameters
    ----------
    allowance
        Folders that may be read, the folder of results, and how long a question may take.
    """

    def __init__(self, allowance: Allowance) -> None:
        self._allowance = allowance
        self._held = ExitStack()  # the folder of results, until the server ends
        self._folder: Path | None = None

    def cases(self) -> CasesAnswer:
        """List the cases that can be asked about: the built-in ones, and case files in the given folders."""
        titles = {name: _title(BUILT_IN / name / "case.toml") for name in built_in_cases()}
        files = (str(path) for root in self._allowance.roots for path in _case_files(root))
        return CasesAnswer(built_in=titles, files=[*islice(files, MOST_FILES)])

    def modes(
        self,
        case: str,
        scenario: str | None = None,
        values: Values | None = None,
        frequencies_hz: tuple[float, float] = ELECTROMECHANICAL_HZ,
        most: int = USUAL_MODES,
        parts: int = MOST_PARTS,
    ) -> ModesAnswer:
        """Compute modes of a case: frequency, damping, participation factors and mode shape, each with its own mode.

        ``values`` sets parameters first, such as {"grid.X_L": 0.3}. Without ``scenario`` the modes are those of the
        case's first one; the others are named with their verdicts. ``frequencies_hz``: lowest and highest frequency
        [Hz] of the modes that are listed; those outside are counted. ``most`` modes are listed, up to 200: those that
        the case names, and the least damped of the others, which are counted. ``parts``: states and machines that are
        listed of each, up to 200, the largest first.
        """
        low, high = frequencies_hz
        for name, number in (("most", most), ("parts", parts)):
            if not 1 <= number <= MOST_MODES:
                raise NoAnswerError(
                    f"{name} = {number}: give a whole number from 1 to {MOST_MODES}"
                )
        found = self._ask("modes", case, scenario, values, "--range", f"{low!r}:{high!r}")
        first, *others = found["scenarios"]
        return ModesAnswer(
            case=found["case"],
            scenarios=[_scenario_modes(first, frequencies_hz, most, parts)],
            others={one["name"]: one["stability"]["sentence"] for one in others},
            questions=_first(found["questions"]),
        )

    def run_summary(
        self, case: str, scenario: str, stop: float | None = None, values: Values | None = None
    ) -> RunSummaryAnswer:
        """Simulate a scenario in time, with its events, up to ``stop`` [s], and tell what the run ends in."""
        further = [] if stop is None else ["--stop", repr(float(stop))]
        further += ["--no-csv", "--out", str(self._own_folder() / "run")]
        (found,) = self._ask("run", case, scenario, values, *further)
        answer = found["answer"]
        return RunSummaryAnswer(
            scenario=found["name"],
            stable=answer["stable"],
            verdict=answer["verdict"],
            remark=answer.get("remark") or "",
            frequency_hz=answer.get("frequency_hz"),
            damping_percent=answer.get("damping_percent"),
            components=_largest(answer.get("components") or {}),
            stop_time_s=found["stop_time"],
        )

    def screen_worst(
        self, case: str, scenario: str, points: str | None = None, outages: str = "n-1"
    ) -> ScreeningAnswer:
        """Compute a case's modes at operating points and after outages, and tell the worst.

        ``points`` is a table (CSV) in a given folder; ``outages`` is "n-1", "lines", "units" or names.
        """
        further = ["--outages", _plain(outages, "outages")]
        if points is not None:
            further += ["--points", self._file(points)]
        further += ["--out", str(self._own_folder() / "screen")]
        found = self._ask("screen", case, scenario, None, *further)
        modes = sorted(found["modes"], key=lambda mode: mode["worst"]["damping_percent"])
        failures = [f"{_place(one)}: {one['why']}" for one in found["failures"]]
        return ScreeningAnswer(
            scenario=found["scenario"],
            stable=found["stable"],
            computed=found["counts"].get("computed", 0),
            unstable=_first(_place(one) for one in found["unstable"]),
            failures=_first(failures),
            worst=[_screened(mode) for mode in modes[:MOST_ROWS]],
        )

    def check(
        self, fmu: str, binding: str | None = None, only: list[str] | None = None
    ) -> CheckAnswer:
        """Check whether an FMU can be trusted in a co-simulation; it runs in a sandbox, for minutes.

        ``fmu`` and ``binding`` are files in a given folder; ``only`` names checks, such as "repeatability".
        """
        words = ["fmu", "check", self._file(fmu), "--json"]
        for name in only or []:
            words += ["--only", _plain(name, "only")]
        if binding is not None:
            words += ["--binding", self._file(binding)]
        found = ask(words, self._allowance)
        rows = found["checks"]
        return CheckAnswer(
            fmu=Path(found["fmu"]).name,
            faults=found["faults"],
            not_judged=[
                f"{row['check']}: {row['evidence']}"
                for row in rows
                if row["verdict"] not in ("pass", "fail", "remark")
            ],
            checks=[CheckRowAnswer.model_validate(row) for row in rows],
        )

    def scr(self, case: str, scenario: str | None = None) -> StrengthsAnswer:
        """Compute the short-circuit power of every bus, and the SCR of converters; the weakest bus stands first."""
        found = self._ask("scr", case, scenario, None)
        (one, *_) = found["scenarios"]
        buses = sorted(one["buses"], key=lambda bus: bus["s_sc_mva"])
        return StrengthsAnswer(
            scenario=one["name"],
            convention=found["convention"],
            buses=[BusStrengthAnswer.model_validate(bus) for bus in buses[:MOST_ROWS]],
        )

    def sensitivities(self, case: str, scenario: str) -> SensitivitiesAnswer:
        """Compute which parameters of the running FMUs move a scenario's critical mode, the strongest first."""
        (found,) = self._ask("sensitivities", case, scenario, None)
        rows = sorted(found["sensitivities"], key=_strength, reverse=True)
        return SensitivitiesAnswer(
            scenario=found["scenario"],
            mode_frequency_hz=found["mode"]["frequency_hz"],
            mode_damping_percent=found["mode"]["damping_percent"],
            influences=[InfluenceAnswer.model_validate(row) for row in rows[:MOST_ROWS]],
        )

    def explain(self, case: str, scenario: str, values: Values | None = None) -> ExplanationAnswer:
        """Explain a scenario's verdict: what decides, who takes part, and what to look at before it is believed."""
        found = self._ask("modes", case, scenario, values)
        (one,) = found["scenarios"]
        stability = one["stability"]
        because = [_growth_elsewhere(one), stability["reason"], *map(_sentence, _deciding(one))]
        return ExplanationAnswer(
            scenario=one["name"],
            stable=one["stable"],
            verdict=stability["sentence"],
            because=[text for text in because if text],
            doubts=_first(dict.fromkeys([*one["warnings"], *found["questions"]])),
        )

    def _ask(
        self, command: str, case: str, scenario: str | None, values: Values | None, *further: str
    ) -> Any:
        words = [command, self._case(case), "--json", *further]
        if scenario is not None:
            words += ["--scenario", _plain(scenario, "scenario")]
        for name, value in (values or {}).items():
            written = str(value).lower() if isinstance(value, bool) else str(value)
            words += ["--set", f"{_plain(name, 'values')}={written}"]
        return ask(words, self._allowance)

    def _own_folder(self) -> Path:
        """Return where this server writes: the folder of results, or one in it if another server has that."""
        results = self._allowance.results
        for folder in (results, *(results / f"server_{k}" for k in range(2, MOST_SERVERS + 1))):
            if self._folder is not None:
                break
            with suppress(FolderInUseError):
                self._held.enter_context(hold_folder(folder))
                self._folder = folder
        if self._folder is None:
            raise NoAnswerError(
                f"{MOST_SERVERS} servers write into {results} already; end one, or start this one with --results"
            )
        return self._folder

    def _case(self, case: str) -> str:
        if case in built_in_cases():
            return case
        try:
            return self._file(case)
        except InputError as error:
            near = close_names(case, built_in_cases())
            hint = f" {near}" if near else ""
            raise NoAnswerError(
                f"{error};{hint} the built-in cases: {', '.join(built_in_cases())}"
            ) from None

    def _file(self, name: str) -> str:
        """Return the path of a file in a given folder; a relative one starts in the first of them that has it."""
        given = Path(_plain(name, "file"))
        for root in self._allowance.roots:
            with suppress(OSError, RuntimeError):  # a name that no file can have; links in a loop
                path = (root / given).resolve()
                if is_within(path, self._allowance.roots) and path.is_file():
                    return str(path)
        folders = ", ".join(str(root) for root in self._allowance.roots)
        raise NoAnswerError(
            f"{name}: there is no such file in the folders that may be read: {folders}"
        )


def _first(texts: Iterable[object]) -> list[str]:
    """Return texts as an agent gets them: the first, and how many others there are."""
    every = list(map(str, texts))
    more = [f"and {len(every) - MOST_ROWS} more"] if len(every) > MOST_ROWS else []
    return every[:MOST_ROWS] + more


def _plain(text: str, what: str) -> str:
    """Return a text that a command takes for a value, not for an option."""
    if not text or text.startswith("-") or not text.isprintable() or len(text) > LONGEST_NAME:
        begin = text[:60]
        raise NoAnswerError(
            f"{what} = {begin!r}: give a name or a path, which does not begin with '-' and has at most "
            f"{LONGEST_NAME} characters"
        )
    return text


def _case_files(root: Path) -> Iterable[Path]:
    """Yield the case files of a folder and of those in it, the hidden ones and links to folders left out."""
    for folder, inner, names in islice(os.walk(root), MOST_FOLDERS):
        inner[:] = sorted(name for name in inner if not name.startswith("."))
        for name in sorted(names):
            path = Path(folder, name)
            if path.suffix == ".toml" and is_within(path, [root]) and _is_case(path):
                yield path


def _is_case(path: Path) -> bool:
    """Return whether the first 100,000 characters of a file name components, as those of a case do."""
    if not path.is_file():
        return False
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            return "[components" in file.read(100_000)
    except OSError:
        return False


def _title(path: Path) -> str:
    for line in path.read_text(encoding="utf-8").splitlines():
        key, _, value = line.partition("=")
        if key.strip() == "title":
            return value.strip().strip('"')
    return ""


def _largest(parts: Mapping[str, float], most: int = MOST_ROWS) -> dict[str, float]:
    ordered = sorted(parts.items(), key=lambda part: part[1], reverse=True)
    return dict(ordered[:most])


def _scenario_modes(
    one: Mapping[str, Any], frequencies_hz: tuple[float, float], most: int, parts: int
) -> ScenarioModesAnswer:
    every = sorted(one["modes"], key=lambda mode: (not mode["name"], mode["damping_percent"]))
    modes = sorted(every[:most], key=lambda mode: mode["damping_percent"])
    outside = one.get("outside_range") or {"oscillatory_modes": None, "least_damped": None}
    return ScenarioModesAnswer(
        scenario=one["name"],
        stable=one["stable"],
        verdict=one["stability"]["sentence"],
        eigenvalues=one["stability"]["eigenvalues"],
        frequency_range_hz=frequencies_hz,
        modes=[_mode(mode, parts) for mode in modes],
        left_out=len(every) - len(modes),
        outside_range=outside["oscillatory_modes"],
        least_damped_outside=outside["least_damped"],
    )


def _mode(mode: Mapping[str, Any], most: int) -> ModeAnswer:
    parts = {row["state"]: row["factor"] for row in mode["participation"]}
    shape = _shape(mode["shape"])
    return ModeAnswer(
        name=mode["name"],
        frequency_hz=mode["frequency_hz"],
        damping_percent=mode["damping_percent"],
        real=mode["real"],
        imag=mode["imag"],
        participation=_largest(parts, most),
        shape=dict(islice(shape.items(), most)),
        machines_left_out=max(0, len(shape) - most),
    )


def _shape(rows: Iterable[Mapping[str, Any]]) -> dict[str, tuple[float, float]]:
    """Return speeds of machines relative to the largest one: magnitude, and angle [deg] within ±180."""
    speeds = [row for row in rows if row["state"].endswith("machine.omega")]
    ordered = sorted(speeds, key=lambda row: float(row["magnitude"]), reverse=True)
    return {
        row["state"].partition(".")[0]: (
            row["magnitude"] / ordered[0]["magnitude"],
            (row["angle_deg"] - ordered[0]["angle_deg"] + 180) % 360 - 180,
        )
        for row in ordered
    }


def _place(item: Mapping[str, Any]) -> str:
    return f"{item['point']}, {item['outage']}"


def _screened(mode: Mapping[str, Any]) -> ScreenedModeAnswer:
    worst = mode["worst"]
    return ScreenedModeAnswer(
        name=mode["name"],
        frequency_hz=worst["frequency_hz"],
        damping_percent=worst["damping_percent"],
        point=worst["point"],
        outage=worst["outage"],
        participation=_largest(mode["participation"]),
    )


def _strength(row: Mapping[str, Any]) -> float:
    """Return by how much a percent of the value moves the damping; values of 0 come last."""
    return abs(float(row["damping_points_per_percent"] or 0.0))


def _deciding(one: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the listed modes that decide a scenario's verdict: those that grow, or else the least damped one.

    There is none where the verdict is not known, or rests on growth outside of the listed frequencies alone."""
    ordered = sorted(one["modes"], key=lambda mode: float(mode["damping_percent"]))
    if one["stable"] is False:
        return [mode for mode in ordered if mode["real"] > 0][:MOST_DECIDING]
    return ordered[:1] if one["stable"] else []


def _growth_elsewhere(one: Mapping[str, Any]) -> str:
    """Tell of the mode that grows fastest, if it is not among those listed; else ""."""
    found = one["stability"]
    fastest = found["largest_growth_rate"]
    listed = (mode["real"] for mode in one["modes"])
    if one["stable"] is not False or fastest is None:
        return ""
    if any(math.isclose(real, fastest, rel_tol=LIKE) for real in listed):
        return ""
    hertz = found["frequency_hz"]
    at = f"at {hertz:.4g} Hz" if hertz else "without an oscillation"
    states = ", ".join(f"{row['state']} {row['factor']:.2f}" for row in found["participation"][:4])
    if found["common_speed"]:
        states = f"all machines alike: {', '.join(found['common_speed'][:4])}"
    return (
        f"the mode that grows fastest is outside of the listed frequencies: {fastest:+.3g} 1/s {at}; "
        f"in it take part {states}"
    )


def _sentence(mode: Mapping[str, Any]) -> str:
    parts = list(_largest(mode["components"]).items())[:4]
    who = ", ".join(f"{name} {whole_percent(share)}" for name, share in parts)
    return (
        f"the mode of {mode['frequency_hz']:.3f} Hz has a damping of {mode['damping_percent']:.2f} %; "
        f"in it take part {who}"
    )
