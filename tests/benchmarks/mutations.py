"""Would the tests notice? Plausible mistakes are made in copies of the repository, and the tests named for them run.

python -m tests.benchmarks.mutations [--only NAME] [--workers N] [--limit SECONDS] [--again]

The list is mutations.toml beside this file. Results are kept in mutations.json, mutation by mutation, so that a run
that was stopped goes on where it was; one whose file, tests or entry changed is run anew. mutations.md is the page.
"""

import argparse
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from queue import SimpleQueue
from time import perf_counter

ROOT = Path(__file__).parents[2]
HERE = Path(__file__).parent
LIST, RESULTS, PAGE = (HERE / f"mutations.{ending}" for ending in ("toml", "json", "md"))

_FIRST_BUILDS = 120.0
"""Seconds beyond the limit that a run without a mistake may take."""

CAUGHT, SURVIVED, NOT_APPLICABLE = "caught", "survived", "not applicable"
UNCLEAR, TOO_SLOW = "unclear", "too slow"
MEANING = {
    CAUGHT: "the named tests pass without the mutation and fail with it",
    SURVIVED: "they pass with it as well",
    TOO_SLOW: "with it they did not end within the time limit",
    UNCLEAR: "they fail or select nothing without it already",
    NOT_APPLICABLE: "the text is not in the file, or more than once",
}


@dataclass(frozen=True)
class Mutation:
    """A mistake: ``old``, which occurs once in ``file``, becomes ``new``; ``tests`` are arguments of pytest."""

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]

    def applied(self, text: str) -> str | None:
        """The file's text with the mistake; None where ``old`` does not occur exactly once, however it is laid out."""
        places = list(re.finditer(in_any_layout(self.old.strip()), text))
        if len(places) != 1:
            return None
        # Indentation and line ends around the text stay as they are in the file.
        return text[: places[0].start()] + self.new.strip() + text[places[0].end() :]

    def key(self, root: Path) -> str:
        """Names what a result rests on: the entry, the file, and the files of tests."""
        parts = [repr(asdict(self)).encode()]
        for name in (self.file, *(t.partition("::")[0] for t in self.tests)):
            path = root / name
            parts.append(path.read_bytes() if path.is_file() else b"")
        return hashlib.sha256(b"\0".join(parts)).hexdigest()[:16]


@dataclass(frozen=True)
class Outcome:
    """What came of a mutation: the verdict, seconds, the first test that failed, and `Mutation.key` of what was run."""

    verdict: str
    seconds: float = 0.0
    by: str = ""
    key: str = ""


def in_any_layout(code: str) -> str:
    """A pattern that matches code whichever way the formatter breaks its lines."""
    pattern = re.sub(r"\\?\s+", r"\\s+", re.escape(code))
    pattern = re.sub(r"(\\[(\[{])(\\s\+)?", r"\1\\s*", pattern)
    return re.sub(r"(\\s\+)?(\\[)\]}])", r",?\\s*\2", pattern)


def read_list(path: Path = LIST) -> list[Mutation]:
    """The mutations of a file."""
    entries = tomllib.loads(path.read_text(encoding="utf-8"))["mutation"]
    return [Mutation(**{**entry, "tests": tuple(entry["tests"])}) for entry in entries]


class Copy:
    """A copy of the repository in which mistakes are made; the user's own tree is only read."""

    def __init__(self, root: Path, folder: Path) -> None:
        self.tree, self._caches = folder / "tree", folder / "caches"
        for name in _files(root):
            if (root / name).is_file():
                (self.tree / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(root / name, self.tree / name)
        (self._caches / "plain").mkdir(parents=True)
        self._plain: dict[tuple[str, ...], bool] = {}

    def passes_without(self, tests: tuple[str, ...], limit: float) -> bool:
        """Whether some tests, and at least one, pass as the code is; first builds may take them longer."""
        if tests not in self._plain:
            self._plain[tests] = (
                self._run(tests, limit + _FIRST_BUILDS, self._caches / "plain")[0] == 0
            )
        return self._plain[tests]

    def try_out(self, mutation: Mutation, limit: float) -> Outcome:
        """Make the mistake, run the tests that must fail, and take it back."""
        return replace(self._try_out(mutation, limit), key=mutation.key(self.tree))

    def _try_out(self, mutation: Mutation, limit: float) -> Outcome:
        path = self.tree / mutation.file
        before = path.read_text(encoding="utf-8") if path.is_file() else ""
        after = mutation.applied(before)
        if after is None:
            return Outcome(NOT_APPLICABLE)
        if not self.passes_without(mutation.tests, limit):
            return Outcome(UNCLEAR)
        return self._made(path, before, after, mutation.tests, limit)

    def try_unchecked(self, mutation: Mutation, tests: tuple[str, ...], limit: float) -> Outcome:
        """Make the mistake and run some tests; of those that pass without it only one that failed is asked."""
        path = self.tree / mutation.file
        before = path.read_text(encoding="utf-8")
        after = mutation.applied(before)
        if after is None:
            return Outcome(NOT_APPLICABLE)
        found = self._made(path, before, after, tests, limit)
        if found.verdict == CAUGHT and not (found.by and self.passes_without((found.by,), limit)):
            return replace(found, verdict=UNCLEAR)
        return found

    def _made(
        self, path: Path, before: str, after: str, tests: Sequence[str], limit: float
    ) -> Outcome:
        # Built files are named by what they are made from, but not by the code that makes them: each gets a cache.
        cache = self._caches / "mutated"
        shutil.copytree(self._caches / "plain", cache, copy_function=os.link, dirs_exist_ok=True)
        begin = perf_counter()
        path.write_text(after, encoding="utf-8")
        try:
            code, first = self._run(tests, limit, cache)
        finally:
            path.write_text(before, encoding="utf-8")
            shutil.rmtree(cache, ignore_errors=True)
        seconds = round(perf_counter() - begin, 1)
        if code is None:
            return Outcome(TOO_SLOW, seconds)
        return Outcome(
            SURVIVED if code in (0, 5) else CAUGHT, seconds, first
        )  # 5: nothing was selected

    def _run(self, tests: Sequence[str], limit: float, cache: Path) -> tuple[int | None, str]:
        """Exit code of pytest, None if it took too long, and the first test that failed."""
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-x",
            "-q",
            "-p",
            "no:cacheprovider",
            "-p",
            "xdist",
            "-n",
            "0",
            *tests,
        ]
        drop = ("CI", "PYTEST_ADDOPTS", "PYTEST_XDIST_WORKER", "PYTEST_CURRENT_TEST")
        environment = {name: value for name, value in os.environ.items() if name not in drop}
        # Bytecode is told from older by seconds and size: a mistake of equal length would not be seen.
        environment |= {
            "PYTHONPATH": str(self.tree),
            "PYTHONDONTWRITEBYTECODE": "1",
            "GFOR_COSIM_CACHE": str(cache),
        }
        environment["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"  # a start costs a fifth
        process = subprocess.Popen(
            command,
            cwd=self.tree,
            env=environment,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            printed, _ = process.communicate(timeout=limit)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            return None, ""
        failed = [line for line in printed.splitlines() if line.startswith(("FAILED ", "ERROR "))]
        return process.returncode, failed[0].split(" - ")[0].partition(" ")[2] if failed else ""


def _files(root: Path) -> list[str]:
    """Of the repository, with those that are new but not ignored."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=root, capture_output=True, check=True)
    return [name for name in listed.stdout.decode().split("\0") if name]


def run_all(
    mutations: Iterable[Mutation],
    root: Path,
    workers: int,
    limit: float,
    tell: Callable[[Mutation, Outcome], None],
) -> None:
    """Try mutations out, each worker in a copy of its own; equal selections are run once without a mistake."""
    groups: dict[tuple[str, ...], list[Mutation]] = {}
    for mutation in mutations:
        groups.setdefault(mutation.tests, []).append(mutation)
    waiting: SimpleQueue[list[Mutation]] = SimpleQueue()
    for group in [*groups.values(), *[[]] * workers]:  # an empty one sends a worker home
        waiting.put(group)
    lock = threading.Lock()

    def work(folder: Path) -> None:
        copy = Copy(root, folder)
        while group := waiting.get():
            for mutation in group:
                outcome = copy.try_out(mutation, limit)
                with lock:
                    tell(mutation, outcome)

    with (
        tempfile.TemporaryDirectory(prefix="mutations") as folder,
        ThreadPoolExecutor(workers) as pool,
    ):
        for done in [pool.submit(work, Path(folder) / str(k)) for k in range(workers)]:
            done.result()


def page(mutations: Sequence[Mutation], outcomes: dict[str, Outcome]) -> str:
    """The table as Markdown, with the score above it."""
    known = [(m, outcomes[m.name]) for m in mutations if m.name in outcomes]
    count = Counter(outcome.verdict for _, outcome in known)
    score = f"**{count[CAUGHT]} of {len(known)} caught**" + (
        f"; {len(mutations) - len(known)} of the list were not run"
        if len(known) < len(mutations)
        else ""
    )
    lines = [
        "# Would the tests notice?",
        "",
        "Plausible mistakes, each made in a copy of the repository, and what the tests named for it said. Written by",
        "`python -m tests.benchmarks.mutations`; the list is [mutations.toml](mutations.toml).",
        "",
        score + ".",
        "",
        *(
            f"- {verdict} ({count[verdict]}): {text}"
            for verdict, text in MEANING.items()
            if count[verdict]
        ),
        "",
        "| Mistake | File | Verdict | First test that failed |",
        "|---|---|---|---|",
    ]
    for mutation, outcome in sorted(
        known, key=lambda entry: (entry[1].verdict == CAUGHT, entry[0].file)
    ):
        name, by = (text.replace("|", "\\|") for text in (mutation.name, outcome.by))
        verdict = outcome.verdict if outcome.verdict == CAUGHT else f"**{outcome.verdict}**"
        lines.append(f"| {name} | `{mutation.file}` | {verdict} | {f'`{by}`' if by else '–'} |")
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m tests.benchmarks.mutations", description=__doc__.split("\n")[0]
    )
    parser.add_argument(
        "--only", action="append", metavar="NAME", help="those with this in their name (repeatable)"
    )
    parser.add_argument(
        "--workers", type=int, default=1, metavar="N", help="copies that work side by side (1)"
    )
    parser.add_argument(
        "--limit", type=float, default=300.0, metavar="S", help="seconds for one run of tests (300)"
    )
    parser.add_argument("--again", action="store_true", help="run also those whose result is known")
    options = parser.parse_args(arguments)

    mutations = read_list()
    chosen = [
        m for m in mutations if not options.only or any(text in m.name for text in options.only)
    ]
    if not chosen:
        parser.error(f"no mutation has {' or '.join(map(repr, options.only))} in its name")
    stored = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else {}
    known = {name: Outcome(**entry) for name, entry in stored.items()}
    known = {
        m.name: known[m.name]
        for m in mutations
        if m.name in known and known[m.name].key == m.key(ROOT)
    }
    if options.again:
        known = {
            name: outcome for name, outcome in known.items() if name not in {m.name for m in chosen}
        }

    def tell(mutation: Mutation, outcome: Outcome) -> None:
        print(
            f"{outcome.verdict}: {mutation.name} ({outcome.seconds:.0f} s) {outcome.by}", flush=True
        )
        known[mutation.name] = outcome
        write()

    def write() -> None:
        entries = {name: asdict(known[name]) for name in sorted(known)}
        RESULTS.write_text(
            json.dumps(entries, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
        )
        PAGE.write_text(page(mutations, known), encoding="utf-8")

    run_all([m for m in chosen if m.name not in known], ROOT, options.workers, options.limit, tell)
    write()
    verdicts = [known[m.name].verdict for m in chosen]
    print(
        f"{verdicts.count(CAUGHT)} of {len(verdicts)} caught; the table is in {PAGE.relative_to(ROOT)}"
    )
    return 0 if all(verdict == CAUGHT for verdict in verdicts) else 1


if __name__ == "__main__":
    sys.exit(main())
