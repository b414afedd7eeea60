"""How far a parameter may go: the search alone, and on loops whose limit is known from Hurwitz."""

import json
from functools import partial

import numpy as np
import pytest

import orchestrator as gfor_in_python
from orchestrator.cases.case import load_case
from orchestrator.core.errors import InputError
from orchestrator.studies.points.executor import Serial
from orchestrator.studies.points.points import Work
from orchestrator.studies.points.store import PointStore
from orchestrator.studies.sweep.axes import parse_vary
from orchestrator.studies.sweep.limit import HALVINGS, Ending, ParameterLimit, Until, search
from orchestrator.studies.sweep.request import SweepRequest
from orchestrator.studies.sweep.sweep import plan_sweep, run_sweep
from tests.systems.coupling.small_fmus import small_fmu

H, F, N, U = Ending.HOLDS, Ending.FAILS, Ending.NO_POINT, Ending.NOT_KNOWN
LAG = 0.1


def by_rule(rule, count=9):
    """The search over places 0 … count − 1 where ``rule`` says what each comes to."""
    return search([rule(float(k)) for k in range(count)], rule, lambda *_: True)


# -- the search ----------------------------------------------------------------------------------------


def test_the_first_change_is_bisected():
    holds, beyond, again = by_rule(lambda x: H if x < 3.3 else F)
    assert holds < 3.3 <= beyond
    assert beyond - holds == pytest.approx(2.0**-HALVINGS)
    assert again == []


def test_a_range_that_holds_again_later_is_told_from_one_that_does_not():
    holds, beyond, again = by_rule(lambda x: F if 2.5 <= x < 5.5 else H)
    assert holds < 2.5 <= beyond
    assert again == [6, 7, 8]


def test_nothing_fails():
    assert by_rule(lambda _: H) == (8.0, None, [])


def test_the_start_fails():
    assert by_rule(lambda x: F if x < 4 else H) == (None, 0.0, [4, 5, 6, 7, 8])


def test_what_has_no_operating_point_before_it_is_unstable_ends_the_search_as_such():
    """On the grid 4 is unstable; the end of the operating points at 3.2 comes first."""
    rule = lambda x: H if x < 3.2 else N if x < 3.9 else F  # noqa: E731
    assert rule(4.0) is F
    holds, beyond, _ = by_rule(rule)
    assert holds < 3.2 <= beyond
    assert rule(beyond) is N


def test_no_value_between_ends_the_search():
    assert search([H, F], lambda _: pytest.fail("asked"), lambda *_: False) == (0.0, 1.0, [])


def test_damping_that_is_least_on_the_way_is_told():
    def limit(*dampings):
        tried = [{"value": k, "kind": str(H), "damping_percent": d} for k, d in enumerate(dampings)]
        tried.append({"value": len(dampings), "kind": str(F), "damping_percent": -1.0})
        end = float(len(dampings))
        found = ParameterLimit(
            "x", "", "s", "S", Until(), F, end - 0.5, end, None, "", tuple(tried), (), "", end
        )
        return found.sentence

    assert "x = 2.5 (on the way 3.06 % at 1), " in limit(3.98, 3.06, 4.2)
    assert "on the way" not in limit(3.98, 3.06, 2.9)


def limit_along(values, kinds, holds_at, beyond):
    """The sentence for a grid of values that come to these kinds, with a damping of 11 % asked for."""
    tried = tuple(
        {"value": x, "kind": str(kind), "damping_percent": 10.0}
        for x, kind in zip(values, kinds, strict=True)
    )
    held = [x for x, kind in zip(values, kinds, strict=True) if kind is H and x != values[0]]
    again = tuple(held) if holds_at is None else ()
    found = ParameterLimit(
        "K", "", "s", "S", Until(11), F, holds_at, beyond, None, "", tried, again, "", beyond
    )
    return found.sentence


def test_a_range_is_told_in_the_direction_in_which_it_runs():
    kinds = [H, H, F]
    assert "11 % or more down to K = 81, " in limit_along([400, 200, 0], kinds, 81.0, 80.0)
    assert "11 % or more up to K = 320, " in limit_along([0, 200, 400], kinds, 320.0, 321.0)


def test_a_range_that_fails_from_its_start_tells_where_it_holds():
    nowhere = limit_along([0, 100, 200], [F, F, F], None, 0.0)
    assert nowhere.endswith("at the start, K = 0; and nowhere in the range damped by 11 % or more")
    later = limit_along([0, 100, 200], [F, F, H], None, 0.0)
    assert "damped by 11 % or more at 200, first reached between 100 and 200: the r" in later
    assert "nowhere" not in limit_along([0, 100], [F, U], None, 0.0)


# -- coupled FMUs --------------------------------------------------------------------------------------


@pytest.fixture
def gfor(gfor):
    return partial(gfor, "sweep")


@pytest.fixture
def loop(tmp_path):
    """An integrator of gain −k and two lags of T in a loop: s·(sT + 1)² + k is stable up to k = 2/T."""
    path = tmp_path / "loop.toml"
    lag = small_fmu("lag").path
    path.write_text(
        f"""\
name = "loop"
[solver]
step_size = 1e-3
[components.k]
fmu = '{small_fmu("integrator").path}'
parameters = {{ gain = -5 }}
[components.one]
fmu = '{lag}'
parameters = {{ T = {LAG} }}
[components.two]
fmu = '{lag}'
parameters = {{ T = {LAG} }}
[[connections]]
from = "k.y"
to = "one.u"
[[connections]]
from = "one.y"
to = "two.u"
[[connections]]
from = "two.y"
to = "k.u"
[scenarios.only]
title = "Loop"
[analysis]
modes = [{{ name = "swing", states = ["one.x", "two.x"] }}]
swing = ["one.x", "two.x"]
""",
        encoding="utf-8",
    )
    return path


def told(gfor, loop, *options):
    code, text, err = gfor(loop, "--workers", 1, "--out", loop.parent / "out", "--json", *options)
    return code, json.loads(text), err


def limit_of(loop, vary, damping=0.0):
    """The same without a command, as JSON's types."""
    plan = planned(loop, vary, until=Until(damping))
    return run_sweep(plan, Work(Serial(), PointStore(loop.parent / "points"))).limits[0].as_json()


def test_the_limit_of_a_loop_is_that_of_hurwitz(gfor, loop):
    code, found, err = told(gfor, loop, "--vary", "k.gain=-5:-30", "--until", "unstable")
    assert code == 0
    # one step of delay in the loop: 1 ms at 10 rad/s
    assert found["limit"] == pytest.approx(-2 / LAG, rel=0.02)
    assert abs(found["beyond"]) > abs(found["limit"])
    assert found["beyond"] == pytest.approx(found["limit"], rel=1e-3)
    assert found["reason"] is None
    assert found["mode"]["name"] == "swing"
    assert found["mode"]["frequency_hz"] == pytest.approx(1 / LAG / 6.2832, rel=0.02)
    # the step map alone would be stable at 0.2 %
    assert -0.05 < found["mode"]["damping_percent"] < 0
    assert sum(found["mode"]["components"].values()) == pytest.approx(1, abs=0.03)
    assert "9 values were tried before the bisection" in err
    assert (
        json.loads((loop.parent / "out" / "limits.json").read_text())[0]["limit"] == found["limit"]
    )


def test_a_wanted_damping_is_a_limit_too(loop):
    found = limit_of(loop, "k.gain=-2:-30:6", 20.0)
    roots = np.roots([LAG**2, 2 * LAG, 1, -found["limit"]])
    (swing,) = roots[roots.imag > 0]
    assert -swing.real / abs(swing) == pytest.approx(0.2, abs=0.005)
    assert found["mode"]["damping_percent"] == pytest.approx(20, abs=0.1)
    assert len(found["tried"]) == 6


@pytest.mark.parametrize(
    ("vary", "ends_with", "said"),
    [
        ("k.gain=-5:-15:3", "holds", "stable over the whole range, k.gain from -5 1/s to -15 1/s"),
        ("k.gain=-30:-5:3", "fails", "UNSTABLE already at the start, k.gain = -30 1/s"),
    ],
)
def test_no_limit_is_told_with_its_reason(loop, vary, ends_with, said):
    found = limit_of(loop, vary)
    assert (found["limit"], found["ends_with"]) == (None, ends_with)
    assert found["reason"].startswith(said)


def test_a_value_that_cannot_start_is_no_limit_of_stability(loop):
    found = limit_of(loop, "two.T=0.1:-0.1:3")
    assert found["limit"] is None
    assert found["ends_with"] == "no operating point"
    assert 0 < found["holds_at"] < 0.001
    assert found["reason"].startswith("no operating point from two.T = ")
    assert "no limit of stability" in found["reason"]
    assert "T must exceed 0" in found["reason"]
    assert "…" not in found["reason"]
    assert found["why"].split()[-1] in found["lines"][0]  # the cause is there to its end


def test_a_unit_beyond_its_rating_on_the_way_is_told_in_the_answer():
    found = gfor_in_python.load("infinite_bus").sweep(
        ["gfor.P_0=0.9:1.1:3"], scenarios=["dip"], until="unstable", workers=1
    )
    (limit,) = found.as_json()["limits"]
    assert limit["sentence"] == "gfor is beyond rating from gfor.P_0 = 1.1 pu on"
    (_, then) = limit["lines"]
    assert then.startswith("stable over the whole range, gfor.P_0 from 0.9 pu to 1.1 pu; least")
    assert limit["reason"] == "; ".join(limit["lines"])
    assert limit["beyond_rating"] == {"value": 1.1, "units": ("gfor",)}


def test_on_the_terminal_the_answer_comes_first(gfor, loop):
    code, text, _ = gfor(
        loop,
        "--workers",
        1,
        "--out",
        loop.parent / "o",
        "--vary",
        "k.gain=-5:-30:2",
        "--until",
        "unstable",
        "--fail-unstable",
    )
    assert code == 1
    first = text.splitlines()[0]
    assert first.startswith("Loop: stable down to k.gain = -")
    assert "'swing', 1.5" in first


# -- several parameters together -----------------------------------------------------------------------


def planned(loop, *vary, **more):
    return plan_sweep(load_case(loop), SweepRequest([parse_vary(text) for text in vary], **more))


def test_several_parameters_take_one_value(loop):
    plan = planned(loop, "one.T,two.T=0.1,0.2")
    assert plan.values((1,)) == {"one.T": 0.2, "two.T": 0.2}


def test_a_pattern_stands_for_all_variables_that_fit(loop):
    assert planned(loop, "k.gai*=1,2").values((0,)) == {"k.gain": 1.0}


@pytest.mark.parametrize(
    ("vary", "said"),
    [
        (["one.T,k.gain=1,2"], "one value cannot be that of one.T [s], k.gain [1/s]"),
        (["one.T,two.T=1,2", "two.T=3,4"], "both vary two.T"),
        (["one.Z*=1,2"], "no parameter of the chosen scenarios fits"),
        (["one.T=1:2"], "COUNT is missing"),
        (["tie: length=1:2:3"], "the network has no line 'tie'"),
        (["tie: girth=1:2:3"], "'girth' is not known"),
    ],
)
def test_what_cannot_move_together_is_refused(loop, vary, said):
    with pytest.raises(InputError, match=said.replace("[", r"\[")):
        planned(loop, *vary)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--vary", "one.T=0.1,0.2", "--until", "unstable"], "needs a range"),
        (
            ["--vary", "one.T=0.1:0.2", "--vary", "two.T=0.1:0.2", "--until", "unstable"],
            "searches along one range",
        ),
        (["--vary", "one.T=0.1:0.2", "--until", "soon"], "'unstable'"),
        (["--vary", "one.T=0.1:0.2", "--until", "120 %"], "'120 %' is not a damping"),
        (
            ["--vary", "one.T=0.1:0.2", "--until", "0.05"],
            "is read in percent; write 5 for a ratio of 0.05",
        ),
    ],
)
def test_a_search_that_is_none_is_refused(gfor, loop, options, said):
    code, _, err = gfor(loop, "--out", loop.parent / "out", *options)
    assert code == 2
    assert said in err
