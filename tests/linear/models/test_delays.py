"""Delays, cuts and disturbances of connections in the linear model, against characteristic equations and simulation."""

import numpy as np
import pytest
from scipy.special import lambertw

from orchestrator.linear.doubts.coupled_response import worst_disagreement
from orchestrator.linear.doubts.examination import examine
from orchestrator.linear.models.delays import SHORT, WireLink, doubtful_delays, representation_error
from orchestrator.linear.models.linearization import Blocks, compose, continuous
from orchestrator.linear.models.state_space import state_space
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.modes import eigenvalues
from orchestrator.systems.coupling.events import ParameterChange, WireFault
from orchestrator.systems.coupling.imperfections import Bias, Delay, DropOut, Noise, Quantisation
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.schedule import gauss_seidel, jacobi
from orchestrator.systems.coupling.system import System
from tests.systems.coupling.small_fmus import small_fmu

H = 1e-3
K = -3.0
LOOP = gauss_seidel((("x",),))


def loop(*imperfections):
    """ẋ = K·y with y = x, over one connection from its output to its input."""
    system = System()
    system.add("x", small_fmu("integrator"), {"gain": K})
    system.connect("x.y", "x.u")
    for imperfection in imperfections:
        system.disturb(system.connections[0], imperfection)
    return system


def with_gain(*imperfections, wire=0, bias=0.0):
    """A lag whose output returns over a gain of −2; what is at the gain goes straight through it."""
    system = System()
    system.add("lag", small_fmu("lag"), {"T": 0.05, "x_0": 0.0})
    system.add("gain", small_fmu("gain"), {"K": -2.0, "offset": bias})
    system.connect("lag.y", "gain.u")
    system.connect("gain.y", "lag.u")
    for imperfection in imperfections:
        system.disturb(system.connections[wire], imperfection)
    return system


def multipliers(steps):
    """Roots of μ^(d+1) − μ^d − H·K: the loop with a register of d steps, exactly."""
    return np.roots([1.0, -1.0, *np.zeros(steps - 1), -H * K])


@pytest.mark.parametrize("steps", [1, 2, 17, SHORT])
def test_a_delay_of_few_steps_is_exact_at_every_frequency(steps):
    with Master(loop(Delay(steps * H)), LOOP, H) as master:
        model = compose(Blocks(master), LOOP)
    found = np.linalg.eigvals(model.A)
    # the place of the step before adds a zero
    found = found[np.argsort(-np.abs(found))][: steps + 1]
    expected = multipliers(steps)
    for value in expected:
        assert np.abs(found - value).min() < 1e-7
    assert model.number_of_states == 1


def test_a_long_delay_gives_the_modes_of_its_register():
    steps = 400
    with Master(loop(Delay(steps * H)), LOOP, H) as master:
        model = compose(Blocks(master), LOOP)
    assert len(model.names) < 40
    expected = np.log(multipliers(steps).astype(complex)) / H
    slow = expected[np.abs(expected) * steps * H < 20]
    assert len(slow) >= 6
    found = eigenvalues(model)
    for value in slow:
        assert np.abs(found - value).min() < 2e-5 * abs(value)


def test_the_continuous_delay_gives_the_roots_of_the_transcendental_equation():
    delay = 0.4
    with Master(loop(Delay(delay)), LOOP, H) as master:
        model = continuous(Blocks(master, derivatives=True))
    found = eigenvalues(model)
    for branch in range(-3, 3):
        root = lambertw(K * delay, branch) / delay  # λ = K·exp(−λ·T)
        assert np.abs(found - root).min() < 1e-6 * abs(root)


@pytest.mark.parametrize(("delay", "stable"), [(1.0, True), (20.0, None)])
def test_a_range_beyond_the_delay_gives_no_verdict(delay, stable):
    """ẋ = K·x(t − T) is stable for |K|·T < π/2; 24 / (2π·20 s) = 0.19 Hz is less than the range's 2 Hz."""
    system = System()
    system.add("x", small_fmu("integrator"), {"gain": -0.01})
    system.connect("x.y", "x.u")
    system.disturb(system.connections[0], Delay(delay))
    with Master(system, LOOP, 0.01) as master:
        blocks = Blocks(master, derivatives=True)
        examined = examine(master, blocks, compose(blocks, LOOP), None)
    assert examined.stability.stable is stable
    assert bool(examined.warnings) == (stable is None)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("eigenvalue", [-19.5 + 3.3j, -1e3 + 0j, 1e3 + 2j])
def test_an_error_beyond_all_numbers_is_an_error(eigenvalue):
    """e^(1950) is no number; the delay must be said to be wrong all the same."""
    link = WireLink("a.y -> b.u", 100.0, is_cut=False)
    assert representation_error(link, eigenvalue, 1e-4) > 0.9
    (said,) = doubtful_delays([link], [-0.1 + 0.05j, eigenvalue], 1e-4)
    assert f"at the eigenvalue {eigenvalue:.4g}" in said


def test_the_representation_knows_its_error():
    long = WireLink("a.y -> b.u", 0.2, is_cut=False)
    assert representation_error(long, 1j * 12 / 0.2, 1e-4) < 1e-5
    assert representation_error(long, 1j * 24 / 0.2, None) < 1e-8
    assert representation_error(long, 1j * 100 / 0.2, 1e-4) > 0.01
    assert (
        representation_error(WireLink("a.y -> b.u", 5e-3, is_cut=False), 1j * 20_000, 1e-4) < 1e-9
    )


@pytest.mark.parametrize("steps", [1, 5, SHORT + 50])
@pytest.mark.parametrize("wire", [0, 1])
@pytest.mark.parametrize(
    "schedule",
    [
        gauss_seidel((("lag",), ("gain",))),
        gauss_seidel((("gain",), ("lag",))),
        jacobi(("lag", "gain")),
    ],
    ids=["lag first", "gain first", "side by side"],
)
def test_the_step_map_moves_as_the_running_system(schedule, wire, steps):
    """Whatever goes straight through, and whichever connection is late.

    The disturbance is a jump, of which the polynomials of a long delay have no more than the slow part.
    """
    with Master(with_gain(Delay(steps * H), wire=wire), schedule, H) as master:
        find_operating_point(master)
        found = worst_disagreement(master, compose(Blocks(master), schedule))
    assert found.error < (1e-7 if steps <= SHORT else 0.02), found


def test_the_response_to_an_input_is_that_of_the_run():
    """An input of the gain steps while the way to the gain is late."""
    schedule = gauss_seidel((("lag",), ("gain",)))
    system = with_gain(Delay(30 * H), bias=1.0)
    with Master(system, schedule, H) as master:
        find_operating_point(master)
        space = state_space(
            Blocks(master, inputs=["gain.K"], outputs=["gain.y", "lag.y"]), schedule
        )
        before = [master.components[c].get(["y"])["y"] for c in ("gain", "lag")]
        recorder = Recorder(["gain.y", "lag.y"], 1)
        step = 1e-5
        master.run(0.2, [ParameterChange(0.0, "gain", "K", -2.0 + step)], [recorder])
    response = space.step_response(np.array([step]), recorder.times[1:])
    np.testing.assert_allclose(recorder.values[1:] - before, response, rtol=0, atol=1e-9)


def test_a_lost_signal_opens_the_loop():
    for lost in (DropOut(), DropOut(0.0), DropOut(2.0)):
        with Master(with_gain(lost), jacobi(("lag", "gain")), H) as master:
            blocks = Blocks(master, derivatives=True)
            assert np.abs(eigenvalues(continuous(blocks)) + 20.0).max() < 1e-6
            step = eigenvalues(compose(blocks, master.schedule))
            assert np.abs(step[np.abs(step) < 100] + 20.0).max() < 1e-3


def test_a_bias_moves_the_operating_point_and_no_mode():
    schedule = gauss_seidel((("lag",), ("gain",)))
    with Master(with_gain(), schedule, H) as master:
        modes = eigenvalues(compose(Blocks(master), schedule))
    with Master(with_gain(Bias(0.3)), schedule, H) as master:
        point = find_operating_point(master)
        assert point.states["lag.x"] == pytest.approx(-2 * 0.3 / 3, abs=1e-12)  # x = −2·(x + 0.3)
        assert np.allclose(
            np.sort(eigenvalues(compose(Blocks(master), schedule))), np.sort(modes), rtol=1e-7
        )
        master.run(0.1)
        assert master.components["lag"].get(["x"])["x"] == pytest.approx(-0.2, abs=1e-12)


def test_a_substitute_gives_the_operating_point_of_the_open_loop():
    with Master(with_gain(DropOut(0.7)), gauss_seidel((("lag",), ("gain",))), H) as master:
        assert find_operating_point(master).states["lag.x"] == pytest.approx(-1.4, abs=1e-10)


@pytest.mark.parametrize(
    ("imperfection", "kind"), [(Noise(0.1, 3), "noise"), (Quantisation(0.1), "quantisation")]
)
def test_noise_and_quantisation_leave_point_and_modes_and_the_verdict_says_so(imperfection, kind):
    schedule = gauss_seidel((("lag",), ("gain",)))
    with Master(with_gain(imperfection, bias=1.0), schedule, H) as master:
        assert find_operating_point(master).states["lag.x"] == pytest.approx(1 / 3, abs=1e-12)
        blocks = Blocks(master, derivatives=True)
        model = compose(blocks, schedule)
        said = examine(master, blocks, model, continuous(blocks)).warnings
        assert np.allclose(np.sort(eigenvalues(model).real), eigenvalues(model).real, rtol=1)
    assert any(f"lag.y -> gain.u has {imperfection}" in s and f"without {kind}" in s for s in said)


def test_a_cut_and_a_fault_to_come_are_said_beside_the_verdict():
    schedule = gauss_seidel((("lag",), ("gain",)))
    system = with_gain(DropOut())
    later = WireFault(1.0, "lag", system.connections[1], Delay(0.1))
    system.foresee(later.connection, later.imperfection)
    with Master(system, schedule, H) as master:
        blocks = Blocks(master, derivatives=True)
        said = examine(master, blocks, compose(blocks, schedule), continuous(blocks)).warnings
    assert any("lag.y -> gain.u is frozen: it is cut" in s for s in said)
    assert any(
        "gain.y -> lag.u has faults later (delay of 0.1 s): the modes are those before" in s
        for s in said
    )


def test_delays_between_two_steps_are_interpolated_for_other_steps():
    """What a longer communication step would do with the same delay is asked of the same blocks."""
    with Master(loop(Delay(0.02)), LOOP, H) as master:
        exact = lambertw(K * 0.02).real / 0.02
        for step in (5e-4, 3e-3, 8e-3):
            values = eigenvalues(compose(Blocks(master, step), LOOP))
            # holding the input delays it by half a step more
            held = exact - step / 2 * exact**2 / (1 + exact * 0.02)
            assert abs(values[np.argmax(values.real)] - held) < abs(exact) * (exact * step) ** 2
