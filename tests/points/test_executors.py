"""The same answers from every executor, whatever happens to its workers."""

import sys

import pytest

from fmus.toolchain.extras import MissingLibraryError
from orchestrator.errors import InputError
from orchestrator.points.dask_cluster import DaskCluster
from orchestrator.points.executor import WorkerLostError
from orchestrator.points.processes import Processes
from orchestrator.points.serial import Serial
from tests.points.small_tasks import always_die, die_once, double, fail

NUMBERS = range(8)


@pytest.mark.parametrize("executor", [Serial(), Processes(2)])
def test_every_task_is_answered_once(executor):
    assert sorted(executor.run(double, NUMBERS)) == [(n, 2 * n) for n in NUMBERS]
    assert list(executor.run(double, [])) == []
    assert sorted(executor.run(double, NUMBERS)) == [(n, 2 * n) for n in NUMBERS]
    executor.close()


@pytest.mark.parametrize("executor", [Serial(), Processes(2)])
def test_an_exception_ends_the_run(executor):
    with pytest.raises(InputError, match="three cannot be used"):
        list(executor.run(fail, NUMBERS))


def test_killed_workers_lose_nothing(tmp_path):
    tasks = [(n, str(tmp_path)) for n in NUMBERS]
    assert sorted(Processes(2).run(die_once, tasks)) == [(n, 2 * n) for n in NUMBERS]


def test_a_task_that_always_kills_its_worker_is_given_up_and_no_other_is():
    answers = dict(Processes(2).run(always_die, NUMBERS))
    lost = answers.pop(2)
    assert isinstance(lost, WorkerLostError)
    assert "its worker process died 3 times" in str(lost)
    assert answers == {n: 2 * n for n in NUMBERS if n != 2}


def test_leaving_early_stops_the_workers():
    answers = Processes(2).run(double, range(1000))
    next(answers)
    answers.close()


def test_without_dask_the_error_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingLibraryError, match=r"pip install 'gfor-cosim\[cluster\]'"):
        list(DaskCluster("tcp://localhost:1").run(double, NUMBERS))


@pytest.mark.slow
def test_a_dask_cluster(tmp_path):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        executor = DaskCluster(cluster.scheduler_address)
        assert sorted(executor.run(double, NUMBERS)) == [(n, 2 * n) for n in NUMBERS]
        tasks = [(n, str(tmp_path)) for n in NUMBERS]
        assert sorted(executor.run(die_once, tasks)) == [(n, 2 * n) for n in NUMBERS]
        with pytest.raises(InputError, match="three cannot be used"):
            list(executor.run(fail, NUMBERS))


@pytest.mark.slow
def test_a_scheduler_that_is_not_there(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("orchestrator.points.dask_cluster._PATIENCE", 1)
    with pytest.raises(InputError, match="no Dask scheduler answers there"):
        list(DaskCluster("tcp://127.0.0.1:9").run(double, NUMBERS))
