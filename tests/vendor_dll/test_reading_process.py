"""How the process that reads a DLL ends: the DLL's own doing lasts as a verdict, want of time does not."""

import pytest

from fmus.vendor_dll import asking
from fmus.vendor_dll import fmu as dll_module
from fmus.vendor_dll.fmu import DllError, read_dll
from orchestrator.fmi import vendor_files
from orchestrator.fmi.description import read_description
from orchestrator.fmi.vendor_files import as_fmu
from tests.support.vendor_dlls import compiled, lag

SLOW = lag(begin="usleep(1500000);", head="\n#include <unistd.h>\n")


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    """So that nothing was kept; what is compiled is found where it was."""
    real = vendor_files.cache_directory
    monkeypatch.setattr(vendor_files, "cache_directory", lambda kind: tmp_path / real(kind).name)
    monkeypatch.setattr(vendor_files, "_tried_now", {})


def test_a_trial_that_lacked_time_is_told_not_kept_and_tried_anew(empty_cache, tmp_path, monkeypatch, caplog):
    library = compiled(SLOW, tmp_path)
    monkeypatch.setattr(dll_module, "_LONGEST", 1.0)
    first = as_fmu(library)
    description = read_description(first)
    assert description.kept_in == "not tried"
    assert "does not end within 1 s while Model_Initialize runs: time ran out" in description.kept_why
    assert "the next call tries it anew" in caplog.text
    assert as_fmu(library) == first  # not twice in one process
    vendor_files._tried_now.clear()
    monkeypatch.setattr(dll_module, "_LONGEST", 60)
    second = as_fmu(library)
    assert second != first
    assert read_description(second).kept_in == "arrays"
    assert as_fmu(library) == second


def test_a_dll_that_never_comes_back_is_told_as_such_every_time(empty_cache, tmp_path, monkeypatch):
    monkeypatch.setattr(dll_module, "_LONGEST", 2.0)
    monkeypatch.setattr(asking, "_OWN_DOING", 0.02)  # other tests may have the processors
    library = compiled(lag(do="for (volatile int go = 1; go;) {}"), tmp_path)
    for _ in range(2):
        vendor_files._tried_now.clear()
        description = read_description(as_fmu(library))
        assert description.kept_in == "not tried"
        assert "while Model_Outputs runs: the DLL does not come back" in description.kept_why


def test_a_trial_that_was_killed_from_outside_is_no_lasting_verdict(tmp_path):
    trial = read_dll(compiled(lag(do="raise(SIGKILL);", head="\n#include <signal.h>\n"), tmp_path)).trial
    assert trial.passing
    assert "ends with SIGKILL while Model_Outputs runs: something else ended it" in trial.why
    trial = read_dll(compiled(lag(do="abort();"), tmp_path)).trial
    assert not trial.passing


def test_a_start_that_takes_too_long_is_not_laid_on_the_dll(tmp_path, monkeypatch):
    monkeypatch.setattr(asking, "BEFORE_IT_STARTS", 0.0)
    monkeypatch.setattr(asking, "note_beside", lambda answer: answer.with_name("not there yet"))
    with pytest.raises(DllError, match=r"time ran out before the DLL was loaded.*try again"):
        read_dll(compiled(lag(head="__attribute__((constructor)) static void b(void) { for (;;) {} } "), tmp_path))


def test_a_crash_names_the_function_that_was_called(tmp_path):
    source = lag().replace("{ return &INFO; }", "{ abort(); return &INFO; }")
    with pytest.raises(DllError, match="ends with SIGABRT while Model_GetInfo runs: it crashes there"):
        read_dll(compiled(source, tmp_path))
