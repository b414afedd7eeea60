"""Before the first event nothing may move: growths with known answers, and motions that are none."""

import numpy as np
import pytest

from orchestrator.simulation.watch.finding import Finding
from orchestrator.simulation.watch.seen import Watcher
from orchestrator.simulation.watch.undisturbed import Unrest, undisturbed_motion
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.schedule import jacobi
from tests.simulation.watch.seen import seen_of, system
from tests.systems.coupling.test_master import ring, system_of

PI = np.pi


def found(signals, until=1.0):
    return list(undisturbed_motion(seen_of(signals, 2.0), system("a", "b"), until))


@pytest.mark.parametrize("hertz", [0.01, 3.0, 37.0, 900.0])
@pytest.mark.parametrize("rate", [10.0, 30.0])
def test_a_growth_is_told_with_rate_frequency_component_and_time(hertz, rate):
    """0.01 Hz has no period in the time: it is a growth without oscillation."""
    size = 1e-12

    def y(t):
        return 0.7 + size * np.exp(rate * np.minimum(t, 1.0)) * np.cos(2 * PI * hertz * t)

    if size * np.exp(rate) < 1e-6:
        size = 1e-6
    (finding,) = found({"a.y": lambda t: 0.7 + 1e-3 * (y(t) - 0.7), "b.y": y})
    assert finding.kind == "growth"
    assert (finding.component, finding.variable) == ("b", "y")
    assert finding.figures["growth_rate"] == pytest.approx(rate, rel=0.1)
    if hertz > 1:
        assert finding.figures["frequency_hz"] == pytest.approx(hertz, rel=0.1)
    else:
        assert finding.figures["frequency_hz"] == 0.0
    assert 0.0 < finding.time < 1.0
    assert f"from t = {finding.time:.4g} s: b.y moves first and most" in finding.message


def test_a_start_that_settles_moves_but_does_not_grow():
    (finding,) = found({"a.y": lambda t: 1 - 0.01 * np.exp(-5 * t)})
    assert finding.kind == "undisturbed_motion"
    assert finding.figures["motion"] == pytest.approx(0.01, rel=0.02)


def test_a_jump_without_an_event_is_no_growth():
    (finding,) = found({"a.y": lambda t: 0.1 * (t > 0.5)})
    assert finding.kind == "undisturbed_motion"
    assert finding.time == pytest.approx(0.505)


@pytest.mark.parametrize(
    "y",
    [lambda t: 0.5 + 0 * t, lambda t: 0.5 + 1e-9 * np.sin(9 * t), lambda t: 1e-5 * np.tanh(9 * t)],
)
def test_what_stands_still_is_not_told(y):
    assert found({"a.y": y}) == []


def test_what_moves_after_the_event_is_not_undisturbed():
    assert found({"a.y": lambda t: 1e-3 * np.exp(np.maximum(t - 1.0, 0.0) * 5) - 1e-3}) == []


def test_fmus_whose_coupling_makes_them_grow():
    """Two integrators side by side: μ = 1 ± jωH, so that they grow at ln|μ|/H and swing at arg μ/2πH."""
    H, omega = 1e-4, 2 * PI * 90.0
    plan = system_of(
        ring("a", "b"),
        a=("integrator", {"gain": omega, "x_0": 1e-9}),
        b=("integrator", {"gain": -omega}),
    )
    recorder, watcher = Recorder(["a.y", "b.y"], 50), Watcher([], 50)
    with Master(plan, jacobi(("a", "b")), H) as master:
        master.run(0.8, (), [recorder, watcher])
    (finding,) = undisturbed_motion(watcher.seen(recorder), plan, 0.8)
    assert finding.kind == "growth"
    assert finding.figures["growth_rate"] == pytest.approx(
        np.log(abs(1 + 1j * omega * H)) / H, rel=0.02
    )
    assert finding.figures["frequency_hz"] == pytest.approx(
        np.arctan(omega * H) / (2 * PI * H), rel=0.02
    )


@pytest.mark.parametrize(
    ("hertz", "explained"), [(1.0, True), (2.004, True), (1.5, False), (0.02, False), (0.4, False)]
)
def test_a_forcing_explains_its_frequency_and_multiples_alone(hertz, explained):
    swings = Finding(
        "sustained_oscillation", 0.0, "a", "x", "swings", None, {"frequency_hz": hertz}
    )
    assert Unrest(0.0, 9.0, "a.x", "forcing", 1.0).explains(swings) is explained
