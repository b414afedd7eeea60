"""A POD design as a calculation sheet."""

import math
from collections.abc import Iterable, Sequence

from rich.markup import escape
from rich.table import Table

from orchestrator.cases.questions.idle_values import DAMPING_CONTROLLERS
from orchestrator.core.options import Option
from orchestrator.core.spelling import joined
from orchestrator.linear.spectra.modes import Mode, damping_ratio
from orchestrator.linear.spectra.stability import Stability
from orchestrator.output.report.mode_tables import eigenvalue_text
from orchestrator.output.report.terminal_tables import make_table
from orchestrator.studies.pod_design.design import PodDesign
from orchestrator.studies.pod_design.lead_lag import (
    LARGEST_STAGE_ANGLE,
    angle_deg,
    compensation_deg,
)
from orchestrator.studies.pod_design.margins import LARGER_GAIN, Margins
from orchestrator.studies.pod_design.refinement import GainSweep, Refinement

_MARK = "†"  # mark behind a swept gain with which the system is unstable


def sheet(d: PodDesign) -> Iterable[Table | str]:
    names = d.target.components
    components = (
        f"component {names[0]}" if len(names) == 1 else f"{len(names)} components with one setting"
    )
    yield (
        f"[bold]{DAMPING_CONTROLLERS[d.request.controller]} design by eigenvalue sensitivity[/bold]: "
        + escape(f"{d.case}, scenario {d.target.scenario}, mode {d.mode_name}, {components}")
    )
    steps = [(str(number), *row) for number, row in enumerate(_steps(d), start=1)]
    yield _table("", "", "Step", "Formula", "Result", rows=steps)
    if d.refinement:
        yield _refinement(d.refinement, d.required_damping)
        if any(s.unstable for s in d.refinement.sweeps):
            yield f"{_MARK} the system is unstable with this gain"
    yield _result(d)
    if d.margins:
        yield _margins(d.margins, d)
    elif d.stability.stable is False:
        yield "[yellow]no margins: the system is unstable with this setting[/yellow]"
    yield from (
        f"[dim]{escape(note)}[/dim]" for note in (d.refinement.notes if d.refinement else ())
    )


def first_screen(d: PodDesign, command: str) -> Iterable[Table | str]:
    """Yield the answer and the modes.

    ``command``: what shows the modes with `PodDesign.less_gain`."""
    yield f"[bold {'green' if d.met else 'red'}]{'met' if d.met else 'not met'}[/]: {escape(verdict(d))}"
    if d.less_gain is not None:
        yield escape(f"{_of_less_gain(d)}: {command}")
    table = _table("", "", f"Mode {d.mode_name}", "Least damped, 0.1 to 2 Hz", "Next", "Stable")
    for title, around, target, stability in (
        ("as it is, the controller off", d.before, d.initial, d.stability_before),
        (
            f"{DAMPING_CONTROLLERS[d.request.controller]}, {_setting(d)}",
            d.after,
            d.final.eigenvalue,
            d.stability,
        ),
    ):
        values = sorted([target, *(mode.eigenvalue for mode in around.others)], key=damping_ratio)
        least, following = (_short(value) for value in [*values, None][:2])
        stable = {True: "yes", False: "NO", None: "not known"}[stability.stable]
        table.add_row(title, _short(around.counting(target)), least, following, stable)
    yield table
    if d.other_sign:
        yield escape(d.other_sign[0].upper() + d.other_sign[1:])
    yield ""


def _short(value: complex | None) -> str:
    return (
        "–" if value is None else f"{value.imag / math.tau:.3f} Hz, {percent(damping_ratio(value))}"
    )


def _steps(d: PodDesign) -> Iterable[tuple[str, str, str]]:
    S, K, f = d.sensitivities, f"{d.request.delta_gain:g}", d.filters
    phase, N = angle_deg(S.value), d.target.stages
    omega = d.initial.imag
    yield "Target mode, POD off", "λ₀ = σ₀ ± jω₀", f"{mode_text(d.initial)}; ω₀ = {omega:.4f} rad/s"
    asked = (
        "as asked for" if d.request.damping is not None else f"ζ₀ + {percent(d.request.increment)}"
    )
    yield "Required damping", asked, f"ζ_d = {percent(d.required_damping)}"
    yield (
        "Mode aimed at",
        "λ_d = −ζ_d·ω₀ ± jω₀",
        f"{mode_text(d.predicted)}: σ is ζ_d of ω₀, not of |λ|",
    )
    yield (
        (f"Mode with K = ΔK = {K} pu", "λ_NC (the device's own lead/lag)", mode_text(S.mode))
        if d.target.has_gain_alone
        else (
            f"Mode with K = ΔK = {K} pu, no lead/lag",
            "λ_NC (T_S1 = T_S2 = 0)",
            mode_text(S.mode),
        )
    )
    yield (
        "Non-compensated sensitivity",
        "Ŝ_NC = (λ_NC − λ₀)/ΔK",
        f"{abs(S.value):.6f} rad/s per pu ∠ {phase:.2f}°",
    )
    if d.target.has_gain_alone:
        yield "Lead/lag", "fixed", "the device's own: only the gain is designed"
    elif N == 0:
        yield "Lead/lag", "N_S = 0", "none"
    else:
        kind = "lead" if phase >= 0 else "lag"
        formula = "(180° − φ_NC)/N_S" if phase >= 0 else "(180° + φ_NC)/N_S"
        each = abs(compensation_deg(phase)) / N
        beyond = (
            f"; more than {LARGEST_STAGE_ANGLE:g}°: consider more stages"
            if each > LARGEST_STAGE_ANGLE
            else ""
        )
        yield f"Angle of each of N_S = {N} stages", f"φ = {formula}, {kind}", f"{each:.2f}°{beyond}"
        ratio = "(1 − sin φ)/(1 + sin φ)" if phase >= 0 else "(1 + sin φ)/(1 − sin φ)"
        yield "Filtering ratio", f"a = {ratio}", f"{f.filtering_ratio:.4f}"
        yield (
            "Lead/lag, centred on ω₀",
            "T_S1 = 1/(ω₀√a); T_S2 = a·T_S1",
            f"T_S1 = {f.T_S1:.4f} s; T_S2 = {f.T_S2:.4f} s",
        )
    yield (
        f"Sensitivity with the lead/lag, ΔK = {K} pu",
        "Ŝ = (λ(ΔK) − λ₀)/ΔK",
        f"{abs(S.compensated):.6f} rad/s per pu ∠ {angle_deg(S.compensated):.2f}°",
    )
    used = ("", " (not used)") if not d.request.compensated_gain else (" (not used)", "")
    yield "Gain", "K = |λ_d − λ₀|/|Ŝ_NC|", f"{d.gain_non_compensated:.2f} pu{used[0]}"
    yield (
        "Gain with the lead/lag's own sensitivity",
        "K = |λ_d − λ₀|/|Ŝ|",
        f"{d.gain_compensated:.2f} pu{used[1]}",
    )
    low, high = d.request.bounds(search=False)
    bound = f"{d.active_bound} bound active" if d.active_bound else "no bound active"
    yield "Gain within its bounds", f"K ∈ [{low:g}, {high:g}] pu", f"{d.gain:.2f} pu ({bound})"
    yield (
        "Closed loop with this design",
        "eigenvalue of the coupled FMUs",
        mode_text(d.designed.eigenvalue),
    )


def _refinement(r: Refinement, required: float) -> Table:
    columns = (
        "Lead/lag",
        "T_S1 [s]",
        "T_S2 [s]",
        "Gain [pu] → least damping of all modes [%]",
        f"Best, or first with {percent(required)}: the target",
        "the least of all",
    )
    return _table("Refinement on the closed loop", *columns, rows=map(_swept, r.sweeps))


def _swept(s: GainSweep) -> tuple[str, ...]:
    gains = [p.setting.gain for p in s.points]
    marks = [_MARK * (gain in s.unstable) for gain in gains]
    each = zip(gains, s.least, marks, strict=False)
    dampings = ", ".join(f"{gain:.4g}→{100 * least:.1f}{mark}" for gain, least, mark in each)
    chosen = f"{s.chosen.setting.gain:.1f}{_MARK * (s.chosen.setting.gain in s.unstable)}"
    return (
        s.why,
        *([f"{s.filters.T_S1:.4f}", f"{s.filters.T_S2:.4f}"] if s.filters.T_S2 else ["–", "–"]),
        dampings or f"{gains[0]:g}…{gains[-1]:g} ({len(gains)})",
        f"K = {chosen} pu: {percent(s.chosen.damping_ratio)}",
        "–" if s.chosen_least is None else percent(s.chosen_least),
    )


def _result(d: PodDesign) -> Table:
    f = d.final.setting.filters
    lead = f", N_S = {d.target.stages}, T_S1 = {f.T_S1:.4f} s, T_S2 = {f.T_S2:.4f} s"
    setting = f"K = {d.final.setting.gain:.2f} pu{'' if d.target.has_gain_alone else lead}"
    rows = (
        ("Setting", "off", setting),
        (f"Target mode {d.mode_name}", mode_text(d.initial), mode_text(d.achieved)),
        ("Worst other mode, 0.1 to 2 Hz", _other(d.before.worst), _other(d.worst_other)),
        ("Largest real part of all", *map(_growth, (d.stability_before, d.stability))),
    )
    return _table("Result", "", "Without POD", "With the final setting", rows=rows)


def _margins(m: Margins, d: PodDesign) -> Table:
    gain = d.final.setting.gain
    lost = f"no eigenvalue unstable, no mode from 0.1 to 2 Hz below {percent(m.limit)}"
    up, down = f"more than × {m.reach:g}, the most tried", "down to 0"
    if m.up is not None and m.lost_up is not None:
        up = f"× {m.up:.2f} (K = {m.up * gain:.0f} pu), then {mode_text(m.lost_up)} is lost"
    if m.down is not None and m.lost_down is not None:
        down = f"× {m.down:.2f} (K = {m.down * gain:.0f} pu), then {mode_text(m.lost_down)} is lost"
    rows = [(f"Gain up, {lost}", up), ("Gain down, the same", down), *_loop_rows(m)]
    rows += [
        (f"Damping of the target with {name}, the rest as it is", percent(z))
        for name, z in m.variations.items()
    ]
    return _table("Margins of the final setting", "Quantity", "Value", rows=rows)


def _loop_rows(m: Margins) -> Iterable[tuple[str, str]]:
    if m.loop is None:
        yield "Phase and delay margin", f"not known: {m.no_loop}"
        return
    never = "no limit: the gain around the loop is 1 at no frequency"
    for name, size, hertz in (
        (
            "Phase margin, the loop broken at K",
            m.loop.phase_deg and f"{m.loop.phase_deg:.1f}°",
            m.loop.phase_hz,
        ),
        ("Delay margin", m.loop.delay and f"{1e3 * m.loop.delay:.1f} ms", m.loop.delay_hz),
        ("Largest sensitivity 1/|1 + L|", f"{m.loop.peak:.2f}", m.loop.peak_hz),
    ):
        yield name, f"{size} at {hertz:.3g} Hz" if size else never


def verdict(d: PodDesign) -> str:
    """Return the target's damping beside the required one, and what stands in the way of relying on it."""
    target = f"the target has {percent(d.achieved_damping)} of damping, {percent(d.required_damping)} are required"
    parts = [target, *_of_the_modes(d), *_of_the_margin(d), *_of_the_bounds(d)]
    return joined("; ", parts)


def remarks(d: PodDesign) -> list[str]:
    """Return the verdict without the target's damping and the margin, which a report has as figures."""
    less = [] if d.less_gain is None else [_of_less_gain(d)]
    return [*_of_the_modes(d), *_of_the_bounds(d), *less]


def _of_less_gain(d: PodDesign) -> str:
    assert d.less_gain is not None
    lead = "" if d.target.has_gain_alone else " without lead/lag"
    return (
        f"less gain has more damping: K = {d.less_gain.setting.gain:.4g} pu{lead}, where the sensitivity was taken, "
        f"gives the target {percent(d.less_gain.damping_ratio)}, and the least damped mode of all has no less either"
    )


def _of_the_modes(d: PodDesign) -> Iterable[str]:
    """Yield what became of the target and of the other modes, and which gain does it."""
    if d.after.other_named:
        yield (
            f"with this gain two modes have traded places: the one that was followed is at "
            f"{eigenvalue_text(d.final.eigenvalue)} rad/s with {percent(d.final.damping_ratio)}, the one that the case "
            f"now calls {d.mode_name} has {percent(d.after.other_named.damping_ratio)}, and the lesser counts"
        )
    least = d.before.worst
    if least is not None and least.damping_ratio < damping_ratio(d.initial):
        yield (
            f"the target, {d.mode_name}, is not the least damped mode, which has {percent(least.damping_ratio)} at "
            f"{least.frequency_hz:.3f} Hz without the controller"
        )
    if d.broken:
        yield f"but {d.broken}"
    elif d.met and (other := d.worst_other) and other.damping_ratio < d.required_damping:
        yield f"least damped of all then {percent(other.damping_ratio)} at {other.frequency_hz:.3f} Hz"
    if d.gain_is_swept:
        yield (
            f"K = {d.final.setting.gain:.4g} pu stands in the place of the equations' {d.gain:.4g} pu, with which "
            f"the target has {percent(d.designed.damping_ratio)}"
        )


def _of_the_margin(d: PodDesign) -> Iterable[str]:
    if d.damping_met and d.thin_margin is not None:
        yield (
            f"no margin: {percent(d.achieved_damping)} at K = {d.final.setting.gain:.4g} pu, and "
            f"{percent(d.thin_margin)} at {LARGER_GAIN}"
        )
    if d.met and d.spoilt:
        yield f"no margin: at {LARGER_GAIN} {d.spoilt}"


def _of_the_bounds(d: PodDesign) -> Iterable[str]:
    """Yield what the bounds of the gain did, or where the damping is short, what another setting has."""
    if not d.damping_met:
        yield _out_of_reach(d, d.refinement) if d.refinement else _other_gain(d)
    elif d.final is d.designed and d.active_bound == "lower":
        yield (
            f"the sensitivity asks for K = {d.unbounded_gain:.4g} pu, and the bounds allow no less than "
            f"{d.final.setting.gain:.4g} pu (both on the base S_n of the converter): "
            + Option.GAIN_BOUNDS
            + f" 0:{d.request.bounds(search=True)[1]:g} "
            + Option.REFINE
            + " finds the least gain that meets it"
        )


def _other_gain(d: PodDesign) -> str:
    """Return what another gain does with the design's lead/lag."""
    if d.other_gain is None:
        return "use " + Option.REFINE
    low, high = d.request.bounds(search=False)
    gain, there = f"K = {d.other_gain.setting.gain:.4g} pu", percent(d.other_gain.damping_ratio)
    if d.other_gain.damping_ratio >= d.required_damping:
        cost = f"{gain} with the same lead/lag has {there}, at the cost of another mode: use "
        return cost + Option.REFINE
    return (
        f"with this lead/lag no gain from {low:g} to {high:g} pu has more than {there}, at {gain}: see with "
        + Option.REFINE
        + " what another one does"
    )


def _out_of_reach(d: PodDesign, r: Refinement) -> str:
    """Why the sweeps show that the requirement is out of reach."""
    if not r.sweeps:
        return "the refinement could not follow the mode with any setting within the bounds"
    low, high = d.request.bounds(search=True)
    text = (
        f"no setting with K from {low:g} to {high:g} pu was found that meets it, of {len(r.sweeps)} lead/lag "
        "settings swept over the gain"
    )
    if r.even is not None:
        text += ". The setting chosen gives the best least damping of all modes that was found"
    if d.final.setting.gain == low > 0:
        text += ". The setting chosen is at the lower bound of the gain: a lower one in "
        text += Option.GAIN_BOUNDS + " may allow more"
    return text


def _setting(d: PodDesign) -> str:
    gain, f = f"K = {d.final.setting.gain:.4g} pu", d.final.setting.filters
    return (
        gain if d.target.has_gain_alone else f"{gain}, T_S1 = {f.T_S1:.4f} s, T_S2 = {f.T_S2:.4f} s"
    )


def mode_text(value: complex) -> str:
    return f"{eigenvalue_text(value)} rad/s ({value.imag / math.tau:.3f} Hz, {percent(damping_ratio(value))})"


def _growth(stability: Stability) -> str:
    rate = stability.largest_growth_rate
    return stability.verdict if rate is None else f"{rate:+.4g} 1/s"


def _other(mode: Mode | None) -> str:
    return f"{mode_text(mode.eigenvalue)}, {mode.participation[0][0]}" if mode else "none"


def percent(ratio: float) -> str:
    return f"{100 * ratio:.2f} %"


def _table(title: str, *columns: str, rows: Iterable[Sequence[str]] = ()) -> Table:
    return make_table(title, *columns, left=len(columns), rows=rows)
