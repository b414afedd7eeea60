"""Model builder and kernels on models small enough to have an analytic answer."""

import contextlib
import ctypes
import math
from inspect import unwrap

import casadi as ca
import numpy as np
import pytest

from fmus.toolchain import symbols
from fmus.toolchain.compiler import (
    TARGETS,
    _run,
    _ways,
    compile_for,
    compile_library,
    host_platform,
)
from fmus.toolchain.kernel import c_source
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.tape import tape_of
from tests.support.jacobians import jacobians
from tests.support.kernels import KERNELS, compiled, in_python, vector


def lag():
    m = ModelBuilder("lag", "First-order lag K/(1 + s·T)")
    K = m.parameter("K", 3.0, "1", "Gain")
    T = m.parameter("T", 0.05, "s", "Time constant", minimum=1e-3)
    u = m.input("u", "1", "Input")
    half = m.calculated("half", K / 2, "1", "Half of the gain")
    m.calculated("quarter", half / 2, "1", "A quarter of the gain")
    x = m.state("x", half, "1", "State, starting at K/2")
    m.derivative(x, (K * u - x) / T)
    m.output("y", x + u, "1", "State and input")
    m.require(T - m.internal_step, "T must exceed internal_step")
    return m.build()


def oscillator(integrator="runge_kutta"):
    m = ModelBuilder("oscillator", "Harmonic oscillator of 1 rad/s")
    q = m.state("q", 1.0, "1", "Position")
    v = m.state("v", 0.0, "1", "Velocity")
    m.derivative(q, v)
    m.derivative(v, -q)
    m.output("energy", (q**2 + v**2) / 2, "1", "Energy")
    return m.build(integrator=integrator)


# -- analytic answers --------------------------------------------------------------------------


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_lag_answers_a_step_with_an_exponential(kernel):
    model = lag()
    code, z, at = KERNELS[kernel](model), vector(model, u=2.0), model.value_references
    code.initialise(z)
    assert (z[at["half"]], z[at["quarter"]], z[at["x"]]) == (1.5, 0.75, 1.5)
    assert code.advance(z, 1e-3, 100) == 0
    exact = 6.0 + (1.5 - 6.0) * math.exp(-0.1 / 0.05)
    assert z[at["x"]] == pytest.approx(exact, rel=1e-8)
    assert z[at["y"]] == z[at["x"]] + 2.0  # outputs belong to the new state
    code.derivatives(z)
    assert z[at["der(x)"]] == pytest.approx((6.0 - exact) / 0.05, rel=1e-7)


@pytest.mark.parametrize("kernel", KERNELS)
def test_outputs_follow_inputs_without_a_step(kernel):
    model = lag()
    code, z, at = KERNELS[kernel](model), vector(model), model.value_references
    code.initialise(z)
    z[at["u"]] = 5.0
    code.outputs(z)
    assert (z[at["x"]], z[at["y"]]) == (1.5, 6.5)


@pytest.mark.parametrize("kernel", KERNELS)
def test_requirements_are_positive_where_the_rule_holds(kernel):
    model = lag()
    code, margin = KERNELS[kernel](model), (ctypes.c_double * 1)()
    code.requirements(vector(model), margin)
    assert margin[0] == 0.05 - 1e-4
    code.requirements(vector(model, T=1e-5), margin)
    assert margin[0] == 1e-5 - 1e-4


@pytest.mark.parametrize("kernel", KERNELS)
def test_advance_names_the_first_state_that_is_not_finite(kernel):
    model = oscillator()
    code, z, at = KERNELS[kernel](model), vector(model), model.value_references
    code.initialise(z)
    z[at["v"]] = 1e308
    z[at["q"]] = 1.0
    assert code.advance(z, 1e3, 3) == 1
    lagging = lag()
    code, z = KERNELS[kernel](lagging), vector(lagging, u=math.nan)
    code.initialise(z)
    assert code.advance(z, 1e-4, 1) == 1


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize(("integrator", "order"), [("runge_kutta", 4), ("sdirk", 2)])
def test_the_error_falls_with_the_order_of_the_method(integrator, order, kernel):
    model = oscillator(integrator)
    code, at = KERNELS[kernel](model), model.value_references

    def error(steps):
        z = vector(model)
        code.initialise(z)
        code.advance(z, 1.0 / steps, steps)
        return math.hypot(z[at["q"]] - math.cos(1.0), z[at["v"]] + math.sin(1.0))

    ratios = [error(n) / error(2 * n) for n in (16, 32, 64)]
    assert ratios == pytest.approx([2.0**order] * 3, rel=0.1)
    assert error(64) < 64.0**-order


def test_energy_of_the_oscillator_decays_as_runge_kutta_predicts():
    """|R(jh)|² = 1 − h⁶/72 + h⁸/576 for the classical method."""
    model, h, n = oscillator(), 0.1, 500
    code, z = compiled(model), vector(model)
    code.initialise(z)
    code.advance(z, h, n)
    energy = z[model.value_references["energy"]]
    assert energy == pytest.approx(0.5 * (1 - h**6 / 72 + h**8 / 576) ** n, rel=1e-12)


def stiff_chain(integrator="sdirk"):
    """Two lags in a row, 1 µs and 10 ms, and a third that follows both."""
    m = ModelBuilder("stiff_chain", "Lags")
    u = m.input("u", "1", "Input", start=1.0)
    T = m.parameter("T", 1e-6, "s", "Short time constant", tunable=True)
    fast, slow = m.state("fast", 0.0, "1", "1 µs"), m.state("slow", 0.0, "1", "10 ms")
    sum_ = m.state("sum", 0.0, "1", "Follows both")
    m.derivative(fast, (u - fast) / T)
    m.derivative(slow, (fast - slow) / 1e-2)
    m.derivative(sum_, (fast + slow - sum_) / 5e-3)
    m.output("y", fast - slow, "1", "Difference")
    return m.build(integrator=integrator)


@pytest.mark.parametrize("kernel", KERNELS)
def test_the_implicit_method_is_stable_and_damps_at_a_hundred_time_constants(kernel):
    model = stiff_chain()
    code, z, at = KERNELS[kernel](model), vector(model), model.value_references
    code.initialise(z)
    assert code.advance(z, 1e-4, 1) == 0
    assert abs(z[at["fast"]] - 1.0) < 0.05  # L-stable: next to nothing is left of a fast mode
    assert code.advance(z, 1e-4, 99) == 0
    assert z[at["fast"]] == pytest.approx(1.0, abs=1e-12)
    assert z[at["slow"]] == pytest.approx(1 - math.exp(-1.0), abs=1e-4)


def test_the_explicit_method_diverges_there():
    model = stiff_chain("runge_kutta")
    code, z = compiled(model), vector(model)
    code.initialise(z)
    assert code.advance(z, 1e-4, 99) == 1


@pytest.mark.parametrize("kernel", KERNELS)
def test_the_implicit_method_factorises_again_when_a_parameter_or_the_step_changes(kernel):
    model = stiff_chain()
    code, used, at = KERNELS[kernel](model), vector(model), model.value_references
    for h, T in ((1e-4, 1e-6), (1e-4, 1e-3), (2e-4, 1e-3), (1e-4, 1e-6)):
        fresh, untouched = KERNELS[kernel](model), vector(model)
        for z, instance in ((used, code), (untouched, fresh)):
            z[at["T"]] = T
            instance.initialise(z)
            assert instance.advance(z, h, 3) == 0
        assert list(used) == list(untouched)


def test_all_kernels_of_the_implicit_method_agree():
    model, results = stiff_chain(), []
    for make in KERNELS.values():
        code, z = make(model), vector(model)
        code.initialise(z)
        code.advance(z, 1e-4, 50)
        results.append(list(z))
    assert results[0] == results[1]
    assert results[0] == pytest.approx(results[2], rel=1e-13)


def test_the_implicit_method_is_refused_for_a_nonlinear_model():
    m, x = builder()
    m.derivative(x, -(x**3))
    with pytest.raises(ValueError, match="model faulty is not linear in its states"):
        c_source(m.build(integrator="sdirk"))


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_model_without_states_still_has_a_kernel(kernel):
    m = ModelBuilder("gain_only", "A gain")
    u = m.input("u", "1", "Input", start=3.0)
    m.output("y", 2 * u, "1", "Output")
    model = m.build()
    code, z = KERNELS[kernel](model), vector(model)
    code.initialise(z)
    assert code.advance(z, 1e-4, 1) == 0
    assert z[model.value_references["y"]] == 6.0


def test_a_model_may_have_a_single_calculated_parameter():
    m, x = builder()
    m.derivative(x, -x)
    m.calculated("c", 2.0, "1", "Two")
    assert m.build().initialise([1e-4])[0] == [2.0]


def test_jacobians_are_exact():
    model = lag()
    A, B, C, D = (
        block.item() for block in jacobians(model)([0.3], [0.1], [1e-4, 3.0, 0.05], [1.5, 0.75])
    )
    assert (A, B, C, D) == (-1 / 0.05, 3.0 / 0.05, 1.0, 1.0)


# -- operations of the Python kernel -----------------------------------------------------------

# 0.25, −0.75 and so on: both signs, both orders, equal arguments, and zero.
POINTS = [
    (0.25, 0.5),
    (0.5, 0.25),
    (-0.75, 0.5),
    (0.75, -0.5),
    (-0.75, -0.5),
    (0.5, 0.5),
    (0.0, 0.5),
    (0.0, -0.0),
]
OPERATIONS = {
    "add": lambda f, a, b: a + b,
    "sub": lambda f, a, b: a - b,
    "mul": lambda f, a, b: a * b,
    "div": lambda f, a, b: a / (b + 2),
    "neg": lambda f, a, b: -a,
    "inv": lambda f, a, b: 1 / (a + 2),
    "sq": lambda f, a, b: a**2,
    "twice": lambda f, a, b: a + a,
    "constpow": lambda f, a, b: (a + 2) ** 2.5,
    "cube": lambda f, a, b: a**3,
    "pow": lambda f, a, b: (a + 2) ** b,
    "fmin": lambda f, a, b: f.fmin(a, b),
    "fmax": lambda f, a, b: f.fmax(a, b),
    "lt": lambda f, a, b: a < b,
    "le": lambda f, a, b: a <= b,
    "gt": lambda f, a, b: a > b,
    "ge": lambda f, a, b: a >= b,
    "eq": lambda f, a, b: a == b,
    "ne": lambda f, a, b: a != b,
    "and": lambda f, a, b: f.logic_and(a > 0, b > 0),
    "or": lambda f, a, b: f.logic_or(a > 0, b > 0),
    "not": lambda f, a, b: f.logic_not(a > 0),
    "if_else": lambda f, a, b: f.if_else(a > b, a + 1, b - 1),
    "if_else_number": lambda f, a, b: f.if_else(a, 2.0, b),
    "atan2": lambda f, a, b: f.atan2(a, b),
    "copysign": lambda f, a, b: f.copysign(a, b),
    "sqrt": lambda f, a, b: f.sqrt(a + 1),
    "sin": lambda f, a, b: f.sin(a),
    "cos": lambda f, a, b: f.cos(a),
    "tan": lambda f, a, b: f.tan(a),
    "exp": lambda f, a, b: f.exp(a),
    "log": lambda f, a, b: f.log(a + 2),
    "fabs": lambda f, a, b: f.fabs(a),
    "floor": lambda f, a, b: f.floor(4.1 * a),
}


def in_casadi(name, a, b):
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    return float(ca.Function("f", [x, y], [OPERATIONS[name](ca, x, y)])(a, b))


def algebra(expressions):
    m = ModelBuilder("algebra", "Expressions of two inputs")
    a, b = m.input("a", "1", "First"), m.input("b", "1", "Second")
    x = m.state("unused", 0.0, "1", "A state that nothing depends on")
    m.derivative(x, 0.0)
    for name, expression in expressions.items():
        m.output(name, expression(symbols, a, b), "1", name)
    return m.build()


@pytest.mark.parametrize("name", OPERATIONS)
def test_python_kernel_computes_what_casadi_computes(name):
    model = algebra({name: OPERATIONS[name]})
    code = in_python(model)
    for a, b in POINTS:
        z = vector(model, a=a, b=b)
        code.outputs(z)
        assert z[model.value_references[name]] == pytest.approx(
            in_casadi(name, a, b), rel=1e-15, abs=0.0
        ), (a, b)


@pytest.mark.parametrize("kernel", ["compiled", "tape"])
def test_kernels_in_c_compute_what_casadi_computes(kernel):
    model = algebra(OPERATIONS)
    code = KERNELS[kernel](model)
    for a, b in POINTS:
        z = vector(model, a=a, b=b)
        code.outputs(z)
        expected = [in_casadi(name, a, b) for name in OPERATIONS]
        got = [z[model.value_references[name]] for name in OPERATIONS]
        np.testing.assert_allclose(got, expected, rtol=1e-15, err_msg=f"{a}, {b}")


@pytest.mark.parametrize("kernel", KERNELS)
def test_the_branch_not_taken_may_be_undefined(kernel):
    model = algebra({"y": lambda f, a, b: f.if_else(a > 0, 1 / a, b)})
    code, z = KERNELS[kernel](model), vector(model, a=0.0, b=7.0)
    code.outputs(z)
    assert z[model.value_references["y"]] == 7.0


def test_an_operation_without_a_code_is_refused_by_number():
    with pytest.raises(
        ValueError, match=f"outputs: operation {symbols.Op.ATAN} has no code of a tape yet"
    ):
        tape_of(algebra({"y": lambda f, a, b: f.atan(a)}))


def test_an_unknown_platform_is_refused_with_those_there_are():
    with pytest.raises(
        ValueError, match=r"no target for platform 'amiga'.*linux64, win64, darwin64"
    ):
        compile_library("", "amiga")


def test_a_failing_compiler_is_quoted():
    with pytest.raises(RuntimeError, match=r"(?s)ziglang\) failed for .*source\.c.*error"):
        compile_library("this is not C", host_platform())


NEEDS_A_RUNTIME = """
__attribute__((visibility("default"))) double third(double a) { return (double)((__int128)a / 3); }
"""
NEEDS_NONE = """
#include <math.h>
#include <stdio.h>
__attribute__((visibility("default"))) double third(double a) { return printf("") + fmod(a, 10) / 3; }
"""


MACS = TARGETS["darwin64"]


@pytest.mark.parametrize(
    ("target", "source", "succeed"),
    [
        (TARGETS["linux64"][0], NEEDS_NONE, [True, True]),
        (TARGETS["linux64"][0], NEEDS_A_RUNTIME, [False, True]),
        # a Mac's own library has the functions of that runtime
        *(
            pytest.param(mac, source, [True, True], marks=[pytest.mark.nightly, pytest.mark.slow])
            for mac in MACS
            for source in (NEEDS_NONE, NEEDS_A_RUNTIME)
        ),
    ],
)
def test_a_library_is_the_same_without_zigs_own_runtime_or_has_it(
    target, source, succeed, tmp_path
):
    """zig compiles its runtime library anew in each new environment."""
    (tmp_path / "source.c").write_text(source, encoding="utf-8")
    ending = ".dylib" if target in MACS else ".so"
    built = tmp_path / f"library{ending}"
    made = []
    for way in unwrap(_ways)(target, ending, (), built):
        made.append(built.read_bytes() if _run(way, tmp_path) is None else None)
        built.unlink(missing_ok=True)
    assert [content is not None for content in made] == succeed
    kept = compile_for(source, target, ending)
    assert {content for content in made if content} == {kept.read_bytes()}
    if host_platform() == "linux64" and ending == ".so":
        third = ctypes.CDLL(str(kept)).third
        third.argtypes, third.restype = [ctypes.c_double], ctypes.c_double
        assert third(9.0) == 3.0


# -- errors of the builder ---------------------------------------------------------------------


def builder():
    m = ModelBuilder("faulty", "A model with a mistake")
    x = m.state("x", 0.0, "1", "State")
    return m, x


@pytest.mark.parametrize("kind", ["parameter", "state", "input", "output", "calculated"])
def test_a_name_can_be_declared_once(kind):
    m, x = builder()
    declare = {
        "parameter": lambda: m.parameter("x", 1.0, "1", "Again"),
        "state": lambda: m.state("x", 0.0, "1", "Again"),
        "input": lambda: m.input("x", "1", "Again"),
        "output": lambda: m.output("x", 2 * x, "1", "Again"),
        "calculated": lambda: m.calculated("x", 1.0, "1", "Again"),
    }
    with pytest.raises(ValueError, match="model faulty: 'x' is declared twice"):
        declare[kind]()


def test_scopes_keep_names_apart_and_end_after_an_error():
    m, x = builder()
    m.derivative(x, -x)
    with m.scope("inner"):
        m.input("x", "1", "Another x")
    with contextlib.suppress(ZeroDivisionError), m.scope("failing"):
        raise ZeroDivisionError
    m.input("u", "1", "Outside")
    assert [i.name for i in m.build().inputs] == ["inner.x", "u"]


def test_every_state_needs_exactly_one_derivative():
    m, x = builder()
    m.state("z", 0.0, "1", "Another state")
    m.derivative(x, -x)
    with pytest.raises(ValueError, match=r"model faulty: no derivative is given for z$"):
        m.build()
    with pytest.raises(ValueError, match="state 'x' has two derivatives"):
        m.derivative(x, x)


@pytest.mark.parametrize("through_another", [False, True])
def test_a_calculated_parameter_must_not_depend_on_a_tunable_one(through_another):
    m, x = builder()
    m.derivative(x, -x)
    K = m.parameter("K", 1.0, "1", "Gain", tunable=True)
    m.calculated("constant", 2.0, "1", "Two")
    c = m.calculated("c", 2 * K, "1", "Twice the gain")
    if through_another:
        m.calculated("d", 2 * c, "1", "Four times the gain")
    with pytest.raises(ValueError, match=r"'c' is computed once, at initialisation, .* tunable"):
        m.build()


def test_an_algebraic_loop_is_refused_when_closed():
    m, x = builder()
    signal = m.algebraic("w")
    with pytest.raises(ValueError, match="model faulty: signal 'w' depends directly on itself"):
        m.close(signal, x + 2 * signal)


def test_an_algebraic_signal_is_replaced_by_its_value():
    m, x = builder()
    w = m.algebraic("w")
    m.derivative(x, -w)
    m.output("y", w + 1, "1", "Output")
    m.close(w, 3 * x)
    model = m.build()
    assert model.derivatives([2.0], [], [1e-4], [])[0][0] == -6.0
    assert model.outputs_function([2.0], [], [1e-4], [])[0][0] == 7.0


def test_algebraic_signals_may_be_closed_in_any_order():
    m, x = builder()
    a, b = m.algebraic("a"), m.algebraic("b")
    m.close(a, 3 * x)
    m.close(b, a + 1)
    m.derivative(x, -b)
    assert m.build().derivatives([2.0], [], [1e-4], [])[0][0] == -7.0


def test_a_loop_through_two_algebraic_signals_is_named():
    m, x = builder()
    a, b = m.algebraic("a"), m.algebraic("b")
    with pytest.raises(ValueError, match="a, b depend on one another"):  # noqa: PT012 — either call may find it
        m.close(a, b + 1)
        m.close(b, a + 1)
        m.derivative(x, -b)
        m.build()


@pytest.mark.parametrize("kind", ["state", "calculated"])
def test_initial_values_must_depend_on_parameters_alone(kind):
    m, x = builder()
    m.derivative(x, -x)
    u = m.input("u", "1", "Input")
    if kind == "state":
        m.derivative(m.state("z", u, "1", "State that starts from an input"), -x)
    else:
        m.calculated("one", 1.0, "1", "One")
        m.calculated("z", u, "1", "Calculated from an input")
    with pytest.raises(ValueError, match=r"model faulty: .*'z'"):
        m.build()


def test_only_a_state_has_a_derivative():
    m, x = builder()
    m.derivative(x, -x)
    K = m.parameter("K", 1.0, "1", "Gain")
    with pytest.raises(ValueError, match="'K'"):  # noqa: PT012 — either call may find it
        m.derivative(K, -x)
        m.build()


def test_units_are_declared_ones_and_pu_names_its_base():
    m, _ = builder()
    with pytest.raises(
        ValueError, match=r"'P' has the unit 'kW', which is not declared; use one of .*MW"
    ):
        m.parameter("P", 1.0, "kW", "Power")
    with pytest.raises(
        ValueError, match="'P' is in pu and names no base; add base='S_n' or '100 MVA'"
    ):
        m.parameter("P", 1.0, "pu", "Power")


def turning_frame():
    """A lag in a frame that turns by ``rate``; the input is held as seen in the frame at the communication point."""
    m = ModelBuilder("turning_frame", "Stepwise state")
    u = m.input("u", "1", "Input", start=2.0)
    rate = m.parameter("rate", 30.0, "rad/s", "Speed of the frame")
    angle = m.state("angle", 0.5, "rad", "Angle of the frame", stepwise=True)
    x = m.state("x", 0.0, "1", "Lag")
    m.derivative(angle, rate + x)
    m.derivative(x, u * symbols.cos(angle) - x)
    m.output("seen", u * symbols.cos(angle), "1", "Input in the frame")
    return m


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_stepwise_state_stands_still_during_a_step_and_moves_at_its_end(kernel):
    model = turning_frame().build()
    code, z, at = KERNELS[kernel](model), vector(model), model.value_references
    code.initialise(z)
    code.derivatives(z)
    assert z[at["der(angle)"]] == 30.0
    assert code.advance(z, 1e-3, 50) == 0
    x = 2.0 * math.cos(0.5) * (1 - math.exp(-0.05))  # with the angle held: an exponential
    assert z[at["x"]] == pytest.approx(x, rel=1e-12)
    assert z[at["angle"]] == pytest.approx(0.5 + 0.05 * 30.0, rel=1e-15)
    assert z[at["seen"]] == 2.0 * math.cos(z[at["angle"]])
    assert code.advance(z, 1e-3, 50) == 0
    # its rate where the step began
    assert z[at["angle"]] == pytest.approx(2.0 + 0.05 * (30.0 + x), rel=1e-12)


def test_the_implicit_method_refuses_stepwise_states():
    with pytest.raises(
        ValueError, match="turning_frame: the implicit integrator knows no stepwise states"
    ):
        turning_frame().build(integrator="sdirk")
