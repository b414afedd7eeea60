"""FMUs in a process of their own: what they are given, how long is waited for them, what their current is."""

from ctypes import addressof, c_double, c_uint
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.devices.acceptance.checks import port
from orchestrator.devices.acceptance.process import HostedComponent
from orchestrator.devices.sandbox import resource_limits


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
    monkeypatch.setattr(resource_limits.os, "getloadavg", lambda: (load, 0.0, 0.0), raising=False)
    monkeypatch.setattr(resource_limits.os, "cpu_count", lambda: 2)
    assert resource_limits.crowded() == wanted


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
