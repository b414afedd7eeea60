"""How many mistakes drawn at random would the tests notice? The rate, with a seed, over all code of the product.

python -m tests.benchmarks.random_mutations [--seed N] [--count N] [--stages N] [--workers N] [--limit SECONDS]

Mistakes are drawn from the syntax trees of `orchestrator`, `fmus` and `gfor_fmu`: a sign, a factor, a comparison, two
swapped arguments, a dropped term, an index off by one, a wrong constant, `and` for `or`. Each is made in a copy of the
repository, and the tests run in stages until one fails: first the tests of the module's own name and those that import
it, then the fast tests of its folder and of its users, then the slow ones. What survives is to be read:
random_mutations.toml beside this file keeps what changes nothing that a user could see, with the reason.
"""

import argparse
import ast
import json
import os
import random
import re
import shutil
import sys
import tempfile
import tomllib
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

from fmus.toolchain.cache import cache_directory
from tests.benchmarks.mutations import (
    CAUGHT,
    ROOT,
    SURVIVED,
    TOO_SLOW,
    UNCLEAR,
    Copy,
    Mutation,
    Outcome,
)

HERE = Path(__file__).parent
RESULTS, READ = HERE / "random_mutations.json", HERE / "random_mutations.toml"
PACKAGES = ("orchestrator", "fmus", "gfor_fmu")
EQUIVALENT = "equivalent"

_SWAPS = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*"}
_COMPARISONS = {
    ast.Lt: "<=",
    ast.LtE: "<",
    ast.Gt: ">=",
    ast.GtE: ">",
    ast.Eq: "!=",
    ast.NotEq: "==",
}
_QUIET = (ast.Raise, ast.JoinedStr, ast.AnnAssign, ast.arguments, ast.Import, ast.ImportFrom)
"""Below these no mistake is made: messages, annotations and defaults."""


@dataclass(frozen=True)
class Drawn(Mutation):
    """A mistake at one place of a file."""

    at: int = 0

    def applied(self, text: str) -> str | None:
        end = self.at + len(self.old)
        return text[: self.at] + self.new + text[end:] if text[self.at : end] == self.old else None


class Places:
    """Where in a file which mistakes can be made."""

    def __init__(self, file: str, text: str) -> None:
        self.file, self.text = file, text
        self._starts = [0]
        for line in text.splitlines(keepends=True):
            self._starts.append(self._starts[-1] + len(line))
        self._lines = text.splitlines()

    def _offset(self, line: int, column: int) -> int:
        return self._starts[line - 1] + len(self._lines[line - 1].encode()[:column].decode())

    def _span(self, node: ast.expr) -> tuple[int, int]:
        return self._offset(node.lineno, node.col_offset), self._offset(
            node.end_lineno, node.end_col_offset
        )

    def _source(self, node: ast.expr) -> str:
        begin, end = self._span(node)
        return self.text[begin:end]

    def mistakes(self) -> list[Drawn]:
        """All that can be made in the file."""
        found = []
        for node in self._loud(ast.parse(self.text)):
            for kind, new in self._of(node):
                begin, end = self._span(node)
                old = self.text[begin:end]
                name = f"{self.file}:{node.lineno} {kind}: {_short(old)} -> {_short(new)}"
                found.append(Drawn(name, self.file, old, new, (), begin))
        return found

    def _loud(self, node: ast.AST) -> Iterator[ast.expr]:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, _QUIET):
                continue
            if isinstance(child, ast.expr):
                yield child
            yield from self._loud(child)

    def _of(self, node: ast.expr) -> Iterator[tuple[str, str]]:
        if isinstance(node, ast.BinOp) and type(node.op) in _SWAPS and not _text(node):
            left, right = self._span(node.left), self._span(node.right)
            begin, end = self._span(node)
            sign = next(k for k in range(left[1], right[0]) if self.text[k] in "+-*/")
            kind = "sign" if isinstance(node.op, ast.Add | ast.Sub) else "factor"
            yield kind, self.text[begin:sign] + _SWAPS[type(node.op)] + self.text[sign + 1 : end]
            yield "dropped term", self.text[begin:sign].rstrip()
        elif (
            isinstance(node, ast.UnaryOp)
            and isinstance(node.op, ast.USub)
            and not isinstance(node.operand, ast.Constant)
        ):
            yield "sign", self._source(node.operand)
        elif (
            isinstance(node, ast.Compare)
            and len(node.ops) == 1
            and type(node.ops[0]) in _COMPARISONS
        ):
            sides = self._source(node.left), self._source(node.comparators[0])
            yield "comparison", f"{sides[0]} {_COMPARISONS[type(node.ops[0])]} {sides[1]}"
        elif isinstance(node, ast.BoolOp):
            word = " or " if isinstance(node.op, ast.And) else " and "
            yield "and/or", "(" + word.join(self._source(value) for value in node.values) + ")"
        elif (
            isinstance(node, ast.Call)
            and len(node.args) >= 2
            and not any(isinstance(a, ast.Starred) for a in node.args)
        ):
            first, second = self._span(node.args[0]), self._span(node.args[1])
            begin, end = self._span(node)
            texts = self._source(node.args[1]), self._source(node.args[0])
            if texts[0] != texts[1]:
                between = self.text[first[1] : second[0]]
                yield (
                    "swapped arguments",
                    self.text[begin : first[0]]
                    + texts[0]
                    + between
                    + texts[1]
                    + self.text[second[1] : end],
                )
        elif (
            isinstance(node, ast.Subscript)
            and isinstance(node.slice, ast.Constant)
            and isinstance(node.slice.value, int)
        ):
            yield "off by one", f"{self._source(node.value)}[{node.slice.value + 1}]"
        elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
            yield "wrong constant", repr(node.value * 2 if node.value else 1)


def _text(node: ast.BinOp) -> bool:
    return any(
        isinstance(part, ast.JoinedStr)
        or (isinstance(part, ast.Constant) and isinstance(part.value, str))
        for part in ast.walk(node)
    )


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."


def drawn(seed: int, count: int, root: Path = ROOT) -> list[Drawn]:
    """Mistakes at random: each kind is as likely as the others, and so is each place of a kind."""
    by_kind: dict[str, list[Drawn]] = {}
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            name = path.relative_to(root).as_posix()
            for mistake in Places(name, path.read_text(encoding="utf-8")).mistakes():
                by_kind.setdefault(mistake.name.split(" ", 1)[1].partition(":")[0], []).append(
                    mistake
                )
    random_ = random.Random(seed)
    chosen: dict[str, Drawn] = {}
    while len(chosen) < count:
        mistake = random_.choice(by_kind[random_.choice(sorted(by_kind))])
        chosen.setdefault(mistake.name, mistake)
    return list(chosen.values())


def stages(mistake: Drawn, root: Path = ROOT) -> list[tuple[str, ...]]:
    """Arguments of pytest: the nearest tests, the fast ones of the folder and of its users, the slow ones."""
    module = mistake.file.removesuffix(".py").replace("/", ".").removesuffix(".__init__")
    own, stem = _mirror(mistake.file), Path(mistake.file).stem
    files = {
        p.relative_to(root).as_posix(): p.read_text(encoding="utf-8")
        for p in sorted((root / "tests").rglob("test_*.py"))
    }
    files = {
        name: text
        for name, text in files.items()
        if "/benchmarks/" not in name and "/pages/" not in name
    }
    near = [
        name
        for name, text in files.items()
        if re.search(rf"\b{re.escape(module)}\b", text) or Path(name).stem == f"test_{stem}"
    ]
    near = near or [
        name for name, text in files.items() if re.search(rf"\b{re.escape(stem)}\b", text)
    ]
    in_folder = [name for name in files if name.startswith(f"{own}/") and name not in near]
    users = _folders_that_import(module, root)
    far = [
        name
        for name in files
        if name not in near
        and name not in in_folder
        and _room(name.removeprefix("tests/")) in users
    ]
    return [
        (*near, "-m", "not slow"),
        (*in_folder, *far, "-m", "not slow"),
        (*near, *in_folder, "-m", "slow"),
    ]


def _mirror(file: str) -> str:
    package, _, rest = file.partition("/")
    if package == "orchestrator" and "/" in rest:
        return f"tests/{_room(rest)}"
    if file.startswith("fmus/toolchain/"):
        return "tests/toolchain"
    return "tests/models" if package in ("fmus", "gfor_fmu") else "tests"


def _room(file: str) -> str:
    """Floor and room of a file of the orchestrator; the floor alone for one that stands on it."""
    *folders, _ = file.split("/")
    return "/".join(folders[:2])


def _folders_that_import(module: str, root: Path) -> set[str]:
    """Test folders of the packages that import a module, and those whose tests run commands."""
    found = {"face/cli", "studies/modes", "studies/runs", "reproduction"}
    for path in (root / "orchestrator").rglob("*.py"):
        if module in path.read_text(encoding="utf-8"):
            found.add(_room(path.relative_to(root / "orchestrator").as_posix()))
    return found


class Trial:
    """Tries mistakes out in one copy of the repository."""

    def __init__(self, root: Path, folder: Path, limit: float) -> None:
        self._copy, self._limit = Copy(root, folder), limit
        kept = cache_directory("fmus").parent
        if kept.is_dir():
            shutil.copytree(
                kept, folder / "caches" / "plain", copy_function=_link, dirs_exist_ok=True
            )

    def outcome(self, mistake: Drawn, most: int) -> tuple[Outcome, int]:
        """Verdict and the stage that gave it (1, 2, 3)."""
        seconds = 0.0
        for number, tests in enumerate(stages(mistake, self._copy.tree)[:most], start=1):
            if len(tests) == 2:  # of no file
                continue
            found = self._copy.try_unchecked(mistake, tests, self._limit)
            seconds += found.seconds
            if found.verdict != SURVIVED:
                return Outcome(found.verdict, round(seconds, 1), found.by), number
        return Outcome(SURVIVED, round(seconds, 1)), most


def _link(source: str, target: str) -> None:
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m tests.benchmarks.random_mutations", description=__doc__.split("\n")[0]
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument(
        "--stages",
        type=int,
        default=3,
        help="1: nearest tests, 2: all fast ones, 3: slow ones too (3)",
    )
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument(
        "--limit", type=float, default=600.0, metavar="S", help="seconds for one run of tests (600)"
    )
    options = parser.parse_args(arguments)

    kept = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else {}
    read = (
        {
            e["name"]: e["why"]
            for e in tomllib.loads(READ.read_text(encoding="utf-8")).get("equivalent", [])
        }
        if READ.exists()
        else {}
    )
    mistakes = drawn(options.seed, options.count)

    def work(share: list[Drawn], folder: Path) -> None:
        trial = Trial(ROOT, folder, options.limit)
        for mistake in share:
            before = kept.get(mistake.name)
            if before and (
                before["verdict"] == CAUGHT
                or (before["verdict"] == SURVIVED and before["stage"] >= options.stages)
            ):
                continue
            outcome, stage = (
                (Outcome(EQUIVALENT), 0)
                if mistake.name in read
                else trial.outcome(mistake, options.stages)
            )
            kept[mistake.name] = {**asdict(outcome), "stage": stage}
            print(
                f"{outcome.verdict} (stage {stage}, {outcome.seconds:.0f} s): {mistake.name} {outcome.by}",
                flush=True,
            )
            RESULTS.write_text(
                json.dumps(dict(sorted(kept.items())), indent=1, ensure_ascii=False) + "\n",
                encoding="utf-8",
            )

    with (
        tempfile.TemporaryDirectory(prefix="random-mutations") as folder,
        ThreadPoolExecutor(options.workers) as pool,
    ):
        shares = [mistakes[k :: options.workers] for k in range(options.workers)]
        for job in [
            pool.submit(work, share, Path(folder) / str(k)) for k, share in enumerate(shares)
        ]:
            job.result()

    verdicts = Counter(EQUIVALENT if m.name in read else kept[m.name]["verdict"] for m in mistakes)
    judged = len(mistakes) - verdicts[EQUIVALENT] - verdicts[UNCLEAR] - verdicts[TOO_SLOW]
    fast = sum(kept[m.name]["verdict"] == CAUGHT and kept[m.name]["stage"] <= 2 for m in mistakes)
    print(f"{verdicts[CAUGHT]} of {judged} caught, {fast} by fast tests; {dict(verdicts)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
