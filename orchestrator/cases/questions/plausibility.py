"""Impossible data are refused, and most unusual data are questioned; both with their place in the file.

A question is a warning: the case runs. It is answered by the key ``meant`` of the case, a list of names
``component.variable`` (patterns such as ``sg*.machine.H`` fit several)."""

import fnmatch
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product

from fmus.synchronous_generator.conversion import LEAST_LEAKAGE
from orchestrator.cases.draft import Draft
from orchestrator.cases.flow.power_flow import PowerFlow
from orchestrator.cases.form.build_choices import CHOICES
from orchestrator.cases.form.names import close_names
from orchestrator.cases.form.unusual_value import UnusualValue
from orchestrator.cases.questions.dead_bands import dead_band_doubts
from orchestrator.cases.questions.plausible_networks import network_doubts
from orchestrator.cases.questions.plausible_ranges import SMALLEST_SHARE
from orchestrator.cases.questions.plausible_sources import SOLVED, source_doubts
from orchestrator.cases.questions.plausible_values import outside, place_of, unit_of, value_of
from orchestrator.cases.questions.stabiliser_gains import stabiliser_doubts
from orchestrator.core.errors import Problem, QuestionTopic, few
from orchestrator.core.question_kinds import answer
from orchestrator.devices.fmi.port_mapping import BoundDescription
from orchestrator.systems.coupling.schedule import SECOND_ORDER
from orchestrator.systems.coupling.system import ComponentPlan


@dataclass(frozen=True, slots=True)
class Rule:
    """The parameter ``larger`` must exceed ``smaller``, or at least reach it, or differ from it.

    ``needed_with``: a variable that marks the machines whose equations need the rule; at other machines a broken rule
    is a question. ``only_without``: a variable of machines that the rule is not about. ``why_not_equal``: why of two
    equal values, where that is another reason."""

    larger: str
    smaller: str
    why: str
    may_be_equal: bool = False
    needed_with: str = ""
    only_without: str = ""
    may_be_smaller: bool = False
    why_not_equal: str = ""

    def holds(self, larger: float, smaller: float) -> bool:
        if self.may_be_smaller:
            return abs(larger - smaller) > LEAST_LEAKAGE * larger
        return larger > smaller or (self.may_be_equal and larger == smaller)

    def text(self, larger: str, smaller: str, *, are_equal: bool) -> str:
        must = "must not exceed" if self.may_be_equal else "must be less than"
        must = "must differ from" if self.may_be_smaller else must
        why = self.why_not_equal if are_equal and self.why_not_equal else self.why
        return f"{smaller} {must} {larger}: {why}"


_FIELD = "what a winding screens, it takes from the reactance; a machine without a field winding is not modelled"
_SCREENS = (
    "a winding that reacts can only lower the reactance; equal says that there is no such winding"
)
_LEAKAGE = "the leakage reactance is what no rotor winding can screen"
_SINGULAR = "the windings' data divide by the difference; write a smaller machine.X_l, such as half of this one"
_SLOWER = (
    "the transient is by definition the slower one; check the units and whether the two are swapped"
)

_CONVERSION = "machine.exact_conversion"
"""Of the machines whose FMU converts the data of a data sheet and requires the order of the time constants.

GENROU and its kin hold without it: each winding has an equation with its own time constant, and X'' > X' or X_l > X''
give it a negative reactance. PSS/E only warns."""

_LIMITS = "the lower limit exceeds the upper one; are the two swapped?"
_EQUAL = "the limits are equal, so that nothing can move between them; correct one"
LIMITS = (
    ("exciter.E_MAX", "exciter.E_MIN"),
    *((f"exciter.V_{k}MAX", f"exciter.V_{k}MIN") for k in ("R", "A", "I", "M", "F")),
    *((f"governor.{q}_MAX", f"governor.{q}_MIN") for q in ("V", "P", "G")),
)
"""Limits of a machine's controls, the upper one first."""

RULES = (
    Rule("machine.X_d", "machine.X_d1", _FIELD),
    Rule("machine.X_d1", "machine.X_d2", _SCREENS, may_be_equal=True, needed_with=_CONVERSION),
    Rule("machine.X_d2", "machine.X_l", _LEAKAGE, needed_with=_CONVERSION),
    Rule("machine.X_d", "machine.X_l", _LEAKAGE),
    Rule("machine.X_q", "machine.X_l", _LEAKAGE),
    *(
        Rule(X1, "machine.X_l", _SINGULAR, only_without=_CONVERSION, may_be_smaller=True)
        for X1 in ("machine.X_d1", "machine.X_q1")
    ),
    Rule("machine.X_q", "machine.X_q1", _SCREENS, may_be_equal=True),
    Rule("machine.X_q1", "machine.X_q2", _SCREENS, may_be_equal=True),
    Rule(
        "machine.X_q1",
        "machine.X_d2",
        _SCREENS,
        may_be_equal=True,
        needed_with=_CONVERSION,
        only_without=_CONVERSION,
    ),
    Rule("machine.X_q2", "machine.X_l", _LEAKAGE),
    Rule("machine.T_d10", "machine.T_d20", _SLOWER, needed_with=_CONVERSION),
    Rule("machine.T_q10", "machine.T_q20", _SLOWER, needed_with=_CONVERSION),
    Rule(
        "machine.s_12",
        "machine.s_10",
        "saturation rises with the flux; are the two swapped?",
        may_be_equal=True,
    ),
    *(Rule(upper, lower, _LIMITS, why_not_equal=_EQUAL) for upper, lower in LIMITS),
)
"""Rules of the machines' data. The FMUs refuse the same data in any tool; here the error names the line, before any FMU
is started."""

RESISTANCES = (
    ("transformer.R_t", "transformer.X_t"),
    ("filter.R_c", "filter.X_c"),
    ("RA", "XA"),
    ("machine.X_d1", "machine.X_q1"),
    ("machine.X_q", "machine.X_d"),
)
"""Resistances and reactances, each with a larger one that it should not exceed; RA and XA are of a motor's stator."""


# apparent power [pu of the rating] above which a converter's operating point is questioned
_FULL = 1.05
_LONG = 0.01  # step of phasor models [s] above which it is questioned
_OF_PARTS = ("machine", "exciter", "governor", "pss", "oel", "uel")
"""Begins of a generator's variables; another scenario may choose a part that has one which this one's has not."""

_LEADS = (
    ("exciter.K", "exciter.T_A", "exciter.T_B"),
    ("governor.D_t", "governor.T_2", "governor.T_3"),
)
"""Of SEXS and of TGOV1: a parameter that only they have, their lead and their lag."""

_SHOWN = 3  # largest number of components that a question names; the others are counted


def check_plausibility(draft: Draft) -> None:
    broken = list(_broken_rules(draft))
    for name, rule, text in broken:
        if _is_needed(rule, draft.system.components[name]):
            draft.note(place_of(draft, name, rule.smaller, rule.larger), text)
    _check_frequencies(draft)
    _check_meant(draft)
    doubts = [*_doubts(draft), *_broken_orders(draft, broken)]
    # one question about a value is enough, and a range says more
    ranges = {doubt.name for doubt in doubts}
    draft.found.questions += _long_step(draft)
    thousands = [
        (name, text) for name, text in draft.found.thousandfold.items() if name not in ranges
    ]
    doubts += (
        UnusualValue(name, draft.places[name], text, "a thousand times the value of the file")
        for name, text in thousands
    )
    question(draft, [doubt for doubt in doubts if not _is_varied(draft.given.varied, doubt)])


def question(draft: Draft, doubts: Iterable[UnusualValue]) -> None:
    """Add questions to the draft's, without those that the case answers; equal ones become one."""
    meant = draft.given.case.meant
    open_ = [doubt for doubt in doubts if not is_meant(doubt.name, meant)]
    draft.found.questions += _merged(open_, draft.grid)


def is_meant(name: str, meant: Iterable[str]) -> bool:
    """Tell if one of the patterns that a case lists as meant confirms a variable."""
    return any(fnmatch.fnmatchcase(name, pattern) for pattern in meant)


def _is_varied(varied: Iterable[str], doubt: UnusualValue) -> bool:
    """Tell if a question is about a value that a study varies, alone or beside another."""
    component, _, variable = doubt.name.partition(".")
    for pattern, _, changed in (key.partition(".") for key in varied):
        if changed in (variable, *doubt.compared) and fnmatch.fnmatchcase(component, pattern):
            return True
    return False


def _check_meant(draft: Draft) -> None:
    """Check the entries of ``meant``. A component may exist in another scenario, where its variable is checked."""
    for pattern in draft.given.case.meant:
        component, _, variable = pattern.partition(".")
        if draft.given.whole and not fnmatch.filter(draft.known, component):
            hint = close_names(component, sorted(draft.known), "name it as [components] does")
            draft.note(
                draft.given.place("meant"),
                f"{pattern!r}: there is no component {component!r}; {hint}",
            )
        plans = [
            p for name, p in draft.system.components.items() if fnmatch.fnmatchcase(name, component)
        ]
        elsewhere = variable in (*CHOICES, SOLVED) or variable.partition(".")[0] in _OF_PARTS
        here = (v for p in plans for v in p.description.variables)
        if plans and not elsewhere and not any(fnmatch.fnmatchcase(v, variable) for v in here):
            text = f"{component} has no variable {variable!r}; `gfor fmu info` lists them"
            draft.note(draft.given.place("meant"), f"{pattern!r}: {text}")


def _doubts(draft: Draft) -> Iterator[UnusualValue]:
    for name, plan in draft.system.components.items():
        for variable in plan.description.parameters:
            wanted = plan.description.variables[variable].usual
            value = None if wanted is None else value_of(plan, variable)
            if wanted is not None and value is not None and _has_effect(plan, variable):
                scale, bases = _to_rating(draft, name, variable)
                yield from outside(draft, name, variable, value, wanted, scale=scale, bases=bases)
        for own, of_lead, of_lag in _LEADS if plan.kind == "machine" else ():
            lead, lag = value_of(plan, of_lead), value_of(plan, of_lag)
            if lead and lag and lead > 2 * lag and value_of(plan, own) is not None:
                text = f"{of_lead} = {lead:g} s, the lead, exceeds {of_lag} = {lag:g} s, the lag; are the two swapped?"
                place = place_of(draft, name, of_lead, of_lag)
                kind = f"{of_lead} above {of_lag}"
                yield UnusualValue(f"{name}.{of_lead}", place, text, kind, (of_lag,))
        for resistance, reactance in RESISTANCES:
            R, X = value_of(plan, resistance), value_of(plan, reactance)
            if R is not None and X is not None and R > 1.05 * X > 0:
                text = (
                    f"{resistance} = {R:g} pu exceeds {reactance} = {X:g} pu; are the two swapped?"
                )
                place = place_of(draft, name, resistance, reactance)
                kind = f"{resistance} above {reactance}"
                yield UnusualValue(f"{name}.{resistance}", place, text, kind, (reactance,))
    yield from _small_units(draft)
    yield from network_doubts(draft)
    yield from source_doubts(draft)
    yield from _ratings(draft)
    yield from dead_band_doubts(draft)
    yield from stabiliser_doubts(draft)


def _long_step(draft: Draft) -> Iterator[Problem]:
    """Ask about a step of the file after which phasor models exchange too late for their modes."""
    solver, grid = draft.given.case.solver, draft.tables.get(draft.grid or "")
    if (
        grid
        and "phasor" in (grid.model or "")
        and solver.step_size > _LONG
        and solver.schedule not in SECOND_ORDER
    ):
        text = f"{1e3 * solver.step_size:g} ms are long for phasor models and move modes: 1 to 5 ms are usual; is it"
        yield Problem(
            draft.given.place("solver", "step_size"),
            f"{text} meant? `gfor steps` says what a step costs",
        )


def _ratings(draft: Draft) -> Iterator[UnusualValue]:
    """Ask about bindings whose rating is not the one that the FMU itself starts with."""
    for name, plan in draft.system.components.items():
        found = plan.description
        if not isinstance(found, BoundDescription):
            continue
        for rated, said in found.unlike_delivered().items():
            text = f"the binding has {said}: is the binding's rating that of one unit as delivered?"
            place = draft.given.place("components", name, "binding")
            yield UnusualValue(f"{name}.{rated}", place, text, f"{rated} of a binding")


def question_loading(draft: Draft, flow: PowerFlow | None) -> None:
    """Ask about units whose operating point exceeds their rating, of machines in active power, and about powers that
    another rating moves. The operating point is the power flow's if there is one."""
    question(draft, [*_rescaled(draft, flow), *_beyond_load_limits(draft)])
    # one question about a rating is enough
    asked = {question.place for question in draft.found.questions}
    question(draft, (d for d in _overloaded(draft) if d.place not in asked))


def _rescaled(draft: Draft, flow: PowerFlow | None) -> Iterator[UnusualValue]:
    """Powers in parts of a rating from outside, where nothing from there says the power too."""
    said = [key for key in draft.given.from_outside if key.endswith(".P_0")]
    for name, before in draft.found.ratings.items():
        plan = draft.system.components[name]
        P, S_n = value_of(plan, "P_0"), value_of(plan, "S_n")
        if (
            flow is None
            or name not in flow.powers
            or name in flow.balancing
            or not P
            or not S_n
            or S_n == before
        ):
            continue
        if unit_of(plan, "P_0") == "pu" and not any(
            fnmatch.fnmatchcase(f"{name}.P_0", key) for key in said
        ):
            text = (
                f"S_n = {S_n:g} MVA where the file has {before:g} MVA moves its power from {P * before:.4g} to "
                f"{P * S_n:.4g} MW, which {flow.slack}, the slack, takes up: P_0 = {P:.4g} is in parts of S_n"
            )
            text += (
                f", and {name}.P_0={P * before / S_n:.4g} keeps the power"
                if abs(P * before) <= S_n
                else ""
            )
            kind = "a rating that moves a power"
            yield UnusualValue(f"{name}.S_n", place_of(draft, name, "S_n"), text, kind)


_LOAD_LIMITS = ("governor.ld_ref", "governor.A_T")
"""Loads that limiters of turbines hold: of GGOV1 and GAST."""


def _beyond_load_limits(draft: Draft) -> Iterator[UnusualValue]:
    """Ask about turbines whose operating point lies at the load that their limiter holds, or above."""
    for (name, plan), limit in product(draft.system.components.items(), _LOAD_LIMITS):
        held, P_m = value_of(plan, limit), _mechanical_power(plan)
        if held is None or P_m is None or P_m < held:
            continue
        text = (
            f"{limit} = {held:g} pu, the load that the turbine's limiter holds, is not above the operating "
            f"point's {P_m:.4g} pu; the limiter holds a load just above that instead, and the turbine gives no more"
        )
        kind = f"{limit} below the operating point"
        yield UnusualValue(f"{name}.{limit}", place_of(draft, name, limit), text, kind)


def _mechanical_power(plan: ComponentPlan) -> float | None:
    """Return the power of a machine's turbine at the operating point, on the turbine's rating [pu]."""
    P, Q, v, S_n = (value_of(plan, name) for name in ("P_0", "Q_0", "v_0", "S_n"))
    if P is None or Q is None or not v or not S_n:
        return None
    R_s, R_t = (value_of(plan, name) or 0.0 for name in ("machine.R_s", "transformer.R_t"))
    R = R_s * S_n / (value_of(plan, "machine.S_data") or S_n) + R_t
    return (P + R * (P**2 + Q**2) / v**2) * S_n / (value_of(plan, "governor.T_rate") or S_n)


def overloads(
    plans: Mapping[str, ComponentPlan],
    meant: Iterable[str],
    ratings: Mapping[str, float] | None = None,
) -> dict[str, float]:
    """Units whose operating point exceeds their rating, with what it asks for [pu of the rating].

    ``ratings``: likely ratings [MVA] of units whose S_n is only the base of their data."""
    found = {}
    for name, plan in plans.items():
        P, Q, S_n = (value_of(plan, v) for v in ("P_0", "Q_0", "S_n"))
        if (
            P is None
            or Q is None
            or S_n is None
            or any(unit_of(plan, v) != "pu" for v in ("P_0", "Q_0"))
        ):
            continue
        apparent = abs(P) if plan.kind == "machine" else math.hypot(P, Q)
        apparent *= S_n / (ratings or {}).get(name, S_n)
        if apparent > _FULL and not is_meant(f"{name}.S_n", meant):
            found[name] = apparent
    return found


def _overloaded(draft: Draft) -> Iterator[UnusualValue]:
    for name, apparent in overloads(
        draft.system.components, draft.given.case.meant, draft.base_ratings
    ).items():
        plan = draft.system.components[name]
        P, Q, S_n = (value_of(plan, v) for v in ("P_0", "Q_0", "S_n"))
        text = (
            f"the operating point, P_0 = {P:.4g} pu and Q_0 = {Q:.4g} pu, asks for {apparent:.3g} pu of "
            f"S_n = {S_n:g} MVA, more than the rating of the {plan.kind}"
        )
        kind = f"a {plan.kind} above its rating"
        yield UnusualValue(f"{name}.S_n", place_of(draft, name, "S_n"), text, kind)


# -- one value ---------------------------------------------------------------------------------------


_OF_RATING = ("governor.V_M", "governor.P_M", "governor.G_M", "governor.K", "governor.D_t")
"""Begins of variables that shrink as a base grows: limits, gains and damping of turbines."""


def _to_rating(draft: Draft, name: str, variable: str) -> tuple[float, tuple[str, str]]:
    """The factor from the base of a machine's data to its rating, and the names of both; otherwise 1.

    The base is ``machine.S_data``, or S_n where that is only the base."""
    plan = draft.system.components[name]
    S_data, S_n = value_of(plan, "machine.S_data"), value_of(plan, "S_n")
    likely = draft.origins[name].rating_mva if name in draft.origins else None
    if likely is not None and S_n and variable.startswith(_OF_RATING):
        return S_n / likely, ("S_n", "the likely rating")
    known = [(S_data, "machine.S_data"), (S_n, "S_n"), (likely, "the likely rating")]
    bases = [(size, word) for size, word in known if size]
    if len(bases) < 2:
        return 1.0, ("", "")
    (smaller, first), (larger, last) = bases[0], bases[-1]
    if variable == "machine.H":
        return smaller / larger, (first, last)
    impedance = variable in ("machine.R_s", "governor.R") or variable.startswith("machine.X_")
    return (larger / smaller if impedance else 1.0), (first, last)


_OF_WINDINGS = {
    "machine.T_d20": ("machine.X_d1", "machine.X_d2"),
    "machine.T_q20": ("machine.X_q1", "machine.X_q2"),
}
"""Time constants of a winding that is missing where two reactances are equal."""


def _has_effect(plan: ComponentPlan, variable: str) -> bool:
    """Return whether a value is one of a machine: an infinite bus has a small reactance on purpose."""
    if variable == "machine.X_d1" and value_of(plan, "machine.H") == 0:
        return False
    winding = _OF_WINDINGS.get(variable)
    return winding is None or not _is_missing(plan, *winding)


def _is_missing(plan: ComponentPlan, transient: str, subtransient: str) -> bool:
    """Return whether X'' = X' says that an axis has no damper winding; X''_d is X''_q where there is one for both."""
    known = plan.description.variables
    X1 = value_of(plan, transient)
    X2 = value_of(plan, subtransient if subtransient in known else "machine.X_d2")
    return X1 is not None and X1 == X2


def _broken_rules(draft: Draft) -> Iterator[tuple[str, Rule, str]]:
    """Yield the component, the rule that its data break, and both values in words."""
    for name, plan in draft.system.components.items():
        for rule in RULES:
            if _breaks(plan, rule):
                both = (rule.larger, rule.smaller)
                are_equal = value_of(plan, rule.larger) == value_of(plan, rule.smaller)
                values = (_value_text(plan, v) for v in both)
                yield name, rule, rule.text(*values, are_equal=are_equal)


def _breaks(plan: ComponentPlan, rule: Rule) -> bool:
    larger, smaller = value_of(plan, rule.larger), value_of(plan, rule.smaller)
    if larger is None or smaller is None or rule.holds(larger, smaller):
        return False
    if rule.only_without and rule.only_without in plan.description.variables:
        return False
    winding = _OF_WINDINGS.get(rule.smaller)
    return winding is None or not _is_missing(plan, *winding)


def _is_needed(rule: Rule, plan: ComponentPlan) -> bool:
    return not rule.needed_with or rule.needed_with in plan.description.variables


def _value_text(plan: ComponentPlan, variable: str) -> str:
    unit = f" {unit_of(plan, variable)}".removesuffix(" 1")
    default = "" if variable in plan.parameters else " (the default)"
    return f"{variable} = {value_of(plan, variable):g}{unit}{default}"


def _broken_orders(draft: Draft, broken: Iterable[tuple[str, Rule, str]]) -> Iterator[UnusualValue]:
    """Ask about rules that are broken at machines whose equations hold without them."""
    broken = [*broken]
    refused = {
        (name, rule.smaller)
        for name, rule, _ in broken
        if _is_needed(rule, draft.system.components[name])
    }
    for name, rule, text in broken:
        asked = not _is_needed(rule, draft.system.components[name])
        if asked and (name, rule.smaller) not in refused:
            place = place_of(draft, name, rule.smaller, rule.larger)
            warned = f"{text}; PSS/E only warns, and the equations hold with it"
            kind = f"{rule.smaller} not below {rule.larger}"
            yield UnusualValue(f"{name}.{rule.smaller}", place, warned, kind, (rule.larger,))


# -- several components ------------------------------------------------------------------------------


def _check_frequencies(draft: Draft) -> None:
    """Check that coupled components have one rated frequency: frames of two frequencies turn against each other."""
    fs = {
        n: p.description.port.f_n
        if isinstance(p.description, BoundDescription)
        else value_of(p, "f_n")
        for n, p in draft.system.components.items()
    }
    rated = {name: f for name, f in fs.items() if f is not None}
    for group in _coupled(draft):
        known = {name: f for name, f in rated.items() if name in group}
        if len(set(known.values())) < 2:
            continue
        grid = draft.grid if draft.grid in known else None
        common = known[grid] if grid else max(set(known.values()), key=list(known.values()).count)
        reference = grid or next(name for name, f in known.items() if f == common)
        for name, f in known.items():
            if f != common and not any(
                p.place == _frequency_place(draft, name) for p in draft.found.problems
            ):
                draft.note(
                    _frequency_place(draft, name),
                    f"{name} is rated at {f:g} Hz and {reference} at {common:g} Hz; what is coupled has one rated "
                    f"frequency, because voltages and currents are exchanged in one frame: give both the same f_n "
                    f"(a whole [network] has a key 'frequency', a binding has rating.f_n)",
                )


def _frequency_place(draft: Draft, name: str) -> str:
    if isinstance(draft.system.components[name].description, BoundDescription):
        return draft.given.place("components", name, "binding")
    return place_of(draft, name, "f_n")


def _coupled(draft: Draft) -> list[set[str]]:
    """Components that are connected, directly or through others."""
    groups = [{name} for name in draft.system.components]
    wires = (
        frozenset((c.source.component, c.target.component))
        for c in reversed(draft.system.connections)
    )
    for ends in reversed(
        dict.fromkeys(wires)
    ):  # the last wire between two decides where their group stands
        touched = [group for group in groups if group & ends]
        groups = [group for group in groups if not group & ends] + [set().union(*touched)]
    return groups


def _small_units(draft: Draft) -> Iterator[UnusualValue]:
    """Ask about units in the power flow with a rating too small to affect the network."""
    ports = {p.name: p.bus for p in draft.network.ports} if draft.network else {}
    plans = {
        name: plan
        for name, plan in draft.system.components.items()
        if name in ports and plan.kind != "load"
    }
    ratings = {
        name: S_n for name, plan in plans.items() if (S_n := value_of(plan, "S_n")) is not None
    }
    if not ratings:
        return
    largest = max(ratings, key=lambda name: ratings[name])
    for name, S_n in ratings.items():
        shared = (
            [n for n in draft.origins if n in ratings and ports[n] == ports[name]]
            if name in draft.origins
            else []
        )
        # the share of a unit may be arbitrarily small
        whole = sum(ratings[n] for n in shared) if shared else S_n
        if whole < SMALLEST_SHARE * ratings[largest]:
            text = f"S_n = {S_n:g} MVA beside {largest}'s {ratings[largest]:g} MVA; is it in MVA?"
            kind = "a small rating"
            yield UnusualValue(f"{name}.S_n", place_of(draft, name, "S_n"), text, kind)


# -- questions ---------------------------------------------------------------------------------------


def _merged(doubts: list[UnusualValue], grid: str | None) -> list[Problem]:
    """Merge equal questions about several components into one, and add how to answer it.

    ``grid``: the component whose lines and loads are elements of their own."""
    groups: dict[tuple[str, str, str], list[str]] = {}
    for doubt in doubts:
        groups.setdefault((doubt.place, doubt.text, doubt.kind), []).append(doubt.name)
    questions = []
    for (place, text, kind), names in groups.items():
        component, _, variable = names[0].partition(".")
        about = variable.partition(".")[0] if component == grid else component
        answers = names if len(names) <= _SHOWN else [f"*.{variable}"]
        topic = QuestionTopic(kind, about, tuple(answers))
        questions.append(Problem(place, _question(text, names, answers), topic=topic))
    return questions


def _question(text: str, names: list[str], answers: list[str]) -> str:
    asked = f"{few((name.partition('.')[0] for name in names), _SHOWN)}: {text}"
    return f"{asked}; if it is meant, say so at the top of the case: {answer(answers)}"
