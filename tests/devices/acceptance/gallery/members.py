"""The members of the gallery: good FMUs of several kinds, and faulty ones, each with the name of its fault."""

import re
from dataclasses import dataclass, replace
from functools import cache
from math import sqrt

from tests.devices.acceptance.gallery.build import Source, Variable

FORMS = {
    # form -> (macro, empty where it is the usual one, (names, unit) of the voltage, of the current)
    "rectangular": ("", ("v_re", "v_im"), ("i_re", "i_im")),
    "polar": ("PORT_POLAR", ("V_mag", "V_ang"), ("I_mag", "I_ang")),
    "abc": ("PORT_ABC", ("va", "vb", "vc"), ("ia", "ib", "ic")),
    "qd": ("PORT_QD", ("vq", "vd"), ("iq", "id")),
    "power": ("PORT_POWER", ("u_re", "u_im"), ("P", "Q")),
}


@dataclass(frozen=True)
class Member:
    """One FMU of the gallery.

    Attributes
    ----------
    fault
        Its name, as `gfor fmu check` gives it; empty for a good one.
    binding
        Text of its binding; None for an FMU that has none.
    thread
        Where somebody reported that fault of an exporter, as ``owner/repository#number``.
    only
        Checks to ask; all of them where empty.
    """

    source: Source
    fault: str = ""
    binding: str | None = None
    thread: str = ""
    only: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return self.source.name


def converter(
    name,
    form="rectangular",
    *,
    units=None,
    depends=(),
    state=True,
    step_size="1e-4",
    stop_time="1",
    omega=("omega", "pu"),
    switch=False,
    shown=None,
    pod=False,
    **defines,
):
    """The converter of converter.c; ``units`` are those of voltage, current, power."""
    macro, inputs, outputs = FORMS[form]
    v_unit, i_unit, p_unit = units or ("pu", "pu", "pu")
    # The macros that scale its units, as numbers, for the start values that are declared.
    v, p = float(eval(str(defines.get("V_UNIT", 1)))), float(eval(str(defines.get("P_UNIT", 1))))
    rating = float(defines.get("RATING", 1500.0))
    starts = [v, -v / 2, -v / 2] if form == "abc" else [v, 0.0]
    parameters = [
        ("S_n", rating, "MVA"),
        ("P_0", 0.5 * p, p_unit),
        ("Q_0", 0.0, "Mvar" if p_unit == "MW" else p_unit),
        ("v_0", v, v_unit),
        ("theta_0", 0.0, "rad"),
    ]
    variables = [
        Variable(n, r, "parameter", s, u, variability="fixed")
        for r, (n, s, u) in enumerate(parameters)
    ]
    variables += [
        Variable(
            "R_f", 5, "parameter", float(defines.get("DROOP", 0.02)), "pu", variability="tunable"
        ),
        Variable("tau", 6, "parameter", 0.1, "s", variability="fixed"),
    ]
    angle = form == "polar"
    variables += [
        Variable(n, 7 + k, "input", s, "rad" if angle and k else v_unit)
        for k, (n, s) in enumerate(zip(inputs, starts, strict=True))
    ]
    if form == "power":
        i_units = [p_unit, "Mvar" if p_unit == "MW" else p_unit]
        depends = inputs
    else:
        i_units = [i_unit, "rad" if angle else i_unit, i_unit]
    variables += [
        Variable(n, 10 + k, "output", None, i_units[k], depends=depends)
        for k, n in enumerate(outputs)
    ]
    variables += [Variable(omega[0], 13, "output", None, omega[1])]
    if shown:  # name and unit of an output of active power
        variables += [Variable(shown[0], 14, "output", None, shown[1], depends=inputs)]
    if switch:
        variables += [
            Variable("damping", 0, "parameter", 0, "", variability="tunable", type="Boolean")
        ]
    if pod:
        variables += DAMPING_CONTROLLER
        defines = {"POD": 1, "INTERNAL": POD_STEP, **defines}
        step_size = POD_STEP
    return Source(
        name,
        "converter.c",
        {**({macro: 1} if macro else {}), **defines},
        tuple(variables),
        step_size,
        stop_time,
        state,
    )


POD_STEP = "5e-4"
"""Communication and internal step [s] of one with a damping controller, which is watched for minutes."""

DAMPING_CONTROLLER = (
    Variable("pod_p.enabled", 0, "parameter", 0, "", variability="tunable", type="Boolean"),
    Variable("pod_p.K", 15, "parameter", 40.0, "pu", variability="tunable"),
    Variable("pod_p.T_W", 16, "parameter", 3.0, "s", variability="tunable"),
    Variable("pod_p.T_f", 17, "parameter", 0.05, "s", variability="tunable"),
    Variable("pod_p.limit", 18, "parameter", 0.1, "pu", variability="tunable"),
    Variable("delta_p_pod", 19, "output", None, "pu"),
)

START = "\n".join(f'[start.{n}]\nvariable = "{n}"' for n in ("P_0", "Q_0", "v_0", "theta_0"))


def binding(form, *, rating=1500, voltage="", current="", start=START):
    _, inputs, outputs = FORMS[form]
    shape = "rectangular" if form == "power" else form
    lines = [
        "[rating]",
        f'S_n = "{rating} MVA"',
        'V_n = "230 kV"',
        "[voltage]",
        f'form = "{shape}"',
        f"variables = {list(inputs)}",
        voltage,
        "[current]",
        f'form = "{form}"',
        f"variables = {list(outputs)}",
        current,
        start,
    ]
    return "\n".join(lines) + "\n"


def small(name, model, variables, **options):
    defines = options.pop("defines", {})
    return Source(name, "small.c", {f"MODEL_{model}": 1, **defines}, tuple(variables), **options)


DAHLQUIST = (
    Variable("x", 0, "output", unit="1"),
    Variable("k", 1, "parameter", 1, "1", variability="tunable"),
)
SWING = (Variable("x", 0, "output", unit="1"), Variable("v", 1, "output", unit="1"))
VAN_DER_POL = (*SWING, Variable("mu", 2, "parameter", 1, "1", variability="fixed"))
BALL = (*SWING, Variable("e", 2, "parameter", 0.7, "1", variability="tunable"))
GAIN = (
    Variable("u", 0, "input", 0, "1"),
    Variable("y", 1, "output", unit="1", depends=("u",)),
    Variable("k", 2, "parameter", 2, "1", variability="tunable"),
)
LAG = (
    Variable("u", 0, "input", 0, "1"),
    Variable("y", 1, "output", unit="1", depends=("u",)),
    Variable("d", 2, "parameter", 0.5, "1", variability="tunable"),
    Variable("T", 3, "parameter", 0.05, "s", variability="fixed"),
)

OPEN_LAG = (
    *LAG,
    Variable("x", 4, "local", unit="1"),
    Variable("der(x)", 5, "local", unit="", rate_of="x"),
    Variable("trail", 6, "local", unit="1"),
    Variable("der(trail)", 7, "local", unit="", rate_of="trail"),
)

TANK = (
    Variable("level", 0, "output", unit="1"),
    Variable("relay", 1, "output", unit="1", variability="discrete"),
    Variable("q", 2, "parameter", 1, "1", variability="fixed"),
    Variable("steps", 3, "output", unit="1"),
)

SI = {
    "V_UNIT": "(230.0 * sqrt(2.0 / 3.0))",
    "I_UNIT": "(RATING / (230.0 * sqrt(3.0)) * sqrt(2.0))",
    "P_UNIT": "RATING",
}
V_PEAK = {**SI, "V_UNIT": repr(230.0 * sqrt(2 / 3)), "P_UNIT": repr(1500.0)}


def _si(form):
    value = "" if form == "abc" else 'value = "phase peak"'
    current = "" if form == "abc" else 'value = "peak"'
    return value, current


def device(name, kind, form="rectangular", **options):
    """A converter of another kind, of devices.c: MATCHING, MACHINE, OSCILLATOR, DROOPING or FOLLOWING."""
    return replace(converter(name, form, KIND=kind, **options), file="devices.c")


def other_kinds():
    """Ten honest converters that share no control with `converter`, three of them at other ratings."""

    def at_rating(name, kind, rating, kV):
        units = {
            "V_UNIT": repr(kV * sqrt(2 / 3)),
            "I_UNIT": f"(RATING / ({kV} * sqrt(3.0)) * sqrt(2.0))",
            "P_UNIT": repr(float(rating)),
            "RATING": repr(float(rating)),
        }
        source = device(name, kind, "qd", units=("kV", "kA", "MW"), **units)
        value, current = _si("qd")
        start = START.replace('variable = "v_0"', 'variable = "v_0"\nvalue = "phase peak"')
        bound = binding("qd", rating=rating, voltage=value, current=current, start=start)
        return Member(source, binding=bound.replace("230 kV", f"{kV} kV"))

    return [
        Member(device("matching", "MATCHING")),
        Member(device("matching_with_loop", "MATCHING", VOLTAGE_LOOP=60.0)),
        Member(device("battery_of_slow_link", "MATCHING", T_DC=1.5, T_SOURCE=0.05)),
        Member(device("virtual_machine", "MACHINE")),
        Member(device("virtual_oscillator", "OSCILLATOR")),
        Member(device("droop_of_impedance", "DROOPING", VOLTAGE_LOOP=60.0, R_V=0.15, X_V=0.45)),
        Member(device("droop_of_soft_limit", "DROOPING", SOFT_LIMIT=1.05, I_LIMIT=1.3)),
        Member(device("following_with_fast_frequency", "FOLLOWING")),
        at_rating("matching_of_2_mva", "MATCHING", 2.5, 0.69),
        at_rating("virtual_machine_of_900_mva", "MACHINE", 900, 220),
    ]


def faults_of_other_kinds():
    """Give devices that wind up, have a droop of one range, or pass over an input that is no number in silence."""

    def winds_up(name, kind, **defines):
        only = (*COMPARING, "steady_state", "power_balance", "anti_windup")
        return Member(device(name, kind, **defines), "winds up", only=only)

    def one(name, fault, check, **defines):
        only = (*COMPARING, "steady_state", "power_balance", check)
        return Member(device(name, **defines), fault, only=only)

    loop = {"VOLTAGE_LOOP": 60.0}
    return [
        winds_up("oscillator_that_winds_up", "OSCILLATOR", FAULT_ANTI_WINDUP=0, **loop),
        winds_up("matching_that_winds_up", "MATCHING", FAULT_ANTI_WINDUP=0, **loop),
        winds_up("winds_up_absorbing", "MATCHING", FAULT_ANTI_WINDUP="(own.re < e)", **loop),
        winds_up("following_that_winds_up", "FOLLOWING", FAULT_Q_WINDS_UP=6.0),
        one(
            "slip_within_a_range",
            "droop of one range",
            "evenness",
            kind="DROOPING",
            FAULT_SLIP_WITHIN=0.004,
        ),
        one(
            "power_within_a_range",
            "droop of one range",
            "evenness",
            kind="FOLLOWING",
            FAST_WITHIN=0.2,
        ),
        one(
            "hides_what_is_no_number",
            "not a number hidden",
            "nan_input",
            kind="MACHINE",
            FAULT_HIDES_NAN=1,
        ),
    ]


COMPARING = ("runs", "independence", "repeatability", "reading", "feedthrough")
"""What must be known before two runs are compared."""


def carriers(name, fault="", *, only=(), thread="", rating=1500, **options):
    """The converter on the three kinds of carrier: continuous, control sampled every 200 µs, black box in SI units."""
    signal = ""
    if "omega" in options:
        signal = (
            f'[signals.omega]\nvariable = "{options["omega"][0]}"\nunit = "{options["omega"][1]}"'
        )
    plain = (
        binding(
            "rectangular", rating=rating, current='base = "100 MVA"', start=f"{START}\n{signal}"
        )
        if signal
        else None
    )
    value, current = _si("qd")
    start = START.replace('variable = "v_0"', 'variable = "v_0"\nvalue = "phase peak"')
    box = binding("qd", rating=rating, voltage=value, current=current, start=f"{start}\n{signal}")
    si = {"units": ("kV", "kA", "MW"), "state": False, **V_PEAK}
    asked = tuple(dict.fromkeys((*COMPARING, *only))) if only else ()
    return [
        Member(converter(name, **options), fault, plain, thread, asked),
        Member(
            converter(f"{name}_sampled", SAMPLED="2e-4", **options), fault, plain, thread, asked
        ),
        Member(
            converter(f"{name}_black_box", "qd", **{**si, **options}), fault, box, thread, asked
        ),
    ]


@cache
def good():
    """FMUs with nothing wrong."""
    members = [
        *carriers("converter"),
        *carriers(
            "converter_in_hz",
            omega=("f_meas", "Hz"),
            OMEGA_UNIT=50.0,
            only=("rated_frequency", "signs"),
        ),
        *[
            Member(
                converter(
                    f"converter_shows_{unit.lower()}", shown=("P_meas", unit), SHOWN_UNIT=shown
                ),
                only=("steady_state", "power_balance", "shown_power"),
            )
            for unit, shown in (("MW", "(0.98 * z[S_N])"), ("kW", "(1000 * z[S_N])"), ("pu", "1.0"))
        ],
        Member(
            converter("converter_of_battery", shown=("soc", "1"), STORE=1.0),
            only=("steady_state", "later_times"),
        ),
        *carriers(
            "converter_stiff",
            X_PU=0.12,
            R_PU=0.01,
            only=("steady_state", "power_balance", "signs", "limits"),
        ),
        *carriers(
            "converter_no_droop_of_q",
            Q_DROOP=0.0,
            only=("steady_state", "power_balance", "signs", "limits"),
        ),
        Member(converter("converter_other_numbers", RATING=40.0, DROOP=0.01, X_PU=0.4, R_PU=0.02)),
        Member(converter("converter_without_state", state=False)),
        Member(converter("converter_internal_step", FIXED_STEP="2.5e-5")),
        Member(converter("converter_coarse_steps", FIXED_STEP="1e-4", step_size="1e-3")),
        Member(converter("converter_feedthrough", SHUNT=0.05, depends=("v_re", "v_im"))),
        Member(converter("converter_feedthrough_unsaid", SHUNT=0.05, depends=None)),
        Member(
            converter(
                "converter_initialised_at_entry",
                SHUNT=0.05,
                depends=("v_re", "v_im"),
                INITIALISED_AT_ENTRY=1,
            )
        ),
        Member(converter("converter_strict_time", STRICT_TIME=1)),
        Member(converter("converter_one_step_size", ONLY_STEP="1e-4")),
        Member(
            converter("converter_unstable_beyond", ONE_SUBSTEP=1, step_size="4e-3", stop_time="20")
        ),
        Member(converter("converter_with_an_end", FAULT_ERROR_AT=1.0)),
        Member(small("dahlquist", "DAHLQUIST", DAHLQUIST, step_size="1e-3", stop_time="10")),
        Member(small("van_der_pol", "VAN_DER_POL", VAN_DER_POL, step_size="1e-2", stop_time="20")),
        Member(small("bouncing_ball", "BOUNCING_BALL", BALL, step_size="1e-2", stop_time="3")),
        Member(small("gain", "GAIN", GAIN, step_size="0.1", stop_time="2")),
        Member(small("lag", "LAG", LAG, step_size=None, stop_time="2")),
        # what was said to be the FMU's fault, and is not
        Member(converter("converter_that_ends", ENDS_AT=0.8)),
        Member(converter("converter_without_a_function", WITHOUT_DESERIALIZE=1, state=False)),
        Member(converter("converter_that_forbidden_calls_crash", FAULT_NO_ORDER=1)),
        Member(small("tank", "TANK", TANK, step_size="1e-2", stop_time="20")),
        Member(converter("converter_with_damping", switch=True)),
        Member(converter("converter_with_pod", pod=True)),
        Member(converter("converter_with_integral_pod", pod=True, POD_INTEGRAL=3.0, POD_LEAK=2.0)),
        Member(_open_lag("open_lag")),
        Member(converter("converter_with_dip_memory", DIP_MEMORY=1)),
        Member(converter("converter_that_wraps", WRAPS_BY="(2 * 3.14159265358979323846)")),
        Member(converter("converter_of_two_droops", FAULT_CHARGING_DROOP=2)),
        *other_kinds(),
    ]
    for form in ("polar", "abc", "qd", "power"):
        value, current = _si(form)
        if form == "power":
            current, i_unit = "", "MW"
        else:
            i_unit = "kA"
        start = START.replace('variable = "v_0"', 'variable = "v_0"\nvalue = "phase peak"')
        members.append(
            Member(
                converter(f"converter_{form}_si", form, units=("kV", i_unit, "MW"), **V_PEAK),
                binding=binding(form, voltage=value, current=current, start=start),
            )
        )
    return members


IDENTITY = binding("rectangular", current='base = "100 MVA"')


@cache
def faulty():
    """FMUs with one fault each."""

    def wrong(name, fault, /, **options):
        bound = options.pop("bound", None)
        return Member(converter(name, **options), fault, bound)

    lag = Member(small("lag", "LAG", LAG, step_size="1e-3", stop_time="2"))

    def wrong_lag(name, fault, variables=LAG, **defines):
        source = replace(
            lag.source,
            name=name,
            defines={**lag.source.defines, **defines},
            variables=tuple(variables),
        )
        return Member(source, fault)

    def wrong_tank(name, fault, **defines):
        return Member(
            small(name, "TANK", TANK, defines=defines, step_size="1e-2", stop_time="20"), fault
        )

    silent = (LAG[0], replace(LAG[1], depends=()), *LAG[2:])
    return [
        wrong("hidden_state", "hidden state", FAULT_HIDDEN=1),
        wrong("hidden_state_slow", "hidden state", FAULT_HIDDEN=1, DROOP=0.002),
        wrong("order_of_start_values", "order of setting matters", FAULT_CLEARS_NEXT="P_0"),
        wrong("order_of_inputs", "order of setting matters", FAULT_CLEARS_NEXT="IN_1"),
        wrong("sign", "wrong sign", I_FACTOR=-1),
        wrong("sign_bound", "wrong sign", I_FACTOR=-1, bound=IDENTITY),
        wrong("sign_of_q", "wrong sign", Q_FACTOR=-1),
        wrong("base_of_rating", "wrong base", I_UNIT=1.0),
        wrong("base_of_rating_other", "wrong base", I_UNIT=1.0, RATING=250.0),
        wrong("base_root_three", "wrong base", I_FACTOR=1 / sqrt(3)),
        wrong(
            "base_of_start",
            "wrong base",
            P_UNIT="(100.0 / 1500.0)",
            bound=IDENTITY.replace("1500 MVA", "1500 MVA"),
        ),
        wrong("delayed", "delayed output", FAULT_DELAY=1),
        wrong("delayed_other", "delayed output", FAULT_DELAY=1, step_size="2e-4", X_PU=0.1),
        wrong(
            "delayed_in_dips",
            "delayed output",
            FAULT_DELAY=1,
            DELAYED_WHERE="(hypot(S->z[IN_1], S->z[IN_2]) < 0.7)",
        ),
        wrong("delayed_current_alone", "delayed output", FAULT_DELAY=1, LATE="OUT_1"),
        wrong_lag("stale", "delayed output", FAULT_STALE=1),
        wrong("step_dependent", "step-dependent answer", FAULT_STEP=1),
        wrong("step_dependent_other", "step-dependent answer", FAULT_STEP=3, step_size="5e-4"),
        wrong("rounded_steps", "internal step leaks", FAULT_ROUNDING="1e-4"),
        wrong(
            "rounded_steps_other", "internal step leaks", FAULT_ROUNDING="5e-5", step_size="1e-4"
        ),
        wrong("shared", "shared between instances", FAULT_SHARED=1),
        wrong_lag("shared_lag", "shared between instances", FAULT_SHARED=1),
        wrong("second_instance", "instances differ", FAULT_SECOND_INSTANCE=1),
        wrong("random", "not repeatable", FAULT_RANDOM="1e-3"),
        wrong("reading", "reading changes it", FAULT_READING="1e-4"),
        wrong("leaking", "memory leak", FAULT_LEAK=64),
        wrong("leaking_little", "memory leak", FAULT_LEAK=8),
        wrong("leaking_instances", "memory leak", FAULT_LEAK_INSTANCE=16384),
        wrong("leaking_states", "memory leak", FAULT_LEAK_STATE=1),
        wrong("crash", "crash", FAULT_CRASH_AT=0.05),
        wrong("crash_late", "crash", FAULT_CRASH_AT=1.7),
        wrong("crash_much_later", "crash", FAULT_CRASH_AT=9.0, stop_time="10"),
        wrong("abort", "crash", FAULT_ABORT_AT=0.2),
        wrong("crash_on_nan", "crash", FAULT_CRASH_ON_NAN=1),
        wrong("hang", "hang", FAULT_HANG_AT=0.03),
        wrong("exit", "exit", FAULT_EXIT_AT=0.5),
        wrong("error", "error in a step", FAULT_ERROR_AT=0.3),
        wrong("flood_of_messages", "output flood", FAULT_FLOOD=100000),
        wrong("flood_of_text", "output flood", FAULT_PRINT=2000),
        wrong("nan_after_limit", "not a number", FAULT_NAN_LIMIT=1.5),
        wrong("nan_after_time", "not a number", FAULT_NAN_AT=0.4),
        wrong("undeclared_feedthrough", "undeclared feed-through", SHUNT=0.05),
        wrong("undeclared_feedthrough_small", "undeclared feed-through", SHUNT=1e-4),
        wrong_lag("undeclared_feedthrough_lag", "undeclared feed-through", silent),
        wrong("reset_parameter", "reset leaves something", FAULT_RESET=1),
        wrong_lag("reset_lag", "reset leaves something", FAULT_RESET=1),
        wrong("start_values", "start values differ", FAULT_START=1),
        wrong("drift", "no steady state", FAULT_DRIFT=0.01),
        wrong("growing_state", "growing state", FAULT_GROWING_STATE=1),
        wrong("serialised_state", "serialised state", FAULT_SERIALISED=1),
        wrong("crash_at_once", "crash", FAULT_CRASH_AT=5e-5),
        wrong("discards", "error in a step", FAULT_DISCARD_AT=0.3),
        wrong("ends_of_an_error", "error in a step", ENDS_AT=0.3, FAULT_SAYS_WHY=1),
        wrong("ends_at_once", "ends at once", ENDS_AT=5e-4),
        wrong("missing_function", "missing function", WITHOUT_DESERIALIZE=1),
        wrong_tank("tank_by_calls", "step-dependent answer", FAULT_RELAY_BY_CALLS=1),
        wrong_tank("tank_beside_a_counter", "step-dependent answer", FAULT_COUNTS_CALLS=1),
        *_wrong_units(),
        *_invalid(),
        *missed(),
        *missed_by_one_point(),
        *reported(),
        *tampering(),
        *late_outputs(),
        *large_signals(),
        *damping(),
        *faults_of_other_kinds(),
    ]


POD_ASKED = ("runs", "independence", "repeatability", "steady_state", "power_balance")
"""Checks that come before a damping controller is tried."""


def damping():
    """Give faults of a damping controller alone, each beside `converter_with_pod`, which is good."""

    def one(name, fault, *only, **defines):
        source = converter(name, pod=True, **defines)
        return Member(source, fault, only=(*POD_ASKED, *(only or ("pod",))))

    return [
        one("pod_of_dead_band", "POD with a dead band", FAULT_POD_DEAD_BAND=0.01),
        one("pod_of_one_side", "POD of one side", FAULT_POD_TIMES="(power > 0)"),
        one(
            "pod_off_above_power",
            "POD of some points only",
            FAULT_POD_TIMES="(m[P_REF] < 0.8)",
        ),
        one(
            "pod_off_below_voltage",
            "POD of some points only",
            FAULT_POD_TIMES="(m[VOLT] > 0.97)",
        ),
        one(
            "pod_reversed_while_charging",
            "POD of some points only",
            FAULT_POD_TIMES="(m[P_REF] < 0 ? -1 : 1)",
        ),
        one(
            "pod_reversed_for_large_swings",
            "POD reversed",
            FAULT_POD_TIMES="(fabs(power) > 0.07 ? -1 : 1)",
        ),
        one(
            "pod_gain_of_step",
            "POD follows the step",
            FAULT_POD_TIMES="(last_step > 1.5 * INTERNAL ? 0.5 : 1)",
        ),
        one("pod_dead_after_a_while", "POD changes with time", FAULT_POD_TIMES="(m[AGE] < 50)"),
        one(
            "pod_that_fades",
            "POD changes with time",
            FAULT_POD_TIMES="exp(-m[AGE] / 30)",
        ),
        one(
            "pod_of_the_minute",
            "follows the clock",
            "clock",
            FAULT_POD_TIMES="(wall_clock() / 60 % 2 ? 0.5 : 1)",
        ),
        one(
            "pod_dead_after_a_date",
            "follows the clock",
            "clock",
            FAULT_POD_TIMES="(wall_clock() > 1900000000 ? 0 : 1)",
        ),
        one("current_of_the_minute", "follows the clock", "clock", FAULT_CLOCK_CURRENT=0.98),
        one("pod_without_washout", "POD without washout", FAULT_POD_WITHOUT_WASHOUT=1),
        one("pod_above_its_limit", "POD limit not as declared", FAULT_POD_LIMIT=2.0),
        one("pod_below_its_limit", "POD limit not as declared", FAULT_POD_LIMIT=0.6),
        one("pod_latched_by_dips", "POD changed by a disturbance", FAULT_POD_TIMES="(m[DIPS] < 1)"),
        one(
            "pod_off_at_no_power",
            "POD of some points only",
            FAULT_POD_TIMES="(fabs(m[P_REF]) > 0.04)",
        ),
        one(
            "pod_off_while_it_takes_reactive_power",
            "POD of some points only",
            FAULT_POD_TIMES="(m[Q_REF] > -0.2)",
        ),
        one(
            "pod_of_less_limit_one_way",
            "POD limit not as declared",
            FAULT_POD_TIMES="(power < -0.04 ? -0.04 / power : 1)",
        ),
        one(
            "pod_weak_in_larger_swings",
            "POD uneven",
            FAULT_POD_TIMES="(fabs(power) > 0.04 && fabs(power) < 0.09 ? 0.4 : 1)",
        ),
        one("pod_that_tires", "POD tires", FAULT_POD_TIMES="(m[WORKED] < 1 ? 1 : 0.4)"),
        one("pod_tired_by_use", "POD tires", FAULT_POD_TIMES="(m[USED] < 0.4 ? 1 : 0.4)"),
        one("pod_unstable", "POD unstable", POD_INTEGRAL=1.0, POD_LEAK="(-1.0)"),
        one("pod_slowly_unstable", "POD unstable", POD_INTEGRAL=1.0, POD_LEAK="(-15.0)"),
        one(
            "pod_that_winds_up",
            "POD winds up",
            POD_INTEGRAL=3.0,
            POD_LEAK=2.0,
            FAULT_POD_WINDS_UP=1,
        ),
        one(
            "pod_that_stays_off",
            "POD changed by its switch",
            FAULT_POD_TIMES="(m[SWITCHED] < 3)",
        ),
        one("pod_that_does_nothing", "POD without effect", FAULT_POD_TIMES="0"),
        one(
            "pod_gain_of_the_start",
            "parameter not taken",
            "reading",
            "tunables",
            FAULT_POD_KEEPS_GAIN=1,
        ),
    ]


def large_signals():
    """What shows in dips and jumps only, and after them; each beside `converter_with_dip_memory`, which is good."""

    def one(name, fault, *only, **defines):
        return Member(
            converter(name, **defines), fault, only=("runs", "independence", "repeatability", *only)
        )

    remembers = {"DIP_MEMORY": 1}
    return [
        one("state_of_dip_counter", "hidden state", "state", FAULT_STATE_KEEPS="DIPS", **remembers),
        one("state_of_wind_up", "hidden state", "state", FAULT_STATE_KEEPS="WOUND", **remembers),
        one("state_of_dip_timer", "hidden state", "state", FAULT_STATE_KEEPS="LOW", **remembers),
        one(
            "reset_of_dip_counter",
            "reset leaves something",
            "reset",
            FAULT_RESET_KEEPS="DIPS",
            **remembers,
        ),
        one("shared_in_limiter", "shared between instances", FAULT_STATIC_LIMIT="2e-3"),
        one("static_in_limiter", "shared between instances", FAULT_STATIC_TOTAL=1),
        one("gain_of_dips", "changed by a disturbance", "after_dips", FAULT_GAIN_OF_DIPS=0.7),
        one(
            "gain_for_a_while",
            "changed by a disturbance",
            "after_dips",
            FAULT_GAIN_WHERE="(m[SINCE] < 2)",
            FAULT_GAIN_BY=1.5,
        ),
        one(
            "gain_of_the_fourth_dip",
            "changed by a disturbance",
            "after_dips",
            FAULT_GAIN_WHERE="(m[DIPS] >= 4)",
            FAULT_GAIN_BY=0.7,
        ),
        one(
            "limit_of_three_dips",
            "no current limit",
            "limits",
            FAULT_LIMIT_OFF_WHERE="(m[DIPS] >= 4)",
        ),
        one(
            "limit_until_overvoltage",
            "no current limit",
            "limits",
            FAULT_LIMIT_OFF_WHERE="(m[OVER] > 0.5)",
        ),
        one("wound_up", "rests elsewhere", "after_dips", FAULT_WINDS_UP=0.25),
        one("blocks_after_deep_dips", "blocks", "limits", FAULT_BLOCKS_BELOW=0.35),
        one(
            "blocks_after_jumps", "blocks", "limits", FAULT_BLOCKS_AT_JUMP="(25 * 3.14159265 / 180)"
        ),
        one("knows_the_dips", "no current limit", "limits", FAULT_KNOWS_DIPS=1),
        *points_and_ratings(),
        one(
            "clock_of_single_precision",
            "counts time",
            "steady_state",
            "later_times",
            FAULT_FLOAT_CLOCK=1,
        ),
        one(
            "sum_of_single_precision",
            "counts time",
            "steady_state",
            "later_times",
            FAULT_FLOAT_SUM=1,
        ),
        one(
            "gain_of_the_time",
            "counts time",
            "steady_state",
            "later_times",
            FAULT_TRIPLES_AFTER=20.0,
        ),
        Member(
            converter(
                "battery_of_the_time", shown=("soc", "1"), STORE=1.0, FAULT_TRIPLES_AFTER=20.0
            ),
            "counts time",
            only=("steady_state", "later_times"),
        ),
        *[
            Member(
                converter(f"shows_{name}", shown=("P_meas", unit), SHOWN_UNIT=shown),
                "wrong units",
                only=("steady_state", "power_balance", "shown_power"),
            )
            for name, unit, shown in (
                ("kw_as_mw", "MW", "(1000 * z[S_N])"),
                ("mw_as_kw", "kW", "z[S_N]"),
                ("kw_as_pu", "pu", "(1000 * z[S_N])"),
                ("pu_as_mw", "MW", "1.0"),
            )
        ],
        Member(
            converter(
                "shows_size_of_power",
                shown=("P_meas", "MW"),
                SHOWN_UNIT="z[S_N]",
                FAULT_SHOWS_SIZE=1,
            ),
            "wrong sign",
            only=("steady_state", "power_balance", "shown_power"),
        ),
        one("leaking_in_dips", "memory leak", "after_dips", FAULT_LEAK_IN_DIPS=4096),
        one(
            "feedthrough_of_high_voltage",
            "undeclared feed-through",
            "reading",
            "feedthrough",
            FAULT_SHUNT_ABOVE=1.03,
        ),
        *in_a_tool("leaking_in_a_tool", FAULT_LEAK_INSTANCE=26000),
        *in_a_tool("leaking_resets_in_a_tool", FAULT_LEAK_RESET=26000),
    ]


def in_a_tool(name, **defines):
    """What keeps memory, of an FMU that says that it runs in a tool."""

    def needs_tool(text):
        return text.replace(b"<CoSimulation ", b'<CoSimulation needsExecutionTool="true" ')

    return [
        Member(
            replace(converter(name, **defines), change=needs_tool),
            "memory leak",
            only=("runs", "memory"),
        )
    ]


def points_and_ratings():
    """What shows without power, with full power, while it takes power, at another rating, and long after a change."""

    def one(name, fault, *only, **defines):
        return Member(
            converter(name, **defines), fault, only=("steady_state", "power_balance", *only)
        )

    return [
        one("nan_without_power", "not a number", "operating_points", FAULT_NAN_IDLE=1),
        one("clips_its_start", "power not as asked", "operating_points", FAULT_CLIPS_START=0.8),
        one("base_of_own_rating", "base of another rating", "ratings", FAULT_BASE_OF_START=1),
        one("limit_of_own_rating", "limit of another rating", "ratings", FAULT_BASE_OF_LIMIT=1),
        one("droop_while_charging", "uneven droop", "evenness", FAULT_CHARGING_DROOP=4),
        one(
            "undamped_while_charging", "uneven damping", "evenness", UNDAMPED_WHERE="(m[P_REF] < 0)"
        ),
        one(
            "undamped_at_full_power",
            "uneven damping",
            "evenness",
            UNDAMPED_WHERE="(m[P_REF] > 0.9)",
        ),
        one(
            "droop_of_high_voltage",
            "uneven droop",
            "evenness",
            FAULT_GAIN_WHERE="(m[VOLT] > 1.05)",
            FAULT_GAIN_BY=2,
        ),
        Member(
            converter("damping_off_while_charging", switch=True, FAULT_CHARGING_SWITCH=1),
            "uneven damping",
            only=(
                "runs",
                "independence",
                "repeatability",
                "steady_state",
                "power_balance",
                "evenness",
            ),
        ),
        one("sign_of_q_at_high_voltage", "wrong sign", "signs", FAULT_Q_SIGN_WHERE="(v > 1.07)"),
        one("sign_of_q_at_low_voltage", "wrong sign", "signs", FAULT_Q_SIGN_WHERE="(v < 0.94)"),
        one(
            "angle_of_another_turn",
            "jumps with its angle",
            "angles",
            WRAPS_BY="(2 * 3.14159265358979 - 0.003)",
        ),
        one(
            "angle_of_two_turns",
            "jumps with its angle",
            "angles",
            WRAPS_AT="(4 * 3.14159265358979)",
            WRAPS_BY=12.4,
        ),
        one("limit_of_a_short_time", "no current limit", "limits", FAULT_LIMIT_TIRES=1.5),
        one("droop_of_q_while_charging", "uneven droop", "signs", FAULT_CHARGING_Q_DROOP=-1),
        one("trips_below_088", "trips", "limits", FAULT_TRIPS_AFTER=3.0),
        one(
            "limit_that_latches",
            "changed by a disturbance",
            "limits",
            FAULT_LIMIT_TIMES="(m[DIPS] > 1 ? 0.6 : 1)",
        ),
        one("refused_in_the_run", "parameter not taken", "tunables", FAULT_REFUSES_IN_RUN=1),
        one("ignored_in_the_run", "parameter not taken", "tunables", FAULT_IGNORES_IN_RUN=1),
        one("resonance", "keeps moving", "signs", FAULT_RINGS=7),
    ]


def late_outputs():
    """What a master reads in initialisation mode is not there yet, or is of the inputs before."""
    only = ("runs", "initial_outputs")
    entry = converter(
        "outputs_at_entry", FAULT_OUTPUTS_AT_ENTRY=1, SHUNT=0.05, depends=("v_re", "v_im")
    )
    return [
        *carriers("outputs_at_exit", "outputs come late", only=only, FAULT_OUTPUTS_AT_EXIT=1),
        Member(entry, "outputs come late", only=only),
    ]


def missed():
    """What once passed every check, on each carrier."""
    signs = ("steady_state", "power_balance", "signs")
    return [
        *carriers("q_measured", "wrong sign", only=signs, Q_MEASURED=-1.0),
        *carriers(
            "q_measured_stiff", "wrong sign", only=signs, Q_MEASURED=-1.0, X_PU=0.15, Q_DROOP=0.03
        ),
        *carriers("p_measured", "unstable", only=signs, P_MEASURED=-1.0),
        *carriers(
            "nan_once", "not a number", only=("runs",), FAULT_NAN_ONCE=5.0001, stop_time="10"
        ),
        *carriers("crash_in_dip", "crash", only=("limits",), FAULT_CRASH_IN_DIP_AFTER=2.0),
        *carriers("held", "step not honoured", only=("sample_time",), FIXED_STEP="1e-3"),
        *carriers(
            "sixty_hertz",
            "wrong rated frequency",
            only=("rated_frequency",),
            NOMINAL=60.0,
            OMEGA_UNIT=60.0,
            omega=("f_meas", "Hz"),
        ),
        *carriers("no_limit", "no current limit", only=("limits",), I_LIMIT=1e9),
    ]


def _open_lag(name, **defines):
    return small(
        name, "OPEN_LAG", OPEN_LAG, defines=defines, step_size="1e-3", stop_time="2", settable=True
    )


def missed_by_one_point():
    """What passed every check, since it works at the points, the step, the time or the setting that were tried."""

    def one(name, fault, only, /, **options):
        return carriers(name, fault, only=only, **options)[0]

    balance = ("steady_state", "power_balance")
    signs = (*balance, "signs")
    switched = {"switch": True}
    return [
        one("imported_p", "power not as asked", balance, FAULT_IMPORTED_P=1.7),
        one("imported_q", "power not as asked", balance, FAULT_IMPORTED_Q=-1),
        one("imported_limit", "no current limit", ("limits",), FAULT_IMPORTED_LIMIT=1),
        one(
            "drifts_later",
            "leaves its steady state",
            ("runs", "steady_state"),
            FAULT_DRIFTS_AFTER=3.0,
            FAULT_DRIFTS_BY=0.02,
            stop_time="5",
        ),
        one(
            "ramp",
            "leaves its steady state",
            ("runs", "steady_state"),
            FAULT_DRIFTS_AFTER=0.0,
            FAULT_DRIFTS_BY=1e-3,
            stop_time="5",
        ),
        one(
            "leaking_later",
            "memory leak",
            ("runs", "memory"),
            FAULT_LEAK=64,
            FAULT_LEAK_AFTER=2.4,
            stop_time="10",
        ),
        one("limit_tires", "no current limit", ("limits",), FAULT_LIMIT_TIRES=0.16),
        one("absorbing_droop", "wrong sign", signs, FAULT_ABSORBING=-1.0),
        *carriers(
            "omega_reversed",
            "wrong frequency",
            only=signs,
            omega=("f_meas", "Hz"),
            OMEGA_UNIT=50.0,
            OMEGA_FACTOR=-1,
        ),
        one("omega_by_two_pi", "wrong frequency", signs, OMEGA_FACTOR="6.2831853"),
        one("angle_in_turns", "wrong frequency", signs, TURNS="50.0"),
        *carriers("one_way", "loses synchronism", only=signs, FAULT_ONE_WAY=1),
        one("state_of_switch", "hidden state", ("state",), FAULT_STATE_SWITCH=1, **switched),
        one("state_of_switched", "hidden state", ("state",), FAULT_STATE_OF_SWITCHED=1, **switched),
        one(
            "reset_of_switch",
            "reset leaves something",
            ("reset",),
            FAULT_RESET_SWITCH=1,
            **switched,
        ),
        one(
            "shared_switch",
            "shared between instances",
            ("independence",),
            FAULT_SWITCHED_SHARED=1,
            **switched,
        ),
        one("one_state_at_a_time", "hidden state", ("state",), FAULT_ONE_BUFFER=1),
        Member(_open_lag("state_not_taken", FAULT_IGNORES_STATE="X"), "state not taken"),
        Member(_open_lag("state_that_nothing_shows", FAULT_STATE_SILENT="TRAIL"), "hidden state"),
    ]


def reported():
    """Faults of exporters that somebody reported in public."""
    state, reset = ("state", "state_size"), ("reset", "reinstantiation")

    def one(name, fault, thread, /, **options):
        return carriers(name, fault, thread=thread, **options)

    def with_state(name, fault, thread, /, **options):
        return one(name, fault, thread, **options)[:2]  # a black box has none

    return [
        *one(
            "one_behind",
            "delayed output",
            "CATIA-Systems/FMIKit-Simulink#200",
            only=("delay",),
            FAULT_ONE_BEHIND=1,
        ),
        *one(
            "skips_a_step",
            "step not honoured",
            "CATIA-Systems/FMIKit-Simulink#133",
            only=("sample_time",),
            FAULT_SKIPS="1e-4",
        )[::2],
        *one(
            "so_many_steps",
            "step-dependent answer",
            "CATIA-Systems/FMIKit-Simulink#68",
            only=("delay", "step_invariance"),
            FAULT_STEP=2,
        ),
        *one(
            "at_least_its_step",
            "step-dependent answer",
            "hyumo/qFMU#23",
            only=("delay", "step_invariance"),
            FAULT_AT_LEAST="1e-3",
        )[::2],
        *one(
            "timer_of_calls",
            "step-dependent answer",
            "lbl-srg/modelica-buildings#3412",
            only=("delay", "step_invariance"),
            FAULT_TIMER_CALLS=60,
        ),
        *one(
            "euler",
            "not a number",
            "CogniPilot/rumoca#347",
            only=("runs",),
            FAULT_EULER=10,
            step_size="4e-2",
            stop_time="20",
        )[::2],
        *one(
            "nan_with_ok",
            "not a number",
            "CATIA-Systems/FMPy#278",
            only=("runs",),
            FAULT_NAN_AT=3.0,
            stop_time="4",
        ),
        *one(
            "nothing_first",
            "no steady state",
            "CATIA-Systems/FMPy#440",
            only=("steady_state",),
            FAULT_NOTHING_FIRST=1,
        ),
        *one(
            "ignores_parameters",
            "parameter not taken",
            "CATIA-Systems/FMPy#163",
            only=("start_values",),
            FAULT_IGNORES=1,
        ),
        *one(
            "shared_parameters",
            "shared between instances",
            "CATIA-Systems/FMIKit-Simulink#326",
            only=("independence",),
            FAULT_SHARED_PARAMETERS=1,
        ),
        *one(
            "crash_again",
            "crash",
            "NTNU-IHB/PythonFMU#213",
            only=("reinstantiation",),
            FAULT_CRASH_AGAIN=1,
        ),
        *one(
            "crash_after_reset",
            "crash",
            "OpenModelica/OpenModelica#6703",
            only=reset,
            FAULT_CRASH_AFTER_RESET=1,
        ),
        *one(
            "crash_on_free",
            "crash",
            "OpenModelica/OpenModelica#16321",
            only=("runs",),
            FAULT_CRASH_ON_FREE=100,
        ),
        *one(
            "hang_on_free",
            "hang",
            "OpenModelica/OMSimulator#1391",
            only=("runs",),
            FAULT_HANG_ON_FREE=100,
        )[:1],
        *one(
            "reset_time",
            "reset fails",
            "modelica/Reference-FMUs#204",
            only=reset,
            FAULT_RESET_TIME=1,
            STRICT_TIME=1,
        ),
        *one(
            "reset_of_parameters",
            "reset leaves something",
            "CATIA-Systems/FMIKit-Simulink#412",
            only=reset,
            FAULT_RESET=1,
        ),
        *with_state(
            "hang_after_restore",
            "hang",
            "OpenModelica/OpenModelica#12260",
            only=("state",),
            FAULT_HANG_AFTER_RESTORE=1,
        )[:1],
        *with_state(
            "state_of_parameters",
            "hidden state",
            "OpenModelica/OpenModelica#15216",
            only=("state",),
            FAULT_STATE_PARAMETERS=1,
        ),
        *with_state(
            "state_of_tick",
            "hidden state",
            "modelica/Reference-FMUs#652",
            only=("state",),
            FAULT_STATE_TICK=1,
        )[1:],
        *with_state(
            "state_of_owner",
            "serialised state",
            "CATIA-Systems/FMPy#811",
            only=state,
            FAULT_STATE_OWNER=1,
        ),
        *one(
            "leaking_resets",
            "memory leak",
            "OpenModelica/OpenModelica#7444",
            only=("memory",),
            FAULT_LEAK_RESET=500,
        ),
        *one(
            "leaking_files",
            "files stay open",
            "CATIA-Systems/FMPy#110",
            only=("memory",),
            FAULT_LEAK_FILE=1,
        ),
        *_described(),
    ]


def _described():
    """Faults of model descriptions."""

    def without_units(text):
        return re.sub(rb"<UnitDefinitions>.*</UnitDefinitions>", b"", text, flags=re.DOTALL)

    def kinds(text):
        return text.replace(
            b'dependencies="8 9"', b'dependencies="8 9" dependenciesKind="constant"'
        )

    file = ("fmi_validity", "units")
    plain, fed = (
        converter("no_unit_definitions"),
        converter("kinds_of_dependencies", SHUNT=0.05, depends=("v_re", "v_im")),
    )
    return [
        Member(
            replace(plain, change=without_units),
            "invalid FMI",
            None,
            "OpenModelica/OpenModelica#5845",
            file,
        ),
        Member(
            replace(fed, change=kinds), "invalid FMI", None, "modelica/Reference-FMUs#675", file
        ),
    ]


def tampering():
    """FMUs that write results of their own; the first one is faulty besides."""
    return [
        *carriers("forged_results", "not a number", FAULT_TAMPERING=0, FAULT_NAN_AT=0.0),
        Member(converter("forged_everywhere", FAULT_TAMPERING=1), "tampering"),
        Member(converter("forged_in_binary", FAULT_TAMPERING=255), "tampering"),
        Member(
            converter("forged_and_stays", FAULT_TAMPERING=1, FAULT_TAMPERING_STAYS=1), "tampering"
        ),
    ]


def _wrong_units():
    kilovolts = converter("units_of_voltage", units=("A", "pu", "pu"))
    kelvin = converter("units_definition")
    kelvin = replace(kelvin, units={"MVA": {"kg": "1", "m": "2", "s": "-3", "factor": "1000"}})
    bound = converter("units_bound", units=("kV", "pu", "pu"))
    unfit = Member(bound, "binding does not fit", IDENTITY)
    return [Member(kilovolts, "wrong units"), Member(kelvin, "wrong units"), unfit]


def _invalid():
    twice = converter("same_name_twice")
    first = twice.variables[0]
    twice = replace(twice, variables=(*twice.variables, replace(first, reference=6)))
    bare = converter("without_start")
    bare = replace(
        bare,
        variables=tuple(replace(v, start=None) if v.name == "v_re" else v for v in bare.variables),
    )
    return [Member(twice, "unreadable"), Member(bare, "invalid FMI")]
