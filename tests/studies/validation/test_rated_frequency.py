"""What shows that a recording is of a grid with another rated frequency than the device's."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.studies.validation.event import prepare_event
from orchestrator.studies.validation.hypotheses import _is_off_later
from orchestrator.studies.validation.questions import QuestionKind
from orchestrator.studies.validation.record import PortBases, Recording
from orchestrator.studies.validation.windows import Windows
from orchestrator.studies.validation.words import sentence

LENGTH = 6.0  # [s]


def recorded(frames, power=0.5):
    """A recording of so many phasors a second through a dip from 1 to 1.2 s."""
    times = np.arange(round(LENGTH * frames)) / frames
    everywhere = np.ones(len(times), dtype=bool)
    dip = (times >= 1) & (times < 1.2)
    return Recording(
        label="rec",
        begin=0.0,
        interval=1 / frames,
        voltage=1 - 0.3 * dip + 0j,
        power=power + 0 * times + 0j,
        good=everywhere,
        driven=everywhere,
        frame_hz=50.0,
        instantaneous=False,
        average=0.02,
        channels={"v": SimpleNamespace()},
    )


OF_NO_OTHER = [(frames, 60, None) for frames in (10, 60, 100, 1000)] + [(50, 50, None)]
"""Those of the device's own grid, those of both grids, and samples of other recorders."""


@pytest.mark.parametrize(
    ("frames", "rated", "grid"),
    [(50, 60, 50), (25, 60, 50), (30, 50, 60), (60, 50, 60), *OF_NO_OTHER],
)
def test_so_many_phasors_a_second_are_of_one_grid(frames, rated, grid):
    """By IEEE C37.118.1-2011; 10 a second are sent in both."""
    event = prepare_event(recorded(frames), PortBases(100.0, rated))
    found = [one for one in event.questions if one.kind is QuestionKind.FRAMES]
    assert [one.figures["grid"] for one in found] == ([] if grid is None else [grid])
    assert all(f"--set f_n={grid}" in sentence(one) for one in found)
    assert not any(one.keeps_open for one in found)


@pytest.mark.parametrize(("swing_off", "asked"), [(0.2, True), (0.01, False)])
def test_a_swing_after_a_large_fault_is_judged_by_itself(swing_off, asked):
    """The fault moves P by 1 pu, and the swing after it by 0.03 pu, of which a part is off."""
    times = recorded(100).times
    swing = 0.03 * np.sin(3 * (times - 1.2)) * (times > 1.2)
    power = 0.5 - 1.0 * ((times > 1) & (times <= 1.2)) + swing + 0j
    assert np.linalg.norm(swing_off * swing) < 0.06 * np.linalg.norm(power - 0.5)
    event = SimpleNamespace(
        recording=recorded(100, power),
        windows=Windows(1.0, 1.2, LENGTH),
        start=SimpleNamespace(power=0.5 + 0j),
    )
    played = SimpleNamespace(power=power + swing_off * swing)
    assert _is_off_later(SimpleNamespace(event=event, played=played)) is asked
