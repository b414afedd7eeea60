"""A sweep assigns values layer by layer, as a scenario does; what is varied goes before everything else."""

import numpy as np
import pytest

import orchestrator as gfor
from orchestrator.cases.form.parameter_files import read_parameter_file
from orchestrator.studies.points.task import StudyCase
from orchestrator.studies.sweep import point
from orchestrator.studies.sweep.axes import Vary
from orchestrator.studies.sweep.point import SweepPointTask, compute_point
from orchestrator.studies.sweep.request import SweepRequest
from orchestrator.studies.sweep.sweep import plan_sweep
from tests.studies.sweep.sweep_case import two_oscillators

FULL_TURN = 2 * np.pi


@pytest.fixture
def case(tmp_path):
    return gfor.load(two_oscillators(tmp_path))


@pytest.fixture
def write(tmp_path):
    def make(*lines, name="values.toml"):
        (tmp_path / name).write_text("\n".join(["[set]", *lines]), encoding="utf-8")
        return tmp_path / name

    return make


@pytest.fixture
def values_at(monkeypatch):
    """Values with which a point of a sweep is computed."""

    def find(task):
        seen = []
        with monkeypatch.context() as patched:
            patched.setattr(
                point, "compute_modes", lambda prepared, _: seen.append(prepared) or 1 / 0
            )
            compute_point(task)
        return seen[0].values

    return find


def listed(key, *values):
    return Vary(key, None, len(values), False, values)


@pytest.mark.parametrize(
    ("lines", "values"),
    [
        (['"a1.gain" = 9.0', '"?1.gain" = 4.0'], {"a1.gain": 16.0}),
        (['"a1.gain" = 9.0', '"?1.gain" = 4.0'], {}),
        (['"?1.gain" = 4.0', '"a1.gain" = 9.0'], {"?1.gain": 16.0}),
        (['"a1.gain" = 9.0'], {"a1.gain": 16.0, "?1.gain": 5.0}),
    ],
)
def test_values_have_the_same_priority_as_in_a_scenario(case, write, lines, values):
    file = write(*lines)
    gain = case.scenario("one", values, parameters=file).values["a1.gain"]
    found = (
        case.sweep({"slow.T": [0.1, 0.2]}, ["one"], values, parameters=file)
        .table()
        .query("mode == 'first'")
    )
    assert found["frequency_hz"].tolist() == pytest.approx(
        [np.sqrt(gain * FULL_TURN) / FULL_TURN] * 2, rel=1e-4
    )


def test_a_later_file_goes_before_an_earlier_one_whatever_the_patterns(case, write, values_at):
    first, second = (
        write('"a1.gain" = 9.0', '"?1.gain" = 4.0'),
        write('"a1.gain" = 8.0', name="later.toml"),
    )
    files = [read_parameter_file(path) for path in (first, second)]
    planned = plan_sweep(
        case.file, SweepRequest([listed("slow.T", 0.1, 0.2)], ["one"], parameters=files)
    )
    assert values_at(planned.task(planned.scenarios[0], (0,)))["a1.gain"] == 8.0


@pytest.mark.parametrize(
    "fixed", [{"a1.gain": 5.0}, {"a1.gain": 5.0, "a*.gain": 6.0}, {"?1.gain": 5.0}]
)
def test_what_is_varied_goes_before_every_other_value(case, write, values_at, fixed):
    file = read_parameter_file(write('"a1.gain" = 9.0', '"?1.gain" = 4.0'))
    planned = plan_sweep(
        case.file, SweepRequest([listed("a1.gain", 3.0, 7.0)], ["one"], fixed, parameters=[file])
    )
    for place, gain in (((0,), 3.0), ((1,), 7.0)):
        assert values_at(planned.task(planned.scenarios[0], place))["a1.gain"] == gain


def test_a_task_of_its_own_keeps_that_order(case, write, values_at):
    (prepared,) = case.file.prepare(["one"])
    layer = read_parameter_file(write('"a1.gain" = 9.0', '"?1.gain" = 4.0'))
    task = SweepPointTask(StudyCase.of(prepared, [layer]), {"a1.gain": 3.0}, (0.1, 2.0))
    assert {
        key: value for key, value in values_at(task).items() if key in ("a1.gain", "b1.gain")
    } == {
        "a1.gain": 3.0,
        "b1.gain": 4.0,
    }
    same = SweepPointTask(StudyCase.of(prepared), {"a1.gain": 3.0}, (0.1, 2.0))
    assert same.key != task.key


def test_the_results_say_what_held_at_all_points(case, write, tmp_path):
    file = write('"a1.gain" = 9.0', '"b2.gain" = -4.0')
    swept = case.sweep({"slow.T": [0.1, 0.2]}, ["one"], {"a1.gain": 16.0}, parameters=file)
    assert swept.dataset.attrs["overrides"] == '{"a1.gain": 16.0, "b2.gain": -4.0}'
