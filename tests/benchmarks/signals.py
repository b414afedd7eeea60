"""Commands that get a signal at any moment: ``python -m tests.benchmarks.signals [SIGNALS SEED [COMMAND]]``.

Each command below is run undisturbed, and then with SIGTERM or SIGINT at a moment that is spread evenly over its
life, in the processor's time, so that other work on the machine does not matter (Linux). The process of each is a copy
of this one, which has imported the libraries already; so the moments lie in the command's own work.

A command that was ended has to end with the signal's code and its words on the last lines, without a traceback, without
a process left, and without a file that is written in part. One that was done before has to end as undisturbed.
"""

import atexit
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from fmus.toolchain import temporary
from orchestrator.face.cli import _command_in, _parser, main
from tests.benchmarks.kills import processor_time

COUNT, SEED, LONGEST = 1000, 1, 300.0
CODES = {signal.SIGTERM: (143, "ended by SIGTERM"), signal.SIGINT: (130, "interrupted")}
RUN = ("run", "infinite_bus", "--scenario", "dip", "--stop", "0.5")
WORDS: dict[str, tuple[str, ...]] = {
    "run": (*RUN, "--out", "out"),
    "run of two": ("run", "infinite_bus", "--stop", "1.3", "--linear", "--out", "out"),
    "modes": ("modes", "infinite_bus", "--scenario", "dip", "--out", "out"),
    "linearize": ("export", "linear", "infinite_bus", "--scenario", "dip", "--out", "out"),
    "export-ssp": ("export", "ssp", "infinite_bus", "--scenario", "dip", "--out", "out"),
    "export-comtrade": ("export", "comtrade", "before/dip", "--out", "out"),
    "sensitivities": (
        "sensitivities",
        "two_area",
        "--scenario",
        "gfor",
        "--parameter",
        "gfor.*",
        "--out",
        "out",
    ),
    "report": ("report", "before", "--out", "out.html"),
    "admittance": ("fmu", "admittance", "gfor.fmu", "--from-hz", "1", "--out", "out"),
    "build": ("fmu", "build", "gfor", "--dest", "out"),
    "bind": ("fmu", "bind", "gfor.fmu", "--out", "out.toml"),
}
"""Words of a command by its name here; ``before`` and ``gfor.fmu`` are there."""


def begun(folder: Path, words: tuple[str, ...]) -> int:
    """A copy of this process that runs a command in a folder; its number."""
    child = os.fork()
    if child:
        return child
    code = 70
    try:
        os.setsid()
        os.chdir(folder)
        (folder / "tmp").mkdir()
        temporary._process = os.getpid()  # it removes its temporary folders itself
        os.environ["TMPDIR"] = tempfile.tempdir = str(folder / "tmp")
        for number, name in ((1, "stdout"), (2, "stderr")):
            os.dup2(
                os.open(folder.parent / f"{folder.name}.{name}", os.O_WRONLY | os.O_CREAT), number
            )
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        sys.argv = ["gfor", *words]
        code = main()
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def ended(child: int, kind: int = 0, moment: float = LONGEST) -> tuple[int, float]:
    """Wait for a process, and send it a signal at a moment of its processor's time [s]; code and time used."""
    used, sent, begin = 0.0, False, time.monotonic()
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status), used
        used = max(used, processor_time(child))
        if not sent and kind and used >= moment:
            time.sleep(random.random() * 0.02)
            os.kill(child, kind)
            sent = True
        if time.monotonic() - begin > LONGEST:
            os.killpg(child, signal.SIGKILL)
        time.sleep(0.004)


def wrong(folder: Path, child: int, code: int, kind: int, usual: int) -> list[str]:
    """What is wrong with a command that got a signal."""
    error = (folder.parent / f"{folder.name}.stderr").read_text(encoding="utf-8", errors="replace")
    found = []
    wanted, words = CODES[signal.Signals(kind)]
    if code not in (wanted, usual):
        found.append(f"exit code {code}")
    if code == wanted and words not in error:
        found.append("it does not say that it was ended")
    if "Traceback" in error or "Exception ignored" in error:
        found.append("a traceback")
    left = [path.name for path in (folder / "tmp").iterdir()]
    left += [str(path) for path in folder.rglob(".part-*") if path.is_dir()]
    try:
        os.killpg(child, 0)
        left.append("a process")
    except ProcessLookupError:
        pass
    found += [f"left behind: {name}" for name in left]
    return [f"{'; '.join(found)}\n{error[-3000:]}"] if found else []


def prepared(folder: Path, before: Path) -> Path:
    """A folder with what the commands read."""
    folder.mkdir()
    for path in before.iterdir():
        (folder / path.name).symlink_to(path)
    return folder


def tried(
    top: Path, before: Path, name: str, count: int, chance: random.Random
) -> tuple[Counter[str], list[str]]:
    """Send a command signals, one a life; how they ended, and what is wrong."""
    found, errors = Counter[str](), list[str]()
    usual, life = ended(begun(prepared(top / name, before), WORDS[name]))
    if usual not in (0, 3):
        said = "".join(
            (top / f"{name}.{kind}").read_text(encoding="utf-8") for kind in ("stdout", "stderr")
        )
        return Counter({"not run": 1}), [f"undisturbed it ends with {usual}\n{said[-2000:]}"]
    for k in range(count):
        kind, moment = chance.choice(list(CODES)), chance.uniform(0, life)
        folder = prepared(top / f"{name} {k}", before)
        child = begun(folder, WORDS[name])
        code, _ = ended(child, kind, moment)
        found["done before" if code == usual else str(code)] += 1
        errors += [
            f"{signal.Signals(kind).name} at {moment:.2f} s: {w}"
            for w in wrong(folder, child, code, kind, usual)
        ]
    return found, errors


MADE = {
    "before": (*RUN, "--out", "before"),
    "gfor.fmu": ("fmu", "build", "gfor", "--dest", "."),
}
"""Words of the commands that make what others read."""


def made(folder: Path, names: list[str]) -> Path:
    """Make what these commands read: a run, or an FMU."""
    folder.mkdir()
    read = {word.partition("/")[0] for name in names for word in WORDS[name]}
    for what in MADE.keys() & read:
        own = folder.parent / f"making of {what}"
        own.mkdir()
        code, _ = ended(begun(own, MADE[what]))
        assert code == 0, (folder.parent / f"{own.name}.stderr").read_text(encoding="utf-8")
        (own / what).rename(folder / what)
    return folder


def main_of(words: list[str]) -> int:
    """Try all commands, or those named; the number of errors."""
    numbers = [int(word) for word in words if word.isdigit()]
    names = [word for word in words if not word.isdigit()] or list(WORDS)
    count, seed = [*numbers, *(COUNT, SEED)[len(numbers) :]][:2]
    chance, wrongs = random.Random(seed), 0
    for words_of in (*MADE.values(), *(WORDS[name] for name in names)):
        _parser({_command_in(words_of)})  # imports
    top = Path(tempfile.mkdtemp())  # nothing that a copy of this process removes at its end
    try:
        before = made(top / "made", names)
        for k, name in enumerate(names):
            share = (count - k + len(names) - 1) // len(names)
            found, errors = tried(top, before, name, share, chance)
            print(
                f"{name:16} {share:4} signals: {dict(found)}, {len(errors)} with errors", flush=True
            )
            for error in errors:
                print(error, flush=True)
            wrongs += len(errors)
    finally:
        shutil.rmtree(top)
    print(f"seed {seed}: {count} signals, {wrongs} with errors")
    return wrongs


if __name__ == "__main__":
    sys.exit(bool(main_of(sys.argv[1:])))
