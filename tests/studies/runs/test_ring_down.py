"""The ring-down table shows the mode, or nothing and why."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.studies.runs import tables
from orchestrator.studies.runs.ring_down import _obstacle, ring_down_of
from orchestrator.studies.runs.run import run_scenario
from orchestrator.studies.signals import signal_modes
from tests.support.scenarios import prepare_one


def run_of(tmp_path, events, stop):
    text = load_case("two_area").path.read_text(encoding="utf-8")
    head, _, tail = text.partition("[[events]]")
    path = tmp_path / "case.toml"
    path.write_text(f"{head}{events}{tail[tail.index(chr(10) + '[') :]}", encoding="utf-8")
    ready = prepare_one(path, "gfor", stop_time=stop)
    return run_scenario(ready)


STEP = '[[events]]\ntype = "load_change"\ntime = "{} s"\ncomponent = "grid"\nload = "load_2"\nscale = {}\n'


@pytest.fixture(scope="module")
def of_a_step(tmp_path_factory):
    """A run of 8 s, of which its first swing rings down undisturbed."""
    return run_of(tmp_path_factory.mktemp("step"), STEP.format(1, 1.02), 8.0)


def test_a_ring_down_is_shown(of_a_step):
    result = of_a_step
    assert result.ring_down.damping_percent == pytest.approx(10.6, abs=1)


@pytest.mark.parametrize(
    ("events", "stop", "why"),
    [
        (STEP.format(1, 1.02), 3.0, "has fewer than 1 periods of the mode"),
        (
            STEP.format(1, 1.02) + STEP.format(3, 1.0),
            6.0,
            "falls into its window, from t = 2 s to t = 6 s",
        ),
    ],
)
def test_what_is_no_ring_down_of_the_mode_is_not_shown(tmp_path, events, stop, why):
    result = run_of(tmp_path, events, stop)
    assert result.ring_down is None
    (said,) = [text for text in result.modes.warnings if "no ring-down" in text]
    assert why in said


@pytest.mark.parametrize(
    ("at", "why"),
    [
        (2.0, ""),  # the event that the window begins at
        (2.1, "step falls into its window, from t = 2 s to t = 8 s"),
        (7.9, "step falls into its window, from t = 2 s to t = 8 s"),
        (8.0, ""),
    ],
)
def test_an_event_within_a_window_is_in_the_way(at, why):
    class Step(SimpleNamespace):
        def __str__(self):
            return "step"

    modes = SimpleNamespace(prepared=SimpleNamespace(events=[Step(time=at)]))
    times = np.linspace(2.0, 8.0, 13)
    assert _obstacle(modes, SimpleNamespace(frequency_hz=0.6), times, []) == why


@pytest.mark.parametrize(("moved", "shown"), [(1.0, True), (1.15, True), (1.5, False)])
def test_the_mode_beside_a_ring_down_is_that_of_the_system_that_rings(of_a_step, moved, shown):
    """With a mode of what the events leave that lies elsewhere, the swing is not called that mode."""
    result = of_a_step
    (name, mode), *_ = result.modes.named.items()
    at = complex(mode.eigenvalue.real, moved * mode.eigenvalue.imag)
    after = replace(result.modes, named={name: replace(mode, eigenvalue=at)})
    seen, why = ring_down_of(result.modes, result.dataset, [], after)
    assert (seen is not None) is shown
    assert shown or "it swings at 0." in why
    table = tables.ring_downs([replace(result, ring_down=result.ring_down, after=after)])
    assert [row[2] for row in table.rows] == [f"{moved * mode.frequency_hz:.4f}"]
    seen, why = ring_down_of(result.modes, result.dataset, [], "the modes after are not known: x")
    assert (seen, why.endswith("is shown: the modes after are not known: x")) == (None, True)


@pytest.mark.parametrize("hertz", [(0.5,), (0.5, 0.9)])
def test_how_far_two_modes_are_told_apart_is_said_of_two(hertz):
    modes = [
        SimpleNamespace(
            eigenvalue=complex(-0.2, 2 * np.pi * f),
            frequency_hz=f,
            amplitude=1.0,
            doubts=(),
            damping_ratio=0.06,
        )
        for f in hertz
    ]
    own = SimpleNamespace(
        interval=0.02,
        modes=modes,
        about=(),
        start=0.0,
        stop=20.0,
        line=None,
        is_trend=lambda m: False,
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(signal_modes, "over_a_trend", lambda *_: "")
        said = signal_modes.SignalModes.remarks.fget(own)
    assert sum("tell two modes apart" in text for text in said) == len(hertz) - 1
