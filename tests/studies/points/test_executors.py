"""The same answers from every executor, whatever happens to its workers."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from fmus.toolchain.extras import MissingLibraryError
from orchestrator.core.errors import CosimError, ErrorKind, InputError
from orchestrator.studies.points.dask_cluster import TLS_FILES, DaskCluster
from orchestrator.studies.points.executor import Serial
from orchestrator.studies.points.lost_workers import WorkerLostError
from orchestrator.studies.points.processes import Processes
from orchestrator.studies.points.study import choose_executor
from tests.studies.points.small_tasks import (
    always_die,
    die_once,
    double,
    fail,
    sleepy_double,
    waits,
)

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


def test_workers_that_are_ended_close_what_they_hold(tmp_path):
    """Else an interrupted study would wait for its points, or leave the folders of their FMUs behind."""
    executor = Processes(2)
    outcomes = executor.run(waits, [(n, str(tmp_path)) for n in range(2)])
    assert next(outcomes) == (0, 0)
    assert [path.name for path in tmp_path.iterdir()] == ["1"]
    executor.close()
    assert list(tmp_path.iterdir()) == []


def test_without_dask_the_error_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingLibraryError, match=r"pip install 'gfor-cosim\[cluster\]'"):
        list(DaskCluster("tcp://localhost:1").run(double, NUMBERS))


@pytest.mark.slow
def test_a_dask_cluster(tmp_path):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None
    ) as cluster:
        executor = DaskCluster(cluster.scheduler_address)
        assert sorted(executor.run(double, NUMBERS)) == [(n, 2 * n) for n in NUMBERS]
        tasks = [(n, str(tmp_path)) for n in NUMBERS]
        assert sorted(executor.run(die_once, tasks)) == [(n, 2 * n) for n in NUMBERS]
        with pytest.raises(InputError, match="three cannot be used"):
            list(executor.run(fail, NUMBERS))


@pytest.mark.slow
def test_a_cluster_whose_workers_are_all_gone_ends_the_run_with_what_is_there(monkeypatch, caplog):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr("orchestrator.studies.points.dask_cluster._PATIENCE", 5)
    monkeypatch.setattr("orchestrator.studies.points.dask_cluster.INTERVAL", 0.5)
    monkeypatch.setattr("orchestrator.studies.points.dask_cluster.INTERVAL", 0.5)
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address=None
    ) as cluster:
        results = DaskCluster(cluster.scheduler_address).run(sleepy_double, NUMBERS)
        first = next(results)
        cluster.scale(0)
        with pytest.raises(
            CosimError, match=r"no usable worker is left since \d+ s.* are kept.*dask worker"
        ) as caught:
            list(results)
    assert first == (first[0], 2 * first[0])
    assert caught.value.kind is ErrorKind.WORKER_LOST
    assert "is lost" in caplog.text
    assert "no other is there" in caplog.text


@pytest.mark.slow
def test_a_cluster_whose_workers_lack_the_project_is_refused_at_once(tmp_path):
    """A worker of another environment: one in which `orchestrator` cannot be found."""
    distributed = pytest.importorskip("distributed")
    (tmp_path / "sitecustomize.py").write_text(
        "import sys\nclass Hidden:\n    def find_spec(self, name, path=None, target=None):\n"
        "        if name.split('.')[0] == 'orchestrator':\n            raise ModuleNotFoundError(name)\n"
        "sys.meta_path.insert(0, Hidden())\n"
    )
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(tmp_path), str(Path(__file__).parents[3])]),
    }
    with distributed.LocalCluster(n_workers=0, dashboard_address=None) as cluster:
        command = [
            sys.executable,
            "-m",
            "distributed.cli.dask_worker",
            cluster.scheduler_address,
            "--no-dashboard",
        ]
        worker = subprocess.Popen(command, env=environment, cwd=tmp_path, stderr=subprocess.DEVNULL)
        try:
            with pytest.raises(
                InputError,
                match=r"none of its 1 workers can import gfor-cosim \(orchestrator\); install",
            ):
                list(DaskCluster(cluster.scheduler_address).run(double, NUMBERS))
        finally:
            worker.terminate()
            worker.wait()


@pytest.fixture(scope="module")
def certificates(tmp_path_factory):
    """Two folders with certificates, each of an authority of its own."""
    pytest.importorskip("distributed")
    from distributed import Security  # noqa: PLC0415 - slow to import

    def folder(name):
        made, place = Security.temporary(), tmp_path_factory.mktemp(name)
        for file, text in zip(
            TLS_FILES, (made.tls_ca_file, made.tls_client_cert, made.tls_client_key), strict=True
        ):
            (place / file).write_text(text, encoding="utf-8")
        return place, made

    return folder("ours"), folder("strangers")


@pytest.mark.slow
def test_a_cluster_with_tls_lets_in_who_has_its_certificate(certificates, monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr("orchestrator.studies.points.dask_cluster._PATIENCE", 10)
    (ours, security), (strangers, _) = certificates
    with distributed.LocalCluster(
        n_workers=1, protocol="tls", security=security, dashboard_address=None
    ) as cluster:
        address = cluster.scheduler_address
        assert address.startswith("tls://")
        assert sorted(DaskCluster(address, ours).run(double, NUMBERS)) == [
            (n, 2 * n) for n in NUMBERS
        ]
        with pytest.raises(InputError, match="no Dask scheduler answers there"):
            list(DaskCluster(address, strangers).run(double, NUMBERS))
        with pytest.raises(InputError, match=r"no Dask scheduler answers there.*with --tls"):
            list(DaskCluster(address).run(double, NUMBERS))


def test_certificates_are_complete_and_used(tmp_path):
    with pytest.raises(
        InputError, match=r"no ca\.pem and no cert\.pem and no key\.pem; the folder must hold"
    ):
        choose_executor(None, "tls://host:8786", (), tmp_path)
    with pytest.raises(InputError, match="needs an address that begins with tls://"):
        choose_executor(None, "tcp://host:8786", (), tmp_path)
    with pytest.raises(InputError, match="name its address with --scheduler"):
        choose_executor(2, None, (), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("address", "warned"), [("tcp://192.0.2.1:9", True), ("tcp://127.0.0.1:9", False)]
)
def test_an_open_connection_to_another_machine_is_named(address, warned, monkeypatch, caplog):
    pytest.importorskip("distributed")
    monkeypatch.setattr("orchestrator.studies.points.dask_cluster._PATIENCE", 1)
    with pytest.raises(InputError, match="no Dask scheduler answers there"):
        list(DaskCluster(address).run(double, NUMBERS))
    assert ("whoever can reach the scheduler can run programs" in caplog.text) == warned


@pytest.mark.slow
def test_a_scheduler_that_is_not_there(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("orchestrator.studies.points.dask_cluster._PATIENCE", 1)
    with pytest.raises(InputError, match="no Dask scheduler answers there"):
        list(DaskCluster("tcp://127.0.0.1:9").run(double, NUMBERS))
