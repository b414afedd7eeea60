"""FMUs in a process of their own: what they are given, how long is waited for them, what their current is."""

from ctypes import addressof, c_double, c_uint
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.devices.acceptance.checks import port
from orchestrator.devices.acceptance.checks.all import CHECKS
from orchestrator.devices.acceptance.checks.base import failed
from orchestrator.devices.acceptance.process import HostedComponent
from orchestrator.devices.acceptance.runner import CRASH, _Runner
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


@pytest.mark.parametrize(
    ("fault", "again", "before", "alive", "asked", "told"),
    [
        (CRASH, "", ["loads", "reset"], False, 1, True),
        (CRASH, CRASH, ["loads", "reset"], False, 1, False),
        (CRASH, "", [], False, 0, False),
        (CRASH, "", ["loads", "reset"], True, 0, False),
        ("hang", "", ["loads", "reset"], False, 0, False),
    ],
    ids=["not alone", "alone as well", "first of all", "still there", "no crash"],
)
def test_a_crash_that_does_not_come_in_a_new_process_is_told_with_what_came_before(
    fault, again, before, alive, asked, told, monkeypatch
):
    answers = []
    run = object.__new__(_Runner)
    run._limits, run._asked = SimpleNamespace(seconds=1.0), before
    run._process = SimpleNamespace(alive=alive)
    monkeypatch.setattr(
        run, "_answer", lambda one: answers.append(one) or SimpleNamespace(fault=again)
    )
    crashed = failed("state", fault, "its process died")
    found = run._with_whom(crashed)
    assert answers == [CHECKS["state"]] * asked
    more = "; not so in a new process: what came before it, loads, reset, damaged the FMU's memory"
    assert found == replace(crashed, evidence=crashed.evidence + more * told)
