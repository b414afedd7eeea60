"""A DLL that needs a file which its text parameter names gets it where it is closed off, or it is said what hid it."""

import fmpy
import pytest

import orchestrator as gfor
from orchestrator.core.errors import ComponentError, InputError
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.vendor_files import as_fmu
from orchestrator.face.api.dll import build_from_dll
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import gauss_seidel
from orchestrator.systems.coupling.system import System
from tests.support.vendor_dlls import INFO, INTERFACE, compiled

SIGNALS = """
#include <stdio.h>
static const struct signal IN[] = {{"u", "", "pu", 9, 1}}, OUT[] = {{"y", "", "pu", 9, 1}};
static const struct parameter PAR[] = {{"gains", "", "File of gains", "", 10, 0, {.s = "DEFAULT"}, {0}, {0}}};
"""
CALLS = """
int32_t Model_Initialize(struct instance *s) {
    FILE *f = fopen(*(const char **)s->par, "r");
    OTHERWISE
    if (fscanf(f, "%lf", s->doubles) != 1) s->doubles[0] = 0;
    fclose(f);
    return 0;
}
int32_t Model_Outputs(struct instance *s) { *(double *)s->out = s->doubles[0] * *(double *)s->in; return 0; }
"""


def needs_a_file(folder, default="gains.txt", otherwise=""):
    """The library, which crashes where its file is not there; ``otherwise`` comes before."""
    info = INFO % {"name": "filed", "sample_time": 1e-3, "doubles": 1}
    source = (
        INTERFACE
        + SIGNALS.replace("DEFAULT", default)
        + info
        + CALLS.replace("OTHERWISE", otherwise)
    )
    return compiled(source, folder, "filed")


def gain(fmu):
    """What the FMU makes of 1, in a process that is closed off."""
    system = System()
    system.add("k", read_description(fmu))
    system.components["k"].inputs["u"] = 1.0
    with Master(system, gauss_seidel([["k"]]), 1e-3) as master:
        master.advance(2)
        return master.components["k"].values(["y"])["y"]


def test_a_file_beside_the_dll_is_read_and_followed_when_it_changes(tmp_path):
    library = needs_a_file(tmp_path)
    (tmp_path / "gains.txt").write_text("3", encoding="utf-8")
    assert gain(library) == 3
    assert gfor.check(library, only=["runs", "repeatability"]).trusted
    (tmp_path / "gains.txt").write_text("4", encoding="utf-8")
    assert gain(library) == 4


def test_a_file_that_is_given_goes_into_the_fmu(tmp_path, monkeypatch):
    library = needs_a_file(tmp_path, "C:/models/gains.txt")
    elsewhere = tmp_path / "else where"
    elsewhere.mkdir()
    file = elsewhere / "my gains.txt"
    file.write_text("5", encoding="utf-8")
    built = build_from_dll(library, tmp_path / "built", texts={"gains": str(file)})
    assert "its state is in the host's arrays" in built.told[1]
    file.unlink()
    monkeypatch.chdir(elsewhere)
    found = fmpy.simulate_fmu(
        str(built.path), stop_time=0.01, step_size=1e-3, start_values={"u": 1.0}, output=["y"]
    )
    assert found["y"][-1] == 5


@pytest.mark.parametrize("given", [None, "not_there.json"])
def test_a_crash_for_want_of_a_file_is_told_as_that(given, tmp_path):
    library = needs_a_file(tmp_path)
    named = given or "gains.txt"
    words = rf"ends with SIGSEGV while Model_Initialize runs; it sees no files .* gains = '{named}' .*--text"
    with pytest.raises(InputError, match=words) as caught:
        build_from_dll(library, tmp_path, texts={"gains": given} if given else None)
    assert "author" not in str(caught.value)
    if not given:
        with pytest.raises(InputError, match=words):
            as_fmu(library)
        (tmp_path / "gains.txt").write_text("6", encoding="utf-8")
        assert gain(library) == 6


def test_a_dll_that_says_that_it_has_no_file_is_helped_out(tmp_path):
    library = needs_a_file(tmp_path, otherwise='if (!f) { s->error = "no gains"; return 2; }')
    with pytest.raises(
        ComponentError,
        match=r"error of the DLL: no gains.*parameter gains names the file gains.txt",
    ):
        gain(library)
    (tmp_path / "gains.txt").write_text("7", encoding="utf-8")
    assert gain(library) == 7  # what was built without it is not taken again


def test_a_dll_does_not_choose_which_file_it_reads(tmp_path):
    (tmp_path / "secret.txt").write_text("8", encoding="utf-8")
    for n, default in enumerate((str(tmp_path / "secret.txt"), "../secret.txt", "link.txt")):
        place = tmp_path / str(n)
        place.mkdir()
        (place / "link.txt").symlink_to(tmp_path / "secret.txt")
        with pytest.raises(
            InputError, match=r"it sees no files but those that its text parameters name"
        ):
            as_fmu(needs_a_file(place, default))
