"""Figures of JSON beside the same figures worked out here: a factor or a sign in any of them is a wrong unit."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.cases.scenario.short_circuit import BusStrength
from orchestrator.studies.immittance.margins import Margin, NyquistMargins, margins_json
from orchestrator.studies.sensitivities.sensitivities import Sensitivity
from orchestrator.studies.sensitivities.view import rows_of
from orchestrator.studies.siting.confirmation import Confirmation
from orchestrator.studies.siting.view import _modes, _shift, confirmation_json
from tests.support.scenarios import bare_scenario

EIGENVALUE = -0.3137 + 3.7193j
EIGENVALUE_JSON = {
    "real": -0.3137,
    "imag": 3.7193,
    "frequency_hz": 3.7193 / (2 * np.pi),
    "damping_percent": 31.37 / abs(EIGENVALUE),
}


def test_of_the_strength_of_a_bus():
    said = BusStrength("bus_1", 417.3, 7.19, ("gfor",), 113.0).as_json()
    assert said.pop("scr") == pytest.approx(417.3 / 113.0)
    assert said == {
        "bus": "bus_1",
        "s_sc_mva": 417.3,
        "x_r": 7.19,
        "converters": ("gfor",),
        "rating_mva": 113.0,
    }


def test_of_nyquist_margins():
    up, down = Margin(3.19, 1.37), Margin(0.417, 2.71)
    phase, delay = Margin(41.3, 0.73), Margin(0.0173, 0.59)
    distance, disk = Margin(0.371, 1.93), Margin(0.677, 1.13)
    said = margins_json(NyquistMargins(up, down, phase, delay, distance, disk))
    expected = {
        "gain": (0.417, 2.71),
        "gain_up": (3.19, 1.37),
        "gain_down": (0.417, 2.71),
        "phase_deg": (41.3, 0.73),
        "delay_s": (0.0173, 0.59),
        "distance": (0.371, 1.93),
        "disk": (0.677, 1.13),
    }
    assert {key: (one["value"], one["frequency_hz"]) for key, one in said.items()} == expected


def test_of_a_sensitivity():
    change, continuous = 0.0413 - 0.0719j, 0.0431 - 0.0697j
    parameter = SimpleNamespace(name="gfor.H", value=2.3, unit="s", tunable=True, scale=2.3)
    row = Sensitivity(parameter, EIGENVALUE, change, continuous, "stays")
    mode = SimpleNamespace(
        eigenvalue=EIGENVALUE,
        frequency_hz=EIGENVALUE_JSON["frequency_hz"],
        damping_percent=EIGENVALUE_JSON["damping_percent"],
        by_component={"gfor": 1.0},
    )
    modes = SimpleNamespace(name_of=lambda _: "", prepared=bare_scenario(), modes=[])
    (said,) = rows_of(SimpleNamespace(rows=[row], mode=mode, modes=modes, held=()))
    # a difference quotient of the damping ratio [%], beside the derivative of the product
    step = 1e-6
    ends = [EIGENVALUE + sign * step * change for sign in (-1, 1)]
    low, high = (-100 * z.real / abs(z) for z in ends)
    points = (high - low) / (2 * step)
    expected = {
        "value": 2.3,
        "frequency_hz_per_unit": -0.0719 / (2 * np.pi),
        "damping_points_per_unit": points,
        "frequency_hz_per_percent": -0.0719 / (2 * np.pi) * 0.023,
        "damping_points_per_percent": points * 0.023,
        "real_per_unit": 0.0413,
        "imag_per_unit": -0.0719,
        "continuous_real_per_unit": 0.0431,
        "continuous_imag_per_unit": -0.0697,
    }
    figures = {key: value for key, value in said.items() if isinstance(value, float)}
    assert figures == pytest.approx(expected, rel=1e-6)


def test_of_a_place_for_a_device():
    mode = SimpleNamespace(
        eigenvalue=EIGENVALUE,
        damping_percent=EIGENVALUE_JSON["damping_percent"],
        by_component={"sg1": 0.417},
    )
    (said,) = _modes((SimpleNamespace(label="swing", mode=mode),))
    assert said.pop("mode") == "swing"
    assert said.pop("components") == {"sg1": 0.417}
    assert said == pytest.approx(EIGENVALUE_JSON)
    shift = SimpleNamespace(damping=1.37, change=-0.0517 + 0.0231j, part=0.719, hardly=False)
    assert _shift(shift) == {
        "damping_points": 1.37,
        "real": -0.0517,
        "imag": 0.0231,
        "part_of_best": 0.719,
        "controllable": True,
    }


def test_of_what_coupled_fmus_say_of_a_place():
    said = confirmation_json(
        Confirmation(
            "bus_1",
            predicted=-0.0517 + 0.0231j,
            coupled=-0.0531 + 0.0219j,
            with_device=EIGENVALUE,
            stable=True,
        )
    )
    assert said["with_device"] == pytest.approx(EIGENVALUE_JSON)
    assert said["predicted"] == {"real": -0.0517, "imag": 0.0231}
    assert said["coupled"] == {"real": -0.0531, "imag": 0.0219}
    assert said["error_percent"] == pytest.approx(
        100 * np.hypot(0.0014, 0.0012) / np.hypot(0.0531, 0.0219)
    )
    assert said["damping_percent_of_device_alone"] == pytest.approx(
        EIGENVALUE_JSON["damping_percent"]
    )
