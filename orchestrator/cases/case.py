"""A case file, read and checked against its form."""

from __future__ import annotations

import difflib
import json
import re
import tomllib
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import cached_property, partial
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

import tomli_w
from pydantic import ValidationError

from fmus.toolchain.cache import cache_directory
from orchestrator.cases.form.definition import CaseDefinition
from orchestrator.cases.form.locate import place_in
from orchestrator.cases.form.model_kinds import kind_wanted, of_kind
from orchestrator.cases.form.names import close_names, no_scenario
from orchestrator.cases.form.parameter_files import ParameterFile, read_parameter_file
from orchestrator.cases.form.schema import CaseTable, ComponentTable, Value
from orchestrator.cases.form.values import TWICE, flatten, given_twice
from orchestrator.cases.questions.contradictions import contradictions
from orchestrator.core.errors import MOST_PROBLEMS, TOO_MANY, CaseError, InputError, Problem, few
from orchestrator.core.foreign_files import check_name, cleaned, steering_in, why_refused
from orchestrator.core.late import Late
from orchestrator.core.options import Option
from orchestrator.core.question_kinds import besides
from orchestrator.core.toml_files import Table, fault_of, read_toml
from orchestrator.core.uncollected import uncollected
from orchestrator.systems.coupling.no_trip_regions import NoTripCode

if TYPE_CHECKING:
    from orchestrator.cases.draft import Draft
    from orchestrator.cases.events import event_tables
    from orchestrator.cases.flow import sharing
    from orchestrator.cases.flow.sharing import Dispatch
    from orchestrator.cases.questions import idle_values, mentions
    from orchestrator.cases.scenario import prepare
    from orchestrator.cases.scenario.prepare import PreparedScenario, Preparer
    from orchestrator.systems.coupling.system import ComponentPlan
    from orchestrator.systems.ssp import reading
else:  # what prepares a scenario: FMUs and the power flow, which reading a file does without
    event_tables = Late("orchestrator.cases.events.event_tables")
    sharing = Late("orchestrator.cases.flow.sharing")
    idle_values = Late("orchestrator.cases.questions.idle_values")
    mentions = Late("orchestrator.cases.questions.mentions")
    prepare = Late("orchestrator.cases.scenario.prepare")
    reading = Late("orchestrator.systems.ssp.reading")

BUILT_IN = Path(__file__).parent / "built_in"
_SCHEMA_PASSES = 50
_SOURCES = {
    ".raw": ("a network of PSS/E", "network", "raw"),
    ".rawx": ("a network of PSS/E", "network", "raw"),
    ".dyr": ("dynamics data of PSS/E", "units", "dyr"),
    ".seq": ("sequence data of PSS/E", "network", "seq"),
    ".m": ("a MATPOWER case", "network", "matpower"),
    ".mat": ("a MATPOWER case", "network", "matpower"),
    ".zip": ("an archive, perhaps a CGMES model", "network", "cgmes"),
}
"""Files of other programs by their suffix: what each is, and where a case names it."""

_STEP = "give a communication step with its unit, such as '100 us' with EMT models or '5 ms' with phasor models"
_TIMES = {"step_size": _STEP, "micro_step": _STEP} | dict.fromkeys(
    ("stop_time", "record_interval", "time"), ""
)
"""Keys of times [s], with the remedy."""

_SHARES = {"alpha": "it is a part of the unit's rating: 30 % is 0.3"}


def with_protection(case: Case, code: NoTripCode | None) -> Case:
    """Return the case whose converters trip as soon as a code lets them; as it is where the code is None."""
    if code is None:
        return case
    return replace(case, table=case.table.model_copy(update={"protection": code}))


def built_in_cases() -> tuple[str, ...]:
    return tuple(sorted(p.parent.name for p in BUILT_IN.glob("*/case.toml")))


_FOLDERS = "|".join(
    map(re.escape, {str(BUILT_IN / "_")[:-1], json.dumps(str(BUILT_IN / "_"))[1:-2]})
)
"""The folder of the built-in cases as it stands in a text, and as JSON writes it."""

_INSTALLED = re.compile(rf"(?:{_FOLDERS})(?:(\w+)[\\/]+case\.toml)?")


def without_installed_folder(text: str) -> str:
    """Return a text, or JSON, that calls built-in cases by their names, not by where this installation has them."""
    return _INSTALLED.sub(lambda found: found[1] or "", text)


def as_typed(case: CaseDefinition) -> str:
    """Return what is typed for a case at a command line: a built-in one's name, or the path of a file."""
    path = case.path
    return path.parent.name if path.is_relative_to(BUILT_IN) else quote(str(path))


class Case(CaseDefinition):
    @uncollected()
    def prepare(
        self,
        scenarios: Sequence[str] = (),
        overrides: Mapping[str, Value] | None = None,
        step_size: float | None = None,
        stop_time: float | None = None,
        parameters: Sequence[ParameterFile] = (),
        dispatch: Dispatch | None = None,
        voltages_before: Mapping[str, complex] | None = None,
    ) -> list[PreparedScenario]:
        """Check everything and make the chosen scenarios, or all, ready to run.

        ``parameters``: Their values have priority over the scenario's, and ``overrides`` have priority over theirs.
        ``dispatch``: What the units fed before an outage that they share; None where each feeds its own ``P_0``.
        ``voltages_before``: Bus voltages before an outage [pu], from which loads follow the voltage whose source tells
        their constant currents and impedances. None for those without what ``overrides`` take out of service."""
        other = self._of_kind(overrides, parameters)
        if other is not self:
            return other.prepare(
                scenarios,
                overrides,
                step_size,
                stop_time,
                parameters,
                dispatch=dispatch,
                voltages_before=voltages_before,
            )
        self._check_choice(scenarios)
        values = overrides or {}
        problems, questions = [*self.problems], [*self.questions]
        prepared, named = [], mentions.Named()
        for name in scenarios or self.scenarios:
            preparer = self._preparer(name, values, parameters)
            draft = preparer.draft
            draft.dispatch, draft.voltages_before = dispatch, voltages_before or {}
            lost = self._look_before_outage(
                draft,
                values,
                parameters,
                shares=dispatch is None,
                follows=voltages_before is None,
            )
            ready = preparer.prepare(step_size, stop_time)
            prepared.append(_with_feeders_of_loss(ready, lost, draft.dispatch))
            named.add(draft)
            problems += [p for p in preparer.problems if p not in problems]
            questions += [q for q in draft.found.questions if q not in questions]
        if not problems and self.numbered and mentions.unmatched(self.table, named, self.place):
            problems += self._mentions
        found = [p for p in prepared if p is not None]
        if not problems:
            problems += self._switched_on(found, parameters, values)
        if problems:
            raise CaseError(self.source, [*problems, *besides(problems, questions)])
        if scenarios and self.numbered:
            others = event_tables.other_scenarios(draft, scenarios)
            found[-1] = replace(found[-1], questions=(*found[-1].questions, *others))
        beside = partial(self._beside, overrides, step_size, parameters)
        idle = idle_values.idle_everywhere([p.idle for p in found])
        return [
            replace(
                p,
                beside=beside,
                questions=(*self.questions, *p.questions, *idle),
                changed=self._changes(values, parameters, p.idle),
            )
            for p in found
        ]

    def _check_choice(self, scenarios: Sequence[str]) -> None:
        """Refuse scenarios that the case does not have, or that are chosen twice."""
        problems = []
        for name in scenarios:
            if name not in self.scenarios:
                problems.append(Problem(Option.SCENARIO, no_scenario(name, self.scenarios)))
        for name, count in Counter(scenarios).items():
            if count > 1:
                text = f"the scenario {name!r} is chosen more than once; name it once"
                problems.append(Problem(Option.SCENARIO, text))
        if problems:
            raise CaseError(self.source, [*self.problems, *problems])

    def _look_before_outage(
        self,
        draft: Draft,
        overrides: Mapping[str, Value],
        parameters: Sequence[ParameterFile],
        *,
        shares: bool,
        follows: bool,
    ) -> Collection[str]:
        """Tell a draft the voltages and powers before values take something out of service; gives the units lost.

        ``shares``: whether others are to share the power of these units; not where values say who feeds what.
        ``follows``: whether loads are to follow the voltage."""
        follows = follows and draft.reacts
        shares = shares and not any(key.endswith(".P_0") for key in overrides)
        if not (follows or shares):
            return ()
        before = self._before_outage(draft.given.name, overrides, parameters)
        if before is None:
            return ()
        if follows and before.power_flow is not None:
            draft.voltages_before = before.power_flow.voltages
            draft.loads_as_given = self._loads_as_given(before, overrides)
        if not shares:
            return ()
        lost, draft.dispatch = self._switched_off(draft.given.name, before, overrides, parameters)
        return lost

    def _changes(
        self,
        overrides: Mapping[str, Value],
        parameters: Sequence[ParameterFile],
        idle: idle_values.Idle,
    ) -> str:
        """The values and files that the caller gave, in few words; a value that cannot act in the scenario says so."""
        changes = [*self.events_given, *(file.path.name for file in parameters if file.text)]
        given = [file.values for file in parameters if not file.text] + [overrides]
        changes += [
            f"{key} = {value}{_WITHOUT_EFFECT if idle_values.is_idle(idle, key) else ''}"
            for values in given
            for key, value in values.items()
        ]
        return few(changes, _NAMED)

    def _switched_on(
        self,
        ready: Sequence[PreparedScenario],
        parameters: Sequence[ParameterFile],
        overrides: Mapping[str, Value],
    ) -> list[Problem]:
        """Controllers that a file switches on where the scenario has it off: in one of several scenarios, or beside
        another one that is on there, which no value says."""
        found, said = (
            [],
            [
                key
                for values in (overrides, *(file.values for file in parameters))
                for key in values
            ],
        )
        for file in parameters:
            for key in (
                key
                for key, value in file.values.items()
                if value is True and key.endswith(".enabled")
            ):
                pattern, _, variable = key.partition(".")
                systems = [p.system for p in ready if file.text]
                others = [
                    x
                    for system in systems
                    for x in idle_values.others_on(system, pattern, variable, said)
                ]
                each = [
                    (p.name, self.components_of(p.name).items())
                    for p in ready
                    if others or len(ready) > 1
                ]
                on = {
                    s: p.value(variable)
                    for s, plans in each
                    for name, p in plans
                    if fnmatchcase(name, pattern)
                }
                off = [scenario for scenario, is_on in on.items() if not is_on]
                if off:
                    text = f"too, where it is off: choose one scenario of {', '.join(on)}"
                    if len(on) == 1:
                        remedy = f"choose another scenario, or set {others[0]} = true too where both are meant"
                        text = f"beside {others[0]}, where it is off: {remedy}"
                    found.append(
                        Problem(
                            file.place(key), f"it would switch this on in {', '.join(off)} {text}"
                        )
                    )
        return found

    def _beside(
        self,
        overrides: Mapping[str, Value] | None,
        step_size: float | None,
        parameters: Sequence[ParameterFile],
        name: str,
        plain: bool,
        further: Mapping[str, Value] | None = None,
        stop_time: float | None = None,
    ) -> PreparedScenario | None:
        if not plain:
            return self.prepare(
                [name], {**(overrides or {}), **(further or {})}, step_size, stop_time, parameters
            )[0]
        return self.prepare([name], None, step_size)[0] if overrides or parameters else None

    def _before_outage(
        self, name: str, overrides: Mapping[str, Value], parameters: Sequence[ParameterFile]
    ) -> PreparedScenario | None:
        """The scenario without what values take out of service; None if they take nothing, or without a power flow."""
        on = _without_outages(overrides)
        if self.table.power_flow is None or len(on) == len(overrides):
            return None
        return self._preparer(name, on, parameters).prepare(None, None)

    def _loads_as_given(
        self, before: PreparedScenario, overrides: Mapping[str, Value]
    ) -> frozenset[str]:
        """Loads whose power is given: they draw that after an outage, and do not follow the voltage."""
        heads = [key.rpartition(".")[0] for key in overrides if key.endswith((".P", ".Q"))]
        loads = [f"{before.grid}.{name}" for name in before.following_loads]
        given = [load for load in loads if any(fnmatchcase(load, head) for head in heads)]
        return frozenset(load.removeprefix(f"{before.grid}.") for load in given)

    def _switched_off(
        self,
        name: str,
        before: PreparedScenario,
        overrides: Mapping[str, Value],
        parameters: Sequence[ParameterFile],
    ) -> tuple[Collection[str], Dispatch | None]:
        """Units that values take out of service, and how others share their power."""
        table, on = self.table.power_flow, _without_outages(overrides)
        if table is None or before.power_flow is None:
            return (), None
        powers, plans = before.power_flow.powers, before.system.components
        off = [key for key in overrides if key not in on]
        heads = ("", f"{table.grid}.")
        fed_by = [unit for unit, power in powers.items() if power]
        lost = [
            u
            for u in fed_by
            if any(fnmatchcase(f"{h}{u}.connected", key) for key in off for h in heads)
        ]
        if not lost:
            return (), None
        drawn, loads = 0.0, [x.name for x in before.network.loads] if before.network else []
        of_loads = {
            k
            for k in on
            if any(fnmatchcase(f"{table.grid}.{x}", k.rpartition(".")[0]) for x in loads)
        }
        kept = {key: value for key, value in on.items() if key not in of_loads}
        if of_loads and (intact := self._preparer(name, kept, parameters).prepare(None, None)):
            before_mw, now_mw = (
                sharing.load_of(loads, x[table.grid]) for x in (intact.system.components, plans)
            )
            drawn = before_mw - now_mw
            powers = intact.power_flow.powers if intact.power_flow else powers
        fed = sum(powers[unit].real * plans[unit].number("S_n") for unit in lost)
        rule = self.sharing or sharing.SharingRule(table.sharing)
        return lost, sharing.Dispatch(rule, powers, fed - drawn)

    @cached_property
    def _mentions(self) -> list[Problem]:
        """Names in ``[analysis]`` and ``[[plots]]`` that match nothing in any scenario.

        Scenarios are assembled one after the other until every name is found. A scenario that cannot be assembled
        leaves the rest undecided."""
        named, missing = mentions.Named(), list[mentions.Unmatched]()
        for name in self.scenarios:
            preparer = self._preparer(name, None, ())
            preparer.assemble()
            if preparer.problems:
                return []
            named.add(preparer.draft)
            missing = mentions.unmatched(self.table, named, self.place)
            if not missing:
                break
        return [one.problem for one in missing]

    def components_of(
        self,
        scenario: str,
        overrides: Mapping[str, Value] | None = None,
        parameters: Sequence[ParameterFile] = (),
    ) -> dict[str, ComponentPlan]:
        """Components of one scenario with their values; much cheaper than to prepare it."""
        return {
            name: plan
            for name, (_, plan) in self.tables_and_plans(scenario, overrides, parameters).items()
        }

    def tables_and_plans(
        self,
        scenario: str,
        overrides: Mapping[str, Value] | None = None,
        parameters: Sequence[ParameterFile] = (),
    ) -> dict[str, tuple[ComponentTable, ComponentPlan]]:
        preparer = self._of_kind(overrides, parameters)._preparer(scenario, overrides, parameters)
        components = preparer.assemble().components
        problems = [*self.problems, *preparer.problems]
        if problems:
            raise CaseError(self.source, problems)
        return {name: (preparer.draft.tables[name], plan) for name, plan in components.items()}

    def _of_kind(
        self, overrides: Mapping[str, Value] | None, parameters: Sequence[ParameterFile]
    ) -> Case:
        """The case with the kind of models that is wanted; itself where that is the file's own."""
        kind = kind_wanted(overrides, parameters)
        if kind is None or kind == self.table.models:
            return self
        return replace(self, table=of_kind(self.table, kind))

    def _preparer(
        self, name: str, overrides: Mapping[str, Value] | None, parameters: Sequence[ParameterFile]
    ) -> Preparer:
        return prepare.Preparer(self, name, dict(overrides or {}), parameters)


def _without_outages(overrides: Mapping[str, Value]) -> dict[str, Value]:
    """The values but for those that take something out of service."""
    return {k: value for k, value in overrides.items() if value or not k.endswith(".connected")}


_WITHOUT_EFFECT = " (without effect here)"
_NAMED = 2  # values set that a title names; the others are counted
_FED = 1e-6  # power of a unit from which its loss is told [pu]


def _with_feeders_of_loss(
    prepared: PreparedScenario | None, lost: Collection[str], dispatch: Dispatch | None
) -> PreparedScenario | None:
    """The scenario, which says of units that values took out of service who feeds their power."""
    if prepared is None or prepared.power_flow is None or dispatch is None:
        return prepared
    if not any(abs(dispatch.powers[unit].real) > _FED for unit in lost):
        return prepared
    plans = prepared.system.components
    drawn = (
        sum(dispatch.powers[unit].real * plans[unit].number("S_n") for unit in lost)
        - dispatch.change
    )
    shared = sharing.in_words(
        dispatch, prepared.power_flow.powers, plans, lost, sharing.lost_load(drawn)
    )
    text = f"{shared}, by {dispatch.rule}; the rules are {', '.join(sharing.SharingRule)}"
    return replace(prepared, questions=(*prepared.questions, Problem("[power_flow] sharing", text)))


def load_case(name_or_path: str | Path, *, trust_fmus: bool = False) -> Case:
    """Read a built-in case by name, or a case file or an SSP by path.

    ``trust_fmus``: Whether foreign FMUs may run in this process, where the file says ``isolated = false``; else that is
    a problem."""
    path = Path(name_or_path)
    if str(name_or_path) in built_in_cases():
        path = BUILT_IN / str(name_or_path) / "case.toml"
    check_name(path.absolute())
    if path.is_dir():
        inside = sorted(p.name for p in path.glob("*.toml"))
        hint = f"such as {path / inside[0]}" if inside else "of a case file (.toml) or an SSP"
        raise InputError(f"{name_or_path}: it is a folder; give the path of a file, {hint}")
    if not path.is_file():
        hint = close_names(str(name_or_path), built_in_cases())
        raise InputError(
            f"{name_or_path}: there is no such file, nor a built-in case of that name; "
            f"{f'{hint} ' if hint else ''}built-in: {', '.join(built_in_cases())}"
        )
    if path.suffix.lower() == ".ssp":
        return _from_ssp(path, trust_fmus)
    source = _SOURCES.get(path.suffix.lower())
    if source is not None:
        what, section, key = source
        raise InputError(
            f"{name_or_path}: this is {what}, not a case; `gfor new` writes one (.toml), whose [{section}] has "
            f'{key} = "{path.name}"; give that'
        )
    text, raw = read_toml(path, "the case file", "make it readable for you", steering=True)
    return case_of_text(text, raw, path, trust_fmus=trust_fmus)


def case_of_text(text: str, raw: dict[str, Any], path: Path, *, trust_fmus: bool = False) -> Case:
    """The case of a text that is, or is to be, in a file; ``raw`` is what TOML makes of it."""
    table, problems = _validate(raw, text, path)
    table = table if table.models is None or problems else of_kind(table, table.models)
    return _case(
        table, text, path, problems, path.parent / (table.directory or ""), trust_fmus=trust_fmus
    )


def _from_ssp(path: Path, trust_fmus: bool) -> Case:
    """The case from an SSP. Its FMUs are unpacked into the cache of built FMUs."""
    ssp = reading.read_ssp(path, cache_directory("ssp"))
    text = f"# What {path.name} comes to (SHA-256 {ssp.digest})\n\n{tomli_w.dumps(ssp.tables)}"
    table, problems = _validate(tomllib.loads(text), "", path)
    case = _case(table, text, path, problems, ssp.folder, numbered=False, trust_fmus=trust_fmus)
    return replace(case, questions=ssp.questions)


def _case(
    table: CaseTable,
    text: str,
    path: Path,
    problems: Sequence[Problem],
    directory: Path,
    *,
    numbered: bool = True,
    trust_fmus: bool,
) -> Case:
    """The case, with what its scenarios' parameter files say now and paths that outlast a change of the folder."""
    files: dict[str, ParameterFile | str] = {}
    for name in (name for scenario in table.scenarios.values() for name in scenario.parameters):
        try:
            files[name] = read_parameter_file(directory / name)
        except InputError as error:
            files[name] = str(error)
    home = path.absolute().parent
    return Case(
        table,
        text,
        path=path,
        problems=tuple(problems),
        directory=directory.absolute(),
        numbered=numbered,
        trust_fmus=trust_fmus,
        home=home,
        parameter_files=files,
    )


def _validate(raw: dict[str, Any], text: str, path: Path) -> tuple[CaseTable, list[Problem]]:
    """Validate the tables: note each wrong entry, remove it, and continue with the rest."""
    problems = [
        Problem(place_in(text, where), f"{where[-1]}: {why_refused(character)}")
        for where, character in steering_in(raw)
    ]
    if problems:
        if len(problems) > MOST_PROBLEMS:
            raise CaseError(str(path), [*problems[:MOST_PROBLEMS], TOO_MANY])
        raw = cleaned(raw)
    problems += [
        Problem(place_in(text, where), f"{where[-1]}: {TWICE}") for where in _join_names(raw)
    ]
    for _ in range(_SCHEMA_PASSES):
        try:
            table = CaseTable.model_validate(raw)
            if (
                not text
            ):  # an SSP is one scenario of a case, and keeps what the case says of the others
                return table, problems
            return table, problems or contradictions(table, lambda *where: place_in(text, where))
        except ValidationError as error:
            removed, details = False, error.errors()
            if len(details) > MOST_PROBLEMS:
                first = [
                    (_location(raw, detail["loc"]), detail) for detail in details[:MOST_PROBLEMS]
                ]
                shown = [
                    Problem(place_in(text, where), _schema_message(detail, where))
                    for where, detail in first
                ]
                raise CaseError(str(path), [*shown, TOO_MANY]) from None
            located = [(_location(raw, detail["loc"]), detail) for detail in details]
            seen = [place for place, _ in located]
            for k, (location, detail) in enumerate(located):
                if location in seen[:k] or any(
                    x[: len(location)] == location for x in seen if x != location
                ):
                    # one of several forms that do not fit; what is said of the nearest one is
                    # enough
                    continue
                known = any(p.place == place_in(text, location) for p in problems)
                if not (
                    known and detail["type"] == "missing"
                ):  # missing because it was wrong and removed
                    problem = Problem(place_in(text, location), _schema_message(detail, location))
                    problems += [] if problem in problems else [problem]
                # others may be gone
                removed |= _take_out(raw, _location(raw, detail["loc"]), detail["type"])
            if not removed:
                break
    raise CaseError(str(path), problems)


def _join_names(raw: dict[str, Any]) -> list[tuple[str, ...]]:
    """Join the parts of unquoted names: TOML makes of `grid.X_L = 0.5` a table `grid` with a key `X_L`. The places of
    names that are given both ways."""
    scenarios, twice = raw.get("scenarios"), list[tuple[str, ...]]()
    named = scenarios.items() if isinstance(scenarios, dict) else ()
    tables: list[tuple[tuple[str, ...], Any]] = [
        (("scenarios", name, "set"), table) for name, table in named
    ]
    tables.append((("reference", "when"), raw.get("reference")))
    for place, table in tables:
        key = place[-1]
        if isinstance(table, dict) and isinstance(table.get(key), dict):
            flat = flatten(table[key])
            twice += [(*place, name) for name in given_twice(flat)]
            table[key] = {".".join(parts): value for parts, value in flat}
    return twice


def _location(raw: Any, location: Sequence[str | int]) -> tuple[str | int, ...]:
    """Location of a pydantic error, without the tags that it adds for unions."""
    path: list[str | int] = []
    for part in location:
        inside = (isinstance(raw, dict) and part in raw) or (
            isinstance(raw, list) and isinstance(part, int) and part < len(raw)
        )
        if inside:
            path.append(part)
            raw = raw[part]
        elif (
            part == location[-1]
            and isinstance(raw, dict)
            and part not in ("float", "str", "bool", "[key]")
        ):
            path.append(part)
    return tuple(path)


def _take_out(raw: Any, location: Sequence[str | int], fault: str) -> bool:
    """Remove a wrong entry. If a key is missing in an element of a list, remove the whole element."""
    path = list(location)
    if fault == "missing" or fault.startswith("union_tag"):
        while path and not isinstance(path[-1], int):
            path.pop()
    for part in path[:-1]:
        raw = raw[part]
    if not path:
        return False
    if isinstance(raw, dict) and path[-1] in raw:
        del raw[path[-1]]
        return True
    if isinstance(raw, list) and isinstance(path[-1], int) and path[-1] < len(raw):
        del raw[path[-1]]
        return True
    return False


def _tables(of: type[Table]) -> set[type[Table]]:
    return {of}.union(*(_tables(kind) for kind in of.__subclasses__()))


def _schema_message(detail: Any, location: Sequence[str | int]) -> str:
    key = str(location[-1]) if location else ""
    match detail["type"]:
        case "extra_forbidden":
            known = {name for table in _tables(Table) for name in table.model_fields}
            near = [] if key in known else difflib.get_close_matches(key, sorted(known), 1, 0.75)
            return f"this key is unknown; did you mean {near[0]}?" if near else fault_of(detail)
        case "missing":
            return fault_of(detail)
        case "union_tag_invalid":
            tag, known = detail["ctx"]["tag"], detail["ctx"]["expected_tags"]
            hint = close_names(tag, (one.strip(" '") for one in known.split(",")))
            return f"type {tag!r} is unknown; {f'{hint} ' if hint else ''}choose from {known}"
        case "union_tag_not_found":
            return "the key 'type' is missing; it says what kind of event this is"
        case _:
            seen = detail.get("input")
            in_seconds = key in _TIMES and type(seen) in (int, float)
            unit = " s" if in_seconds else ""
            shown = "" if isinstance(seen, dict | list) else f" (value seen: {seen!r}{unit})"
            said = f"{fault_of(detail)}{unit}{shown}"
            remedy = (_TIMES | _SHARES).get(key, "")
            return f"{said}; {remedy}" if remedy else said
