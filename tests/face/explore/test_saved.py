"""A page that holds the answers of a grid."""

from types import SimpleNamespace

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
