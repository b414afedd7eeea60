"""``gfor completion``: the text that a shell needs to complete commands, options, cases, scenarios, names of values,
codes and files."""

import argparse
import tomllib
from pathlib import Path

from orchestrator.cases.case import BUILT_IN, built_in_cases, load_case
from orchestrator.core.errors import InputError
from orchestrator.systems.coupling.no_trip_regions import NO_TRIP_REGIONS, read_no_trip_code

SHELLS = ("bash", "zsh", "fish")

_IN_FILE = r"""sed -n 's/^\[scenarios\.\([A-Za-z0-9_-]*\).*/\1/p' "$1" 2>/dev/null | sort -u"""
"""Prints the scenarios that a case file has."""

_IN_POSIX = """\
_gfor_scenarios_of() {{
  case "$1" in
{lines}
    *.toml) {in_file} ;;
  esac
}}
"""

_IN_BASH = """\
_gfor_cases() {{
  compgen -W "{cases}" -- "$1"
  compgen -f -- "$1"
}}
_gfor_scenarios() {{
  local word
  for word in "${{COMP_WORDS[@]}}"; do
    compgen -W "$(_gfor_scenarios_of "$word")" -- "$1"
  done
}}
_gfor_values() {{
  local word
  for word in "${{COMP_WORDS[@]}}"; do
    case "$word" in
      {patterns}) "${{COMP_WORDS[0]}}" completion --values-of "$word" --begun "$1" 2>/dev/null; return ;;
    esac
  done
}}
"""

_AT_THE_END_IN_BASH = """
_gfor_complete() {
  _shtab__gfor "$@"
  case "${COMPREPLY[0]}" in
    *=|*.) compopt -o nospace ;;
  esac
}
complete -o bashdefault -F _gfor_complete gfor
"""
"""Lets the cursor stay behind a name whose value is to come."""

_IN_ZSH = """\
_gfor_cases() {{
  compadd {cases}
  _files
}}
_gfor_scenarios() {{
  local word
  for word in $words; do
    compadd -- $(_gfor_scenarios_of "$word")
  done
}}
_gfor_values() {{
  local word
  for word in $words; do
    case "$word" in
      {patterns}) compadd -S '' -- $(gfor completion --values-of "$word" --begun "$PREFIX" 2>/dev/null); return ;;
    esac
  done
}}
"""

_IN_FISH = """\
function _gfor_scenarios
  for word in (commandline -opc)
    switch $word
{lines}
      case '*.toml'
        {in_file}
    end
  end
end
function _gfor_values
  set -l tokens (commandline -opc)
  for word in $tokens
    switch $word
      case {patterns}
        $tokens[1] completion --values-of $word --begun (commandline -ct) 2>/dev/null
        return
    end
  end
end
"""

_CASES_IN_FISH = "(string split ' ' -- '{cases}'; __fish_complete_path (commandline -ct))"
"""fish runs these words for each completion."""

_LOADED = """\
in bash, for this shell alone:
  source <(gfor completion bash)
in bash, for every new one (with the package bash-completion):
  mkdir -p ~/.local/share/bash-completion/completions
  gfor completion bash > ~/.local/share/bash-completion/completions/gfor
in zsh:
  mkdir -p ~/.zfunc
  gfor completion zsh > ~/.zfunc/_gfor
  and in ~/.zshrc: fpath=(~/.zfunc $fpath); autoload -Uz compinit && compinit
in fish:
  mkdir -p ~/.config/fish/completions
  gfor completion fish > ~/.config/fish/completions/gfor.fish

After an update of gfor-cosim, write the file again.
"""
"""How each shell takes what is printed."""

_FOLDERS = ("DIR", "FOLDER")
"""Metavariables of the arguments that take a folder."""

_FILES = ("FILE.fmu", "DEVICE", "NETWORK", "vendor.toml", "[NAME=]FILE")
"""Metavariables of the arguments that take a file or something else, so that they are not read as a path."""


_VALUE = "COMPONENT.PARAMETER="
"""How the metavariables of arguments begin that take a value by its name."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", nargs="?", choices=SHELLS, help="the shell that reads the result")
    # what the shells ask while a line is typed
    parser.add_argument("--values-of", metavar="CASE", help=argparse.SUPPRESS)
    parser.add_argument("--begun", metavar="TEXT", default="", help=argparse.SUPPRESS)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = _LOADED


def run(options: argparse.Namespace) -> int:
    """Print the completions; cases are those that are built in today, beside files."""
    if options.values_of is not None:
        print("\n".join(_values_of(options.values_of, options.begun)))
        return 0
    if options.shell is None:
        raise InputError(f"name the shell that reads the result: {', '.join(SHELLS)}")
    import shtab  # noqa: PLC0415 - no other command needs it

    from orchestrator.face.cli import whole_parser  # noqa: PLC0415 - it imports every command
    from orchestrator.face.cli.certificate import ALL, CODES, read_code  # noqa: PLC0415 - as above

    parser = whole_parser()
    cases = " ".join(built_in_cases())
    words = {read_code: (*CODES, ALL), read_no_trip_code: (*NO_TRIP_REGIONS,)}
    of_cases = _in_shells("_gfor_cases", _CASES_IN_FISH.format(cases=cases))
    of_scenarios = _in_shells("_gfor_scenarios", "(_gfor_scenarios)")
    of_values = _in_shells("_gfor_values", "(_gfor_values)")
    for action in _actions_of(parser):
        if action.choices is not None or action.nargs == 0:
            continue
        if action.type in words:
            action.choices = words[action.type]
        elif action.metavar == "CASE":
            action.complete = of_cases  # type: ignore[attr-defined]  # shtab's own attribute
        elif "--scenario" in action.option_strings:
            action.complete = of_scenarios  # type: ignore[attr-defined]
        elif str(action.metavar).startswith(_VALUE):
            action.complete = of_values  # type: ignore[attr-defined]
        elif action.metavar in _FOLDERS:
            action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]
        elif action.type is Path or action.metavar in _FILES:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
    preamble = _preamble(options.shell, cases)
    print(shtab.complete(parser, options.shell, root_prefix="_gfor", preamble=preamble))
    if options.shell == "bash":
        print(_AT_THE_END_IN_BASH)
    return 0


def _in_shells(function: str, in_fish: str) -> dict[str, str]:
    return {"bash": function, "zsh": function, "fish": in_fish}


def _preamble(shell: str, cases: str) -> str:
    """Return the functions that offer cases, and the scenarios of the case that the line names."""
    names = {case: " ".join(_scenarios_of(case)) for case in built_in_cases()}
    if shell == "fish":
        lines = "\n".join(
            f"      case {case}\n        string split ' ' -- '{found}'"
            for case, found in names.items()
        )
        patterns = " ".join([*names, "'*.toml'"])
        in_file = _IN_FILE.replace("$1", "$word")
        return _IN_FISH.format(lines=lines, in_file=in_file, patterns=patterns)
    lines = "\n".join(f'    {case}) echo "{found}" ;;' for case, found in names.items())
    own = {"bash": _IN_BASH, "zsh": _IN_ZSH}[shell].format(
        cases=cases, patterns="|".join([*names, "*.toml"])
    )
    return _IN_POSIX.format(lines=lines, in_file=_IN_FILE) + own


def _values_of(case: str, begun: str) -> list[str]:
    """Return the names that ``--set`` takes of a case and that begin so; those of components alone before the dot."""
    file = load_case(case)
    scenarios = file.table.scenarios
    fullest = min(scenarios, key=lambda name: len(scenarios[name].remove))
    (prepared,) = file.prepare([fullest])
    plans = prepared.system.components
    if "." not in begun:
        return [f"{name}." for name in plans if name.startswith(begun)]
    component = begun.partition(".")[0]
    if component not in plans:
        return []
    variables = plans[component].description.variables.items()
    names = (f"{component}.{name}=" for name, one in variables if one.causality == "parameter")
    return [name for name in names if name.startswith(begun)]


def _scenarios_of(case: str) -> list[str]:
    """Return the scenarios of a built-in case, without reading its network."""
    table = tomllib.loads((BUILT_IN / case / "case.toml").read_text(encoding="utf-8"))
    return [*table.get("scenarios", ())]


def _actions_of(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """Return the arguments of a parser and of the commands in it."""
    actions = []
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                actions += _actions_of(command)
        else:
            actions.append(action)
    return actions
