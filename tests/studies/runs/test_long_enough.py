"""The stop that a run is told which is too short for a verdict: one time, in the verdict and in the findings."""

import re

import numpy as np
import pytest

import orchestrator as gfor_api
from orchestrator.linear.spectra.modes import make_mode
from orchestrator.simulation.watch.finding import Finding, go_on_to, rounded_up
from orchestrator.studies.runs import long_enough
from orchestrator.studies.runs.answer_of_run import of_run
from tests.studies.runs.test_answers import SPEEDS, result


def asking(enough, until=None):
    message = f"not judged; {go_on_to(enough)}; the same again from t = 3 s"
    return Finding("not_judged", 1.0, "gfor", "x", message, until, enough=enough)


def told(run):
    """The times that the verdict and the findings tell."""
    found = long_enough.with_one_stop(run.modes, run.after, run.findings)
    verdict = re.findall(r"--stop (\S+)", of_run(run).remark)
    return verdict, [re.findall(r"go on to t = (\S+) s", one.message) for one in found]


@pytest.mark.parametrize(
    ("enough", "until", "stop"),
    [
        (7.0, None, "16"),  # the mode decays until then
        (21.4, None, "21.4"),  # what the finding asks for is longer
        (21.4, 3.0, "21.4"),  # a speed that came back just before the end
    ],
)
def test_verdict_and_findings_name_one_stop_the_longest(enough, until, stop):
    run = result([asking(enough, until), asking(6.0)])
    assert told(run) == ([stop], [[stop], [stop]])


def mode_that_decays():
    return make_mode(-1.2 + 5j, np.ones(2) / 2, np.ones(2), SPEEDS)


def test_a_run_whose_end_is_judged_keeps_its_findings():
    run = result([Finding("not_judged", 1.0, "gfor", "x", "between events", 3.0)])
    assert long_enough.with_one_stop(run.modes, run.after, run.findings) == run.findings


def test_the_stop_is_that_from_which_on_a_growth_shows(monkeypatch):
    """A run that ends before it is sent on a second time otherwise."""
    monkeypatch.setattr(long_enough, "lasting_changes", lambda _: {"load.scale": 1.2})
    run = result([asking(3.0)], stop=2.0)
    run.modes.modes = [mode_that_decays()]
    shows = long_enough.seen_from(run.modes, None)
    assert shows > 1 + 3 / 1.2  # the mode is gone before
    assert told(run) == ([f"{shows:g}"], [[f"{shows:g}"]])
    run = result(stop=shows)
    assert of_run(run).verdict == "stable"
    run = result(stop=shows - 0.1)
    run.modes.modes = [mode_that_decays()]
    assert of_run(run).remark.endswith(f"settles: --stop {shows:g}")


@pytest.mark.parametrize(
    ("time", "rounded"), [(3.0, 3.0), (1 + 2.2 * 1.5, 4.3), (0.1 + 0.2, 0.3), (12.341, 12.35)]
)
def test_a_stop_is_rounded_up(time, rounded):
    assert rounded_up(time) == rounded


def test_the_stop_that_a_short_run_tells_gives_a_verdict():
    """``--stop 4`` and ``t = 3 s`` were told, and both were not known again."""
    case = gfor_api.load("two_area")

    def run(stop):
        return (
            case.with_(solver={"stop_time": stop}, analysis={"ring_down": None})
            .scenario("pod_pq")
            .run()
            .result
        )

    short = run(2.0)
    ((verdict,), times) = told(short)
    assert of_run(short).good is None
    assert times == [[verdict]]
    assert of_run(run(float(verdict))).good is True
