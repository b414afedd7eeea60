"""A DLL for Windows on Linux, under Wine: the figures of a library for Linux, and what it may not do."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from fmus.vendor_dll.fmu import DllError, read_dll
from orchestrator.core.errors import ComponentError, InputError
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.instance import open_component
from orchestrator.devices.fmi.isolated_component import IsolatedComponent
from orchestrator.devices.fmi.vendor_files import READER, foreign_platforms
from orchestrator.devices.sandbox import wine
from orchestrator.devices.sandbox.resource_limits import Limits
from orchestrator.face.api.fmu import info
from orchestrator.linear.models.blocks import Blocks
from orchestrator.linear.models.periodic import model_of
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.modes import eigenvalues
from tests.support.vendor_dlls import compiled, droop_device, lag
from tests.vendor_dll.test_device import device_master, swing

pytestmark = pytest.mark.slow

PLATFORMS = ("linux64", "win64")


@pytest.fixture(scope="module")
def under_wine():
    """Skips where there is no Wine."""
    if shutil.which("wine") is None:
        pytest.skip("wine is not installed")


def read(library):
    return read_dll(library, READER, foreign_platforms(library))


def opened(library, **more):
    """A running instance of a DLL's FMU."""
    component = open_component("vendor", read_description(library), **more)
    component.setup(0.0, None)
    component.enter_initialization_mode()
    component.exit_initialization_mode()
    return component


def answers(component, steps=200):
    """Output of a lag with an input that moves."""
    seen = []
    for k in range(steps):
        component.set({"u": float(k % 7) / 3})
        component.step(k * 1e-4, 1e-4)
        seen.append(component.values(["y"])["y"])
    return seen


def test_a_windows_dll_computes_to_the_last_bit_what_a_linux_one_does(under_wine, tmp_path):
    found = {}
    for platform in PLATFORMS:
        with opened(compiled(lag(), tmp_path, platform=platform)) as component:
            found[platform] = answers(component)
            assert all(p.in_force for p in component.protections) or platform == "win64"
            state = component.save_state()
            later = answers(component, 20)
            component.restore_state(state)
            assert answers(component, 20) == later
            again = component.deserialize_state(component.serialize_state(state))
            component.restore_state(again)
            assert answers(component, 20) == later
    assert found["linux64"] == found["win64"]
    assert len(set(found["win64"])) > 100


@pytest.mark.parametrize("hide", ["", "static double hidden; filtered = &hidden;"])
def test_modes_and_runs_of_a_device_differ_by_the_c_librarys_sine_alone(under_wine, tmp_path, hide):
    """Its cosine has another last bit on Windows; what the trial finds of a hidden state is the same."""
    modes, runs, kept = [], [], []
    for platform in PLATFORMS:
        folder = tmp_path / platform
        folder.mkdir()
        file = droop_device(folder, hide=hide, platform=platform)
        with device_master(file) as master:
            component = master.components["ibr"]
            runs.append([])
            for k in range(300):
                component.set({"v_re": 1.0 if k < 10 else 0.99})
                component.step(k * 1e-4, 1e-4)
                runs[-1].append(component.values(["p"])["p"])
        with device_master(file) as master:
            assert find_operating_point(master).residual < 1e-9
            modes.append(eigenvalues(model_of(master, Blocks(master))))
        library = next(found for found in folder.iterdir() if found.suffix != ".toml")
        kept.append(read(library).trial.state)
    assert kept == ["library" if hide else "arrays"] * 2
    assert len(modes[0]) == len(modes[1])
    assert abs(swing(modes[0]) - swing(modes[1])) < 1e-6
    assert np.abs(np.subtract(*runs)).max() < 1e-9
    assert np.ptp(runs[1]) > 1e-3


FAULTS = {
    "*(volatile int *)16 = 0;": ("crash of the Windows library", "memory that is not its own"),
    "exit(3);": ("under Wine has ended",),
    's->error = "it does not like 7"; if (s->time > 0) return 2;': ("it does not like 7",),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_dll_that_fails_under_wine_is_named(under_wine, tmp_path, fault):
    source = lag(
        do=f"if (s->time > 2.5e-4 && s->time < 3.5e-4) {{ {fault} }}",
        head="\n#include <stdlib.h>\n",
    )
    with opened(compiled(source, tmp_path, platform="win64")) as component:
        with pytest.raises(ComponentError) as error:
            answers(component)
        assert all(words in str(error.value) for words in FAULTS[fault])


def test_a_hang_under_wine_is_ended_with_all_its_processes(under_wine, tmp_path):
    source = lag(do="for (volatile int go = s->time > 2.5e-4; go;) {}")
    description = read_description(compiled(source, tmp_path, platform="win64"))
    with IsolatedComponent("vendor", description, limits=Limits(seconds=1.0)) as component:
        component.setup(0.0, None)
        component.enter_initialization_mode()
        component.exit_initialization_mode()
        group = component.process_group
        with pytest.raises(ComponentError, match="hang: no answer within 1 s"):
            answers(component)
    left = [line for line in Path("/proc").glob("[0-9]*/stat") if _in_group(line, group)]
    assert not left


def _in_group(stat, group):
    try:
        return stat.read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()[
            2
        ] == str(group)
    except OSError:  # it has ended since
        return False


def test_a_dll_that_crashes_while_it_is_loaded_is_refused(under_wine, tmp_path):
    head = "\n__attribute__((constructor)) static void begin(void) { *(volatile int *)16 = 0; }\n"
    with pytest.raises((InputError, DllError), match="Wine"):
        read(compiled(lag(head=head), tmp_path, platform="win64"))


def test_a_crash_under_wine_names_the_function_that_was_called(under_wine, tmp_path):
    source = lag().replace("{ return &INFO; }", "{ *(volatile int *)16 = 0; return &INFO; }")
    with pytest.raises(
        DllError, match=r"while Model_GetInfo runs, .* under Wine ends: crash .* memory that is not"
    ):
        read(compiled(source, tmp_path, platform="win64"))


ESCAPE = """
#include <stdio.h>
static int attempted(void) {
    FILE *f = fopen("WRITTEN", "w");
    int64_t found;
    int all = f ? 1 : 0;
    if (f) fclose(f);
    if ((f = fopen("SECRET", "r"))) all += 2, fclose(f);
    __asm__ volatile("syscall" : "=a"(found) : "a"(41), "D"(2), "S"(1), "d"(0) : "rcx", "r11", "memory");
    if (found >= 0) all += 4; /* a socket of the internet */
    if ((f = fopen("OWN", "w"))) all += 8, fclose(f);
    return all;
}
"""


def test_under_wine_a_dll_neither_reads_nor_writes_the_users_files_nor_opens_sockets(
    under_wine, tmp_path, monkeypatch
):
    """It asks Wine's server, which opens files in its place, and the kernel itself.

    NumPy's threads, which machines of several cores have, are not there before a process is closed off."""
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "4")
    secret, written = tmp_path / "secret", tmp_path / "written"
    secret.write_text("a key", encoding="ascii")
    head = (
        ESCAPE.replace("SECRET", f"Z:{secret}")
        .replace("WRITTEN", f"Z:{written}")
        .replace("OWN", "C:/windows/temp/x")
    )
    source = lag(head=head, begin="((double *)s->out)[0] = s->doubles[0] = 100 + attempted();")
    library = compiled(source, tmp_path, platform="win64")
    with opened(library) as component:
        assert component.values(["y"])["y"] == 108
    assert not written.exists()
    # the same attempts succeed where nothing is closed off
    trusted = opened(library, isolated=False)
    with trusted:
        assert trusted.values(["y"])["y"] == 115
    assert written.exists()


def test_without_wine_a_windows_dll_is_refused_with_the_remedy(tmp_path, monkeypatch):
    def missing():
        raise wine.NoWineError(wine.MISSING)

    library = tmp_path / "vendor.dll"
    library.write_bytes(
        b"MZ" + bytes(58) + (64).to_bytes(4, "little") + b"PE\0\0\x64\x86" + bytes(64)
    )
    monkeypatch.setattr(wine, "find_wine", missing)
    with pytest.raises(
        InputError, match=r"vendor\.dll: .*install it .*or ask its author for a build for Linux"
    ):
        info(library)


@pytest.mark.parametrize(
    ("machine", "words"),
    [
        (b"\x4c\x01", "a Windows DLL of 32 bits"),
        (b"\xc4\x01", "a Windows DLL of 32 bits for ARM"),
        (b"\x64\xaa", "a Windows DLL for ARM64"),
    ],
)
def test_a_windows_dll_for_another_machine_is_refused_by_name(tmp_path, machine, words):
    library = tmp_path / "vendor.dll"
    library.write_bytes(b"MZ" + bytes(58) + (64).to_bytes(4, "little") + b"PE\0\0" + machine)
    with pytest.raises(DllError, match=f"it is {words}, and those for 64-bit x86 can be run"):
        read_dll(library, also=("win64",))
