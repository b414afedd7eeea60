"""Angles whose stated unit their own values contradict are asked about, and no honest ones."""

import numpy as np
import pytest
import xarray as xr

from orchestrator.studies.signals.angle_units import doubtful_angles

T = np.arange(0, 20, 0.02)
SWING = 0.02 * np.exp(-0.1 * T) * np.sin(2 * np.pi * 0.6 * T)  # deviation of the frequency [Hz]


def record(unit, scale, drift=0.05, wrap=True, **others):
    """An angle that follows the swing from 1 rad on in a frame that drifts [Hz]; ``others``: name → unit and values."""
    angle = 1.0 + 2 * np.pi * np.cumsum(drift + SWING) * 0.02
    if wrap:
        angle = np.angle(np.exp(1j * angle))
    curves = {"NORTH.va": (unit, scale * angle)} | {
        name.replace("__", "."): pair for name, pair in others.items()
    }
    return xr.Dataset(
        {name: ("time", values, {"units": own}) for name, (own, values) in curves.items()},
        {"time": T},
    )


DEGREES = 180 / np.pi


@pytest.mark.parametrize(
    ("unit", "scale", "asked"),
    [("deg", 1.0, "radians"), ("rad", DEGREES, "degrees"), ("deg", DEGREES, ""), ("rad", 1.0, "")],
)
@pytest.mark.parametrize("other", ["jumps", "hertz", "speed", "another place"])
def test_both_directions_by_jumps_and_by_frequencies(unit, scale, asked, other):
    others = {
        "jumps": {},
        "hertz": {"NORTH__f": ("Hz", 50 + SWING)},
        "speed": {"NORTH__omega": ("pu", 1 + SWING / 50)},
        "another place": {"SOUTH__f": ("Hz", 60 + 0.9 * SWING)},
    }[other]
    drift = 0.2 if other == "jumps" else 0.0
    found = doubtful_angles(record(unit, scale, drift, **others))
    assert len(found) == bool(asked)
    if asked:
        label = {"radians": "rad", "degrees": "deg"}[asked]
        assert found[0].startswith(f"angles are labelled {unit}, and NORTH.va ")
        assert found[0].endswith(f"are they in {asked}? Write [{label}] behind the names")
        words = {
            "hertz": "57.3",
            "speed": "57.3",
            "another place": "57.3",
            "jumps": "from one end of its range to the other",
        }
        assert words[other] in found[0] or "begins with" in found[0]


def test_small_honest_angles_are_not_asked_about():
    """Degrees within a few units, with a step that is no wrap, and with a frequency that has another cause."""
    step = xr.Dataset(
        {"A.va": ("time", np.where(T < 5, -1.0, 5.28), {"units": "deg"})}, {"time": T}
    )
    assert doubtful_angles(step) == []
    noise = np.random.default_rng(3).normal(size=len(T))
    apart = record("deg", 1.0, 0.0, NORTH__f=("Hz", 50 + 0.01 * noise))
    assert doubtful_angles(apart) == []


def test_only_the_signal_that_is_asked_for_is_looked_at():
    dataset = record("deg", 1.0, 0.2, SOUTH__p=("MW", SWING))
    assert doubtful_angles(dataset, "SOUTH.p") == []
    assert len(doubtful_angles(dataset, "NORTH.va - SOUTH.p")) == 1
