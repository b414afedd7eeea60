"""The infinite bus: it stands still, its dip and load step come at their times, and modes know nothing of its clock."""

import numpy as np
import pytest

from fmus.toolchain.catalogue import build_model
from orchestrator.cases.case import load_case
from orchestrator.studies.modes.modes import compute_modes
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder
from tests.support.scenarios import prepare_one

H, STOP = 1e-4, 0.06
FASTEST = 2.0 / 0.5 * 2 * np.pi * 50
"""How fast the voltage falls when 200 MW are switched on at a bus with B = 0.5: ΔG/B·ω_b [pu/s]."""


@pytest.mark.parametrize(
    "values", [{}, {"v_0": 0.95, "theta_0": 0.4, "P_0": -7.0, "Q_0": 2.0, "load.P": 900.0}]
)
def test_it_stands_still_with_the_current_it_was_told(values):
    model = build_model("infinite_bus")
    p = np.array([values.get(v.name, v.start) for v in model.parameters])
    by_name = dict(zip([v.name for v in model.parameters], p, strict=True))
    v = by_name["v_0"] * np.exp(1j * by_name["theta_0"])
    i = np.conj((by_name["P_0"] + 1j * by_name["Q_0"]) / v)
    c, x = model.initialise(p)
    u = np.array([i.real, i.imag])
    assert np.abs(np.array(model.derivatives(x, u, p, c))).max() < 1e-10
    y = dict(
        zip(
            [o.name for o in model.outputs],
            np.array(model.outputs_function(x, u, p, c)).ravel(),
            strict=True,
        )
    )
    assert y["v_re"] + 1j * y["v_im"] == pytest.approx(v)
    assert (y["p"], y["q"]) == pytest.approx((by_name["P_0"], by_name["Q_0"]))


def run(scenario, values, *, events, internal_step=1e-4):
    steps = {f"{name}.internal_step": internal_step for name in ("gfor", "grid")}
    prepared = prepare_one("infinite_bus", scenario, steps | values)
    moved = (
        [type(e)(e.time - 0.98, e.component, e.parameter, e.value) for e in prepared.events]
        if events
        else []
    )
    recorder = Recorder(["grid.v", "gfor.p", "gfor.i_s"], 1)
    with Master(prepared.system, prepared.schedule, H) as master:
        master.run(STOP, moved, [recorder])
    return recorder.values


@pytest.mark.parametrize(
    ("scenario", "timed"),
    [
        ("dip", {"grid.dip.timed_depth": 0.2, "grid.dip.start": 0.02, "grid.dip.duration": 0.15}),
        ("load_step", {"grid.load.step": 0.5, "grid.load.step_time": 0.02}),
    ],
)
def test_what_the_clock_does_is_what_a_master_would_do(scenario, timed):
    """A sixth of an internal step early, and so the nearer the shorter that step is."""
    gaps = []
    for internal_step in (1e-4, 2.5e-5):
        by_clock = run(
            scenario, {"grid.clock.runs": True, **timed}, events=False, internal_step=internal_step
        )
        by_master = run(scenario, {}, events=True, internal_step=internal_step)
        assert np.ptp(by_master, axis=0).min() > 0.01
        assert np.array_equal(by_clock[:200], by_master[:200])  # until a step before the time
        gaps.append(np.abs(by_clock - by_master).max())
    assert gaps[0] < 1.01 * FASTEST * H / 6
    assert gaps[1] < gaps[0] / 3


def test_the_dip_ends_after_its_duration():
    values = {
        "grid.clock.runs": True,
        "grid.dip.timed_depth": 0.2,
        "grid.dip.start": 0.01,
        "grid.dip.duration": 0.01,
    }
    v = run("dip", values, events=False)[:, 0]
    assert v[:100] == pytest.approx(1.0)
    assert v[150:200].max() < 0.95
    assert v[-100:].min() > 0.97


def test_without_its_clock_it_has_a_steady_state():
    case = load_case("infinite_bus")
    (prepared,) = case.prepare(["dip"])
    result = compute_modes(prepared, (0.1, 10.0))
    assert result.operating_point.residual < 1e-12
    assert [mode.damping_ratio > 0.2 for mode in result.modes] == [True]  # the droop's
