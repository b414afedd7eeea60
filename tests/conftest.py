"""Fixtures shared by all tests."""

import gc
import os
import signal
from contextlib import nullcontext
from functools import cache
from pathlib import Path

import pytest

if (
    "PYTEST_XDIST_WORKER" in os.environ
):  # before NumPy: threads of BLAS in every worker would wait for each other
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from fmus.toolchain.catalogue import build_model
from fmus.toolchain.exporter import cached
from fmus.toolchain.native_fmu import NativeFmu
from fmus.toolchain.python_fmu import PythonFmu
from orchestrator.core.late import import_xarray_alone
from orchestrator.core.spelling import as_options
from orchestrator.face.cli import main
from tests.support import once
from tests.support.bytecode import TESTS, import_share, keep
from tests.support.durations import (
    MEASURED,
    Measure,
    longest_first,
    mark,
    may_be_chosen,
    require_readable,
)
from tests.support.few_files import require_few_files
from tests.support.reports import FewReports, asks_for_seconds
from tests.support.skips import Skips, in_ci
from tests.support.undrawn import write_empty


def pytest_configure(config):
    """No garbage is looked for among what is collected, which stays; nothing that is written waits for the disk.
    A library for Windows or a Mac that needs all of zig's files is a failure.

    In CI a skip that is not on the list fails the session; with xdist the process that started the others counts.
    """
    gc.disable()
    keep()
    require_few_files()
    os.fsync = lambda handle: None  # no test cuts the power, and thousands of files would wait
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        # a shell starts what runs in its background deaf to Ctrl-C, and all that this starts would
        # be: tests of interrupts would wait for ever
        signal.signal(signal.SIGINT, signal.default_int_handler)
    worker = hasattr(config, "workerinput")
    if in_ci() and not worker:
        config.pluginmanager.register(Skips(), "skips")
    if worker and not asks_for_seconds(config):
        config.pluginmanager.register(FewReports(), "few reports")
    if MEASURED in os.environ:
        config.pluginmanager.register(Measure(Path(os.environ[MEASURED])), "seconds")


@pytest.hookimpl(optionalhook=True)  # where pytest-xdist is there
def pytest_xdist_auto_num_workers():
    """Two a core for ``-n auto``: a test waits for processes, signals and time-outs as long as it computes."""
    return 2 * len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection(session):
    """The workers of a whole run share the work of compiling the tests, and import xarray without dask and pint."""
    worker = getattr(session.config, "workerinput", None)
    if worker and [Path(name).resolve() for name in session.config.args] == [TESTS]:
        number = int(worker["workerid"].removeprefix("gw"))
        chosen = session.config.option.markexpr
        import_xarray_alone()  # or its first array would import both, which is 0.8 s of each worker
        import_share(number, worker["workercount"], lambda path: may_be_chosen(path, chosen))


def pytest_ignore_collect(collection_path, config):
    if collection_path.match("test_*.py") and collection_path.is_relative_to(TESTS):
        return None if may_be_chosen(collection_path, config.option.markexpr) else True
    return None  # others decide


@pytest.hookimpl(wrapper=True)
def pytest_collection_modifyitems(items):
    mark(items)
    require_readable(items)
    yield  # -m chooses by the marks
    longest_first(items)


def pytest_collection_finish():
    gc.freeze()
    gc.enable()


@pytest.fixture(autouse=True)
def spelt(request):
    """Errors are read as the command line says them, but in tests of the Python face."""
    with (
        nullcontext()
        if Path(__file__).parent / "face" / "api" in request.path.parents
        else as_options()
    ):
        yield


@pytest.fixture(scope="session", autouse=True)
def shared_by_workers(tmp_path_factory):
    once.share_in(tmp_path_factory)


@pytest.fixture(scope="session")
def fmu_path():
    """Name of a catalogue model → its built .fmu, Python-backed or native."""
    return cache(
        lambda name, native=False: cached((NativeFmu if native else PythonFmu)(build_model(name)))
    )


@pytest.fixture(scope="module")
def undrawn():
    """Pictures are set up and written, but not drawn: that takes two thirds of a short run.

    For modules whose subject is another one; `tests/studies/runs/test_signal_plots.py` and others look at pictures.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("matplotlib.figure.Figure.savefig", write_empty)
        yield


@pytest.fixture
def in_process(monkeypatch):
    """FMUs of others run in this process, where nothing else is asked for: a process of its own is half a second each.

    For tests whose subject is another one; `tests/devices/sandbox` and others look at isolation."""
    monkeypatch.setattr(
        "orchestrator.devices.fmi.instance.is_isolated", lambda _, isolated: bool(isolated)
    )


@pytest.fixture
def gfor(capsys, monkeypatch):
    """Run the command; returns exit code, standard output and standard error, without the lines of progress that come
    every 30 s on a busy machine."""
    monkeypatch.setattr("orchestrator.face.cli.progress_lines.EVERY", 3600.0)

    def run(*arguments):
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as stop:  # argparse's way out
            code = stop.code
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run
