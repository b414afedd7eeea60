"""``gfor completion``: the text that a shell needs to complete commands, options, cases and files."""

import argparse

from orchestrator.cases.case import built_in_cases

SHELLS = ("bash", "zsh", "fish")

_IN_BASH = """\
_gfor_cases() {{
  compgen -W "{cases}" -- "$1"
  compgen -f -- "$1"
}}
"""

_IN_ZSH = """\
_gfor_cases() {{
  compadd {cases}
  _files
}}
"""

_IN_FISH = "(string split ' ' -- '{cases}'; __fish_complete_path (commandline -ct))"
"""fish has no function of ours: it runs these words for each completion."""

_FOLDERS = ("DIR", "FOLDER")
"""Metavariables of the arguments that take a folder."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=SHELLS, help="the shell that reads the result")


def run(options: argparse.Namespace) -> int:
    """Print the completions; cases are those that are built in today, beside files."""
    import shtab  # noqa: PLC0415 - no other command needs it

    from orchestrator.face.cli import whole_parser  # noqa: PLC0415 - it imports every command

    parser = whole_parser()
    cases = " ".join(built_in_cases())
    of_cases = {"bash": "_gfor_cases", "zsh": "_gfor_cases", "fish": _IN_FISH.format(cases=cases)}
    for action in _actions_of(parser):
        if action.choices is not None or action.nargs == 0:
            continue
        if action.metavar == "CASE":
            action.complete = of_cases  # type: ignore[attr-defined]  # shtab's own attribute
        elif action.metavar in _FOLDERS:
            action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]
        else:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
    preamble = {"bash": _IN_BASH, "zsh": _IN_ZSH}.get(options.shell, "").format(cases=cases)
    print(shtab.complete(parser, options.shell, root_prefix="_gfor", preamble=preamble))
    return 0


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
