"""Statements of a case file that stand twice, concern nothing, or contradict each other, in any scenario."""

from collections.abc import Callable, Iterable, Iterator
from itertools import permutations

from orchestrator.cases.form.build_choices import STAND_IN
from orchestrator.cases.form.names import close_names
from orchestrator.cases.form.schema import CaseTable, ComponentTable
from orchestrator.cases.form.values import TWICE, flatten, given_twice
from orchestrator.core.errors import Problem, QuestionTopic
from orchestrator.core.units import to_unit

Locate = Callable[..., str]


def contradictions(case: CaseTable, place: Locate) -> list[Problem]:
    return [
        *_modes(case, place),
        *_references(case, place),
        *_plots(case, place),
        *_buses(case, place),
        *_units(case, place),
    ]


def _modes(case: CaseTable, place: Locate) -> Iterator[Problem]:
    for k, mode in enumerate(case.analysis.modes):
        where = place("analysis", "modes", k)
        if bool(mode.states) == (mode.against is not None):
            given = "both" if mode.states else "neither"
            text = f"mode {mode.name!r} has {given} of 'states' and 'against'; give one of them, which tells its shape"
            yield Problem(where, text)
        if mode.against is not None and not all(mode.against):
            yield Problem(
                where,
                f"mode {mode.name!r}: a side of 'against' is empty; name the states on both sides",
            )
    for name, k in _again([mode.name for mode in case.analysis.modes]):
        yield Problem(
            place("analysis", "modes", k),
            f"two modes are called {name!r}; give each a name of its own",
        )


def _references(case: CaseTable, place: Locate) -> Iterator[Problem]:
    if case.reference is None:
        return
    scenarios = list(case.scenarios) or [case.name]
    modes = [mode.name for mode in case.analysis.modes]
    for scenario, figures in case.reference.modes.items():
        where = place("reference", "modes", scenario)
        if scenario not in scenarios:
            hint = close_names(scenario, scenarios, f"the case has: {', '.join(scenarios)}")
            yield Problem(
                where,
                f"there is no scenario {scenario!r} that the figures could stand beside; {hint}",
            )
        for name in figures:
            if name not in modes:
                known = (
                    f"[analysis] has: {', '.join(modes)}" if modes else "[analysis] names no mode"
                )
                hint = close_names(name, modes, known)
                text = f"there is no mode {name!r} that the figures could stand beside; {hint}"
                yield Problem(place("reference", "modes", scenario, name), text)


def _plots(case: CaseTable, place: Locate) -> Iterator[Problem]:
    for k, plot in enumerate(case.plots):
        if not plot.panels:
            yield Problem(place("plots", k, "panels"), f"plot {plot.name!r} has no panels; add one")
        for n, panel in enumerate(plot.panels):
            if panel.scale == 0:
                text = f"scale = 0 draws {panel.signal!r} as 0 whatever it is; give another factor, or leave it out"
                yield Problem(place("plots", k, "panels", n, "scale"), text)
    for name, k in _again([plot.name for plot in case.plots]):
        text = f"two plots are called {name!r}, and the later one would replace the file of the other; rename one"
        yield Problem(place("plots", k), text)


def _buses(case: CaseTable, place: Locate) -> Iterator[Problem]:
    for name, _ in _again(case.network.buses if case.network else []):
        yield Problem(place("network", "buses"), f"the bus {name!r} is listed twice; list it once")


def _units(case: CaseTable, place: Locate) -> Iterator[Problem]:
    for key in ("generator_parameters", "converter_parameters") if case.units else ():
        for name in given_twice(flatten(getattr(case.units, key))):
            yield Problem(place("units", key, name), f"{name}: {TWICE}")


def _again(names: Iterable[str]) -> Iterator[tuple[str, int]]:
    seen: set[str] = set()
    for k, name in enumerate(names):
        if name in seen:
            yield name, k
        seen.add(name)


def _stand_ins(case: CaseTable, place: Locate) -> Iterator[Problem]:
    """Devices and what stands for them without dynamics in other scenarios, where their powers differ."""
    fed = {
        name: power
        for name, table in case.components.items()
        if (power := _power(table)) is not None
    }
    stills = [name for name in fed if (case.components[name].model or "").startswith(STAND_IN)]
    for name, other in permutations(fed, 2):
        device, still = case.components[name], case.components[other]
        apart = all({name, other} & set(scenario.remove) for scenario in case.scenarios.values())
        beside = [one for one in stills if case.components[one].bus == device.bus]
        if (
            other in stills
            and name not in stills
            and device.bus == still.bus
            and apart
            and (len(beside) == 1 or _is_named_alike(name, other))
            and fed[name] != fed[other]
        ):
            text = f"{name} feeds {fed[name]:.4g} MW, and {other}, which stands for it, {fed[other]:.4g} MW"
            topic = QuestionTopic("a stand-in with another power", other)
            remedy = "give both the same S_n and P_0"
            yield Problem(place("components", other), f"{text}: {remedy}", topic=topic)


def _is_named_alike(device: str, still: str) -> bool:
    """Compare what follows the first words of two names, as in gfor_13_2 and injection_13_2."""
    return device.partition("_")[2] == still.partition("_")[2]


def _power(table: ComponentTable) -> float | None:
    S_n, P = (table.parameters.get(key, "") for key in ("S_n", "P_0"))
    try:
        return float(f"{to_unit(S_n, 'MVA') * to_unit(P, 'pu'):.3g}") if table.bus else None
    except (TypeError, ValueError):
        return None


def doubts(case: CaseTable, place: Locate) -> list[Problem]:
    ring = case.analysis.ring_down
    found = [*_stand_ins(case, place)]
    if ring is not None and not case.analysis.modes:
        text = "no mode is looked for in the ring-down, because [analysis] names none; add 'modes', or remove it"
        found.append(Problem(place("analysis", "ring_down"), text))
    if ring is not None and ring.start >= case.solver.stop_time:
        text = f"no ring-down is shown: it starts at {ring.start:g} s, and runs stop at {case.solver.stop_time:g} s"
        found.append(Problem(place("analysis", "ring_down"), text))
    return found
