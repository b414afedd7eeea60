"""Control DLL and the sheet's circuit together are the converter: shorter samples tend to `gfor`."""

import numpy as np
import pytest

from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from tests.control_dll.hosts import Circuit, ControlHost, elements

OMEGA, VOLT = 2 * np.pi * 50, 230e3 * np.sqrt(2 / 3)
END, JUMP, TURN = 0.1, 0.05, -0.02
GRID = 4e-5
"""Time between compared values, and sample time of the coarsest run [s]."""

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def power(written):
    """P + jQ [MVA] at the bus each 40 µs with a sample time; the bus voltage turns by −0.02 rad at 50 ms."""

    def run(sample_time, change=lambda u: u, sheet=lambda e: e, **values):
        dll = written(sample_time=sample_time)
        control = ControlHost(dll.libraries["linux64"], **values)
        circuit = Circuit(
            sheet(elements(dll.sheet.read_text(encoding="utf-8"))), sample_time, VOLT, OMEGA
        )
        circuit.begin(1350e6)
        control.inputs[:] = change(circuit.measured())
        assert [control.call(name) for name in ("FirstCall", "CheckParameters", "Initialize")] == [
            0,
            0,
            0,
        ]
        found = []
        for k in range(round(END / sample_time)):
            if k == round(JUMP / sample_time):
                circuit.x[4] *= np.exp(1j * TURN)
            found.append(circuit.power())
            circuit.advance(control.sample(change(circuit.measured()))[:3])
        return np.array(found)[:: round(GRID / sample_time)] / 1e6

    return run


@pytest.fixture(scope="module")
def converter(fmu_path):
    """The same of the FMU `gfor`, whose control does not sample."""
    part, found = 4, []
    with LoadedComponent("gfor", read_description(fmu_path("gfor"))) as component:
        component.setup(0.0, None)
        component.enter_initialization_mode()
        component.exit_initialization_mode()
        for k in range(part * round(END / GRID)):
            voltage = np.exp(1j * TURN * (k >= part * round(JUMP / GRID)))
            component.set({"v_re": voltage.real, "v_im": voltage.imag})
            if not k % part:
                found.append([component.values([name])[name] for name in ("p", "q")])
            component.step(k * GRID / part, GRID / part)
    return np.array(found) @ [1500, 1500j]


def furthest(a, b):
    return np.abs(a - b).max()


def test_shorter_samples_tend_to_the_converter(power, converter):
    """Sampling errs by its time to the first order: half the time, half the error; extrapolated, next to none."""
    errors = {time: furthest(power(time), converter) for time in (4e-5, 2e-5, 1e-5)}
    swing = np.ptp(converter.real)
    assert swing > 300
    assert errors[2e-5] < 0.015 * swing
    assert errors[4e-5] / errors[2e-5] == pytest.approx(2.1, abs=0.2)
    assert errors[2e-5] / errors[1e-5] == pytest.approx(2.05, abs=0.15)
    assert furthest(2 * power(1e-5) - power(2e-5), converter) < 0.05 * errors[1e-5]


def test_the_circuit_starts_at_rest(power):
    before = power(2e-5)[: round(JUMP / GRID)]
    assert np.abs(before - 1350).max() < 0.5


@pytest.mark.parametrize(
    "mistake",
    [
        {"change": lambda u: u[[0, 2, 1, 3, 5, 4, 6, 8, 7]]},
        {"change": lambda u: np.concatenate([u[:3], -u[3:6], u[6:]])},
        {"change": lambda u: u * np.repeat([1.0, 1.02, 1.0], 3)},
        {"sheet": lambda e: e | {"R_cap": 0.0}},
        {"sheet": lambda e: e | {"L_t": 1.02 * e["L_t"]}},
        {"output_lead": 0.0},
        {"angle_0": 0.01},
    ],
    ids=[
        "phases swapped",
        "i_s reversed",
        "i_s 2 % large",
        "no R_cap",
        "L_t 2 % large",
        "no lead",
        "angle",
    ],
)
def test_a_wrong_connection_shows(power, converter, mistake):
    try:
        wrong = furthest(power(2e-5, **mistake), converter)
    except AssertionError:  # the DLL refused values that are no longer finite
        wrong = np.inf
    assert not wrong < 1.2 * furthest(power(2e-5), converter)
