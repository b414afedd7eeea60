"""Names in ``[analysis]``, ``[[plots]]`` and ``solver.record`` that match nothing in any scenario of a case.

Components may be absent from some scenarios. A name is therefore wrong only if no scenario has a match for it."""

import fnmatch
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field

from orchestrator.cases.draft import Draft, Locate
from orchestrator.cases.form.names import close_names, variables_of
from orchestrator.cases.form.schema import CaseTable
from orchestrator.core.errors import InputError, Problem

_LISTS_OUTPUTS = "`gfor fmu info` lists the outputs of an FMU"


@dataclass
class Named:
    components: set[str] = field(default_factory=set)
    states: set[str] = field(default_factory=set)
    # components that are FMU files. Such an FMU may lack outputs and states of the catalogue's model that it replaces,
    # and their names are not checked.
    foreign: set[str] = field(default_factory=set)
    outputs: set[str] = field(default_factory=set)
    # names that an area may contain: components and buses
    homes: set[str] = field(default_factory=set)

    def add(self, draft: Draft) -> None:
        for name, plan in draft.system.components.items():
            fmu = plan.description
            self.components.add(name)
            self.homes.add(name)
            self.states |= {f"{name}.{state}" for state in fmu.states}
            if draft.tables[name].file is not None:
                self.foreign.add(name)
            self.outputs |= {f"{name}.{v}" for v in fmu.outputs if fmu.variables[v].type == "Real"}
            self.homes |= {v.rpartition(".")[0] for v in fmu.outputs} - {""}
        self.homes |= set(draft.network.buses) if draft.network else set()


@dataclass(frozen=True)
class Unmatched:
    """A name that matches nothing so far, at its place.

    ``known``: names among which close ones are; ``otherwise``: the hint where none is close. To look for close ones
    takes longer than to look whether a name is there, and the next scenario may have it."""

    where: str
    text: str
    name: str = ""
    known: Collection[str] = ()
    otherwise: str = ""

    @property
    def problem(self) -> Problem:
        if not self.name:
            return Problem(self.where, self.text)
        hint = close_names(self.name, sorted(self.known), self.otherwise)
        return Problem(self.where, f"{self.text}; {hint}")


def unmatched(case: CaseTable, named: Named, place: Locate) -> list[Unmatched]:
    return [
        *_states(case, named, place),
        *_areas(case, named, place),
        *_signals(case, named, place),
        *_records(case, named, place),
    ]


def _states(case: CaseTable, named: Named, place: Locate) -> Iterator[Unmatched]:
    analysis = case.analysis
    groups: list[tuple[str, list[str]]] = []
    for k, mode in enumerate(analysis.modes):
        groups.append((place("analysis", "modes", k, "states"), mode.states))
        groups += [(place("analysis", "modes", k, "against"), side) for side in mode.against or ()]
    if "swing" in analysis.model_fields_set:
        groups.append((place("analysis", "swing"), analysis.swing))
    for where, patterns in groups:
        for pattern in patterns:
            if not fnmatch.filter(named.states, pattern) and not _of_foreign(named, pattern):
                yield Unmatched(
                    where,
                    f"{pattern!r}: no scenario has a state component.state of that name",
                    pattern,
                    named.states,
                    "`gfor modes --json` lists the states",
                )


def _of_foreign(named: Named, pattern: str) -> bool:
    return "." in pattern and bool(fnmatch.filter(named.foreign, pattern.partition(".")[0]))


def _areas(case: CaseTable, named: Named, place: Locate) -> Iterator[Unmatched]:
    for area, patterns in case.analysis.areas.items():
        for pattern in patterns:
            if not fnmatch.filter(named.homes, pattern):
                yield Unmatched(
                    place("analysis", "areas", area),
                    f"{pattern!r}: no scenario has such a component or bus",
                    pattern,
                    named.homes,
                    "name components, or the buses that feed them",
                )


def _records(case: CaseTable, named: Named, place: Locate) -> Iterator[Unmatched]:
    for pattern in case.solver.record:
        if (
            pattern != "*"
            and not fnmatch.filter(named.outputs, pattern)
            and not _of_foreign(named, pattern)
        ):
            yield Unmatched(
                place("solver", "record"),
                f"{pattern!r}: no scenario has such an output to record",
                pattern,
                named.outputs,
                _LISTS_OUTPUTS,
            )


def shown_signals(case: CaseTable, place: Locate) -> list[tuple[str, str]]:
    """Signals of the ring-down and of plots, each with its place."""
    entries = (
        [(place("analysis", "ring_down"), case.analysis.ring_down.signal)]
        if case.analysis.ring_down
        else []
    )
    return entries + [
        (place("plots", k, "panels", n, "signal"), signal)
        for k, plot in enumerate(case.plots)
        for n, panel in enumerate(plot.panels)
        for signal in (panel.signal, *panel.also)
    ]


def _signals(case: CaseTable, named: Named, place: Locate) -> Iterator[Unmatched]:
    for where, expression in shown_signals(case, place):
        yield from _signal(where, expression, named)


def _signal(where: str, expression: str, named: Named) -> Iterator[Unmatched]:
    try:
        names = variables_of(expression)
    except InputError as error:
        yield Unmatched(where, str(error))
        return
    for name in names:
        component = name.partition(".")[0]
        if name not in named.outputs and component not in named.foreign:
            own = [output for output in named.outputs if output.startswith(f"{component}.")]
            known = own or named.outputs
            yield Unmatched(
                where, f"no scenario has an output {name!r}", name, known, _LISTS_OUTPUTS
            )
