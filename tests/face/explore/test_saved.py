"""A page that holds the answers of a grid."""

import copy
import itertools
from types import SimpleNamespace

import pytest

from orchestrator.core.errors import CaseError, InputError, Problem
from orchestrator.face.explore import saved
from orchestrator.face.explore.interpolation import judged_cell
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


@pytest.mark.parametrize(
    ("most", "bound", "said"),
    [
        (1.6, 10.0, {"above": "power flow: no solution found"}),
        (9.0, 3.0, {"above": "the declared bound"}),
        (9.0, 10.0, {}),
    ],
)
def test_why_a_slider_goes_no_further_is_kept(most, bound, said):
    """Its range ended somewhere, without a word."""

    def computed(point):
        if point["grid.load.scale"] > most:
            problem = Problem.of_scenario(
                "power_flow", "base", "power flow: no solution found. Lower it"
            )
            raise CaseError("case.toml", [problem])
        return {}

    mover = {"parameter": "grid.load.scale", "value": 1.0, "minimum": 0.0, "maximum": bound}
    values, why = saved._reached_values(mover, 12, computed)
    assert why == said
    assert max(values) <= min(most, bound)


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
    """All values lie where the case has an answer, up to the end of that; the case's own is computed once."""
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
    assert (grid[0], len(grid), 2.0 in grid) == (1.0, 13, True)
    assert 8.7 < grid[-1] <= 9.0
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


def test_where_the_least_damped_mode_is_not_followed_its_error_exceeds_that_of_each_drawn_one():
    """A mode that leaves at one corner is not drawn; by `least` above `most` the page knows that it hides."""
    swing, slow = -1.0 + 10j, -0.1 + 3j
    left, right = answer_of(swing, slow), answer_of(swing, -2.0 + 6j)
    halfway = answer_of(swing, -0.15 + 3.5j)
    cell = judged_cell({"p": (1.0, 2.0)}, [0, 1], [left, right], lambda point: halfway)
    assert cell["modes"] == [[0, 0]]
    damping = [100 / abs(1 + 10j), 15 / abs(0.15 + 3.5j)]
    assert cell["least"] == pytest.approx(damping[0] - damping[1], rel=0.05)  # two digits of it
    assert cell["most"] == 0.0


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
    mode["damping_percent"] = 17.595012345678
    mode["shape"] = [{"state": "a", "magnitude": 1.0}, {"state": "b", "magnitude": 0.001}]
    answer["modes"]["scenarios"][0]["power_flow"] = {"buses": [1.23456789]}
    flows = []
    first, second = (smaller_answer(copy.deepcopy(answer), flows) for _ in range(2))
    (kept,) = first["modes"]["scenarios"][0]["modes"]
    assert (kept["real"], [one["state"] for one in kept["shape"]]) == (-0.123456789, ["a"])
    assert (
        f"{kept['damping_percent']:.2f}" == "17.60"
    )  # as the command says, and not 17.595 rounded again
    assert flows == [{"buses": [1.23457]}]
    assert [one["modes"]["scenarios"][0]["power_flow"] for one in (first, second)] == [0, 0]


@pytest.mark.parametrize("share", [0.6547218, 0.2747361, 0.12496, 0.0544996, 0.655, 0.6550002])
def test_a_share_is_rounded_once(share):
    """65.47 % once became 65.5 % in the page's content, and 66 % in what it shows."""
    answer = answer_of(-0.1 + 3j)
    (mode,) = answer["modes"]["scenarios"][0]["modes"]
    mode |= {"components": {"a": share}, "participation": [{"state": "a.x", "factor": share}]}
    (kept,) = smaller_answer(answer, [])["modes"]["scenarios"][0]["modes"]
    for held in (kept["components"]["a"], kept["participation"][0]["factor"]):
        assert len(str(held)) <= len("0.12345") + (share < 0.1)
        for digits in (2, 3):  # a percent, and a tenth of it
            assert f"{held:.{digits}f}" == f"{share:.{digits}f}"


def test_of_many_parameters_a_page_keeps_those_of_its_sliders_and_what_is_off():
    rows = [{"parameter": f"a.p{k}", "value": 1.0, "switches": []} for k in range(2000)]
    rows += [{"parameter": "line.closed", "value": False, "switches": []}]
    rows += [{"parameter": "a.x", "value": 1.0, "switches": ["a.p7"]}]
    kept = smaller_parameters({"parameters": rows}, ["a.x"])["parameters"]
    assert [one["parameter"] for one in kept] == ["a.p7", "line.closed", "a.x"]


def page_of_scenarios(monkeypatch, path, *names):
    """Contents of a page of several scenarios. Each has a damping of its own, and its own value of the slider."""
    kept = {}
    monkeypatch.setattr(saved, "resolve", lambda vary, _: axis_of(vary, [1.0, 2.0]))
    monkeypatch.setattr(saved, "whole_page", lambda content: kept.update(content) or "")

    def answer(what, tell):
        scenario = what.get("scenario")
        if what["ask"] == "parameters":
            return {"parameters": [{"parameter": "a.x", "value": {"a": 1.0, "b": 1.5}[scenario]}]}
        if what["ask"] == "first":
            return {"curves": {scenario: [[0.0], [1.0]]}}
        if what["ask"] == "open":
            return {"scenarios": {name: name.upper() for name in "abc"}}
        return answer_of(complex(-0.1 * what["values"]["a.x"] * (1 + "ab".index(scenario)), 3.0))

    case = SimpleNamespace(scenario=lambda name, values: SimpleNamespace(prepared=None))
    beginning = {"scenario": names[0], "values": {}, "range": [0.1, 2.0]}
    desk = SimpleNamespace(answer=answer)
    saved.save_page(
        path, case, desk, beginning, ["a.x"], lambda *count: None, further=list(names[1:])
    )
    return kept


def test_several_scenarios_have_each_their_answers_cells_values_and_response(monkeypatch, tmp_path):
    kept = page_of_scenarios(monkeypatch, tmp_path / "p.html", "a", "b")
    assert kept["open"]["scenarios"] == {"a": "A", "b": "B"}
    assert (kept["grid"], kept["own"]) == ({"a.x": [1.0, 2.0]}, {"a.x": 1.0})
    other = kept["others"]["b"]
    assert (other["grid"], other["own"]) == ({"a.x": [1.0, 1.5, 2.0]}, {"a.x": 1.5})
    assert [[*one["first"]["curves"]] for one in (kept, other)] == [["a"], ["b"]]
    assert kept["parameters"]["b"]["parameters"][0]["value"] == 1.5
    real = {
        (one["scenario"], one["values"]["a.x"]): one["answer"]["modes"]["scenarios"][0]["modes"][0]
        for one in kept["answers"]
    }
    assert {key: mode["real"] for key, mode in real.items()} == pytest.approx(
        {("a", 1.0): -0.1, ("a", 2.0): -0.2, ("b", 1.0): -0.2, ("b", 1.5): -0.3, ("b", 2.0): -0.4}
    )
    for cell in kept["cells"]:
        corners = [kept["answers"][place] for place in cell["corners"]]
        assert {one["scenario"] for one in corners} == {cell["scenario"]}
        assert [one["values"]["a.x"] for one in corners] == list(cell["at"]["a.x"])
    assert [cell["scenario"] for cell in kept["cells"]] == ["a", "b", "b"]


def test_a_page_of_one_scenario_is_as_it_was(monkeypatch, tmp_path):
    assert "others" not in page_of_scenarios(monkeypatch, tmp_path / "p.html", "a")


def test_several_scenarios_need_the_same_sliders(tmp_path):
    beginning = {"scenario": "a", "values": {}, "range": [0.1, 2.0]}
    with pytest.raises(InputError, match="name them by --vary"):
        saved.save_page(
            tmp_path / "p.html", None, None, beginning, [], lambda *count: None, further=["b"]
        )


def test_a_page_has_no_unit_that_is_out_of_service():
    names = ("a", "b")
    units = [{"name": name, "out": f"{name}.connected"} for name in names]
    rows = [
        {"parameter": "a.connected", "value": True, "switches": []},
        {"parameter": "a.K", "value": 1.0, "switches": []},
        {"parameter": "b.connected", "value": False, "switches": []},
        {"parameter": "b.K", "value": 1.0, "switches": []},
        {"parameter": "grid.b.connected", "value": True, "switches": []},
        {"parameter": "grid.line_b.connected", "value": True, "switches": []},
    ]
    kept = smaller_parameters({"parameters": rows, "diagram": {"units": units}}, [])
    assert [one["name"] for one in kept["diagram"]["units"]] == ["a"]
    listed = [one["parameter"] for one in kept["parameters"]]
    assert listed == ["a.connected", "a.K", "grid.line_b.connected"]
    assert smaller_parameters({"parameters": rows[:2]}, [], 600)["parameters"] == []
