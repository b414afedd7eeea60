"""The command ``gfor``. Each subcommand is a module of this package, imported only where it is called."""

import argparse
import codecs
import difflib
import shlex
import sys
from collections.abc import Collection, Mapping, Sequence
from importlib import import_module
from io import TextIOWrapper
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

from fmus.toolchain.extras import SetupError
from orchestrator.core.errors import INTERRUPTED, TERMINATED, CosimError, InputError
from orchestrator.core.interrupts import calls
from orchestrator.core.late import import_xarray_alone, put_off_parts_of_numpy
from orchestrator.core.safe_files import inputs, spare_input
from orchestrator.core.spelling import as_options
from orchestrator.core.uncollected import stay_uncollected, uncollected
from orchestrator.face.cli.at_work import saying_that_it_is_at_work
from orchestrator.face.cli.interrupted import ending, is_interrupt
from orchestrator.face.cli.later import answer_first
from orchestrator.output.results import origin

_ESCAPE = "gfor_escape"

_LISTED = Path(__file__).with_name("commands.txt").read_text(encoding="utf-8").splitlines()
COMMANDS = {name: words for name, _, words in (line.partition(": ") for line in _LISTED)}
"""Commands, with what they are for; those of a group follow its name."""

GROUPS = {
    "fmu": "An FMU, DLL or device by itself",
    "signal": "What a run or a recording says",
    "export": "Models and signals for other tools",
    "master": "Other masters, and runs with them",
}

OLD = {
    **{name.partition(" ")[2]: name for name in COMMANDS if name.startswith(("fmu ", "signal "))},
    **{f"export-{kind}": f"export {kind}" for kind in ("ssp", "comtrade", "dll")},
    "linearize": "export linear",
    "which-master": "master which",
    "federate": "master federate",
    "black-box": "modes --black-box",
}
"""Spellings before 0.3, which work until 1.0, with today's."""

# a command in a group has the module of its old name
_MODULES = {new: old for old, new in OLD.items()}

_READERS = (
    "certify",
    "report",
    "signal compare",
    "signal identify",
    "signal source",
    "sweep",
    "validate",
    "verify",
)
"""Commands that read or write recordings and tables, with xarray, and hand no array of theirs to dask or pint."""

# the page that ``gfor`` alone prints
QUESTIONS = Path(__file__).with_name("questions.txt").read_text(encoding="utf-8")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns 0, 1 for a failure during a run, 2 for input that cannot be used."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    _print_anything()
    put_off_parts_of_numpy()
    alone = arguments is None
    with calls.terminable(ending=alone), as_options():
        code = _run(words, alone=alone)
    return TERMINATED if calls.terminated and code == INTERRUPTED else code


def _run(words: Sequence[str], *, alone: bool) -> int:
    """Run; where it returns, no signal changes the exit code any more. ``alone`` as in `_execute`."""
    try:
        code = _execute(words, alone=alone)
        if calls.taken and code != INTERRUPTED:
            raise KeyboardInterrupt  # somebody swallowed it on its way
        calls.over = True
    except BaseException as error:
        if not is_interrupt(error):
            raise
        calls.over = True
        print(ending(error), file=sys.stderr)
        # clears CPython's note of an interrupt inside exec(), as of dataclasses; it would end us by
        # SIGINT
        exec("")
        code = INTERRUPTED
    return code


def _execute(words: Sequence[str], *, alone: bool) -> int:
    """Parse and compute; ``alone``: whether the process has nothing else to do."""
    files: dict[str, Path] = {}

    def tell_origin() -> dict[str, Any]:
        return _origin(words, files)

    try:
        words = _spelt_today(words)
        # libraries take an interrupt in their import for an error of their own, and to look for circles among what is
        # imported takes a quarter of a short command's time
        with calls, uncollected():
            # others' studies are looked for only where the command is none of ours: it takes a moment
            listed = COMMANDS if _command_in(words) else commands()
            command = _command_in(words, listed)
            parser = _parser({command}, listed)
        if alone:
            stay_uncollected()
        options = parser.parse_args(words)
        origin.check_named(vars(options))
        files |= origin.files_read(vars(options))
        origin.said.append(tell_origin)
        inputs.update(path.resolve() for path in files.values())
        for path in origin.written(vars(options)):
            spare_input(path)
            if path.is_file():
                from orchestrator.output.results.manifest import spare_result  # noqa: PLC0415 - only where it is needed

                spare_result(path)
        with answer_first(), saying_that_it_is_at_work(command):
            return int(options.command(options))
    except (CosimError, SetupError, OSError) as error:
        if is_interrupt(error):
            raise
        return _failed(error)
    finally:
        inputs.clear()
        origin.said[:] = [tell for tell in origin.said if tell is not tell_origin]


def _spelt_today(words: Sequence[str]) -> list[str]:
    place = next((k for k, word in enumerate(words) if not word.startswith("-")), 0)
    today = OLD.get(words[place]) if words else None
    if today is None:
        return list(words)
    print(
        f"note: gfor {words[place]} is now gfor {today}; the old spelling works until 1.0",
        file=sys.stderr,
    )
    return [*words[:place], *today.split(), *words[place + 1 :]]


def commands() -> dict[str, str]:
    """Return our commands, and behind them the studies of other distributions, with what each is for."""
    from orchestrator.studies.added import unlisted  # noqa: PLC0415 - imports what all studies need

    added = unlisted(COMMANDS)
    taken = added.keys() & {name.partition(" ")[0] for name in COMMANDS}
    for name in taken:
        print(
            f"note: the study {name!r} is not used, as gfor {name} is a command of gfor-cosim: {added[name]}; "
            f"give it another name",
            file=sys.stderr,
        )
    return COMMANDS | {name: words for name, words in added.items() if name not in taken}


def _command_in(words: Sequence[str], listed: Collection[str] = COMMANDS) -> str | None:
    named = [word for word in words if not word.startswith("-")][:2]
    return next((name for name in (" ".join(named), *named[:1]) if name in listed), None)


def _origin(words: Sequence[str], files: Mapping[str, Path]) -> dict[str, Any]:
    from orchestrator.core.file_hashes import remembered_sha256  # noqa: PLC0415 - likewise
    from orchestrator.output.results.manifest import inputs_behind  # noqa: PLC0415 - likewise
    from orchestrator.studies.points.code import code_hash  # noqa: PLC0415 - only where results are written

    hashes = {name: remembered_sha256(path) for name, path in files.items()}
    for path in (
        word
        for before, word in pairwise(["", *words])
        if before.removeprefix("--") not in origin.WRITTEN
    ):
        hashes |= {f"{path}/{name}": of for name, of in inputs_behind(Path(path)).items()}
    command = shlex.join(["gfor", *words])
    return {"command": command, "directory": str(Path.cwd()), "code": code_hash(), "inputs": hashes}


def _failed(error: CosimError | SetupError | OSError) -> int:
    """Say what was wrong; returns the exit code."""
    match error:
        case CosimError():
            _print_error(str(error))
            return error.exit_code
        case SetupError():
            _print_error(str(error))
            return InputError.exit_code
        case BrokenPipeError():
            return 0
        case OSError():  # of a file that no command expected to fail with
            where = f"{error.filename}: " if error.filename is not None else ""
            remedy = "make sure that the disk has room and that you may read and write there"
            _print_error(f"{where}{error.strerror or error}; {remedy}")
    return CosimError.exit_code


def _print_anything() -> None:
    """Have characters that a terminal's encoding lacks replaced; an error would come after all was computed."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper) and stream.errors == "strict":
            codecs.register_error(_ESCAPE, _escaped)
            stream.reconfigure(errors=_ESCAPE)


def _escaped(error: UnicodeError) -> tuple[str, int]:
    r"""Characters that an encoding lacks, as ``\uXXXX``, which JSON reads."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    units = error.object[error.start : error.end].encode("utf-16-be", "surrogatepass")
    return "".join(
        f"\\u{units[k]:02x}{units[k + 1]:02x}" for k in range(0, len(units), 2)
    ), error.end


def _print_error(text: str) -> None:
    from rich.console import Console  # noqa: PLC0415 - `gfor --version` and `gfor --help` do without
    from rich.markup import escape  # noqa: PLC0415

    console = Console(stderr=True, soft_wrap=True, highlight=False, emoji=False)
    console.print(f"[bold red]error:[/bold red] {escape(text)}")


def _print(text: str) -> int:
    print(text, end="")
    return 0


class _Version(argparse.Action):
    """Prints the installed version; it is only looked up when it is asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version  # noqa: PLC0415 - not needed by any command

        print(f"gfor-cosim {version('gfor-cosim')}")
        parser.exit()


class _Once(argparse._StoreAction):
    """An option whose second value would put the first one away in silence."""

    given = False

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: Any,
        values: Any,
        option: str | None = None,
    ) -> None:
        if option and self.given:
            parser.error(f"argument {option}: it is given twice, and takes one value; give it once")
        self.given = True
        super().__call__(parser, namespace, values, option)


class _Parser(argparse.ArgumentParser):
    """A parser whose help opens with the newcomer's page, and which hints at what an unknown word may mean."""

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        known = list(action.choices or ())
        near = difflib.get_close_matches(str(value), known, n=1, cutoff=0.75)
        if near and value not in known:
            raise argparse.ArgumentError(
                action, f"there is no command {value!r}; did you mean {near[0]}?"
            )
        super()._check_value(action, value)

    def format_help(self) -> str:
        return f"{QUESTIONS}\n{super().format_help()}"

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        found, rest = self.parse_known_args(args, namespace)
        if rest:
            options = [word.partition("=")[0] for word in rest if word.startswith("--")]
            owners = {option: _commands_with(option) for option in options[:1]}
            hints = [
                f"; {option} is an option of {', '.join(names)}"
                for option, names in owners.items()
                if names
            ]
            self.error(f"unrecognized arguments: {' '.join(rest)}{''.join(hints)}")
        return found


class _Command(argparse.ArgumentParser):
    """A command's parser; it says what a reader of an option says is wrong."""

    def _get_value(self, action: argparse.Action, text: str) -> Any:
        try:
            return super()._get_value(action, text)
        except InputError as error:
            raise argparse.ArgumentError(action, str(error)) from error
        except argparse.ArgumentError as error:
            if isinstance(error.__context__, ValueError) and not isinstance(action.type, type):
                raise argparse.ArgumentError(action, str(error.__context__)) from error
            raise


def _commands_with(option: str) -> list[str]:
    """The commands that have an option, as they are typed."""
    found = []
    for name in commands():
        command = argparse.ArgumentParser(add_help=False)
        module_of(name).add_arguments(command)
        if option in command._option_string_actions:
            found.append(f"gfor {name}")
    return found


def module_of(command: str) -> Any:
    """Return what has a command's ``add_arguments`` and ``run``: its module, or its study where that is all."""
    name = _MODULES.get(command, command).replace("-", "_")
    if command in COMMANDS and (Path(__file__).parent / f"{name}.py").exists():
        return import_module(f"orchestrator.face.cli.{name}")
    from orchestrator.face.cli.study import StudyCommand  # noqa: PLC0415 - imports what all studies need
    from orchestrator.studies.added import STUDIES  # noqa: PLC0415 - as above

    return StudyCommand(command, STUDIES[name])


def whole_parser() -> argparse.ArgumentParser:
    """Return the parser with the arguments of every command, which imports all of them."""
    listed = commands()
    return _parser(listed, listed)


def _parser(
    chosen: Collection[str | None], listed: Mapping[str, str] = COMMANDS
) -> argparse.ArgumentParser:
    """The parser of listed commands, with the arguments of the chosen ones: the others' imports would take seconds."""
    parser = _Parser(
        prog="gfor",
        description="Co-simulation of grid-forming converters: run, linearise, build FMUs.",
    )
    parser.set_defaults(command=lambda _: _print(QUESTIONS))
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    unchosen = _Command(add_help=False)

    def make(*, add_help: bool = True, **given: Any) -> argparse.ArgumentParser:
        """The parser of a command; those of the others are listed, never asked, and one and the same."""
        return _Command(**given) if add_help else unchosen

    # argparse only calls what it is given as a class
    kind_of_parser = cast("type[argparse.ArgumentParser]", make)
    lists = {"": parser.add_subparsers(metavar="COMMAND", parser_class=kind_of_parser)}
    for name, words in listed.items():
        group, _, last = name.rpartition(" ")
        if group not in lists:
            whole = lists[""].add_parser(group, help=GROUPS[group], description=GROUPS[group])
            whole.set_defaults(command=lambda _, whole=whole: _print(whole.format_help()))
            lists[group] = whole.add_subparsers(metavar="COMMAND", parser_class=kind_of_parser)
        # each parser costs argparse looks for translations, and nobody asks the others for help
        command = lists[group].add_parser(last, help=words, add_help=name in chosen)
        if name in chosen:
            for kind in (None, "store"):
                command.register("action", kind, _Once)
            if name in _READERS:
                import_xarray_alone()
            module = module_of(name)
            module.add_arguments(command)
            command.set_defaults(command=module.run)
    return parser
