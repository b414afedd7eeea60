"""What a disturbance sets, what a hosted FMU is given, and how long an answer is waited for."""

from contextlib import nullcontext
from ctypes import addressof, c_double, c_uint
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.devices.acceptance.checks import aftermath, port, ride_through
from orchestrator.devices.acceptance.checks.subject import Subject
from orchestrator.devices.acceptance.process import HostedComponent
from orchestrator.devices.fmi import limits


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


def test_a_hosted_fmu_is_given_one_row_of_as_many_values():
    given = []
    process = SimpleNamespace(
        run=lambda number, into, rows, out: given.append((number, into, rows.copy(), out)) or [0]
    )
    references, values = (c_uint * 2)(7, 9), (c_double * 2)(1.5, -2.5)
    fake = SimpleNamespace(_process=process, number=3)
    assert HostedComponent._set_real(fake, 0, addressof(references), 2, addressof(values)) == 0
    ((number, into, rows, out),) = given
    assert (number, list(into), rows.tolist(), list(out)) == (3, [7, 9], [[1.5, -2.5]], [])


@pytest.mark.parametrize(("load", "wanted"), [(0.1, 1), (6, 3), (1000, 8)])
def test_on_a_crowded_machine_an_answer_is_waited_for_up_to_eight_times_as_long(
    load, wanted, monkeypatch
):
    monkeypatch.setattr(limits.os, "getloadavg", lambda: (load, 0.0, 0.0), raising=False)
    monkeypatch.setattr(limits.os, "cpu_count", lambda: 2)
    assert limits.crowded() == wanted


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


def test_a_current_is_that_of_the_rating_with_which_it_runs(monkeypatch):
    """0.6 + 0.3j of 100 MVA are half as much of 200 MVA."""
    monkeypatch.setattr(
        port, "RealBatch", lambda component, names: SimpleNamespace(read=lambda: (0.6, 0.3))
    )
    running = SimpleNamespace(
        parameters={"S_n": 200.0},
        component=SimpleNamespace(description=SimpleNamespace(variables={})),
        subject=SimpleNamespace(outputs=["p", "i_re", "i_im"], use=SimpleNamespace(values={})),
    )
    assert port.present_current(running) == pytest.approx(0.3 + 0.15j)
    assert port.of_current(running, np.array([[9.0, 0.6, 0.3]])) == pytest.approx([0.3 + 0.15j])
