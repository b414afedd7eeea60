"""Modes of the two-area system with the converter as a black box, against those from its states."""

import pytest

from orchestrator.core.errors import InputError
from orchestrator.studies.black_box import coupled_modes
from orchestrator.studies.black_box.coupled_modes import (
    component_participation,
    is_black_box,
    linearize_with_box,
    modes_with_boxes,
)
from orchestrator.studies.black_box.frequency_response import Excitation
from orchestrator.studies.modes.modes import modes_of, running
from tests.studies.black_box import boxes

SHORT = Excitation(lowest_hz=0.5, lines=80, settled=1e-3)


def compare(master, prepared, excitation, restore, hertz, points):
    white = modes_of(prepared, master, (0.1, 2.0))
    boxed = linearize_with_box(master, "gfor", excitation, restore=restore)
    assert boxed.residual < 1e-9
    found = boxed.modes()
    oscillating = [m for m in white.modes if m.damping_ratio < 0.5]
    assert white.electromechanical in oscillating
    for mode in oscillating:
        same = min(found, key=lambda m: abs(m.eigenvalue - mode.eigenvalue))
        assert same.frequency_hz == pytest.approx(mode.frequency_hz, abs=hertz)
        assert same.damping_percent == pytest.approx(mode.damping_percent, abs=points)
        assert component_participation(same, boxed.component) == pytest.approx(
            component_participation(mode, "gfor"), abs=0.01
        )


def test_without_its_slow_part_measured_the_mode_is_still_there():
    prepared = boxes.prepared("gfor")
    with running(prepared) as master:
        compare(master, prepared, SHORT, True, 0.01, 0.3)


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["gfor", "pod_p", "pod_q", "pod_pq"])
def test_all_scenarios_with_and_without_saved_states(scenario):
    prepared = boxes.prepared(scenario)
    with running(prepared) as master:
        before = master.y.copy()
        compare(master, prepared, Excitation(), True, 0.001, 0.01)
        compare(master, prepared, Excitation("pulse"), False, 0.001, 0.01)
        assert (master.y == before).all()
        assert master.index == 0


def test_our_own_fmus_are_no_black_boxes_and_an_unknown_one_is_refused():
    with running(boxes.prepared("gfor")) as master:
        assert not is_black_box(master.components["gfor"])
        with pytest.raises(InputError, match="no component 'vendor'"):
            linearize_with_box(master, "vendor")


def test_a_box_is_measured_once_though_names_ask_for_its_model_again(monkeypatch):
    measured, asked = [], []
    measure, modes_from = coupled_modes.measure, coupled_modes.modes_from

    def counted(bench, *given):
        measured.append(bench)
        return measure(bench, *given)

    def named(prepared, master, point, blocks, frequency_range, critical, black_boxes):
        """As names are followed from other scenarios: the same point, and one with another gain."""
        again = black_boxes(master)
        assert again["gfor"] is blocks.components["gfor"]
        master.system.components["gfor"].parameters["pod_p.K"] = 1.0
        assert black_boxes(master)["gfor"] is not again["gfor"]
        asked.append(len(measured))
        return modes_from(prepared, master, point, blocks, frequency_range, critical, None)

    monkeypatch.setattr(coupled_modes, "is_black_box", lambda component: component.name == "gfor")
    monkeypatch.setattr(coupled_modes, "measure", counted)
    prepared = boxes.prepared("gfor")
    with running(prepared) as master:
        modes_with_boxes(prepared, master, (0.1, 2.0), excitation=SHORT)
    assert len(measured) == 1
    monkeypatch.setattr(coupled_modes, "modes_from", named)
    with running(prepared) as master:
        modes_with_boxes(prepared, master, (0.1, 2.0), excitation=SHORT)
    assert asked == [3]
