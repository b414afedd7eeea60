"""A network that is solved as data, by a planned factorisation, beside the same network in code."""

import math

import numpy as np
import pytest

from fmus.grid import phasor_grid
from fmus.grid.network import Line, Load, Network, Port, Zip
from fmus.toolchain.dependencies import structure
from fmus.toolchain.elimination_plan import plan_pattern
from fmus.toolchain.model_builder import ModelBuilder
from tests.support.kernels import compiled, in_python, taped, vector
from tests.support.written_out import written_out

BUSES = 12


def meshed() -> Network:
    """A ring with a chord and a phase shifter, a load that follows a law of its own, static generation, and a fault."""
    names = [f"b{k}" for k in range(BUSES)]
    lines = [
        Line(
            f"l{k}",
            names[k],
            names[(k + 1) % BUSES],
            X=0.1 + 0.01 * k,
            R=0.01,
            B=0.02,
            tap=1.0 + 0.01 * (k % 3),
            shift=0.1 * (k == 4),
        )
        for k in range(BUSES)
    ]
    lines.append(Line("chord", "b1", "b8", X=0.3, R=0.02))
    loads = (
        Load("d1", "b3", 50.0, 20.0),
        Load("d2", "b6", 40.0, 10.0, active=Zip(i=0.5, p=0.5)),
        Load("d3", "b9", -30.0, 5.0, active=Zip(p=1.0), k_pf=1.5),
    )
    ports = (Port("g1", "b0"), Port("g2", "b5"), Port("g3", "b10"))
    return Network(
        "meshed",
        tuple(names),
        tuple(lines),
        loads,
        ports,
        stray_B=0.001,
        faults=("b7",),
        phasors=True,
    )


@pytest.fixture(scope="module")
def models():
    """The same network, solved by code and from data."""
    data = phasor_grid.phasor_grid(meshed())
    return {"code": written_out(data), "data": data}


@pytest.fixture(scope="module")
def kernels(models):
    return {
        "code": compiled(models["code"]),
        "tape of code": taped(models["code"]),
        "data": taped(models["data"]),
        "python": in_python(models["data"]),
    }


def started(model, kernel):
    z = vector(model)
    for k, name in enumerate(("g1", "g2", "g3")):
        for variable, value in (
            ("e_re", 1.0),
            ("e_im", 0.1 * k),
            ("y_re", 0.1),
            ("y_im", -3.0 - k),
        ):
            z[model.value_references[f"{name}.{variable}"]] = value
    kernel.initialise(z)
    return z


@pytest.mark.parametrize("how", ["data", "python"])
def test_data_and_code_have_one_solution(models, kernels, how):
    """At the start, after steps, with another admittance, an open line, a fault, and back at the start."""
    at = models["code"].value_references
    assert at == models["data"].value_references

    def course(kernel):
        z, seen = started(models["code"], kernel), []
        for changes in ({}, {"g2.y_im": -9.0}, {"chord.connected": 0.0}, {"b7.fault.on": 1.0}):
            for name, value in changes.items():
                z[at[name]] = value
            assert kernel.advance(z, 2e-3, 3) == 0
            kernel.derivatives(z)
            seen.append(list(z))
        z = started(models["code"], kernel)
        kernel.outputs(z)
        return np.array([*seen, list(z)])

    by_code, other = course(kernels["code"]), course(kernels[how])
    assert np.isfinite(by_code).all()
    moved = np.abs(np.diff(by_code[:, at["b8.v_re"]]))
    assert (moved > 1e-4).all()  # each change reaches the voltages
    assert np.abs(by_code - other).max() <= 1e-11 * np.abs(by_code).max()
    assert not np.array_equal(by_code, other)  # really another way of solving


def test_the_factors_of_one_instance_do_not_serve_another(models, kernels):
    """Different admittances by turns in one workspace; each gets its own answer."""
    kernel, at = kernels["data"], models["data"].value_references

    def voltage(z):
        kernel.outputs(z)
        return z[at["b3.v_re"]], z[at["b3.v_im"]]

    first, second = started(models["data"], kernel), started(models["data"], kernel)
    second[at["g1.y_im"]] = -0.5
    alone = voltage(first), voltage(second)
    assert alone[0] != alone[1]
    assert [voltage(z) for z in (first, second, first, second)] == [*alone, *alone]


def test_both_have_one_description(models):
    """With all that each output depends on, of which an island reaches no other."""
    assert models["code"].nodal is None is not models["data"].nodal
    assert structure(models["data"]) == structure(models["code"])
    lines = Line("ab", "a", "b", X=0.1), Line("cd", "c", "d", X=0.1)
    islands = Network(
        "two", tuple("abcd"), lines, (), (Port("g", "a"), Port("h", "d")), phasors=True
    )
    model = phasor_grid.phasor_grid(islands)
    reached = {u.reference: u.known for u in structure(model).outputs}
    at = model.value_references
    assert {at["g.e_re"], at["h.e_re"]} & {*reached[at["b.v_re"]]} == {at["g.e_re"]}
    assert structure(model) == structure(written_out(model))


def test_a_matrix_that_is_singular_gives_no_finite_voltage(models, kernels):
    """An emf behind an infinite admittance: the slave then names what is not finite."""
    for how in ("data", "python"):
        z = started(models["data"], kernels[how])
        z[models["data"].value_references["g1.y_re"]] = math.inf
        kernels[how].outputs(z)
        assert not math.isfinite(z[models["data"].value_references["b0.v_re"]])


def test_the_plan_holds_the_matrix_and_its_fill():
    """An arrow: eliminated from its tip it fills, from its shaft it does not."""
    n = 30
    rows, columns = (
        [*range(n), *[0] * (n - 1), *range(1, n)],
        [*range(n), *range(1, n), *[0] * (n - 1)],
    )
    plan = plan_pattern(n, rows, columns)
    assert sorted(plan.entries) == sorted(zip(rows, columns, strict=True))
    assert len(plan.column) == len(rows)
    assert plan.order.index(0) >= n - 2
    assert [plan.column[k] for k in plan.diagonal] == list(range(n))


def test_an_implicit_integrator_has_no_nodal_equations():
    m = ModelBuilder("network", "A network")
    x = m.state("x", 0.0, "1", "State")
    m.derivative(x, -x)
    m.nodes({(0, 0): (1.0, 0.0)}, [(1.0, 0.0)])
    with pytest.raises(
        ValueError, match="the implicit integrator solves no nodal equations; take runge_kutta"
    ):
        m.build(integrator="sdirk")


def test_a_change_that_is_undone_gives_the_first_answer_again(models, kernels):
    """A line that is opened and closed, to the last bit."""
    kernel, at = kernels["data"], models["data"].value_references
    z = started(models["data"], kernel)
    seen = []
    for closed in (1.0, 0.0, 1.0):
        z[at["chord.connected"]] = closed
        kernel.outputs(z)
        seen.append(z[at["b8.v_im"]])
    assert seen[0] == seen[2] != seen[1]


def following():
    """Two buses behind an admittance that a parameter and an input set, with a state that follows a voltage."""
    m = ModelBuilder("following", "A state that follows a voltage of a network")
    g = m.parameter("g", 2.0, "1", "Admittance between the buses", tunable=True)
    b = m.input("b", "1", "Admittance to earth", start=1.0)
    i = m.input("i", "1", "Current", start=0.5)
    x = m.state("x", 0.1 * g, "1", "State")
    between = (g, -3.0 * g)
    elements = {(k, j): between for k in (0, 1) for j in (0, 1)}
    elements[0, 1] = elements[1, 0] = (-g, 3.0 * g)
    elements[1, 1] = (g, b - 3.0 * g)
    voltages = m.nodes(elements, [(i, x), (0.2 * x, i * g)])
    m.derivative(x, voltages[1][0] - x)
    for k, (re, im) in enumerate(voltages):
        m.output(f"v{k}_re", re, "1", "Voltage, real part")
        m.output(f"v{k}_im", im, "1", "Voltage, imaginary part")
    return m.build()


ACTS = ("parameter", "input", "given input", "state", "state too", "nan", "undo", "other", "step")
ASKED = ("outputs", "derivatives", "requirements", "initialise", "nothing")


@pytest.mark.parametrize("seed", range(2))
def test_voltages_that_are_kept_are_those_at_the_point(seed):
    """Whatever was set, undone, stepped or asked for before, in two instances' vectors by turns, to the last bit."""
    model, rng = following(), np.random.default_rng(seed)
    at, kernel, fresh = model.value_references, taped(model), taped(model)
    places = {"parameter": at["g"], "input": at["i"], "given input": at["b"]}
    places |= dict.fromkeys(("state", "state too"), at["x"])
    z, other = vector(model), vector(model, g=1.5)
    for one in (z, other):
        kernel.initialise(one)
    seen, before = set(), list(z)
    for act in rng.choice(ACTS, 150):
        kept = list(z)
        if act in places:
            z[places[act]] = rng.choice([0.0, -0.0, 0.7, 1.3])
        elif act == "nan":
            z[at["i"]] = math.nan
        elif act == "undo":
            z[:] = before
        elif act == "other":
            z, other = other, z
        else:
            kernel.advance(z, 1e-2, 2)
        before = kept
        asked = rng.choice(ASKED)
        if asked == "requirements":
            kernel.requirements(z, vector(model))
        elif asked != "nothing":
            getattr(kernel, asked)(z)
        alone = vector(model)
        alone[:] = z
        for ask in (fresh.derivatives, fresh.outputs):
            fresh.begin()
            ask(alone)
        for name in rng.permutation(["outputs", "derivatives"]):
            getattr(kernel, name)(z)
        assert bytes(z) == bytes(alone), (act, asked)
        seen.add(bytes(z))
    assert len(seen) > 40


@pytest.mark.parametrize("moved", ["states", "input", "both"])
def test_what_was_solved_before_leaves_no_trace(models, moved):
    """Where states alone move, only what they reach is solved anew: to the bits of a kernel that solves all."""
    model = models["data"]
    kernel, random = taped(model), np.random.default_rng(5)
    first_state = len(model.parameters) + len(model.calculated) + len(model.inputs)
    z = started(model, kernel)
    kernel.outputs(z)
    for turn in range(12):
        if moved != "input":
            for k in range(len(model.states)):
                z[first_state + k] += 0.1 * random.standard_normal()
        if moved != "states":
            z[model.value_references["g2.e_im"]] = random.standard_normal()
        fresh, alone = taped(model), vector(model)
        alone[:] = z[:]
        calls = ("derivatives", "outputs") if turn % 3 else ("outputs",)
        for one, values in ((kernel, z), (fresh, alone)):
            for call in calls:
                getattr(one, call)(values)
        assert bytes(z) == bytes(alone)
    assert kernel.advance(z, 1e-3, 3) == fresh.advance(alone, 1e-3, 3) == 0
    assert bytes(z) == bytes(alone)
