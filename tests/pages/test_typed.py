"""Commands of pages and of ``gfor --help``, run as they are typed: each in a fresh process, in the order of its page.

Guides that `test_guides.py` follows, and notebooks, are executed there. What needs others' data, another machine or
tool, or many minutes is named in ``typed.toml`` with its reason, or has there a shorter form of the same command.
`.ci/package` runs them with the wheel's ``gfor``, whose folder GFOR_SCRIPTS names.
"""

import os
import shlex
import subprocess
import sysconfig
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest

from orchestrator.face.cli import COMMANDS, QUESTIONS, _command_in
from tests.pages.markdown import blocks, commands, name_of, pages
from tests.pages.test_guides import ANYWHERE, HEAVY, IN_A_CHECKOUT

FOLLOWED = {f".docs/{guide}.md" for guide in (*ANYWHERE, *HEAVY, *IN_A_CHECKOUT)}
TABLE = tomllib.loads(Path(__file__).with_name("typed.toml").read_text(encoding="utf-8"))
NOT_TYPED: dict[str, str] = TABLE["not_typed"]
SHORTER: dict[str, str] = TABLE["shorter"]
BEFORE: dict[str, list[str]] = TABLE["before"]
SECONDS = 900.0
HELP = "gfor --help"


@dataclass(frozen=True)
class Page:
    """A place where commands stand, in their order."""

    name: str
    typed: tuple[str, ...]
    files: tuple[tuple[str, str], ...] = ()


def every_page() -> list[Page]:
    """All that have commands of ``gfor``, and the examples of its help."""
    found = []
    for page in pages():
        if name_of(page) in FOLLOWED or page.suffix != ".md":
            continue
        lines = [
            c.removeprefix(".venv/bin/")
            for b in blocks(page)
            if b.language in ("sh", "bash") and b.kind == ""
            for c in commands(b)
        ]
        if typed := tuple(line for line in lines if line.startswith("gfor ")):
            files = tuple((b.path, b.text) for b in blocks(page) if b.kind == "file")
            found.append(Page(name_of(page), typed, files))
    return [*found, Page(HELP, tuple(examples()))]


def examples() -> list[str]:
    """The help's examples without their words."""
    return [
        line.strip().partition("  ")[0].strip()
        for line in QUESTIONS.splitlines()
        if line.startswith("  gfor ")
    ]


PAGES = every_page()


@pytest.mark.wheel
@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_each_command_of_a_page_works_as_it_is_typed(page, tmp_path):
    scripts = os.environ.get("GFOR_SCRIPTS") or sysconfig.get_path("scripts")
    path = os.pathsep.join([scripts, os.environ["PATH"]])
    environment = {
        k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTEST_CURRENT_TEST")
    }
    environment |= {"PATH": path, "MPLBACKEND": "Agg", "OPENBLAS_NUM_THREADS": "1"}
    for name, text in page.files:
        (tmp_path / name).write_text(text, encoding="utf-8")
    for line in [
        *BEFORE.get(page.name, []),
        *(SHORTER.get(c, c) for c in page.typed if c not in NOT_TYPED),
    ]:
        done = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", line],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
            timeout=SECONDS,
        )
        said = f"{done.stdout[-2000:]}{done.stderr[-3000:]}"
        assert done.returncode in (0, 3), (
            f"{page.name}: {line}: exit code {done.returncode}\n{said}"
        )
        assert "Traceback" not in done.stderr, f"{page.name}: {line}\n{done.stderr[-3000:]}"


def test_the_table_names_commands_that_stand_somewhere():
    typed = {line for page in PAGES for line in page.typed}
    assert {*NOT_TYPED, *SHORTER} <= typed
    assert not {*NOT_TYPED} & {*SHORTER}
    assert {*BEFORE} <= {page.name for page in PAGES}
    assert all(len(reason.split()) > 2 for reason in NOT_TYPED.values())


def test_a_shorter_form_is_the_same_command():
    for long, short in SHORTER.items():
        asked, run = shlex.split(long), shlex.split(short)
        assert asked[:3] == run[:3], long
        given = {word.split("=")[0] for word in asked if word.startswith("--")}
        assert given <= {word.split("=")[0] for word in run}, long


def test_examples_are_read():
    assert len(examples()) == QUESTIONS.count("\n  gfor ")
    assert 'gfor signal identify results/two_area/gfor "sg1.omega - sg2.omega"' in examples()
    assert all(_command_in(shlex.split(line)[1:]) in COMMANDS for line in examples())
