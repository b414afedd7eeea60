"""Limiters of excitation: a run tells when one acts, and run and modes tell what one does at the operating point."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.linear.doubts.excitation_limiters import warnings_at_end
from orchestrator.studies.modes.modes import compute_modes, running
from orchestrator.studies.runs.run import run_scenario
from tests.support.scenarios import prepare_one

OVER = {
    "sg1.oel": "maxex2",
    "sg1.oel.EFDRATED": 1.86,  # the field current of the start is 1.094 of it
    "sg1.oel.TIME1": 0.5,
    "sg1.oel.TIME2": 0.4,
    "sg1.oel.TIME3": 0.3,
    "sg1.oel.KMX": 0.05,
}
PHASOR = {"models": "phasor"}


def prepared(values):
    return prepare_one("kundur", "pss", PHASOR | values, step_size=1e-3)


def about_limiters(warnings):
    return [text for text in warnings if "its limiter of" in text or "of its limiter" in text]


def test_a_run_tells_when_a_limiter_acts_and_at_which_machine(tmp_path):
    case = load_case("kundur").path
    text = case.read_text(encoding="utf-8")
    assert "scale = 1.01" in text
    (tmp_path / "case.toml").write_text(text.replace("scale = 1.01", "scale = 1.2"), "utf-8")
    (tmp_path / "units.csv").write_bytes((case.parent / "units.csv").read_bytes())
    file = tmp_path / "case.toml"
    result = run_scenario(prepare_one(file, "pss", PHASOR | OVER, step_size=1e-3, stop_time=3.0))
    found = [f for f in result.findings if f.kind == "active_limit"]
    assert [(f.component, f.variable) for f in found] == [("sg1", "oel.acts")]
    assert 1.4 < found[0].time < 1.55  # the load rises at 1 s; the time is from TIME2 to TIME1
    assert "the limiter of overexcitation of sg1 acts from t = 1." in found[0].message
    assert about_limiters(result.modes.warnings) == []
    assert found[0].until is None
    assert found[0].what == "limiter of overexcitation"


@pytest.mark.parametrize("R", [1.25, 2.5])
def test_modes_tell_that_a_limiter_acts_at_the_operating_point(R):
    values = {"sg1.uel": "mnlex2", "sg1.uel.R": R, "sg1.uel.K_M": 0.1, "sg1.uel.MELMAX": 9.0}
    result = compute_modes(prepared(values))
    told = about_limiters(result.warnings)
    assert len(told) == (R < 2)
    for text in told:
        assert text.startswith("sg1: its limiter of underexcitation acts at the operating point")
        assert text.endswith("without it: --set sg1.uel=none")


def test_modes_tell_of_an_operating_point_beyond_the_first_point_and_are_those_without_it():
    result = compute_modes(prepared(OVER | {"sg1.oel.EFDRATED": 1.0}))
    (text,) = about_limiters(result.warnings)
    assert "beyond the first point of its limiter of overexcitation: E_fd = 2.04 pu at the" in text
    assert (
        "oel.EFD1 = 1.1 of oel.EFDRATED = 1, which is 1.1 pu; in PSS/E its time would run" in text
    )
    assert "the time runs beyond 2.06 (oel.first_point) only" in text  # 1 % above the start
    free = compute_modes(prepared({}))
    assert result.electromechanical is not None
    assert free.electromechanical is not None
    wanted = free.electromechanical.eigenvalue
    assert result.electromechanical.eigenvalue == pytest.approx(wanted, rel=1e-6)


def test_a_limiter_that_acts_moves_modes():
    """The boost follows the reactive power: the voltage control is another one."""
    values = {"sg1.uel": "mnlex2", "sg1.uel.R": 1.25, "sg1.uel.K_M": 0.1, "sg1.uel.MELMAX": 9.0}
    acting, free = (compute_modes(prepared(given)) for given in (values, {}))
    assert acting.electromechanical is not None
    assert free.electromechanical is not None
    moved = abs(acting.electromechanical.eigenvalue - free.electromechanical.eigenvalue)
    assert moved > 1e-3


def test_modes_tell_of_an_operating_point_beyond_the_limits_of_oel2c():
    """The field current of the start is 2.035 pu; modes are those without the limiter."""
    values = {"sg1.oel": "oel2c", "sg1.oel.I_TFpu": 1.9, "sg1.oel.I_inst": 1.95}
    beyond, free = (compute_modes(prepared(x)) for x in (values | {"sg1.oel.I_lim": 1.8}, {}))
    pickup, instantaneous = about_limiters(beyond.warnings)
    assert "beyond the pickup of its limiter of overexcitation: E_fd = 2.04 pu" in pickup
    assert "and oel.I_TFpu = 1.9; in PSS/E its time would run out" in pickup
    assert "beyond the instantaneous limit of its limiter" in instantaneous
    assert "oel.I_inst = 1.95; in PSS/E it would pull the field down" in instantaneous
    assert beyond.electromechanical is not None
    assert free.electromechanical is not None
    wanted = free.electromechanical.eigenvalue
    assert beyond.electromechanical.eigenvalue == pytest.approx(wanted, rel=1e-6)


def test_modes_tell_of_an_operating_point_beyond_the_pickup_of_oel3c():
    """The field current of the start is 2.035 pu; modes are those without the limiter."""
    values = {"sg1.oel": "oel3c", "sg1.oel.I_TFpu": 1.9}
    beyond, free = (compute_modes(prepared(x)) for x in (values, {}))
    (pickup,) = about_limiters(beyond.warnings)
    assert "beyond the pickup of its limiter of overexcitation: E_fd = 2.04 pu" in pickup
    assert "and oel.I_TFpu = 1.9; in PSS/E its time would run out" in pickup
    assert beyond.electromechanical is not None
    assert free.electromechanical is not None
    wanted = free.electromechanical.eigenvalue
    assert beyond.electromechanical.eigenvalue == pytest.approx(wanted, rel=1e-6)


def test_modes_tell_of_an_operating_point_beyond_a_limiter_that_integrates():
    """It would never come to rest there; modes are those without it."""
    uel = {"sg1.uel": "uel1", "sg1.uel.K_UR": 0.5, "sg1.uel.K_UI": 1.0, "sg1.uel.V_UIMIN": 0.0}
    beyond, free = (compute_modes(prepared(x)) for x in (uel, {}))
    (text,) = about_limiters(beyond.warnings)
    assert "beyond the edge of its limiter of underexcitation: it is let rest, and its edge" in text
    assert "pu farther out (uel.moved)" in text
    assert beyond.electromechanical is not None
    assert free.electromechanical is not None
    wanted = free.electromechanical.eigenvalue
    assert beyond.electromechanical.eigenvalue == pytest.approx(wanted, rel=1e-6)


def test_a_run_tells_of_a_limiter_that_rests_beyond_its_limit_or_holds_on_below_it():
    """At the end its time still runs, then it limits, then it holds what needs no limit any more."""
    oel = {"Q_ref": 0.22, "T_delay": 0.1, "K_P": 0.2, "K_I": 2.0}
    values = {"sg1.oel": "oel4c", **{f"sg1.oel.{name}": value for name, value in oel.items()}}
    told = []
    with running(prepared(values)) as master:
        machine = master.components["sg1"]
        for raised, end in ((0.05, 0.08), (0.05, 0.4), (-0.02, 0.6)):
            machine.set({"exciter.delta_V_ref": raised})
            master.run(end)
            told.append(warnings_at_end(master))
        excess = -machine.get(["oel.excess"])["oel.excess"]
    (rests,), limits, (holds,) = told
    assert rests.startswith("sg1: at t = 0.08 s, the end of the run, its limiter of overexcitation")
    assert "pu beyond oel.Q_ref = 0.22 pu: 0.0" in rests
    assert "of oel.T_delay = 0.1 s have passed; let the run go on beyond t = 0.1" in rests
    assert limits == ()
    assert f"its reactive power is {excess:.4g} pu below oel.Q_ref = 0.22 pu: the integral" in holds
