"""A page that holds the answers of a grid."""

import copy
import itertools
from types import SimpleNamespace

import pytest

from orchestrator.core.errors import InputError
from orchestrator.face.explore import saved
from orchestrator.face.explore.between import judged_cell
from orchestrator.face.explore.smaller import smaller_answer, smaller_parameters


def axis_of(key, values):
    """An axis on one parameter."""
    return SimpleNamespace(
        key=key, members=(), values=values, scale=None, unit="", title=key, sets=lambda x: {key: x}
    )


def answer_of(*eigenvalues):
    """An answer with these modes."""
    modes = [
        {
            "real": one.real,
            "imag": one.imag,
            "damping_percent": -100 * one.real / abs(one),
            "components": {"a": 1.0},
        }
        for one in eigenvalues
    ]
    return {"modes": {"scenarios": [{"modes": modes}]}, "scenarios": {"base": {}}}


def test_each_point_of_the_grid_is_asked_and_counted_once(monkeypatch, tmp_path):
    axes = {"a.x": [1.0, 2.0], "a.y": [0.1, 0.2, 0.3]}
    monkeypatch.setattr(saved, "resolve", lambda vary, _: axis_of(vary, axes[vary]))
    monkeypatch.setattr(saved, "whole_page", lambda content: str(len(content["answers"])))
    asked, told = [], []
    desk = SimpleNamespace(answer=lambda what, tell: asked.append(what) or answer_of(-0.1 + 3j))
    case = SimpleNamespace(scenario=lambda name, values: SimpleNamespace(prepared=None))
    beginning = {"scenario": "base", "values": {"a.z": 5.0}, "range": [0.1, 2.0]}
    saved.save_page(
        tmp_path / "page.html", case, desk, beginning, list(axes), lambda *count: told.append(count)
    )
    assert told == [(k, 8) for k in range(1, 9)]  # six values, and two halfway
    points = [what["values"] for what in asked if what["ask"] == "modes"]
    grid = [(x, y) for x in axes["a.x"] for y in axes["a.y"]]
    halfway = [(1.5, 0.15), (1.5, 0.25)]
    assert points == [{"a.z": 5.0, "a.x": x, "a.y": pytest.approx(y)} for x, y in [*grid, *halfway]]
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == "6"


def test_a_slider_holds_the_cases_own_value_at_which_the_page_begins(monkeypatch, tmp_path):
    axis = axis_of("a.x", [0.0, 0.1 + 0.2, 1.0])
    monkeypatch.setattr(saved, "resolve", lambda vary, _: axis)
    kept = {}
    monkeypatch.setattr(saved, "whole_page", lambda content: kept.update(content) or "")

    def page_of(own):
        parameters = [{"parameter": "a.x", "value": own}]
        desk = SimpleNamespace(
            answer=lambda what, tell: {**answer_of(-0.1 + 3j), "parameters": parameters}
        )
        case = SimpleNamespace(scenario=lambda name, values: SimpleNamespace(prepared=None))
        beginning = {"scenario": "base", "values": {}, "range": [0.1, 2.0]}
        saved.save_page(tmp_path / "p.html", case, desk, beginning, ["a.x"], lambda *count: None)
        assert {"a.x": own} in [one["values"] for one in kept["answers"]]
        return kept["grid"]["a.x"]

    assert page_of(0.5) == [0.0, 0.1 + 0.2, 0.5, 1.0]
    assert page_of(0.3) == [0.0, 0.3, 1.0]
    assert kept["own"] == {"a.x": 0.3}


def test_without_an_axis_the_values_that_move_the_mode_most_are_its_sliders(monkeypatch, tmp_path):
    """A value at which the case has no answer is left out; the case's own is computed once."""
    kept, asked = {}, []
    monkeypatch.setattr(saved, "whole_page", lambda content: kept.update(content) or "")
    mover = {"parameter": "a.x", "value": 2.0, "minimum": 1.0, "maximum": None}

    def answer(what, tell):
        asked.append(what)
        if what["ask"] == "first":
            raise InputError("no event")
        if what["ask"] == "modes" and what["values"].get("a.x", 2.0) > 9:
            raise InputError("no steady state")
        return {**answer_of(-0.15 + 3j), "movers": [mover]}

    case = SimpleNamespace(scenario=lambda name, values: SimpleNamespace(prepared=None))
    beginning = {"scenario": "base", "values": {}, "range": [0.1, 2.0]}
    desk = SimpleNamespace(answer=answer)
    saved.save_page(tmp_path / "page.html", case, desk, beginning, [], lambda *count: None)
    grid = kept["grid"]["a.x"]
    assert (grid[0], max(grid) < 9, 2.0 in grid) == (1.0, True, True)
    assert {"a.x": 2.0} not in [one["values"] for one in kept["answers"]]
    assert len(kept["answers"]) == len(grid)
    assert kept["first"]["reason"] == "no event"
    assert next(what for what in asked if what["ask"] == "movers")["components"] == {"a": 1.0}
    assert [cell["at"]["a.x"] for cell in kept["cells"]] == [
        list(ends) for ends in itertools.pairwise(grid)
    ]


def test_between_two_values_a_straight_line_is_off_by_what_its_middle_was_computed_to_be():
    """λ = −p² + j·10: halfway from p = 1 to 2 it is −2.25, and the line says −2.5. The modes' order plays no part."""

    def at(p):
        swing, control = complex(-(p**2), 10.0), complex(-8.0, 2.0)
        return answer_of(*((swing, control) if p < 1.9 else (control, swing)))

    cell = judged_cell({"p": (1.0, 2.0)}, [0, 1], [at(1.0), at(2.0)], lambda point: at(point["p"]))
    damping = [100 * x / abs(complex(x, 10.0)) for x in (2.5, 2.25)]
    assert cell["modes"] == [[0, 1], [1, 0]]
    assert cell["least"] == pytest.approx(damping[0] - damping[1], rel=0.05)  # two digits of it
    assert (
        cell["most"] == cell["least"]
    )  # the control mode stays, and is damped too well to be seen


def test_a_cell_whose_middle_has_no_answer_is_not_interpolated():
    def refuse(point):
        raise InputError("no steady state")

    both = [answer_of(-1 + 10j), answer_of(-2 + 10j)]
    assert judged_cell({"p": (1.0, 2.0)}, [0, 1], both, refuse) is None
    bent = judged_cell({"p": (1.0, 2.0)}, [0, 1], both, lambda point: answer_of(-1.5 + 10.5j))
    assert bent["hertz"] == pytest.approx(0.5 / 6.283, rel=0.05)  # two digits of it
    far = [answer_of(-1 + 10j), answer_of(-1 + 20j)]
    assert judged_cell({"p": (1.0, 2.0)}, [0, 1], far, lambda point: far[0]) is None


def test_a_smaller_answer_has_the_figures_that_are_shown():
    answer = answer_of(complex(-0.123456789, 3.0))
    (mode,) = answer["modes"]["scenarios"][0]["modes"]
    mode["shape"] = [{"state": "a", "magnitude": 1.0}, {"state": "b", "magnitude": 0.001}]
    answer["modes"]["scenarios"][0]["power_flow"] = {"buses": [1.23456789]}
    flows = []
    first, second = (smaller_answer(copy.deepcopy(answer), flows) for _ in range(2))
    (kept,) = first["modes"]["scenarios"][0]["modes"]
    assert (kept["real"], [one["state"] for one in kept["shape"]]) == (-0.123457, ["a"])
    assert flows == [{"buses": [1.23457]}]
    assert [one["modes"]["scenarios"][0]["power_flow"] for one in (first, second)] == [0, 0]


def test_of_many_parameters_a_page_keeps_those_of_its_sliders_and_what_is_off():
    rows = [{"parameter": f"a.p{k}", "value": 1.0, "switches": []} for k in range(2000)]
    rows += [{"parameter": "line.closed", "value": False, "switches": []}]
    rows += [{"parameter": "a.x", "value": 1.0, "switches": ["a.p7"]}]
    kept = smaller_parameters({"parameters": rows}, ["a.x"])["parameters"]
    assert [one["parameter"] for one in kept] == ["a.p7", "line.closed", "a.x"]
