"""Dips and steps of inputs that acceptance checks apply."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.devices.acceptance.checks import aftermath, ride_through
from orchestrator.devices.acceptance.checks.subject import Subject


def test_a_dip_is_a_part_of_the_voltage_that_the_device_has(monkeypatch):
    normal, asked = 1.04 * np.exp(0.3j), []

    def currents(running, change, steps):
        asked.append(change)
        return np.full(steps, 0.5 + 0j)

    monkeypatch.setattr(ride_through, "currents", currents)
    subject = SimpleNamespace(
        step_size=1e-3,
        point=SimpleNamespace(voltage=normal),
        running=lambda point: nullcontext(SimpleNamespace(time=0.0)),
        while_doing=lambda text: nullcontext(),
    )
    event = ride_through.Disturbance("dip", 0.4 * np.exp(0.5j), 0.1, before=((1.15, 0.2),))
    assert ride_through._disturbed(subject, [event], [], []) is None
    assert asked == pytest.approx([0, 0.15 * normal, 0.4 * np.exp(0.5j) * normal - normal, 0])


def test_after_a_dip_that_it_does_not_survive_a_third_of_it_for_half_as_long_is_tried():
    tried = []

    class Lost(aftermath._Look):
        def __init__(self):
            self._subject = SimpleNamespace(starts=False)

        def after(self, segments, soon):
            tried.append(segments)
            return SimpleNamespace(end=aftermath._End.NOTHING)

    assert len(Lost().until_back([(0.4, 0.3), (1.3, 0.2)], False)) == 2
    (_, milder) = tried
    assert np.ravel(milder) == pytest.approx([0.8, 0.15, 1.1, 0.1])


def test_an_input_that_starts_at_its_limit_is_moved_all_the_same():
    info = SimpleNamespace(start_number=1.0, minimum=1.0, maximum=1.2)
    fake = SimpleNamespace(
        inputs=["u"], port=None, description=SimpleNamespace(variables={"u": info})
    )
    assert Subject.amplitudes.fget(fake) == pytest.approx([0.05])
    info.maximum = 1.06
    assert Subject.amplitudes.fget(fake) == pytest.approx([0.03])
