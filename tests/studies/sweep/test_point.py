"""One point of a sweep: what comes back from disk, and what a failure that is nobody's fault leaves behind."""

import re
from itertools import product

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import ErrorKind
from orchestrator.studies.operating_points import bench
from orchestrator.studies.points.executor import Serial
from orchestrator.studies.points.points import Work
from orchestrator.studies.points.store import PointStore
from orchestrator.studies.sweep import point
from orchestrator.studies.sweep.axes import parse_vary
from orchestrator.studies.sweep.point import PointRecord, compute_point
from orchestrator.studies.sweep.request import SweepRequest
from orchestrator.studies.sweep.sweep import plan_sweep, run_sweep
from tests.cases.new.test_widened_limits import new_case
from tests.studies.sweep.sweep_case import two_oscillators


@pytest.fixture
def task(tmp_path):
    plan = plan_sweep(
        load_case(two_oscillators(tmp_path)), SweepRequest([parse_vary("a1.gain=3:4:2")])
    )
    return plan.task(plan.scenarios[0], (0,))


def test_a_point_comes_back_from_disk_as_it_was(task, tmp_path):
    record = compute_point(task)
    store = PointStore(tmp_path / "points")
    store.save(task.key, *record.stored())
    again = PointRecord.restored(*store.load(task.key))
    assert again.named == record.named
    assert again.stability == record.stability
    assert np.array_equal(again.modes.eigenvalues, record.modes.eigenvalues)
    assert again.modes.names == record.modes.names


def test_a_file_of_another_form_is_computed_anew(task):
    header, arrays = compute_point(task).stored()
    assert PointRecord.restored({**header}, {**arrays}) is not None
    assert PointRecord.restored({**header, "colour": "red"}, {**arrays}) is None
    assert PointRecord.restored({**header}, {}) is None
    assert PointRecord.restored({"named": {}}, {}) is None


@pytest.mark.parametrize(
    ("error", "words"), [(RuntimeError("of a library"), "RuntimeError: of a library")]
)
def test_what_a_library_does_ends_one_point_only_and_is_tried_again(
    task, monkeypatch, error, words
):
    def fails(*_, **__):
        raise error

    monkeypatch.setattr(point, "compute_modes", fails)
    record = compute_point(task)
    assert (record.error, record.lasting, record.modes) == (words, False, None)


def test_what_an_fmu_of_ours_refuses_fails_alone_and_is_kept(tmp_path):
    plan = plan_sweep(
        load_case(two_oscillators(tmp_path)), SweepRequest([parse_vary("slow.T=-1,1")])
    )
    refused, fine = (compute_point(plan.task(plan.scenarios[0], (k,))) for k in (0, 1))
    assert "T must exceed 0" in refused.error
    assert refused.failure.kind is ErrorKind.START
    assert refused.lasting  # a model of ours refuses the same values again
    assert fine.error is None
    assert fine.modes is not None


def test_a_value_that_is_varied_is_not_questioned():
    """An inertia of 0.05 s is asked about where a case has it, and is meant where a sweep goes through it."""
    case, vary = load_case("two_area_rms"), ["sg1.machine.H=0.05:60:2", "sg2.machine.H=6,7"]
    plan = plan_sweep(case, SweepRequest([parse_vary(text) for text in vary], scenarios=["base"]))
    one = plan.task(plan.scenarios[0], (0, 0))
    assert not any("sg1: machine.H" in text for text in compute_point(one).warnings)
    (own,) = case.prepare(["base"], one.overrides)
    assert any("sg1: machine.H = 0.05 s is outside" in q.text for q in own.questions)
    held = SweepRequest(
        [parse_vary("sg2.machine.H=6,7")], scenarios=["base"], values={"sg1.machine.H": 0.05}
    )
    plan = plan_sweep(case, held)
    warnings = compute_point(plan.task(plan.scenarios[0], (0,))).warnings
    assert any("sg1: machine.H = 0.05 s is outside" in text for text in warnings)


def test_a_range_whose_end_has_no_power_flow_is_no_range_that_is_refused():
    case = load_case("two_area_rms")
    plan = plan_sweep(case, SweepRequest([parse_vary("gfor.S_n=0.25:1500:2")], scenarios=["gfor"]))
    error = compute_point(plan.task(plan.scenarios[0], (0,))).error
    assert "no solution found" in error
    assert "is it in MVA" not in error


def test_points_of_a_worker_share_fmus_and_are_those_of_fresh_ones_to_the_last_bit(
    tmp_path, monkeypatch
):
    axes = [parse_vary("a1.gain=3:4:3"), parse_vary("slow.T=-1,1")]
    plan = plan_sweep(load_case(two_oscillators(tmp_path)), SweepRequest(axes))
    tasks = [plan.task(plan.scenarios[0], place) for place in product(range(3), range(2))]
    alone = [compute_point(task) for task in tasks]
    opened, fresh = [], bench.running

    def counted(prepared):
        opened.append(prepared)
        return fresh(prepared)

    monkeypatch.setattr(bench, "running", counted)
    monkeypatch.setattr(point, "in_own_worker", lambda: True)
    with bench.PointBench(remember=True) as of_worker:
        monkeypatch.setattr(point, "_bench_of_worker", lambda: of_worker)
        together = [compute_point(task) for task in tasks]
    for one, other in zip(alone, together, strict=True):
        assert (one.failure is None) == (other.failure is None)
        assert one.error == other.error
        assert (one.named, one.warnings, one.stability) == (
            other.named,
            other.warnings,
            other.stability,
        )
        if one.modes is not None:
            assert one.modes.eigenvalues.tobytes() == other.modes.eigenvalues.tobytes()
            assert one.modes.right.tobytes() == other.modes.right.tobytes()
    assert sum(record.modes is None for record in together) == 3
    assert len(opened) == 4  # the first, and after each that fails


def test_a_sweep_in_this_process_stands_on_the_same_fmus_and_closes_them(tmp_path, monkeypatch):
    axes = [parse_vary("a1.gain=3:4:3")]
    plan = plan_sweep(load_case(two_oscillators(tmp_path)), SweepRequest(axes))
    alone = [compute_point(plan.task(plan.scenarios[0], (k,))) for k in range(3)]
    opened, fresh = [], bench.running

    def counted(prepared):
        opened.append(fresh(prepared))
        return opened[-1]

    monkeypatch.setattr(bench, "running", counted)
    swept, *_ = run_sweep(plan, Work(Serial())).scenarios
    for k, one in enumerate(alone):
        together = swept.points[(k,)].modes
        assert together.eigenvalues.tobytes() == one.modes.eigenvalues.tobytes()
        assert together.right.tobytes() == one.modes.right.tobytes()
    (master,) = opened
    assert all(component._fmu is None for component in master.components.values())
    assert point._bench_here.get() is None


@pytest.fixture
def beyond(tmp_path):
    """What gives the record of a point whose load asks exciters for more than their limits give."""
    case = load_case(new_case(tmp_path, exciter="0.05 -5.0 0.9 /"))

    def record(values, *varied):
        axes = [parse_vary(text) for text in ("grid.load_14.Q=90:100:2", *varied)]
        plan = plan_sweep(case, SweepRequest(axes, scenarios=["base"], values=values))
        return compute_point(plan.task(plan.scenarios[0], (0,) * len(axes)))

    return record


def test_a_point_beyond_a_limit_is_computed_with_the_limit_widened_and_told(beyond):
    """As a screening does; the modes are those of the same limits typed."""
    found = beyond({})
    assert found.error is None
    told = [re.fullmatch(r"(\S+) widened from (\S+) to (\S+)", text) for text in found.warnings]
    limits = {one[1]: float(one[3]) for one in told if one}
    assert limits
    assert all(float(one[2]) < float(one[3]) for one in told if one)
    typed = beyond(limits)
    assert not [text for text in typed.warnings if "widened from" in text]
    assert found.modes.eigenvalues == pytest.approx(typed.modes.eigenvalues, rel=1e-6)


def test_a_limit_that_is_varied_itself_is_not_widened(beyond):
    limit = next(text.split()[0] for text in beyond({}).warnings if "widened from" in text)
    found = beyond({}, f"{limit}=1.2:5:2")
    assert "cannot start" in found.error
