"""Values of a network's source that are most unusual beside its own other data."""

from collections.abc import Iterator, Sequence
from itertools import combinations

from fmus.grid.network import Line
from orchestrator.cases.draft import Draft
from orchestrator.cases.form.unusual_value import UnusualValue
from orchestrator.cases.questions.plausible_loads import load_doubts
from orchestrator.cases.questions.plausible_values import (
    place_of,
    place_of_source,
    unit_of,
    value_of,
)
from orchestrator.systems.coupling.system import ComponentPlan

SOLVED = "solved"  # of the grid, in ``meant``: the source's voltages are a flat start on purpose
# usual reactances of step-up transformers on the machine's rating [pu], widened
_STEP_UP = (0.03, 0.35)
_PARTS = {
    "machine": "machine",
    "exciter": "exciter",
    "governor": "governor",
    "pss": "stabilizer",
    "oel": "oel",
    "uel": "uel",
}
_SHOWN = 3  # machines beyond which one is compared with the others
_LITTLE = 0.05  # loading below which it is questioned [pu]
_SAME = 0.05  # part by which two powers may differ
_ROUNDING = 1e-3  # part of the converters' power by which six digits of P_0 differ at most
_NO_DIFFERENCE = 0.1  # of the file's units [MW]: the rounding of their powers, beside which converters may feed 0
_COMPARED = 8  # converters from which on chance would make some of them fit
_ALIKE = 2.0  # factor within which machines are alike
_UNLIKE = 5.0  # factor from which a machine is unlike the others
_FAR = 20.0  # times the least usual reactance from which on a step-up transformer is questioned


def source_doubts(draft: Draft) -> Iterator[UnusualValue]:
    """Ask about a flat start, loads, step-up transformers, saturation, and units unlike the others."""
    grid = draft.system.components.get(draft.grid or "")
    if (
        grid is None
        or draft.network is None
        or draft.data is None
        or draft.grid is None
        or draft.given.case.network is None
    ):
        return
    where = place_of_source(draft)
    if draft.data.misfit:
        yield UnusualValue(f"{draft.grid}.{SOLVED}", where, draft.data.misfit, "a flat start")
    yield from load_doubts(draft, draft.grid, where)
    yield from _step_up(draft, draft.grid, grid, where)
    yield from _saturation(draft)
    yield from _own_converters(draft)
    yield from _unlike_others(draft)


def _step_up(draft: Draft, name: str, grid: ComponentPlan, where: str) -> Iterator[UnusualValue]:
    """A bus with machines and one branch without charging in a file: the branch is their step-up transformer."""
    written = draft.given.case.network.lines if draft.given.case.network else {}
    if draft.network is None:
        return
    ratings: dict[str, float] = {}
    for port in draft.network.ports:
        plan = draft.system.components.get(port.name)
        S_n = None if plan is None or plan.kind == "load" else value_of(plan, "S_n")
        if S_n is not None:
            ratings[port.bus] = ratings.get(port.bus, 0.0) + S_n
    low, high = _STEP_UP
    at_bus: dict[str, list[Line]] = {bus: [] for bus in ratings}
    for line in draft.network.lines:
        for bus in {line.from_bus, line.to_bus} & at_bus.keys():
            at_bus[bus].append(line)
    with_three = {bus for x in draft.network.transformers for bus in x.buses}
    for bus, rating in ratings.items():
        branches = at_bus[bus]
        if len(branches) != 1 or branches[0].B or branches[0].name in written or bus in with_three:
            continue
        variable = branches[0].variable("X")
        X = value_of(grid, variable)
        own = 0.0 if X is None else X * rating / 100  # on the machines' rating [pu]
        low_side = own < low <= own * rating / 100 <= high
        if X is not None and (low_side or (own > high and (low <= X <= high or own > _FAR * low))):
            meant = (
                f"if {X:g} pu is on the machine's base, it is {100 * X / rating:.4g} pu on 100 MVA"
            )
            if low_side:
                meant = f"if {own:.3g} pu is on 100 MVA, CZ = 1 says so"
            elif not low <= X <= high and own < 100 * low:
                meant = f"is the machine's rating {rating / 10:g} MVA?"
            elif own >= 100 * low:
                meant = f"is it in percent? {own / 100:.3g} pu would be usual, {X / 100:.4g} pu on 100 MVA"
            text = (
                f"{variable} = {X:g} pu on 100 MVA is {own:.3g} pu on the {rating:g} MVA behind it, and "
                f"step-up transformers have {low:g} to {high:g} pu there; {meant}"
            )
            place = draft.places.get(f"{name}.{variable}", f"{where}, {branches[0].name}")
            yield UnusualValue(f"{name}.{variable}", place, text, "an unusual step-up transformer")


def _saturation(draft: Draft) -> Iterator[UnusualValue]:
    """Machines of records that do not saturate where most others do."""
    known = {}
    for name in draft.origins:
        plan = draft.system.components.get(name)
        s_10 = None if plan is None else value_of(plan, "machine.s_10")
        if plan is not None and s_10 is not None:
            known[name] = max(s_10, value_of(plan, "machine.s_12") or 0.0)
    without = [name for name, saturation in known.items() if saturation == 0]
    if len(known) - len(without) < 2 or 2 * len(without) > len(known):
        return
    text = (
        f"the saturation is 0, where {len(known) - len(without)} of {len(known)} machines saturate; give S(1.0) and "
        "S(1.2)"
    )
    where = draft.given.place("units")
    kind = "no saturation"
    yield from (UnusualValue(f"{name}.machine.s_10", where, text, kind) for name in without)


def _unlike_others(draft: Draft) -> Iterator[UnusualValue]:
    """Values of a machine's records that are far from those of all others, which are alike."""
    found: dict[tuple[str, str | None], dict[str, float]] = {}
    for name, origin in draft.origins.items():
        plan = draft.system.components.get(name)
        if plan is None:
            continue
        for variable in origin.lines:
            value = value_of(plan, variable)
            if value is not None and value > 0:
                usual = plan.description.variables[variable].usual
                part = getattr(draft.tables[name], _PARTS.get(variable.partition(".")[0], ""), None)
                if usual is None or usual.fits(value):  # else its range asks
                    found.setdefault((variable, part), {})[name] = value
    for (variable, _), values in found.items():
        for name, value in values.items() if len(values) > _SHOWN else ():
            others = [other for machine, other in values.items() if machine != name]
            low, high = min(others), max(others)
            if high <= _ALIKE * low and (value > _UNLIKE * high or value < low / _UNLIKE):
                beside = f"the {len(others)} other machines have {low:g} to {high:g}"
                text = f"{variable} = {value:g}, where {beside}: is it so?"
                place, kind = place_of(draft, name, variable), f"{variable} unlike the others"
                yield UnusualValue(f"{name}.{variable}", place, text, kind)


def _own_converters(draft: Draft) -> Iterator[UnusualValue]:
    """Converters of the case in another program's network: their power beside their rating, and beside what the file's
    units feed less than in the file. Values from outside are tried on purpose.

    A source that stands in for a converter, as in systems of `gfor interactions`, feeds as well."""
    if draft.network is None or draft.data is None or not draft.data.generation:
        return
    own, beside = dict[str, float](), 0.0
    left = {bus: g.p_mw for bus, g in draft.data.generation.items() if bus != draft.data.slack}
    for port in draft.network.ports:
        plan = draft.system.components.get(port.name)
        P, S_n = (value_of(plan, v) if plan else None for v in ("P_0", "S_n"))
        if plan is None or P is None or S_n is None or unit_of(plan, "P_0") != "pu":
            continue
        if port.name in draft.origins:
            if port.bus in left:
                left[port.bus] -= P * S_n
        elif (
            plan.kind == "converter"
            and "P_0" in plan.parameters
            and f"{port.name}.P_0" not in draft.given.from_outside
        ):
            own[port.name] = P * S_n
            place = place_of(draft, port.name, "P_0")
            if P < 0 or 0 < P < _LITTLE:
                said = (
                    f"draws {-P * S_n:g} MW"
                    if P < 0
                    else f"feeds {P * S_n:g} MW with S_n = {S_n:g} MVA"
                )
                kind = "a converter that draws power" if P < 0 else "a converter with little power"
                text = f"P_0 = {P:g} pu: it {said}; is it so?"
                compared = () if P < 0 else ("S_n",)
                yield UnusualValue(f"{port.name}.P_0", place, text, kind, compared)
        elif plan.kind != "converter":
            beside += P * S_n
    less, fed = sum(left.values()), sum(own.values()) + beside
    if (
        own
        and not draft.given.from_outside
        and abs(less) > max(_SAME * abs(fed), _NO_DIFFERENCE)
        and abs(fed - less) > _SAME * abs(fed)
        and not _is_of_some(less, [*own.values()])
    ):
        text = (
            f"with P_0 and S_n the case's converters feed {fed:.4g} MW, and the file's units {less:.4g} MW less than "
            "in the file; the slack takes the difference: is one of them wrong?"
        )
        kind = "the power of the case's converters"
        for name in own:
            yield UnusualValue(f"{name}.P_0", place_of(draft, name, "P_0"), text, kind)


def _is_of_some(less: float, powers: Sequence[float]) -> bool:
    """Tell whether some of the converters feed just what the units feed less [MW]; the slack makes room for the others,
    as ``gfor new`` writes it for one that names the slack or no unit."""
    if len(powers) > _COMPARED:
        return False
    groups = (group for n in range(1, len(powers)) for group in combinations(powers, n))
    return any(abs(sum(group) - less) <= _ROUNDING * abs(sum(powers)) for group in groups)
