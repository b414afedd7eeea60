"""``gfor completion``: what the Tab key gives in bash and fish."""

import os
import shutil
import subprocess
import sysconfig
from contextlib import redirect_stdout

import pytest

from orchestrator.face.cli import COMMANDS, main
from orchestrator.face.cli.completion import SHELLS

ANSWER = """
source completions
COMP_WORDS=({words})
COMP_CWORD={last}
COMP_LINE="{words}"
COMP_POINT=${{#COMP_LINE}}
function=$(complete -p gfor | sed 's/.* -F \\([^ ]*\\).*/\\1/')
$function "${{COMP_WORDS[0]}}" "${{COMP_WORDS[COMP_CWORD]}}" "${{COMP_WORDS[COMP_CWORD-1]}}" 2> /dev/null
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("completion")
    with (folder / "completions").open("w", encoding="utf-8") as file, redirect_stdout(file):
        assert main(["completion", "bash"]) == 0
    (folder / "own_case.toml").write_text(
        "[components.grid]\n[scenarios.windy]\n[scenarios.windy.set]\n[scenarios.calm]\n", "utf-8"
    )
    return folder


def complete(folder, words):
    """Return what bash offers for the last word, which is begun."""
    script = ANSWER.format(words=words, last=len(words.split()) - 1)
    done = subprocess.run(
        ["bash", "-c", script], cwd=folder, capture_output=True, text=True, check=True
    )
    return {word.strip() for word in done.stdout.split()}


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")
@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("gfor mod", {"modes"}),
        ("gfor fmu che", {"check"}),
        ("gfor modes --scen", {"--scenario"}),
        ("gfor fmu check --bind", {"--binding"}),
        ("gfor modes ieee11", {"ieee118"}),
        ("gfor modes own", {"own_case.toml"}),
        ("gfor modes two_area --schedule mid", {"midpoint"}),
        ("gfor completion fi", {"fish"}),
        ("gfor modes two_area --scenario pod_", {"pod_p", "pod_q", "pod_pq"}),
        ("gfor modes own_case.toml --scenario ''", {"windy", "calm"}),
        ("gfor modes missing.toml --scenario ''", set()),
        ("gfor certify gfor.fmu --code nts", {"nts631"}),
        ("gfor run two_area --protection ''", {"prc029"}),
        ("gfor run two_area --stop ''", set()),
        ("gfor modes missing.toml --set ''", set()),
        ("gfor fmu check --binding own", {"own_case.toml"}),
    ],
)
def test_bash_offers(folder, words, offered):
    assert complete(folder, words) == offered


@pytest.mark.parametrize(
    ("begun", "offered"),
    [
        ("", {"gfor.", "grid."}),
        ("gf", {"gfor."}),
        ("gfor.pod_p.K", {"gfor.pod_p.K="}),
        ("gfor.droop.R", {"gfor.droop.R_f=", "gfor.droop.R_V="}),
        ("sg7.", set()),
    ],
)
def test_values_of_a_case_are_offered_by_component_and_then_by_name(gfor, begun, offered):
    _, out, _ = gfor("completion", "--values-of", "infinite_bus", "--begun", begun)
    assert set(out.split()) == offered


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")
def test_bash_asks_the_command_for_values_of_the_case_on_the_line(folder):
    """A stand-in for the command says what it was asked."""
    asked = folder / "gfor"
    asked.write_text('#!/bin/sh\necho "asked_$5_of_$3="\n', encoding="utf-8")
    asked.chmod(0o755)
    offered = complete(folder, "./gfor sweep two_area --vary gfor.po")
    assert offered == {"asked_gfor.po_of_two_area="}


@pytest.mark.skipif(shutil.which("fish") is None, reason="there is no fish")
@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("gfor mod", {"modes"}),
        ("gfor fmu check --bind", {"--binding"}),
        ("gfor modes ieee11", {"ieee118"}),
        ("gfor modes own_case.toml --scenario ", {"windy", "calm"}),
        ("gfor run two_area --stop ", set()),
    ],
)
def test_fish_offers(folder, gfor, words, offered):
    place = folder / "config" / "fish" / "completions"
    place.mkdir(parents=True, exist_ok=True)
    (place / "gfor.fish").write_text(gfor("completion", "fish")[1], encoding="utf-8")
    done = subprocess.run(
        ["fish", "-c", f"complete -C '{words}'"],
        cwd=folder,
        env={
            "PATH": f"{sysconfig.get_path('scripts')}:{os.environ['PATH']}",
            "HOME": str(folder),
            "XDG_CONFIG_HOME": str(folder / "config"),
        },
        capture_output=True,
        text=True,
        check=True,
    )
    assert {line.partition("\t")[0] for line in done.stdout.splitlines()} == offered


def test_the_help_says_how_each_shell_loads_it(gfor):
    text = gfor("completion", "--help")[1]
    for place in (
        "source <(gfor completion bash)",
        "gfor completion zsh > ~/.zfunc/_gfor",
        "gfor completion fish > ~/.config/fish/completions/gfor.fish",
    ):
        assert place in text


@pytest.mark.parametrize("shell", SHELLS)
def test_every_command_stands_in_each_shell(gfor, shell):
    code, out, _ = gfor("completion", shell)
    assert code == 0
    assert {word for name in COMMANDS for word in name.split() if word not in out} == set()
