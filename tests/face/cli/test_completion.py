"""``gfor completion``: what the Tab key gives in bash."""

import shutil
import subprocess
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
$function gfor "${{COMP_WORDS[COMP_CWORD]}}" "${{COMP_WORDS[COMP_CWORD-1]}}" 2> /dev/null
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
        ("gfor modes own_case.toml --set ''", set()),
        ("gfor fmu check --binding own", {"own_case.toml"}),
    ],
)
def test_bash_offers(folder, words, offered):
    assert complete(folder, words) == offered


@pytest.mark.parametrize("shell", SHELLS)
def test_every_command_stands_in_each_shell(gfor, shell):
    code, out, _ = gfor("completion", shell)
    assert code == 0
    assert {word for name in COMMANDS for word in name.split() if word not in out} == set()
