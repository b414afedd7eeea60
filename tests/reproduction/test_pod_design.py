"""The paper's POD design, and designs elsewhere, from coupled FMUs."""

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import InputError
from orchestrator.linear.spectra.modes import damping_ratio
from orchestrator.studies.coordinated_design.one_point import design_controller
from orchestrator.studies.modes.modes import compute_modes, running
from orchestrator.studies.pod_design.closed_loop import PodLoop, PodSetting
from orchestrator.studies.pod_design.design import DesignRequest
from orchestrator.studies.pod_design.lead_lag import angle_deg
from tests.support.scenarios import prepare_one

pytestmark = pytest.mark.reproduction

SATURATED = {"sg1.machine.saturation": True, "sg2.machine.saturation": True}
PAPER = {"pod_p": (0.20, 0.37), "pod_q": (0.26, 0.29)}
"""T_S1 and T_S2 [s] of the paper's table of POD parameters; K = 200 for both."""


def design(controller, case="two_area", **wanted):
    wanted = {"margins": False, **wanted}
    return design_controller(load_case(case), DesignRequest(controller=controller, **wanted)).result


def closed_loop(d, overrides=None):
    """The named mode with the final setting, from a system that is set up anew."""
    f = d.final.setting.filters
    values = {
        "enabled": True,
        "K": d.final.setting.gain,
        "T_S1": f.T_S1,
        "T_S2": f.T_S2,
        "N_S": d.target.stages,
    }
    case = load_case(d.case)
    (ready,) = case.prepare(
        [d.target.scenario],
        dict(overrides or {}) | {f"gfor.{d.request.controller}.{k}": v for k, v in values.items()},
    )
    return compute_modes(ready).electromechanical


@pytest.mark.parametrize("controller", PAPER)
@pytest.mark.parametrize("overrides", [{}, SATURATED], ids=["plain", "saturated"])
def test_the_papers_parameters(controller, overrides):
    d = design(controller, values=overrides)
    T_S1, T_S2 = PAPER[controller]
    assert abs(d.filters.T_S1 - T_S1) < 0.01
    assert abs(d.filters.T_S2 - T_S2) < 0.01
    assert (d.gain, d.active_bound, d.filters.N_S) == (200.0, "lower", 2)
    assert d.met
    assert d.final.eigenvalue == pytest.approx(closed_loop(d, overrides).eigenvalue, abs=1e-6)


@pytest.mark.parametrize(("controller", "gain"), [("pod_p", 18.7), ("pod_q", 145)])
def test_gains_before_the_floor_are_those_of_the_non_compensated_sensitivity(controller, gain):
    assert design(controller).gain_non_compensated == pytest.approx(gain, rel=0.02)
    assert design(controller, values=SATURATED).gain_non_compensated == pytest.approx(
        gain, rel=0.02
    )


@pytest.mark.parametrize(
    ("controller", "times"), [("pod_p", (0.249, 0.300)), ("pod_q", (0.267, 0.280))]
)
def test_a_small_gain_gives_the_derivative_itself(controller, times):
    d = design(controller, delta_gain=0.1)
    assert abs(d.filters.T_S1 - times[0]) < 0.0015
    assert abs(d.filters.T_S2 - times[1]) < 0.0015
    assert abs(angle_deg(d.sensitivities.compensated)) == pytest.approx(180, abs=2)


@pytest.mark.parametrize("controller", PAPER)
def test_the_sensitivity_of_a_small_gain_predicts_a_small_step(controller):
    """With the lead/lag's own sensitivity the prediction of one point of damping comes true within a tenth of it."""
    d = design(
        controller,
        delta_gain=0.1,
        gain_bounds=(0, 400),
        damping_increment=0.01,
        compensated_gain=True,
    )
    assert d.final.damping_ratio == pytest.approx(d.required_damping, abs=1e-3)


@pytest.mark.parametrize(
    ("controller", "overrides"),
    [
        ("pod_p", {}),
        ("pod_q", {"grid.X_L": 0.3}),
        ("pod_q", {"grid.X_L": 0.6}),
        ("pod_p", {"gfor.S_n": 1800.0, "gfor.P_0": 0.75}),
        ("pod_p", {"gfor.droop.R_f": 0.035}),
    ],
)
def test_refined_designs_keep_what_they_promise_on_a_system_set_up_anew(controller, overrides):
    d = design(controller, values=overrides, refine=True, gain_bounds=(0, 400))
    assert d.met
    assert d.achieved_damping == pytest.approx(d.required_damping, abs=1e-3)
    found = compute_modes(d.prepared)  # without the controller: where the design began
    assert found.electromechanical.eigenvalue == pytest.approx(d.initial, abs=1e-6)
    assert closed_loop(d, overrides).damping_ratio >= d.required_damping - 1e-3


def test_the_refined_gain_is_the_smallest_that_does():
    plain = design("pod_p", gain_bounds=(0, 400))
    assert plain.met  # by a better gain of its sweep, as that of the equations is too small
    refined = design("pod_p", gain_bounds=(0, 400), refine=True)
    assert refined.met
    assert plain.gain < refined.final.setting.gain < 100


@pytest.mark.slow
def test_a_requirement_out_of_reach_is_said_to_be():
    overrides = {"grid.X_L": 0.01}
    plain = design("pod_p", values=overrides, gain_bounds=(200, 400))
    assert (plain.met, plain.active_bound) == (False, "upper")
    d = design("pod_p", values=overrides, refine=True, gain_bounds=(200, 400))
    assert not d.met
    assert len(d.refinement.sweeps) >= 3
    assert d.initial.imag > 6
    assert plain.achieved_damping < d.achieved_damping < d.required_damping
    highest = max(p.damping_ratio for s in d.refinement.sweeps for p in s.points)
    assert highest < d.required_damping
    assert [sweep.why for sweep in d.refinement.sweeps][-2:] == [
        "searched for electromechanical",
        "searched for all modes",
    ]


@pytest.mark.nightly
@pytest.mark.slow
def test_a_search_finds_what_is_not_near_the_design():
    """Near the design 15.0 % are reached; far from it there is a setting with the 15.9 % that are asked for."""
    overrides = {"grid.X_L": 0.01}
    d = design("pod_p", values=overrides)  # one run without bounds and --refine
    assert d.met
    near = [s for s in d.refinement.sweeps if not s.why.startswith("searched")]
    assert max(s.chosen.damping_ratio for s in near) < d.required_damping - 0.005
    assert d.refinement.sweeps[-1].why == "searched for electromechanical"
    assert closed_loop(d, overrides).damping_ratio >= d.required_damping - 1e-3


@pytest.mark.slow
def test_no_other_mode_is_made_unstable_for_the_targets_sake():
    overrides = {"grid.X_L": 0.01}
    plain = design("pod_q", values=overrides, gain_bounds=(200, 5000))
    assert "unstable" in plain.broken
    refined = design("pod_q", values=overrides, gain_bounds=(200, 5000), refine=True)
    assert refined.broken is None
    assert refined.after.growth == 0
    assert refined.stability.stable
    assert refined.achieved_damping > damping_ratio(refined.initial)


@pytest.mark.parametrize("gains", [(200, 200), pytest.param((0, 1), marks=pytest.mark.slow)])
def test_narrow_bounds_are_swept_as_well(gains):
    d = design("pod_p", gain_bounds=gains, refine=True)
    assert gains[0] <= d.final.setting.gain <= gains[1]
    assert d.met == (gains == (200, 200))


def test_margins_say_where_a_mode_is_lost():
    d = design("pod_q", values={"grid.X_L": 0.01}, margins=True, gain_bounds=(200, 400))
    assert d.margins.down is None
    lost = d.margins.lost_up
    assert lost.real > 0
    assert 1 < d.margins.up < 8
    assert set(d.margins.variations) == {
        f"{v} {s}20 %" for v in ("K", "T_S1", "T_S2") for s in "+-"
    }
    overrides = {
        "grid.X_L": 0.01,
        "gfor.pod_q.enabled": True,
        "gfor.pod_q.T_S1": d.filters.T_S1,
        "gfor.pod_q.T_S2": d.filters.T_S2,
    }
    case = load_case("two_area")
    for factor, stable in ((1.0, True), (1.06, False)):
        gain = {"gfor.pod_q.K": d.gain * d.margins.up * factor}
        (ready,) = case.prepare(["gfor"], overrides | gain)
        modes = compute_modes(ready, (0.1, 100.0)).modes
        assert all(m.eigenvalue.real < 0 for m in modes) == stable


@pytest.mark.parametrize("controller", PAPER)
def test_the_delay_margin_is_the_delay_at_which_the_system_turns_unstable(controller):
    """The same linear system with what the gain sees delayed: its history is a polynomial in 30 Chebyshev points."""
    d = design(controller, margins=True)
    ready = prepare_one("two_area", d.target.scenario, {f"gfor.{controller}.N_S": d.target.stages})
    with running(ready) as master:
        loop = PodLoop(master, ["gfor"], controller)
        half, full = (model.A for model in loop.continuous_models(PodSetting(d.gain, d.filters)))
    left, sizes, right = np.linalg.svd(2 * (full - half))
    assert sizes[1] < 1e-6 * sizes[0]  # one gain, in one place
    u, v = sizes[0] * left[:, :1], right[:1]

    def growth(delay):
        D = differentiation(30) * 2 / delay  # of y(t + θ) over θ, from 0, where y = v·x, to −delay
        whole = np.block([[full - u @ v, np.zeros((len(u), 29)), u], [D[1:, :1] @ v, D[1:, 1:]]])
        return np.linalg.eigvals(whole).real.max()

    assert growth(0.2 * d.margins.loop.delay) < 1e-4
    assert growth(0.97 * d.margins.loop.delay) < 1e-4
    assert growth(1.03 * d.margins.loop.delay) > 5e-3


def differentiation(n):
    """Matrix that differentiates a polynomial, given at the n + 1 Chebyshev points from 1 to −1."""
    x = np.cos(np.pi * np.arange(n + 1) / n)
    c = np.r_[2, np.ones(n - 1), 2] * (-1) ** np.arange(n + 1)
    D = np.outer(c, 1 / c) / (x[:, None] - x + np.eye(n + 1))
    return D - np.diag(D.sum(axis=1))


def test_a_second_controller_is_designed_with_the_first_in_place():
    d = design("pod_q", scenario="pod_p")
    case = load_case("two_area")
    (ready,) = case.prepare(["pod_p"])
    assert d.initial == pytest.approx(compute_modes(ready).electromechanical.eigenvalue, abs=1e-6)


def test_a_requirement_that_is_none():
    with pytest.raises(InputError, match=r"the mode has 10.59 % already; ask for more"):
        design("pod_p", damping=0.1)
    with pytest.raises(InputError, match="it must be less than 1"):
        design("pod_p", damping_increment=0.95)


@pytest.mark.nightly
@pytest.mark.slow
def test_one_setting_for_all_converters_of_the_118_bus_system():
    d = design("pod_p", "ieee118", component="gfor*", mode="1-2")
    assert (len(d.target.components), d.target.key) == (28, ("gfor*",))
    assert d.met
    assert d.gain == 200.0
    assert d.achieved_damping > d.required_damping > 0.17
    assert abs(angle_deg(d.sensitivities.compensated)) == pytest.approx(180, abs=1)
    assert d.after.worst.damping_ratio > 0.05
