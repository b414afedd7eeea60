"""A page that holds the answers of a grid."""

from types import SimpleNamespace

from orchestrator.core.errors import InputError
from orchestrator.face.explore import saved


def test_each_point_of_the_grid_is_asked_and_counted_once(monkeypatch, tmp_path):
    axes = {"a.x": [1.0, 2.0], "a.y": [0.1, 0.2, 0.3]}
    monkeypatch.setattr(
        saved, "resolve", lambda vary, _: SimpleNamespace(key=vary, members=(), values=axes[vary])
    )
    monkeypatch.setattr(saved, "whole_page", lambda content: str(len(content["answers"])))
    asked, told = [], []
    desk = SimpleNamespace(
        answer=lambda what, tell: asked.append(what) or {"scenarios": {"base": {}}}
    )
    case = SimpleNamespace(scenario=lambda name, values: SimpleNamespace(prepared=None))
    beginning = {"scenario": "base", "values": {"a.z": 5.0}, "range": [0.1, 2.0]}
    saved.save_page(
        tmp_path / "page.html", case, desk, beginning, list(axes), lambda *count: told.append(count)
    )
    assert told == [(k, 6) for k in range(1, 7)]
    points = [what["values"] for what in asked if what["ask"] == "modes"]
    assert points == [{"a.z": 5.0, "a.x": x, "a.y": y} for x in axes["a.x"] for y in axes["a.y"]]
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == "6"


def test_a_slider_holds_the_cases_own_value_at_which_the_page_begins(monkeypatch, tmp_path):
    axis = SimpleNamespace(key="a.x", members=(), values=[0.0, 0.1 + 0.2, 1.0])
    monkeypatch.setattr(saved, "resolve", lambda vary, _: axis)
    kept = {}
    monkeypatch.setattr(saved, "whole_page", lambda content: kept.update(content) or "")

    def page_of(own):
        parameters = [{"parameter": "a.x", "value": own}]
        desk = SimpleNamespace(
            answer=lambda what, tell: {"parameters": parameters, "scenarios": {"base": {}}}
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
    mode = {"damping_percent": 5.0, "components": {"a": 1.0}}

    def answer(what, tell):
        asked.append(what)
        if what["ask"] == "first":
            raise InputError("no event")
        if what["ask"] == "modes" and what["values"].get("a.x", 2.0) > 9:
            raise InputError("no steady state")
        modes = {"scenarios": [{"modes": [mode]}]}
        return {"movers": [mover], "modes": modes, "scenarios": {"base": {}}}

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
