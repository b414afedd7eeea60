"""A case file from a network's files: scenarios, plots and comments that a person can read and change."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fmus.toolchain.port_variables import I_IM, I_RE, V_IM, V_RE
from orchestrator.cases.case import Case, case_of_text
from orchestrator.cases.flow.beside_file import BesideFile
from orchestrator.cases.form.csv_rows import number, rows_of
from orchestrator.cases.networks.data import bus_name, network_data
from orchestrator.cases.networks.record_use import RecordUse
from orchestrator.cases.new.case_text import CaseText, bus_of_largest_load
from orchestrator.cases.new.converter_places import (
    ConverterPlace,
    buses_by_name,
    place_for,
    with_names,
)
from orchestrator.cases.new.network_files import sources_of
from orchestrator.cases.new.question_comments import LINE_OF_TEXT, with_questions
from orchestrator.cases.new.refusal import of_what_was_given
from orchestrator.cases.new.wanted_case import WantedCase
from orchestrator.cases.new.widened_limits import limits_to_widen
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import CaseError, InputError, Problem
from orchestrator.core.options import Option
from orchestrator.core.uncollected import uncollected
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.devices.fmi.description import FmuDescription


@dataclass(frozen=True)
class NewCase:
    text: str
    assumed: tuple[str, ...]
    scenarios: tuple[PreparedScenario, ...]
    questions: tuple[str, ...] = ()  # at the lines of the text
    black_box: bool = False  # whether its modes need --black-box

    @property
    def records(self) -> tuple[RecordUse, ...]:
        """Return what became of the records of the network's files."""
        return self.scenarios[0].records if self.scenarios else ()

    @property
    def beside_file(self) -> BesideFile | None:
        """How far the power flow of the base case is from the file's voltages; None where the file has none."""
        return self.scenarios[0].beside_file if self.scenarios else None


@uncollected()
def write_case(wanted: WantedCase) -> NewCase:
    """Compose a case, with the questions about its data as comments at their lines.

    Raises `InputError` if a file, a bus or a machine cannot be used; as a case of these files would be refused."""
    sources = sources_of(wanted.files)
    _check_controls(wanted, sources)
    try:
        return _compose(wanted, sources)
    except CaseError as error:
        raise of_what_was_given(error, sources, wanted.options) from error


def _compose(wanted: WantedCase, sources: dict[str, Path]) -> NewCase:
    """Compose a case of the files, by the keys of the case that name them."""
    device = (
        None
        if wanted.device is None
        else _described(wanted.device, wanted.binding, is_dll=wanted.is_dll)
    )
    if "units" in sources:  # tables say neither
        rows = rows_of(sources["units"], ("rating_mva",))
        machines = {bus_name(row["bus"]): number(row, "rating_mva") for row in rows}
        largest = max(machines, key=machines.__getitem__)
        wanted = replace(
            wanted, slack=wanted.slack or largest, frequency=wanted.frequency or "50 Hz"
        )
    first, base = _without_converters(wanted, sources)
    places: list[ConverterPlace] = []
    for converter in wanted.converters:
        places.append(place_for(converter, base, buses_by_name(wanted.files), places))
    draft = CaseText(
        wanted,
        sources,
        base,
        with_names(places),
        _switched(device),
        moved=first.moved,
        widened=first.widened,
    )
    if not places and wanted.kind == "phasor" and draft.fault_bus == first.fault_bus:
        # nothing of the scenario ``base`` has changed, and a large network takes seconds to prepare
        scenarios = [base, *_prepared(draft.text, wanted, ["fault"])]
    else:
        scenarios = _prepared(draft.text, wanted, [])
    questions = dict.fromkeys(q for prepared in scenarios for q in prepared.questions)
    text, numbers = with_questions(draft.text, list(questions), sources)
    black_box = device is not None and not device.can_save_state
    placed = tuple(str(_renumber(question, numbers)) for question in questions)
    return NewCase(text, tuple(draft.assumed(len(placed))), tuple(scenarios), placed, black_box)


def _without_converters(
    wanted: WantedCase, sources: dict[str, Path]
) -> tuple[CaseText, PreparedScenario]:
    """Return the text of the network alone, and its base case: with controls moved and limits widened."""
    fault_bus = _largest_load(CaseText(wanted, sources).text, wanted)
    text = CaseText(wanted, sources, fault_bus=fault_bus)
    base = _prepared(text.text, wanted, ["base"])[0]
    if wanted.move_controls:
        moved = _moved_controls(text.text, wanted, base)
        text = CaseText(wanted, sources, fault_bus=fault_bus, moved=moved)
        base = _prepared(text.text, wanted, ["base"])[0]
    widened = limits_to_widen(base) if wanted.widen_limits and "dyr" in sources else []
    if widened:
        text = CaseText(wanted, sources, fault_bus=fault_bus, moved=text.moved, widened=widened)
        base = _prepared(text.text, wanted, ["base"])[0]
    return text, base


def _check_controls(wanted: WantedCase, sources: Mapping[str, Path]) -> None:
    if wanted.move_controls and "raw" not in sources:
        named = ", ".join(path.name for path in sources.values())
        raise InputError(
            Option.MOVE_CONTROLS
            + f" is for taps and switched shunts of a RAW file, and the network is {named}; "
            "leave it out"
        )
    if wanted.move_controls and wanted.kind != "phasor":
        raise InputError(
            Option.MOVE_CONTROLS
            + ": taps and switched shunts move in phasor models; write "
            + Option.MODELS
            + " phasor, or leave it out"
        )


def _moved_controls(
    text: str, wanted: WantedCase, base: PreparedScenario
) -> dict[str, tuple[float, float]]:
    """Return the positions of the taps and shunts that move in the base case, before and after, by variable."""
    flow = base.power_flow
    if flow is None:
        return {}
    case: Case = case_of_text(text, tomllib.loads(text), wanted.out)
    (settled,) = case.prepare(["base"], voltages_before=flow.voltages)
    before, after = (x.system.components[x.grid] for x in (base, settled))
    positions = {name: (before.number(name), after.number(name)) for name in base.moving}
    return {name: pair for name, pair in positions.items() if pair[0] != pair[1]}


def _largest_load(text: str, wanted: WantedCase) -> str:
    """Return the bus of the largest load, which is faulted; "" if the network cannot be read, which is told later.

    With the fault the network of the first pass is that of the case, and its model is described once."""
    table = case_of_text(text, tomllib.loads(text), wanted.out).table
    if table.network is None:
        return ""
    try:
        slack = table.power_flow.slack if table.power_flow else None
        data = network_data(table.network, wanted.out.absolute().parent, slack)
    except InputError:
        return ""
    return bus_of_largest_load(data.loads, data.buses) if data.buses else ""


def _switched(device: FmuDescription | None) -> dict[str, bool]:
    """The PODs, p or q, that a device has a switch for: ours where None; and whether it starts with them."""
    if device is None:
        return {"p": False, "q": False}
    found = {x: device.variables.get(f"pod_{x}.enabled") for x in "pq"}
    return {
        x: str(v.start).lower() in ("true", "1", "1.0") for x, v in found.items() if v is not None
    }


def _described(path: Path, binding: Path | None, *, is_dll: bool) -> FmuDescription:
    """A device that has the port of a case, perhaps by a binding."""
    found = bound_fmu(path, binding)
    other = [
        v.name
        for v in (V_RE, V_IM, I_RE, I_IM)
        if v.name not in found.variables or found.variables[v.name].unit not in (None, "", "pu")
    ]
    if other:
        way = (
            "say which of its variables it is with "
            + Option.BINDING
            + "; `gfor fmu bind` drafts one"
        )
        way = (
            ("lay a circuit around the DLL in a device's file, and give that to " + Option.DLL)
            if is_dll
            else way
        )
        raise InputError(
            f"{path}: it has no port of voltage and current in pu ({', '.join(other)}); {way}"
        )
    return found


def _prepared(text: str, wanted: WantedCase, names: Sequence[str]) -> list[PreparedScenario]:
    case: Case = case_of_text(text, tomllib.loads(text), wanted.out)
    return case.prepare(names)


def _renumber(question: Problem, numbers: Sequence[int]) -> Problem:
    """Return a question at the line that has its key, by the new numbers of the lines."""
    found = LINE_OF_TEXT.match(question.place)
    if found is None:
        return question
    number = numbers[int(found[1]) - 1]
    return replace(question, place=f"line {number}{question.place[found.end() :]}")
