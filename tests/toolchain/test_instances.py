"""Instances of both kinds of FMU, as a host sees them: state, values, independence."""

import math

import numpy as np
import pytest

from tests.support.host import DISCARD, GENERATOR, OK, H, running

# -- state -------------------------------------------------------------------------------------


def spoil(h):
    """Change parameters, inputs and states of a running converter."""
    h.fmu.setBoolean([h.vr["pod_p.enabled"]], [False])
    h.set(droop__R_f=0.01, pod_p__K=3.0, v_re=0.7, droop__theta=1.0, filter__u_c_q=0.2)
    h.run(7, first=1000)


def test_a_saved_state_restores_everything_and_the_same_future(host):
    h = running(host())
    state, before = h.fmu.getFMUstate(), h.everything()
    future = h.run(50, first=50)
    spoil(h)
    assert h.everything() != before
    h.fmu.setFMUstate(state)
    assert h.everything() == before
    assert h.fmu.getBoolean([h.vr["pod_p.enabled"]]) == [True]
    assert h.run(50, first=50) == future
    h.fmu.setFMUstate(state)  # a state can be restored more than once
    assert h.everything() == before
    h.fmu.freeFMUstate(state)
    assert h.log == []


def test_a_serialised_state_continues_in_another_instance(host):
    h, twin = running(host()), host(instance="twin").initialise()
    state = h.fmu.getFMUstate()
    data, before = h.fmu.serializeFMUstate(state), h.everything()
    future = h.run(50, first=50)
    twin.fmu.setFMUstate(twin.fmu.deSerializeFMUstate(data))
    assert twin.everything() == before
    assert twin.fmu.serializeFMUstate(twin.fmu.getFMUstate()) == data
    assert twin.run(50, first=50) == future


def test_a_state_saved_before_initialisation_keeps_its_parameters(host):
    h = host()
    h.set(P_0=0.4)
    state, before = h.fmu.getFMUstate(), h.everything()
    h.set(P_0=0.5)
    h.initialise()
    h.run(3)
    h.fmu.setFMUstate(state)
    assert h.everything() == before
    h.initialise()
    assert h.get("p") == pytest.approx(0.4, abs=1e-12)


def test_reset_brings_back_start_values(host):
    h, fresh = host(), host(instance="fresh")
    start = fresh.everything()
    h.set(P_0=0.5)
    running(h)
    assert h.everything() != start
    h.fmu.reset()
    assert h.everything() == start
    assert h.step() >= DISCARD  # it is not initialised again yet
    h.fmu.reset()
    assert h.initialise().run(10) == fresh.initialise().run(10)


def test_instances_are_independent(host):
    alone = running(host()).run(50, first=50)
    one, two = running(host()), host(instance="two")
    two.set(P_0=0.3)
    two.initialise()
    mixed = []
    for k in range(50):
        two.run(1, first=7 * k)
        mixed += one.run(1, first=50 + k)
    assert mixed == alone


# -- values ------------------------------------------------------------------------------------


def test_outputs_are_fresh_after_setting_inputs_without_a_step(host):
    """The grid's voltage is v = Σ i / G, with G = P / v_0² = 26 pu at bus 2."""
    h = host("two_area_grid").initialise()
    line = h.get("L.i_re")
    h.set(sg1__i_re=10.0, gfor__i_re=16.0)
    assert h.get("bus_2.v_re") == pytest.approx((26.0 - line) / 26.0, rel=1e-14)
    h.set(gfor__i_re=3.0)
    assert h.get("bus_2.v_re") == pytest.approx((13.0 - line) / 26.0, rel=1e-14)
    h.set(load_2__scale=2.0)
    assert h.get("bus_2.v_re") == pytest.approx((13.0 - line) / 52.0, rel=1e-14)


def test_initialisation_meets_the_power_flow(host):
    h = host()
    h.set(
        P_0=0.6,
        Q_0=0.1,
        v_0=1.02,
        theta_0=0.3,
        v_re=1.02 * math.cos(0.3),
        v_im=1.02 * math.sin(0.3),
    )
    h.initialise()
    assert h.get("p", "q") == pytest.approx([0.6, 0.1], abs=1e-13)
    derivatives = [n for n in h.reals if n.startswith("der(")]
    assert np.abs(h.get(*derivatives)).max() < 1e-9


def test_states_can_be_set_after_initialisation(host):
    h = host().initialise()
    h.set(droop__P_f=0.7)
    assert h.get("droop.P_f") == 0.7
    assert h.get("omega") == pytest.approx(1 + 0.05 * (h.get("droop.P_ref") - 0.7), abs=1e-15)


@pytest.mark.parametrize("name", ["gfor", GENERATOR, "two_area_grid"])
def test_derivatives_equal_a_finite_difference(name, host):
    h = host(name).initialise()
    h.run(20)
    states = [d.variable.derivative.name for d in h.md.derivatives]
    rate = np.array(h.get(*(f"der({s})" for s in states)))
    start, x = h.fmu.getFMUstate(), np.array(h.get(*states))

    def quotient(size):
        h.fmu.setFMUstate(start)
        assert h.step(20 * H, size) == OK
        return (np.array(h.get(*states)) - x) / size

    extrapolated = 2 * quotient(5e-8) - quotient(1e-7)
    assert np.abs(rate).max() > 1e-2
    np.testing.assert_allclose(extrapolated, rate, rtol=1e-5, atol=1e-6 * np.abs(rate).max())


def test_one_long_step_equals_its_short_ones_exactly(host):
    long, short = host(), host(instance="short")
    for h in (long, short):
        h.initialise()
        h.set(v_re=0.95, v_im=0.05)
    assert long.step(0.0, 5e-4) == OK
    assert [short.step(k * H) for k in range(5)] == [OK] * 5
    assert long.everything() == short.everything()


def test_the_internal_step_cuts_a_communication_step(host):
    coarse, fine = host(), host(instance="fine")
    fine.set(internal_step=2.5e-5)
    for h in (coarse, fine):
        h.initialise()
        h.set(v_re=0.95)
        assert h.step() == OK
    x = "feed_forward.u_q"
    assert fine.get(x) != coarse.get(x)
    assert fine.get(x) == pytest.approx(coarse.get(x), abs=1e-3)
    quarters = host(instance="quarters").initialise()
    quarters.set(v_re=0.95)
    assert [quarters.step(k * H / 4, H / 4) for k in range(4)] == [OK] * 4
    assert quarters.get(x) == fine.get(x)


def test_tunable_parameters_take_effect_while_running(host):
    h = host().initialise()
    for k in range(500):
        h.set(v_im=0.1 * math.sin(6.0 * k * H))
        assert h.step(k * H) == OK
    assert h.get("delta_p_pod") == 0.0
    h.fmu.setBoolean([h.vr["pod_p.enabled"]], [True])
    h.set(pod_p__K=10.0)
    ten = h.get("delta_p_pod")
    assert 1e-6 < abs(ten) < 0.1
    h.set(pod_p__K=20.0)
    assert h.get("delta_p_pod") == pytest.approx(2 * ten, rel=1e-14)
    h.set(pod_p__limit=abs(ten))
    assert abs(h.get("delta_p_pod")) == abs(ten)
    assert h.step(500 * H) == OK
    h.fmu.setBoolean([h.vr["pod_p.enabled"]], [False])
    assert h.get("delta_p_pod") == 0.0
