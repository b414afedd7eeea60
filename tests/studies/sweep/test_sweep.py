"""`gfor sweep` as a user meets it, on a case whose answers are known."""

import csv
import json
import re
import shlex
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from orchestrator.cases.case import Case, load_case
from orchestrator.core.errors import ErrorKind, InputError
from orchestrator.devices.fmi.description import VariableInfo
from orchestrator.linear.spectra.mode_tracking import ModeSet
from orchestrator.output.report.html.chapters.studies import of_sweep
from orchestrator.studies.points.dask_cluster import DaskCluster
from orchestrator.studies.points.executor import Serial
from orchestrator.studies.points.failure import Failure
from orchestrator.studies.points.points import Work
from orchestrator.studies.points.processes import Processes
from orchestrator.studies.points.store import PointStore
from orchestrator.studies.sweep import sweep as sweep_module
from orchestrator.studies.sweep.axes import Axis, _axis, parse_vary, resolve
from orchestrator.studies.sweep.point import PointRecord, compute_point
from orchestrator.studies.sweep.request import SweepRequest
from orchestrator.studies.sweep.sweep import ScenarioSweep, plan_sweep, run_sweep
from orchestrator.studies.sweep.verdicts import _least
from tests.studies.sweep.sweep_case import two_oscillators
from tests.support.interruption import interrupted_after
from tests.support.scenarios import prepare_one
from tests.support.undrawn import write_empty

FULL_TURN = 2 * np.pi


@pytest.fixture
def gfor(gfor):
    """Run ``gfor sweep``."""
    return partial(gfor, "sweep")


@pytest.fixture
def case(tmp_path):
    return two_oscillators(tmp_path)


def sweep(case, folder, *vary, executor=None, **settings):
    plan = plan_sweep(
        load_case(case), SweepRequest([parse_vary(text) for text in vary], **settings)
    )
    return run_sweep(plan, Work(executor or Serial(), PointStore(folder)))


def curve(scenario, name):
    """Frequencies [Hz] of a trajectory by place."""
    (trajectory,) = [t for t in scenario.trajectories if t.name == name]
    return {
        p: float(scenario.points[p].modes.frequencies[t.mode]) for p, t in trajectory.points.items()
    }


# -- what it says ------------------------------------------------------------------------------------


@pytest.fixture(autouse=True)
def undrawn_elsewhere(request, monkeypatch):
    """One test looks at the pictures."""
    if request.function is not test_a_named_mode_is_followed_through_a_crossing:
        monkeypatch.setattr("matplotlib.figure.Figure.savefig", write_empty)


def test_a_named_mode_is_followed_through_a_crossing(gfor, case, tmp_path):
    out = tmp_path / "out"
    code, text, err = gfor(case, "--vary", "a1.gain=3:12:7", "--workers", 1, "--out", out)
    assert (code, err) == (0, "")
    assert "Each mode over a1.gain [1/s]" in text
    assert (
        f"14 points computed. Results in {out}: sweep.nc, sweep.csv, cells.json, trajectories.png"
        in text
    )
    with xr.open_dataset(out / "sweep.nc") as data:
        assert dict(data.sizes) == {
            "scenario": 2,
            "a1.gain": 7,
            "trajectory": 2,
            "state": 2,
            "component": 5,
        }
        gain = data["a1.gain"].values
        assert gain == pytest.approx(np.linspace(3, 12, 7))
        for scenario, other in (("one", FULL_TURN), ("two", 4.0)):
            here = data.sel(scenario=scenario)
            assert [str(n) for n in here["trajectory_name"].values] == ["first", "mode 2"]
            first, second = (here.isel(trajectory=k) for k in (0, 1))
            assert first["frequency"].values == pytest.approx(
                np.sqrt(gain * FULL_TURN) / FULL_TURN, rel=1e-5
            )
            assert second["frequency"].values == pytest.approx(
                np.sqrt(other * FULL_TURN) / FULL_TURN, rel=1e-5
            )
            assert first["eigenvalue_imag"].values == pytest.approx(
                first["frequency"].values * FULL_TURN
            )
            assert np.all(first["named"] == 1)
            assert first["component_participation"].sel(component="a1").values == pytest.approx(
                0.5, abs=1e-3
            )
            assert float(second["participation"].sum("state").max()) < 1e-6
            assert float(first["similarity"][1:].min()) > 0.9
        assert data["a1.gain"].attrs == {"units": "1/s", "long_name": "Gain"}
        assert data["frequency"].attrs["units"] == "Hz"
        assert "small_integrator" in data.attrs["fmus"]
        assert data.attrs["case_file"] == case.read_text(encoding="utf-8")
    with (out / "sweep.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * 7 * 2
    assert {
        "scenario",
        "a1.gain [1/s]",
        "trajectory",
        "damping [%]",
        "participation a1.x",
        "beginning",
    } <= set(rows[0])
    for name in ("trajectories.png", "named_modes.png", "sweep_participation.png"):
        assert (out / name).stat().st_size > 5000


def test_json_is_all_that_is_printed(gfor, case, tmp_path):
    arguments = (
        "--scenario",
        "two",
        "--vary",
        "a1.gain=3,6",
        "--vary",
        "b2.gain=-2,-1",
        "--range",
        "0.2:1.5",
    )
    code, out, err = gfor(
        case, *arguments, "--set", "b1.gain=5", "--workers", 1, "--json", "--out", tmp_path
    )
    assert (code, err) == (0, "")
    content = json.loads(out)
    assert content["parameters"][1] == {"name": "b2.gain", "unit": "1/s", "values": [-2, -1]}
    (scenario,) = content["scenarios"]
    found = {
        t["name"]: [(*p["values"].values(), p["frequency_hz"]) for p in t["points"]]
        for t in scenario["trajectories"]
    }
    a = {gain: np.sqrt(gain * FULL_TURN) / FULL_TURN for gain in (3, 6)}
    b = {gain: np.sqrt(-5 * gain) / FULL_TURN for gain in (-2, -1)}
    grid = [(x, y) for x in (3, 6) for y in (-2, -1)]
    assert found["first"] == [(x, y, pytest.approx(a[x], rel=1e-5)) for x, y in grid]
    assert found["mode 2"] == [(x, y, pytest.approx(b[y], rel=1e-5)) for x, y in grid]


def test_a_point_that_fails_is_recorded_and_the_others_are_there(gfor, case, tmp_path):
    out = tmp_path / "out"
    arguments = (
        case,
        "--scenario",
        "one",
        "--vary",
        "slow.T=-10 ms:0.03:5",
        "--workers",
        1,
        "--out",
        out,
    )
    code, _, err = gfor(*arguments)
    assert code == 0
    assert "2 points of 5 failed:" in err
    assert "one, slow.T = -0.01 s: " in err
    assert "T must exceed 0; raise it" in err
    with xr.open_dataset(out / "sweep.nc") as data:
        assert ["T must exceed 0" in str(text) for text in data["error"].values[0]] == [
            True,
            True,
            False,
            False,
            False,
        ]
        assert np.isfinite(data["frequency"].values[0, :, 0]).tolist() == [
            False,
            False,
            True,
            True,
            True,
        ]
    with (out / "sweep.csv").open(encoding="utf-8") as file:
        assert sum("T must exceed 0" in row["error"] for row in csv.DictReader(file)) == 2


def test_if_every_point_fails_so_does_the_sweep(gfor, case, tmp_path):
    code, _, err = gfor(case, "--vary", "slow.T=-2,-1", "--workers", 1, "--out", tmp_path / "out")
    assert code == 1
    assert "4 points of 4 failed" in err


# -- what cannot be used -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("vary", "words"),
    [
        ("a1.gain", "is not of the form component.parameter=START:STOP:COUNT"),
        ("gain=1:2:3", "is not of the form component.parameter=START:STOP:COUNT"),
        ("a1.gain=1:2:3:4", "'1:2:3:4' is not of the form START:STOP:COUNT"),
        ("a1.gain=1:2:1", "COUNT = '1'; it must be a whole number from 2 to"),
        ("a1.gain=1:2:2.5", "COUNT = '2.5'; it must be a whole number"),
        ("a1.gain=1,,2", "a value of the list is missing"),
    ],
)
def test_text_of_another_form(vary, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        parse_vary(vary)


@pytest.mark.parametrize(
    ("vary", "words"),
    [
        (
            "c1.gain=1:2:3",
            "--vary c1.gain: no component of the chosen scenarios is called 'c1'; they have: a1, a2, b1",
        ),
        (
            "a1.gian=1:2:3",
            "--vary a1.gian: component 'a1' has no variable 'gian'; did you mean gain?",
        ),
        (
            "a1.y=1:2:3",
            "--vary a1.y: y is of causality output; only parameters and inputs can be set",
        ),
        ("slow.T=1 MW:2 MW:3", "--vary slow.T: '1 MW' is in MW, but s is needed"),
        ("a1.gain=1:2", "--vary a1.gain: COUNT is missing; write START:STOP:COUNT"),
        ("a1.gain=log:1:2", "--vary a1.gain: COUNT is missing"),
        (
            "a1.gain=2:2:3",
            "--vary a1.gain: the range begins and ends at 2; give two different limits",
        ),
        ("a1.gain=log:-1:2:3", "a logarithmic range from -1 to 2 passes zero"),
        ("a1.gain=1,1.0", "--vary a1.gain: a value stands in the list twice"),
        ("a1.gain=true:false:3", "gain = True is no limit of a range; list the values"),
        ("a1.gain=1:inf:3", "gain = inf; a limit of a range must be a finite number"),
    ],
)
def test_values_that_cannot_be_used(gfor, case, tmp_path, vary, words):
    code, out, err = gfor(case, "--vary", vary, "--out", tmp_path / "out")
    assert (code, out) == (2, "")
    assert words in err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("given", "limits"),
    [
        ("slow.T=0.1-0.5", (0.1, 0.5)),
        ("slow.T=1e-3..0.5", (0.001, 0.5)),
        ("slow.T=-1--0.5", (-1, -0.5)),
        ("slow.T=100 ms to 0.5s", (0.1, 0.5)),
    ],
)
def test_a_range_in_another_form_is_told_in_ours(gfor, case, given, limits):
    """What the message tells to write, typed as a shell reads it, is that range."""
    code, _, err = gfor(case, "--vary", given)
    told = re.search(r"is neither a value nor a range; write (.+) for 11 values", err)
    assert code == 2
    (typed,) = shlex.split(told[1])
    (axis,) = plan_sweep(load_case(case), SweepRequest([parse_vary(typed)], ["one"])).axes
    assert axis.values == pytest.approx(np.linspace(*limits, 11))


@pytest.mark.parametrize(
    "keys", [("a1.gain", "a1.gain"), ("a1.gain", "a?.gain"), ("?1.gain", "b*.gain")]
)
def test_one_variable_is_not_varied_twice(gfor, case, tmp_path, keys):
    arguments = [part for key in keys for part in ("--vary", f"{key}=1,2")]
    code, _, err = gfor(case, *arguments, "--out", tmp_path / "out")
    assert code == 2
    shared = "b1.gain" if keys[1] == "b*.gain" else "a1.gain"
    assert (
        f"--vary {keys[0]} and --vary {keys[1]}: both vary {shared}, which can have one value only"
        in err
    )
    assert plan_sweep(
        load_case(case),
        SweepRequest([parse_vary("a1.gain=1,2"), parse_vary("b?.gain=1,2")], ["one"]),
    )


def test_a_name_that_is_wrong_in_any_scenario_is_refused(case):
    """The case's second scenario alone has the imperfection."""
    own = 'imperfections = { bias = { type = "bias", connection = "a1.y -> a2.u", value = 0.0 } }'
    text = case.read_text(encoding="utf-8")
    for title, other in (("One", "two"), ("Two", "one")):
        case.write_text(
            text.replace(f'title = "{title}"', f'title = "{title}"\n{own}'), encoding="utf-8"
        )
        words = rf"--vary imperfections\.bias\.value: there is no imperfection 'bias'.* \(scenario {other}\)"
        with pytest.raises(InputError, match=words):
            plan_sweep(
                load_case(case), SweepRequest([parse_vary("imperfections.bias.value=0.1,0.2")])
            )


@pytest.mark.parametrize(("varied", "scenario"), [("slow.T=1,2", "two"), ("b1.gain=-1,1", "one")])
def test_both_scenarios_are_checked_with_what_is_varied(case, monkeypatch, varied, scenario):
    checked = []
    prepare = Case.prepare

    def seen(self, scenarios=(), overrides=None, *rest):
        checked.append((tuple(scenarios), dict(overrides or {})))
        return prepare(self, scenarios, overrides, *rest)

    monkeypatch.setattr(Case, "prepare", seen)
    vary = parse_vary(varied)
    plan_sweep(load_case(case), SweepRequest([vary]))
    assert ((scenario,), {vary.key: vary.values[0]}) in checked


def test_a_scenario_is_swept_once(gfor, case):
    code, _, err = gfor(case, "--vary", "a1.gain=1,2", "--scenario", "one", "--scenario", "one")
    assert (code, "the scenario 'one' is chosen more than once; name it once" in err) == (2, True)


def test_units_logarithms_and_patterns(case):
    plan = plan_sweep(
        load_case(case),
        SweepRequest([parse_vary("slow.T=log:10 ms:1:3"), parse_vary("b?.gain=1,2")], ["one"]),
    )
    assert [axis.values for axis in plan.axes] == [(0.01, 0.1, 1.0), (1.0, 2.0)]
    assert plan.values((1, 1)) == {"slow.T": 0.1, "b?.gain": 2.0}
    assert plan.values((1, 0.5)) == {"slow.T": 0.1, "b?.gain": 1.5}
    assert plan.values((0.5, 0)) == {"slow.T": pytest.approx(10**-1.5), "b?.gain": 1.0}
    assert plan.number_of_points == 6


def test_workers_or_a_scheduler(gfor, case):
    code, _, err = gfor(
        case, "--vary", "a1.gain=1,2", "--workers", 2, "--scheduler", "tcp://localhost:1"
    )
    assert code == 2
    assert "--workers and --scheduler exclude each other" in err


# -- following ---------------------------------------------------------------------------------------


def test_points_in_between_resolve_what_one_step_cannot(gfor, case, tmp_path):
    """From 0.28 to 1.95 Hz the ratio of the two amplitudes changes sevenfold: too much to be sure in one step."""
    result = sweep(case, tmp_path / "out" / "points", "a1.gain=0.5,24", scenarios=["two"])
    assert result.refined > 0
    assert result.computed == 2 + result.refined
    (first,) = [t for t in result.scenarios[0].trajectories if t.name == "first"]
    assert [p.beginning.name for p in first.points.values()] == ["START", "REFINED"]
    assert list(first.points) == [(0,), (1,)]  # results are those of the grid
    arguments = (
        case,
        "--scenario",
        "two",
        "--vary",
        "a1.gain=0.5,24",
        "--workers",
        1,
        "--out",
        tmp_path / "out",
    )
    code, out, err = gfor(*arguments)
    assert code == 0
    assert "between the values asked for served to recognise modes" in err
    assert "0 points computed" in out


def test_a_parameter_of_whole_numbers_is_known_as_one():
    prepared = prepare_one("two_area", "pod_p")
    assert resolve(parse_vary("gfor.pod_p.N_S=0,1,2,3"), [prepared]).multiple_of == 1.0
    assert resolve(parse_vary("gfor.pod_p.K=0,1,2,3"), [prepared]).multiple_of is None


@pytest.mark.parametrize(
    ("values", "between"),
    [((0.0, 1.0, 2.0), set()), ((0.0, 3.0), {1.0, 2.0}), ((1.0, 9.0), {2.0, 3.0, 5.0, 7.0})],
)
def test_whole_numbers_have_only_whole_numbers_in_between(
    case, tmp_path, monkeypatch, values, between
):
    plan = plan_sweep(load_case(case), SweepRequest([parse_vary("a1.gain=3:4:2")], ["one"]))
    plan = replace(plan, axes=(replace(plan.axes[0], values=values, multiple_of=1.0),))
    fine, seen = compute_point(plan.task(plan.scenarios[0], (0,))), set()
    monkeypatch.setattr(sweep_module, "is_ambiguous", lambda *_: True)
    monkeypatch.setattr(
        sweep_module, "compute_point", lambda task: seen.add(task.overrides["a1.gain"]) or fine
    )
    run_sweep(plan, Work(Serial(), PointStore(tmp_path / "p")))
    assert all(value == int(value) for value in seen)
    assert between <= seen - set(values)
    assert bool(between) == bool(seen - set(values))


def test_a_mode_beyond_the_range_is_not_followed_there(case, tmp_path):
    result = sweep(
        case, tmp_path / "p", "a1.gain=6:60:19", scenarios=["two"], frequencies=(0.5, 2.0)
    )
    frequencies = curve(result.scenarios[0], "first")
    inside = [g for g in np.linspace(6, 60, 19) if np.sqrt(g * FULL_TURN) / FULL_TURN <= 2.0]
    assert [place for (place,) in frequencies] == list(range(len(inside)))
    # the only one that is left, and not the one that is meant
    assert len(curve(result.scenarios[0], "mode 2")) == 19


# -- keeping -----------------------------------------------------------------------------------------


def test_an_interrupted_sweep_continues(gfor, case, tmp_path, monkeypatch):
    out = tmp_path / "out"
    arguments = (case, "--vary", "a1.gain=3:12:4", "--workers", 1, "--out", out)
    monkeypatch.setattr(sweep_module, "compute_point", interrupted_after(5, compute_point))
    code, text, err = gfor(*arguments)
    assert (code, text) == (130, "")
    assert (
        err == f"interrupted: 5 of 8 points are in {out}; the same command continues from there\n"
    )
    assert len(list((out / "points").glob("*.npz"))) == 5
    half, *_ = (out / "points").glob("*.npz")
    half.write_bytes(half.read_bytes()[:300])  # as a power cut may leave it
    monkeypatch.setattr(sweep_module, "compute_point", compute_point)
    code, text, _ = gfor(*arguments)
    assert code == 0
    assert "4 points computed, 4 were there already" in text
    code, text, err = gfor(*arguments)
    assert "0 points computed, 8 were there already" in text
    assert "another study" not in err
    _, _, err = gfor(case, "--vary", "a1.gain=5:11:2", "--workers", 1, "--out", out)
    assert "out holds another study, with no point of this one: its tables are replaced" in err


def test_what_a_stored_point_depends_on(case, tmp_path):
    folder = tmp_path / "p"
    assert sweep(case, folder, "a1.gain=3:12:4").computed == 8
    # a longer sweep takes over what is there
    assert sweep(case, folder, "a1.gain=3:15:5").computed == 2
    assert sweep(case, folder, "a1.gain=3:12:4", scenarios=["two"]).computed == 0
    assert sweep(case, folder, "a1.gain=3:12:4", frequencies=(0.2, 2.0)).computed == 8
    assert sweep(case, folder, "a1.gain=3:12:4", step=2e-3).computed == 8
    assert sweep(case, folder, "a1.gain=3:12:4", values={"b2.gain": -3.0}).computed == 8
    case.write_text(
        case.read_text(encoding="utf-8").replace("gain = 6.28", "gain = 6.29"), encoding="utf-8"
    )
    assert sweep(case, folder, "a1.gain=3:12:4").computed == 8


def test_a_worker_with_another_case_file_refuses(case):
    plan = plan_sweep(load_case(case), SweepRequest([parse_vary("a1.gain=3:4:2")]))
    task = plan.task(plan.scenarios[0], (0,))
    case.write_text(case.read_text(encoding="utf-8") + "\n# changed\n", encoding="utf-8")
    with pytest.raises(
        InputError, match="this file has another text now than when the study loaded it"
    ):
        compute_point(task)


# -- the same numbers everywhere ---------------------------------------------------------------------


def numbers(result):
    """All that is computed, to the last bit."""
    return [
        (
            sweep.prepared.name,
            place,
            *(getattr(record.modes, a).tobytes() for a in ("eigenvalues", "left", "right")),
        )
        for sweep in result.scenarios
        for place, record in sorted(sweep.points.items())
    ]


def test_processes_compute_what_one_process_does(case, tmp_path):
    alone = sweep(case, tmp_path / "alone", "a1.gain=3:12:4")
    together = sweep(case, tmp_path / "together", "a1.gain=3:12:4", executor=Processes(2))
    assert alone.computed == together.computed == 8
    assert numbers(alone) == numbers(together)


@pytest.mark.slow
def test_a_dask_cluster_computes_what_one_process_does(tmp_path):
    distributed = pytest.importorskip("distributed")
    vary, scenarios = "grid.X_L=0.1,0.2", ["base", "pod_pq"]
    alone = sweep("two_area", tmp_path / "alone", vary, scenarios=scenarios)
    with distributed.LocalCluster(  # of one: `tests/studies/points/test_executors.py` has two
        n_workers=1, threads_per_worker=1, dashboard_address=None
    ) as cluster:
        executor = DaskCluster(cluster.scheduler_address)
        together = sweep(
            "two_area", tmp_path / "together", vary, scenarios=scenarios, executor=executor
        )
    assert alone.computed == together.computed == 4
    assert numbers(alone) == numbers(together)


@pytest.mark.parametrize(
    ("verdicts", "stable"),
    [
        ([True, True], True),
        ([True, None], None),
        ([True, False], False),
        ([None, False], False),
        ([None, None], None),
    ],
)
def test_a_point_that_failed_leaves_the_stability_open(case, verdicts, stable):
    """None stands for a point without modes, such as one whose FMU refuses the value."""
    refused = PointRecord(failure=Failure(ErrorKind.START, "refused", lasting=True))
    records = [refused if v is None else PointRecord(stability={"stable": v}) for v in verdicts]
    prepared = prepare_one(case, "one")
    assert (
        ScenarioSweep(prepared, {(k,): record for k, record in enumerate(records)}).stable is stable
    )


def test_points_without_a_verdict_are_counted_and_warnings_are_said(
    gfor, case, tmp_path, monkeypatch
):
    """Two of four points are not known, and one grows; three have a warning that differs in its figure only."""

    def odd(task):
        record, gain = compute_point(task), task.overrides["a1.gain"]
        stable = {1.0: True, 2.0: None, 3.0: False, 4.0: None}.get(gain, True)
        texts = (f"the step hides {gain:g} %",) if gain in (2, 3, 4) else ()
        verdict = record.stability | {
            "stable": stable,
            "largest_growth_rate": 0.1,
            "sentence": "UNSTABLE: grows",
        }
        return replace(record, stability=verdict, warnings=texts)

    monkeypatch.setattr(sweep_module, "compute_point", odd)
    out = tmp_path / "out"
    arguments = ("--scenario", "one", "--workers", 1, "--out", out, "--vary")
    _, text, err = gfor(case, *arguments, "a1.gain=1,2,3,4")
    assert re.search(
        r"UNSTABLE: .*: at 1 of 4 points \(1 stable, 2 not known\); least damping at .*; worst at a1.gain = 3",
        text,
    )
    turns = (
        "stable at a1.gain = 1 .*, not known at a1.gain = 2 .*; "
        "not known at a1.gain = 2 .*, unstable at a1.gain = 3 "
    )
    assert re.search(turns, text.splitlines()[0])
    assert err.count("the step hides") == 1
    assert re.search(r"^at 3 of \d+ points: the step hides 2 %$", err, re.MULTILINE)
    _, text, _ = gfor(case, *arguments, "a1.gain=1,2", "--json")
    (scenario,) = json.loads(text)["scenarios"]
    assert scenario["warnings"] == [
        {"values": {"a1.gain": 2.0}, "warnings": ["the step hides 2 %"]}
    ]
    with xr.open_dataset(out / "sweep.nc") as data:
        assert data["warnings"].values[0].tolist() == ["", "the step hides 2 %"]
        assert "at 1 of 2 points: the step hides 2 %" in of_sweep(out, data).doubts
        hertz = data["largest_growth_frequency"].values[0]
    with (out / "sweep.csv").open(encoding="utf-8") as file:
        beside = {
            float(row["frequency of largest growth rate [Hz]"]) for row in csv.DictReader(file)
        }
    assert sorted(beside) == pytest.approx(sorted(set(hertz.tolist())))
    with (out / "sweep.csv").open(encoding="utf-8") as file:
        assert {row["warnings"] for row in csv.DictReader(file)} == {"", "the step hides 2 %"}
    _, text, _ = gfor(case, *arguments, "a1.gain=1,2")
    assert re.search(
        r"not known: .*: 1 of 2 points have no verdict, 1 are stable, 0 are unstable", text
    )


def test_the_least_damped_mode_stands_in_the_verdict_with_its_value():
    """A verdict said "nothing grows at any of 5 points", and nothing of the damping."""
    states = ("sg1.delta", "sg1.omega", "sg2.omega")
    left = np.array([[0.5, 0.3, 0.2]] * 2, dtype=complex)
    well, least = (
        ModeSet(np.array([-1 + 9j, real + 4j]), left, np.ones_like(left), states)
        for real in (-0.9, -0.2)
    )
    points = {(k,): PointRecord(modes=one) for k, one in enumerate((well, least, None))}
    axes = [Axis("grid.X_L", "pu", "Line", (0.1, 0.2, 0.3))]
    assert _least(SimpleNamespace(points=points), axes) == (
        "; least damping at grid.X_L = 0.2 pu: 0.637 Hz, 4.99 % (sg1 0.80, sg2 0.20)"
    )
    assert _least(SimpleNamespace(points=dict.fromkeys(points, PointRecord())), axes) == ""


def test_the_limit_that_was_written_is_named_rather_than_a_value_between():
    info = VariableInfo("n.deviation", 0, "Real", "parameter", "tunable", "pu", None, 0.0, None, "")
    with pytest.raises(InputError, match=r"n.deviation = -3 pu; it must be at least 0 pu"):
        _axis(parse_vary("n.deviation=0.1:-3:3"), info)
