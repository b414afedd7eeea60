"""Cases with phasor models on a network table: steady state, modes, switching, and devices of the wrong kind."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import CaseError
from orchestrator.linear.models.linearization import linearize
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.modes import find_modes
from orchestrator.systems.coupling.master import Master
from tests.cases.events.test_switching import RING, watch

PHASOR = (
    RING.replace('stop_time = "0.4 s"', 'stop_time = "0.4 s"\nstep_size = "5 ms"')
    .replace('"gfor"', '"gfor_phasor"')
    .replace('"synchronous_generator_st1"', '"synchronous_generator_st1_phasor"')
    .replace('model = "grid"', 'model = "phasor_grid"')
)


@pytest.fixture
def prepared(tmp_path):
    def prepare(text=PHASOR):
        (tmp_path / "case.toml").write_text(text, encoding="utf-8")
        return load_case(tmp_path / "case.toml").prepare(())[0]

    return prepare


def swing_of(ready):
    with Master(ready.system, ready.schedule, ready.step_size) as master:
        point = find_operating_point(master)
        modes = find_modes(linearize(master), 0.1, 3.0)
        return point, max(
            modes, key=lambda m: m.participation_of(["sg.machine.omega", "vsc.droop.theta"])
        )


def test_the_power_flow_is_the_networks_steady_state_and_the_swing_is_that_of_the_emt_models(
    prepared,
):
    point, found = swing_of(prepared())
    # Ratio, phase shift, charging, shunt and inductive loads are as the power flow has them.
    assert point.initial_residual < 1e-9
    assert point.iterations <= 1
    _, wanted = swing_of(prepared(RING))
    # far faster than what phasor models are for, 6 % of rated frequency
    assert 2 < wanted.frequency_hz < 3
    assert found.frequency_hz == pytest.approx(wanted.frequency_hz, rel=0.01)
    assert found.damping_percent == pytest.approx(wanted.damping_percent, abs=1.0)


def test_lines_loads_and_units_trip_and_return(prepared):
    events = "".join(
        f'[[events]]\ntype = "{kind}"\ntime = "{time} s"\n{what}\n'
        for kind, time, what in (
            ("line_trip", 0.05, 'line = "l23"'),
            ("line_reclosing", 0.1, 'line = "l23"'),
            ("load_trip", 0.15, 'load = "works"'),
            ("load_reconnection", 0.2, 'load = "works"'),
            ("unit_trip", 0.25, 'unit = "vsc"'),
            ("unit_reconnection", 0.3, 'unit = "vsc"'),
        )
    )
    ready = prepared(PHASOR + events)
    names = ["grid.l23.p", "grid.vsc.p", "vsc.p", "grid.b2.v", "sg.p"]
    start, opened, closed, tripped, back, alone, together = watch(
        ready, names, [0.045, 0.095, 0.145, 0.195, 0.245, 0.295, 0.395]
    )
    assert opened["grid.l23.p"] == 0.0
    assert abs(closed["grid.l23.p"]) > 0.1
    assert tripped["grid.b2.v"] > closed["grid.b2.v"] + 0.002
    assert back["grid.b2.v"] == pytest.approx(start["grid.b2.v"], abs=0.01)
    assert (alone["grid.vsc.p"], alone["vsc.p"]) == (0.0, 0.0)
    assert alone["sg.p"] > back["sg.p"] + 0.2
    assert together["grid.vsc.p"] != 0.0


def test_what_a_device_feeds_is_what_the_grid_gets(prepared):
    """A step apart in time at most: the device's figures are of the step done, the grid's of that to come."""
    event = '[[events]]\ntype = "load_change"\ntime = "0.1 s"\nload = "town"\nscale = 1.05\n'
    rows = watch(
        prepared(PHASOR + event), ["grid.vsc.p", "vsc.p", "grid.vsc.q", "vsc.q"], [0.3, 0.305]
    )
    for quantity in "pq":
        fed, got = rows[1][f"vsc.{quantity}"] * 5.0, rows[0][f"grid.vsc.{quantity}"]
        assert fed == pytest.approx(got, abs=0.01)


@pytest.mark.parametrize("device", ["gfor", "synchronous_generator_st1"])
def test_an_emt_device_on_a_phasor_network_is_refused_with_the_model_to_take(prepared, device):
    with pytest.raises(CaseError) as caught:
        prepared(PHASOR.replace(f'"{device}_phasor"', f'"{device}"'))
    (problem,) = caught.value.problems
    assert f"take '{device}_phasor', or model = 'grid'" in problem.text


def test_a_jacobi_schedule_and_other_steps_are_taken_from_the_file(prepared):
    ready = prepared(PHASOR.replace('"5 ms"', '"2 ms"\nschedule = "jacobi"'))
    assert ready.values["vsc.communication_step"] == 2e-3
    assert len(ready.schedule.groups) == 1
