"""Runs that are ended at any moment, and resumed: ``python -m tests.benchmarks.kills [KILLS TERMS SEED]``.

Runs the two areas with five events, two scenarios and a checkpoint every 0.05 s, as a process of its own. Ends it by
SIGKILL (50 times) or SIGTERM (20 times) at a moment that is spread evenly over the whole life of an undisturbed run,
in the processor's time, so that other work on the machine does not matter (Linux). Resumes it, and compares every value
of every file with the undisturbed run's. Two runs go on at a time. Prints a line for each, and a table of where they
were ended. Where nothing had begun, there is nothing to resume, and the folder has to be empty.

After SIGTERM the exit code is 143, or 0 where all was done, and no temporary file and no process is left. Before Python
has come to the command, SIGTERM ends it by itself (-15), and nothing is there yet.
"""

import os
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from tests.face.cli.test_resume import WORDS, checkpoints_in, started, values_of, write_case

STOP = 2.0
TIMES = (0.5, 1.1, 1.1005, 1.3333, 1.6)
AT_A_TIME = 2
TRIES = {signal.SIGKILL: 50, signal.SIGTERM: 20}
SEED = 1
TICK = os.sysconf("SC_CLK_TCK")
CODES = {signal.SIGKILL: {-9, 0}, signal.SIGTERM: {143, -15, 0}}


def ended(out: Path, code: int) -> str:
    """How far a run was, from what it left."""
    kept = out / ".checkpoints"
    if code == 0:
        return "after its end"
    if not (kept / "request.json").exists():
        return "when all was done" if (out / "summary.json").exists() else "before it began"
    if (out / "summary.json").exists() or list(out.glob(".part-*")):
        return "while results of all were written"
    if not checkpoints_in(out):
        return "before the first checkpoint"
    if list(out.glob("*.part-*/trajectory.nc")):
        return "while results of a scenario were written"
    return "with checkpoints"


def left_behind(group: int, tmp: Path) -> Iterator[str]:
    """Processes and files that outlived a run."""
    yield from (path.name for path in tmp.iterdir())
    try:
        os.killpg(group, 0)
        yield f"processes of group {group}"
    except ProcessLookupError:
        pass


def attempt(
    case: Path, folder: Path, kind: int, moment: float, wanted: dict[str, Any]
) -> tuple[str, list[str]]:
    """End a run at a moment [s] and resume it; where that was, and what is wrong."""
    out, tmp = folder / "out", folder / "tmp"
    words = (case, *WORDS, "--out", out, "--checkpoint", "0.05")
    process = started(tmp, *words)
    while process.poll() is None and processor_time(process.pid) < moment:
        time.sleep(0.02)
    process.send_signal(kind)
    _, error = process.communicate(timeout=300)
    code, wrong = process.returncode, []
    if code not in CODES[kind]:
        wrong.append(f"exit code {code}: {error[-3000:]}")
    if kind == signal.SIGTERM and code != -signal.SIGTERM:
        wrong += [f"left behind: {left}" for left in left_behind(process.pid, tmp)]
    where = ended(out, code)
    if where == "before it began":
        there = out.rglob("*") if out.exists() else []
        return where, [
            *wrong,
            *(
                f"it is there: {path.name}"
                for path in there
                if path.name not in (".lock", ".checkpoints")
            ),
        ]
    if code != 0 and where != "when all was done":
        again = started(tmp, "--resume", out)
        _, error = again.communicate(timeout=300)
        if again.returncode != 0:
            wrong.append(f"resumed: exit code {again.returncode}: {error[-3000:]}")
    try:
        found = values_of(out)
    except ValueError as error:  # a file that nobody can read
        there = [
            f"{path.relative_to(out)} ({path.stat().st_size} B)" for path in sorted(out.rglob("*"))
        ]
        return where, [
            *wrong,
            f"exit code {code}; {' '.join(str(error).split())[:200]}; there is: {', '.join(there)}",
        ]
    names = [name for name in {*found, *wanted} if found.get(name) != wanted.get(name)]
    return where, [*wrong, *(f"other values: {name}" for name in sorted(names))]


def undisturbed(case: Path, folder: Path) -> tuple[dict[str, Any], float]:
    """Values of a run that nothing ends, and how long it lives, in the processor's time [s]."""
    process, life = started(folder / "tmp", case, *WORDS, "--out", folder / "out"), 0.0
    while process.poll() is None:
        life = max(life, processor_time(process.pid))
        time.sleep(0.02)
    _, error = process.communicate(timeout=300)
    if process.returncode != 0:
        raise SystemExit(f"the undisturbed run failed: {error}")
    return values_of(folder / "out"), life


def processor_time(process: int) -> float:
    """What a living process has used of the processors [s]."""
    words = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / TICK


def main() -> None:
    asked = [int(word) for word in sys.argv[1:]]
    tries = dict(zip(TRIES, asked[:2], strict=True)) if asked else TRIES
    seed = asked[2] if len(asked) > 2 else SEED
    chance = random.Random(seed)
    with tempfile.TemporaryDirectory() as top, ThreadPoolExecutor(AT_A_TIME) as pool:
        case = write_case(Path(top) / "events.toml", STOP, TIMES)
        wholes = list(
            pool.map(lambda k: undisturbed(case, Path(top) / f"whole_{k}"), range(AT_A_TIME))
        )
        wanted, life = wholes[0][0], max(seconds for _, seconds in wholes)
        assert all(values == wanted for values, _ in wholes)
        print(f"seed {seed}; an undisturbed run takes {life:.1f} s of a processor", flush=True)
        moments = [
            (kind, chance.uniform(0, life)) for kind, count in tries.items() for _ in range(count)
        ]
        chance.shuffle(moments)
        found: Counter[tuple[str, str]] = Counter()
        wrong = 0

        def one(number: int) -> tuple[int, float, str, list[str]]:
            kind, moment = moments[number]
            return kind, moment, *attempt(case, Path(top) / str(number), kind, moment, wanted)

        for kind, moment, where, errors in pool.map(one, range(len(moments))):
            name = signal.Signals(kind).name
            print(
                f"{name} at {moment:5.2f} s: {where}: {'; '.join(errors) or 'equal to the last bit'}",
                flush=True,
            )
            found[name, where] += 1
            wrong += bool(errors)
        for (name, where), count in sorted(found.items()):
            print(f"{name:8} {where:42} {count:3}")
        print(f"{len(moments)} ended, {wrong} with errors")


if __name__ == "__main__":
    main()
