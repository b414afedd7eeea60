"""Guides, executed as they are written: files are made and changed, commands run."""

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from tests.pages.markdown import ROOT, blocks
from tests.support import warm_client
from tests.support.warm import running

DOCS = ROOT / ".docs"
IN_A_CHECKOUT = (
    "how-to/add-an-exciter",
    "how-to/add-a-record",
    "how-to/add-an-acceptance-check",
    "how-to/add-a-study",
    "how-to/add-a-code",
)
HEAVY = (
    "how-to/use-your-own-fmu",
    "how-to/black-box",
    "how-to/write-a-controller-dll",
    "how-to/several-vendors",
    "how-to/scan-and-fmu",
    "how-to/grid-forming-among-grid-following",
    "how-to/faults-and-outages",
)
"""Executed by night."""

ANYWHERE = (
    "first-steps",
    "how-to/own-network",
    "how-to/audit-a-study",
    "how-to/sign-a-certificate",
    "how-to/ship-plug-ins",
    *(pytest.param(guide, marks=pytest.mark.nightly) for guide in HEAVY),
)
WARM = (
    "first-steps",
    "how-to/own-network",
    "how-to/audit-a-study",
    "how-to/sign-a-certificate",
    "how-to/ship-plug-ins",
)
"""Their commands are done by processes whose imports are behind them, as on a machine with one core, without pictures:
of each, imports are most of its time, and a study's workers import all of it again. The other guides, and
``gfor --help``, start ``gfor`` itself."""

SECONDS = 1800.0


@pytest.fixture(scope="module")
def warm():
    with running() as found:
        found.use_one_core()
        yield found


@pytest.fixture
def environment(tmp_path):
    """Make a virtual environment over this one, in which a guide may install; returns its variables."""
    home = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(home)], check=True)
    folder = home / ("Scripts" if os.name == "nt" else "bin")
    (packages,) = home.rglob("site-packages")
    (packages / "beneath.pth").write_text(f"{sysconfig.get_path('purelib')}\n", encoding="utf-8")
    for command, module in {
        "gfor": "orchestrator.face.cli",
        "pip": "pip",
        "pytest": "pytest",
        "mypy": "mypy",
    }.items():
        script = folder / command
        script.write_text(f'#!/bin/sh\nexec {folder}/python -m {module} "$@"\n', encoding="utf-8")
        script.chmod(0o755)
    path = os.pathsep.join([str(folder), str(Path(sys.executable).parent), os.environ["PATH"]])
    pip = {"PIP_DISABLE_PIP_VERSION_CHECK": "1", "PIP_NO_WARN_CONFLICTS": "no"}  # so pip spells yes
    return os.environ | pip | {"PATH": path, "MPLBACKEND": "Agg", "PYTEST_ADDOPTS": "", "CI": ""}


def follow(page, folder, environment):
    """Do what a guide says, block by block."""
    for block in blocks(page):
        if block.kind == "not run":
            continue
        if block.path:
            change(block, folder / block.path)
        elif block.language == "sh":
            done = subprocess.run(
                ["bash", "-euo", "pipefail", "-c", block.text],
                cwd=folder,
                env=environment,
                capture_output=True,
                text=True,
                check=False,
                timeout=SECONDS,
            )
            assert done.returncode == 0, (
                f"{block.place}\n{done.stdout[-4000:]}{done.stderr[-4000:]}"
            )


def change(block, path):
    """Write, append to, or edit a file."""
    if block.kind == "file":
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(block.text, encoding="utf-8")
        return
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    if block.kind == "append":
        lines.append(block.text)
    else:
        at = next((k for k, line in enumerate(lines) if block.text_of_line in line), None)
        assert at is not None, f"{block.place}: {path.name} has no line with {block.text_of_line!r}"
        lines[at] = block.text if block.kind == "replace" else lines[at] + block.text
    path.write_text("".join(lines), encoding="utf-8")


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.parametrize("guide", IN_A_CHECKOUT)
def test_a_guide_for_contributors_works_as_written(guide, tmp_path, environment):
    checkout = tmp_path / "checkout"
    listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in filter(None, names.split("\0")):
        if (ROOT / name).exists():
            (checkout / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, checkout / name)
    follow(DOCS / f"{guide}.md", checkout, environment | {"PYTHONPATH": str(checkout)})


@pytest.mark.slow
@pytest.mark.parametrize("guide", ANYWHERE)
def test_a_guide_for_users_works_as_written(guide, tmp_path, environment, request):
    folder = tmp_path / "work"
    folder.mkdir()
    imported = [str(ROOT)]
    if guide in WARM:
        script = tmp_path / "venv" / "bin" / "gfor"
        fresh = script.read_text(encoding="utf-8").removeprefix("#!/bin/sh\n")
        address = request.getfixturevalue("warm").address
        copy = f'{sys.executable} -I {warm_client.__file__} {address} "$@"'
        script.write_text(f'#!/bin/sh\n[ "$1" = --help ] || exec {copy}\n{fresh}', encoding="utf-8")
        imported += map(str, (tmp_path / "venv").rglob("site-packages"))
    paths = os.pathsep.join(imported)
    follow(DOCS / f"{guide}.md", folder, environment | {"PYTHONPATH": paths})
