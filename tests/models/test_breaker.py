"""Devices behind an open breaker: the current fades, and each goes on by its own controls."""

import numpy as np
import pytest

from fmus.toolchain.catalogue import build_model
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent

GENERATORS = [f"synchronous_generator_{exciter}" for exciter in ("ac4a", "st1", "st4b")]
WATCHED = ("i_re", "i_im", "p", "q", "omega")


def run(path, seconds, values, watched, step=1e-4):
    """The device on a held bus voltage, its breaker opened after 100 steps: columns of the watched outputs."""
    with LoadedComponent("device", read_description(path)) as device:
        device.set(values)
        device.setup(0.0, None)
        device.enter_initialization_mode()
        device.set({"v_re": 1.0, "v_im": 0.0})
        device.exit_initialization_mode()
        rows = []
        for k in range(round(seconds / step)):
            if k == 100:
                device.set({"connected": False})
            device.step(k * step, step)
            rows.append(list(device.get(list(watched)).values()))
    return dict(zip(watched, np.array(rows).T, strict=True))


@pytest.mark.parametrize("name", ["gfor", "gfl", "gfl_l2ep", *GENERATORS])
def test_the_current_fades_within_the_breakers_time(name, fmu_path):
    found = run(fmu_path(name), 0.03, {"P_0": 0.7, "Q_0": 0.2}, WATCHED)
    current = np.hypot(found["i_re"], found["i_im"])
    assert np.ptp(current[:100]) < 1e-8
    assert current[109] == pytest.approx(current[99] / np.e, rel=2e-3)
    assert current[-1] < 1e-7 * current[0]
    assert abs(found["p"][-1]) < 1e-7
    assert all(np.isfinite(values).all() for values in found.values())


@pytest.mark.parametrize("name", GENERATORS)
def test_a_tripped_generator_runs_on_at_no_load_with_its_voltage_and_speed_governed(name, fmu_path):
    model = build_model(name)
    start = {v.name: v.start for v in model.parameters}
    # Alone, the slow governor of the 118-bus case would swing for minutes: it gets the other generators' fast one.
    fast = {
        "T_1": 0,
        "T_2": 0,
        "T_4": 0.3,
        "T_5": 7,
        "T_6": 0.6,
        "K_1": 0.3,
        "K_3": 0.3,
        "K_4": 0,
        "K_5": 0.4,
    }
    fast |= {"K_6": 0, "K_7": 0, "K_8": 0, "T_7": 0}
    values = {"P_0": 0.5, "Q_0": 0.1, "internal_step": 2e-4} | {
        f"governor.{k}": v for k, v in fast.items()
    }
    found = run(fmu_path(name), 80.0, values, (*WATCHED, "v_t", "E_fd", "P_m"), step=1e-2)
    assert all(np.isfinite(values).all() for values in found.values())
    P_m, w = found["P_m"][-1], found["omega"][-1]
    assert P_m == pytest.approx(0.0, abs=2e-3)
    # the droop's speed at no load
    assert w == pytest.approx(1 + 0.5 / start["governor.inverse_R"], abs=5e-4)
    v_t, E_fd = found["v_t"], found["E_fd"]
    # open circuit: E_fd = 1 gives 1 pu at rated speed
    assert v_t[-1] == pytest.approx(w * E_fd[-1], abs=2e-3)
    K = start.get("exciter.K_A", np.inf)
    reference = v_t[0] + (E_fd[0] - E_fd[-1]) / K
    assert v_t[-1] == pytest.approx(reference, abs=2e-3)


def test_a_tripped_converter_keeps_its_voltage_and_goes_to_the_droops_frequency(fmu_path):
    found = run(fmu_path("gfor"), 2.0, {"P_0": 0.6, "Q_0": 0.0}, (*WATCHED, "u"))
    assert all(np.isfinite(values).all() for values in found.values())
    # P_ref covers the transformer's losses, too
    assert found["omega"][-1] == pytest.approx(1 + 0.05 * 0.6, abs=1e-4)
    assert found["p"][-1] == pytest.approx(0, abs=1e-9)
    assert found["u"][-1] == pytest.approx(found["u"][0], abs=0.02)
