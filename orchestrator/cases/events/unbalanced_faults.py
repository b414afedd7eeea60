"""Faults of fewer than three phases, and poles that open, as what the positive sequence meets.

One phase to earth puts the networks of all three sequences in series, two phases those of the positive and the negative
one, two phases to earth all three in parallel. The fault is then an impedance to earth in the positive sequence alone:

    1-phase: Z2 + Z0 + 3·Zf    2-phase: Z2 + Zf    2-phase-earth: Z2 ∥ (Z0 + 3·Zf)

with Z2 and Z0 from the fault's place to earth, and Zf the fault's own impedance: of two phases to earth that of the way
to earth. A phase that opens puts Z2 ∥ Z0 into the line, between both sides of the opening.

Source: C. F. Wagner and R. D. Evans, Symmetrical Components, 1933, chapters III and XIV."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from orchestrator.cases.draft import Draft
from orchestrator.cases.events.sequence_networks import FAULT, Changed, SequenceAssembly
from orchestrator.cases.flow.power_flow import PowerFlow
from orchestrator.cases.flow.solved_fault import SolvedFault
from orchestrator.cases.networks import sequence_data as usual
from orchestrator.core.errors import InputError, Problem, QuestionTopic, few, number_of
from orchestrator.systems.coupling import events as coupled
from orchestrator.systems.coupling.events import Event, FaultKind

_SHOWN = 4  # elements that a question names
_OPEN = (
    100.0  # reactance of a line [pu, 100 MVA] that carries nothing: the most that a network takes
)

_ASSUMED = {
    "line_z0": f"the zero-sequence impedance is taken as {usual.LINE_Z0:g} times that of the positive sequence",
    "transformers": f"the vector group is taken as {usual.NETWORK_TRANSFORMER.upper()}, both neutrals to earth",
    "step_up": "the step-up transformer is taken as YNd, its neutral to earth on the network's side",
    "groups": "the vector group of three windings is taken as YNynd",
    "machine_x2": f"X2 is taken as {usual.MACHINE_X2:g} times X''d",
    "machine_x0": "the neutral is taken as not earthed",
    "converter_x2": "it is taken to feed the positive sequence alone, as a source of current",
    "external_z0": f"the zero-sequence impedance is taken as {usual.EXTERNAL_Z0:g} times that of the positive sequence",
}
"""Key of ``[network.sequences]`` → what is taken without it."""
_EXAMPLES = {
    "line_z0": "line_z0 = 3.0",
    "transformers": 'transformers = "YNyn"',
    "step_up": 'step_up = "YNd"',
    "groups": 'groups.{} = "YNynd"',
    "machine_x2": "machine_x2 = 1.0",
    "machine_x0": "machine_x0 = 0.1",
    "converter_x2": "converter_x2 = 0.2",
    "external_z0": "external_z0 = 1.0",
}
"""Key → a line of ``[network.sequences]`` that says it."""
_ONLY_NEGATIVE: tuple[str, ...] = ("machine_x2", "converter_x2")


def solve_unbalanced(
    draft: Draft, flow: PowerFlow | None, events: Sequence[tuple[Event, str]]
) -> list[tuple[Event, str]]:
    """Return the events with what the positive sequence meets in each fault of fewer phases and each open pole.

    What was taken without data is asked about; each solution is kept with the draft's findings."""
    plan = draft.system.components.get(draft.grid or "")
    if flow is None or plan is None or not any(_is_unbalanced(event) for event, _ in events):
        return [*events]
    values: dict[str, object] = {name: plan.value(name) for name in plan.description.parameters}
    solver = _Solver(draft, flow)
    found: dict[int, Event] = {}
    for k in sorted(range(len(events)), key=lambda k: events[k][0].time):
        event, where = events[k]
        if _is_unbalanced(event):
            try:
                event = solver.solved(event, values, where)
            except InputError as error:
                draft.note(where, str(error))
        found[k] = solver.as_opened(event)
        values.update(found[k].changes().get(draft.grid or "", {}))
    draft.found.questions += solver.questions()
    return [(found[k], where) for k, (_, where) in enumerate(events)]


def _is_unbalanced(event: Event) -> bool:
    match event:
        case coupled.BusFault() | coupled.LineFault():
            return event.on and event.kind != "3-phase"
        case coupled.PoleSwitching() | coupled.PoleEndSwitching():
            return event.open
    return False


class _Solver:
    def __init__(self, draft: Draft, flow: PowerFlow) -> None:
        self._draft, self._flow = draft, flow
        self._assumed: dict[str, list[str]] = {}
        self._asked: list[Problem] = []
        self._turned: list[str] = []
        self._whole: set[str] = (
            set()
        )  # lines that open with all phases, as nothing else is left of them
        self._where = ""

    def as_opened(self, event: Event) -> Event:
        """Return a pole's closing, or that of the whole line where the whole line has opened."""
        poles = coupled.PoleSwitching | coupled.PoleEndSwitching
        if not isinstance(event, poles) or event.line not in self._whole:
            return event
        self._whole.discard(event.line)
        return coupled.LineSwitching(event.time, event.component, event.line, True)

    def solved(self, event: Event, values: Mapping[str, object], where: str) -> Event:
        """Return an event with R and X of the positive sequence."""
        self._where = self._where or where
        match event:
            case coupled.BusFault():
                found = self._assembled(values, Changed(), event.kind, event.bus)
                negative, zero = (x.impedance(event.bus) for x in (found.negative, found.zero))
                z = _met(event.kind, complex(event.R, event.X), negative, zero)
                self._keep(event, event.bus, event.kind, (negative, zero, z), found)
                self._ask_of_capacitances(event.bus, event.bus, event.kind, zero, found)
                return replace(event, R=z.real, X=z.imag)
            case coupled.LineFault():
                found = self._assembled(values, Changed(event.line, event.at), event.kind, FAULT)
                negative, zero = (x.impedance(FAULT) for x in (found.negative, found.zero))
                z = _met(event.kind, complex(event.R, event.X), negative, zero)
                place = f"{event.line}, {100 * event.at:g} %"
                self._keep(event, place, event.kind, (negative, zero, z), found)
                self._ask_of_capacitances(place, FAULT, event.kind, zero, found)
                return replace(event, R=z.real, X=z.imag)
            case coupled.PoleSwitching():
                return self._open_pole(event, values)
            case coupled.PoleEndSwitching():
                return self._open_pole_at_end(event, values)
        return event

    def _open_pole(self, event: coupled.PoleSwitching, values: Mapping[str, object]) -> Event:
        network = self._draft.network
        assert network is not None
        line = next(x for x in network.lines if x.name == event.line)
        found = self._assembled(values, Changed(event.line), "1-phase", line.from_bus)
        own = found.series(event.line)
        negative, zero = (
            z + x.between(line.from_bus, line.to_bus)
            for z, x in zip(own, (found.negative, found.zero), strict=True)
        )
        z = _parallel(negative, zero)
        self._keep(event, event.line, "open pole", (negative, zero, z), found)
        R, X = own[0].real + z.real, own[0].imag + line.X_C + z.imag
        if _is_finite(z) and abs(complex(R, X)) < _OPEN:
            return replace(event, R=R, X=X)
        return self._open_whole(event, negative, zero)

    def _open_pole_at_end(
        self, event: coupled.PoleEndSwitching, values: Mapping[str, object]
    ) -> Event:
        """Return an event with what stands between a line's end and its bus, of which one phase is open."""
        network = self._draft.network
        assert network is not None
        line = next(x for x in network.lines if x.name == event.line)
        bus = line.from_bus if event.end == "from" else line.to_bus
        found = self._assembled(values, Changed(event.line, end=event.end), "1-phase", bus)
        negative, zero = (x.between(bus, FAULT) for x in (found.negative, found.zero))
        z = _parallel(negative, zero)
        self._keep(event, f"{event.line} at {bus}", "open pole", (negative, zero, z), found)
        if _is_finite(z) and abs(z) < _OPEN:
            return replace(event, R=z.real, X=z.imag)
        return self._open_whole(event, negative, zero)

    def _open_whole(
        self,
        event: coupled.PoleSwitching | coupled.PoleEndSwitching,
        negative: complex,
        zero: complex,
    ) -> Event:
        """Return the opening of all phases where two of them carry next to nothing, which is asked about."""
        self._whole.add(event.line)
        text = (
            f"with one phase of {event.line} open its other phases carry next to nothing (Z2 = "
            f"{_words(negative)}, Z0 = {_words(zero)} pu between its ends): the whole line opens"
        )
        self._asked.append(
            Problem(self._where, text, topic=QuestionTopic("an open pole", event.line))
        )
        return coupled.LineSwitching(event.time, event.component, event.line, False)

    def _assembled(
        self, values: Mapping[str, object], changed: Changed, kind: FaultKind, place: str
    ) -> SequenceAssembly:
        """Return both networks, and keep what was taken by a default and counts at a place."""
        found = SequenceAssembly(self._draft, self._flow, dict(values), changed)
        self._turned += [name for name in found.turned if name not in self._turned]
        away = _away(found, place)
        for key, all_names in found.assumed.items():
            names = [x for x in all_names if key != "machine_x0" or x not in away]
            if kind == "2-phase" and key not in _ONLY_NEGATIVE:
                continue
            known = self._assumed.setdefault(key, [])
            known += [name for name in names if name not in known]
        return found

    def _keep(
        self,
        event: Event,
        place: str,
        kind: str,
        impedances: tuple[complex, complex, complex],
        found: SequenceAssembly,
    ) -> None:
        negative, zero, seen = (z if _is_finite(z) else None for z in impedances)
        own = complex(getattr(event, "R", 0.0), getattr(event, "X", 0.0))
        own = 0j if kind == "open pole" else own
        source = found.data.source
        if source and found.read:
            source = f"{', '.join(sorted(found.read))} of {source}"
            source += "; other elements by the case and by defaults" if found.assumed else ""
        else:
            source = "ratios of the case and defaults"
        self._draft.found.faults.append(
            SolvedFault(
                event.time,
                place,
                kind,
                own=own,
                negative=negative,
                zero=zero,
                seen=seen,
                source=source,
            )
        )
        if kind != "open pole" and (seen is None or (kind == "2-phase-earth" and zero is None)):
            self._ask_of_paths(place, kind, negative, seen)

    def _ask_of_paths(
        self, place: str, kind: str, negative: complex | None, seen: complex | None
    ) -> None:
        """Ask about a sequence without a path to earth from a fault's place."""
        lacks = "zero" if negative is not None else "negative"
        remedy = (
            "say which neutrals are earthed, such as [network.sequences] "
            f"{_EXAMPLES['step_up']} or machine_x0 = 0.1"
            if lacks == "zero"
            else "a machine or a load there gives it one"
        )
        effect = f"a fault of kind {kind} draws no current there, and the run shows none"
        if seen is not None:
            effect = (
                f"a fault of kind {kind} is one of kind 2-phase there, without the impedance of the way to earth: the "
                "positive sequence meets Z2 alone"
            )
        text = f"no path of the {lacks} sequence leads to earth from {place}: {effect}; {remedy}"
        self._asked.append(
            Problem(self._where, text, topic=QuestionTopic("a fault without a path"))
        )

    def _ask_of_capacitances(
        self, place: str, bus: str, kind: FaultKind, zero: complex, found: SequenceAssembly
    ) -> None:
        """Ask about a zero sequence that charging and capacitors alone lead to earth from a fault's bus."""
        if kind == "2-phase" or not found.zero.is_capacitive(bus):
            return
        machines = {*found.assumed.get("machine_x0", ())} - _away(found, bus)
        said = _EXAMPLES["machine_x0" if machines else "step_up"]
        data = found.data.source
        file = f"correct {data}" if data else "give a SEQ file"
        text = (
            f"only capacitances (charging of lines, capacitors) lead the zero sequence to earth from {place}, Z0 = "
            f"{_words(zero)} pu on 100 MVA: a fault of kind {kind} draws no more than their current there, and "
            "voltages may rise while it lasts, as in a network whose neutrals are not earthed; if neutrals are, say "
            f"which, such as [network.sequences] {said} or a transformer's vector group, "
            f'groups.NAME = "YNd", or {file}'
        )
        self._asked.append(
            Problem(
                self._where, text, topic=QuestionTopic("a fault with capacitances alone", place)
            )
        )

    def questions(self) -> Iterator[Problem]:
        """Yield what was taken by a default, a question for each key that says otherwise, and what draws no current."""
        yield from self._asked
        for name in self._turned:
            text = (
                f"{name} is at a unit, and its sequence data have the neutral to earth at the unit's side and the "
                "delta at the network's: are its sides exchanged?"
            )
            yield Problem(self._where, text, topic=QuestionTopic("exchanged sides", name))
        for key, names in self._assumed.items():
            if not names:
                continue
            said = _EXAMPLES[key].format(names[0])
            text = (
                f"{_ASSUMED[key]} ({number_of(len(names), 'element')}: {few(names, _SHOWN)}); if it is another, give "
                f"a SEQ file, or write [network.sequences] {said}"
            )
            yield Problem(self._where, text, topic=QuestionTopic(f"sequence data: {key}"))


def _away(found: SequenceAssembly, place: str) -> set[str]:
    """Return the units that no branch of the zero sequence joins with a place."""
    near = {*found.zero.part_of(place)}
    return {port.name for port in found.network.ports if port.bus not in near}


def _met(kind: FaultKind, own: complex, negative: complex, zero: complex) -> complex:
    """Return the impedance that the positive sequence meets at a fault [pu, 100 MVA]."""
    if kind == "2-phase":
        return negative + own
    if kind == "1-phase":
        return negative + zero + 3 * own
    return _parallel(negative, zero + 3 * own)


def _parallel(one: complex, other: complex) -> complex:
    if not _is_finite(one) or not _is_finite(other):
        return other if not _is_finite(one) else one
    return one * other / (one + other)


def _words(z: complex) -> str:
    return f"{z.real:.4g}{z.imag:+.4g}j" if _is_finite(z) else "none"


def _is_finite(z: complex) -> bool:
    return abs(z) != float("inf")
