"""The modes of several scenarios at once are those of each alone, and so are the errors."""

import json
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

import orchestrator as gfor
from orchestrator.core.errors import AnalysisError
from orchestrator.studies.modes import all_modes
from orchestrator.studies.modes.all_modes import compute_all_modes, without_repeated
from orchestrator.studies.modes.modes import compute_modes, modes_json


@pytest.fixture(scope="module")
def scenarios():
    return [one.prepared for one in gfor.load("two_area_rms").choose(("base", "gfor", "pod_p"))]


@pytest.fixture
def watched(monkeypatch):
    """What happens to the FMUs of which scenario, in order."""
    told = []
    opened, prepare = all_modes.running, all_modes.linearised

    @contextmanager
    def running(prepared):
        with opened(prepared) as master:
            told.append(f"open {prepared.name}")
            try:
                yield master
            finally:
                told.append(f"close {prepared.name}")

    monkeypatch.setattr(all_modes, "running", running)
    return told, prepare


def test_each_scenario_gives_what_it_gives_alone_to_the_last_bit(scenarios, watched):
    told, _ = watched
    together = compute_all_modes(scenarios)
    assert modes_json(together) == modes_json([compute_modes(one) for one in scenarios])
    expected = ["open base", "open gfor", "close base", "open pod_p", "close gfor", "close pod_p"]
    # the next one's FMUs are there before the eigenvalues are waited for, and never three
    assert told == expected


def test_scenarios_of_other_events_alone_are_computed_once_and_are_those_of_each_alone(watched):
    told, _ = watched
    case = gfor.load("infinite_bus")
    dip, load_step = (one.prepared for one in case.choose(("dip", "load_step")))
    other = case.scenario("load_step", {"gfor.droop.R_f": 0.04}).prepared
    three = [dip, other, load_step]
    together = compute_all_modes(three)
    assert [one.prepared for one in together] == three
    assert modes_json(together) == modes_json([compute_modes(one) for one in three])
    assert told == ["open dip", "open load_step", "close dip", "close load_step"]
    assert [len(again) for _, again in without_repeated(together)] == [1, 0]


def test_a_scenario_that_repeats_another_is_told_in_one_line(gfor):
    names = ("--scenario", "dip", "--scenario", "load_step")
    code, text, error = gfor("modes", "infinite_bus", *names)
    assert (code, error) == (0, "")
    assert "load_step: the same modes as dip; only its own events come later" in text
    assert text.count(" states, residual ") == 1  # the whole table, as of one scenario alone
    assert "--details, or one --scenario" not in text
    kept = json.loads(gfor("modes", "infinite_bus", *names, "--json")[1])["scenarios"]
    assert [one["name"] for one in kept] == ["dip", "load_step"]
    assert kept[0]["modes"] == kept[1]["modes"]


def test_critical_modes_are_those_of_each_alone(scenarios):
    assert modes_json(compute_all_modes(scenarios, (0.1, 2.0), 0.3)) == modes_json(
        [compute_modes(one, (0.1, 2.0), 0.3) for one in scenarios]
    )


def test_fmus_of_others_stand_once_at_a_time(scenarios, watched, monkeypatch):
    told, _ = watched
    monkeypatch.setattr(all_modes, "is_ours", lambda path: "gfor" not in Path(path).name)
    alone = []
    monkeypatch.setattr(
        all_modes, "compute_modes", lambda prepared, *_, **__: alone.append(prepared.name)
    )
    compute_all_modes(scenarios[:2])
    assert (alone, told) == (["base", "gfor"], [])


def test_a_component_that_is_asked_to_be_isolated_stands_once_at_a_time(scenarios):
    plans = scenarios[0].system.components
    name = next(iter(plans))
    try:
        plans[name], kept = replace(plans[name], isolated=True), plans[name]
        assert not all_modes.all_ours(scenarios[0])
    finally:
        plans[name] = kept
    assert all_modes.all_ours(scenarios[0])


@pytest.mark.parametrize("faulty", [("gfor", "pod_p"), ("pod_p",)])
def test_the_first_error_is_told_and_all_fmus_are_released(scenarios, watched, monkeypatch, faulty):
    told, prepare = watched

    def linearised(prepared, *arguments, **options):
        if prepared.name in faulty:
            raise AnalysisError(f"{prepared.name} has no steady state")
        return prepare(prepared, *arguments, **options)

    monkeypatch.setattr(all_modes, "linearised", linearised)
    with pytest.raises(AnalysisError, match=f"{faulty[0]} has no"):
        compute_all_modes(scenarios)
    opened = [entry.removeprefix("open ") for entry in told if entry.startswith("open")]
    assert opened == [one.name for one in scenarios[: len(opened)]]
    assert opened[-1] == faulty[0]
    assert sorted(
        entry.removeprefix("close ") for entry in told if entry.startswith("close")
    ) == sorted(opened)


def test_an_error_in_the_eigenvalues_comes_before_the_next_scenarios(
    scenarios, watched, monkeypatch
):
    _, prepare = watched

    def linearised(prepared, *arguments, **options):
        if prepared.name == "gfor":
            raise AnalysisError("gfor has no steady state")
        begun = prepare(prepared, *arguments, **options)
        monkeypatch.setattr(
            begun,
            "_spectrum_of_map",
            lambda: (_ for _ in ()).throw(AnalysisError("no convergence")),
        )
        return begun

    monkeypatch.setattr(all_modes, "linearised", linearised)
    with pytest.raises(AnalysisError, match="no convergence"):
        compute_all_modes(scenarios)
