"""Every block of code in README, pages and leaflets: commands parse, files read, Python runs."""

import json
import re
import shlex
import subprocess
import tomllib
from importlib.util import find_spec

import pytest

from orchestrator.face import cli
from tests.pages.markdown import ROOT, blocks, commands, name_of, pages

PAGES = [page for page in pages() if blocks(page)]
OTHERS = {
    "cd",
    "echo",
    "git",
    "grep",
    "mkdir",
    "mkdocs",
    "mv",
    "mypy",
    "pip",
    "pytest",
    "ruff",
    "source",
    "ssh-keygen",
    "tail",
    "test",
}
"""Commands that pages use beside ``gfor`` and ``python``."""
ADDED = {"least-damped", "example", "harbour"}
"""Commands and codes of ``gfor`` that guides add."""

FMUS = (
    "gfor",
    "two_area_grid",
    "synchronous_generator_st1",
    "gfl",
    "gfl_l2ep",
    "regfm_a1_phasor",
    "regfm_b1_phasor",
    "regfm_c1_phasor",
    "infinite_bus",
    "external_grid",
    "static_generation",
    "csvgn1_phasor",
    "lcc_rectifier_phasor",
    "induction_motor_phasor",
    "dera1_phasor",
    "regca1_phasor",
)
"""FMUs that the Python blocks of the leaflets open."""


def of_language(page, *languages):
    return [block for block in blocks(page) if block.language in languages]


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_shell_blocks_parse(page, capsys):
    for block in of_language(page, "sh", "bash"):
        subprocess.run(["bash", "-n"], input=block.text, text=True, check=True)
        for command in commands(block):
            words = shlex.split(command)
            words[0] = words[0].removeprefix(".venv/bin/")
            while "=" in words[0]:
                words.pop(0)  # a variable of the environment
            if words[0] == "gfor":
                parses(words[1:], block.place, capsys)
            elif words[0] in ("python", "python3") and words[1].endswith(".py"):
                assert any(one.path == words[1] for one in blocks(page)), (
                    f"{block.place}: {command}"
                )
            elif words[0] in ("python", "python3"):
                assert words[1] == "-m", f"{block.place}: {command}"
                assert find_spec(words[2]), f"{block.place}: there is no module {words[2]}"
            else:
                assert words[0] in OTHERS, f"{block.place}: {command}"


def parses(words, place, capsys):
    """Read a command line of ``gfor`` with the real parser, and run nothing."""
    if ADDED.intersection(words):
        return
    try:
        cli._parser({cli._command_in(words)}).parse_args(words)
    except SystemExit as stop:  # argparse's way out
        if stop.code:
            pytest.fail(f"{place}: gfor {shlex.join(words)}: {capsys.readouterr().err}")


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_files_in_blocks_read(page):
    for block in of_language(page, "toml"):
        tomllib.loads(block.text)
    for block in of_language(page, "json"):
        json.loads(block.text)
    for block in of_language(page, "python"):
        if block.kind not in ("after", "replace"):  # a line of something larger
            compile(block.text, block.place, "exec")


def runs(block):
    """Whether it is run here; notebooks are executed by `test_notebooks.py`."""
    return block.language == "python" and not block.kind and block.page.suffix == ".md"


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("page", [p for p in PAGES if any(map(runs, blocks(p)))], ids=name_of)
def test_python_blocks_run(page, tmp_path, monkeypatch, fmu_path):
    """In order, in one namespace, in a folder with the FMUs that the leaflets are about."""
    import matplotlib  # noqa: PLC0415

    matplotlib.use("Agg")
    for model in FMUS:
        (tmp_path / f"{model}.fmu").symlink_to(fmu_path(model))
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "page"}
    for block in filter(runs, blocks(page)):
        exec(compile(block.text, block.place, "exec"), names)


def test_what_is_not_run_says_why():
    for page in PAGES:
        for block in blocks(page):
            if block.kind == "not run":
                assert len(block.text_of_line.split()) > 2, block.place


def test_the_readme_lists_every_command():
    """In the order of ``gfor --help``; a group has one row with its commands."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1:3] for line in text.splitlines() if line.startswith("| `gfor ")]
    listed = []
    for head, words in rows:
        name = head.strip().strip("`").split()[1]
        inner = re.findall(r"`(\w+)`:", words)
        listed += [f"{name} {one}" for one in inner] if name in cli.GROUPS else [name]
    assert listed == list(cli.COMMANDS)


def test_the_readme_is_read_at_once():
    """In five minutes: what else there is to say has a page."""
    words = (ROOT / "README.md").read_text(encoding="utf-8").split()
    assert 700 <= len([word for word in words if any(map(str.isalnum, word))]) <= 1200


@pytest.mark.parametrize("page", [p for p in PAGES if any(b.path for b in blocks(p))], ids=name_of)
def test_lines_that_guides_name_exist(page):
    """Quickly, where `test_guides.py` takes minutes."""
    for block in blocks(page):
        if block.kind in ("after", "replace"):
            text = (ROOT / block.path).read_text(encoding="utf-8")
            assert block.text_of_line in text, (
                f"{block.place}: {block.path} has no line with {block.text_of_line!r}"
            )
        elif block.kind == "append":
            assert (ROOT / block.path).is_file(), f"{block.place}: there is no {block.path}"
