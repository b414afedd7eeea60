"""What a command imports before it answers; a process of its own, as the command is typed."""

import subprocess
import sys

import pytest

_COURSE = (
    "time,v [pu]\n"
    + "\n".join(f"{k / 100},{1 + 0.1 * 0.98**k * (-1) ** (k // 25)}" for k in range(600))
    + "\n"
)
_IMPORTED = (
    "import sys; from orchestrator.face.cli import main; main(sys.argv[1:]); "
    "print(sorted({name.partition('.')[0] for name, module in sys.modules.items() if module is not None}))"
)


@pytest.mark.parametrize(
    "command", ["compare a.csv a.csv --signal v", "identify a.csv v --start 0"]
)
def test_recordings_are_read_without_what_they_do_not_need(tmp_path, command):
    """dask and pint come with xarray's first array where they are installed, pydantic with a case."""
    (tmp_path / "a.csv").write_text(_COURSE, encoding="utf-8")
    found = subprocess.run(
        [sys.executable, "-c", _IMPORTED, *command.split()],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    imported = found.stdout.splitlines()[-1]
    assert "'xarray'" in imported
    assert not [name for name in ("dask", "pint", "pydantic") if f"'{name}'" in imported]


def test_a_case_is_loaded_without_what_computes():
    """Else `load` takes a second."""
    code = (
        "import sys, orchestrator; orchestrator.load('two_area_rms').scenarios; "
        "print({'numpy', 'scipy', 'pandas', 'fmpy', 'rich', 'casadi'} & {*sys.modules})"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout == "set()\n"


@pytest.mark.parametrize(
    "module", ["orchestrator", "orchestrator.devices.sandbox.dll_process_worker"]
)
def test_no_process_of_a_device_imports_what_reads_e_mail(module):
    """`importlib.abc` and `importlib.metadata` do, in 15 ms; one check of a DLL starts 26 processes."""
    code = (
        f"import sys; before = {{*sys.modules}}; import {module}; "
        "print({'email', 'importlib.abc', 'importlib.metadata'} & {*sys.modules} - before)"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout == "set()\n"


@pytest.mark.parametrize(("given", "set_aside"), [("", True), ("sys.argv[1:]", False)])
def test_what_a_command_imports_is_not_searched_for_circles_again(given, set_aside):
    """Unless it was called from Python, whose own circles would never be freed."""
    code = (
        "import gc, sys; from contextlib import suppress; from orchestrator.face.cli import main\n"
        f"with suppress(SystemExit): main({given})\n"
        "print(gc.isenabled(), gc.get_freeze_count() > 10_000)"
    )
    found = subprocess.run(
        [sys.executable, "-c", code, "identify", "--help"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert found.stdout.splitlines()[-1] == f"True {set_aside}"
