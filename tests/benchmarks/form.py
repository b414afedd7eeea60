"""Size in syntax nodes and the form of code, room by room.

``python -m tests.benchmarks.form [--against REV] [--rule RULE]``

With ``--against`` the figures of another revision of git stand beside today's; with ``--rule`` each place is listed.
"""

import argparse
import ast
import subprocess
from collections import Counter
from pathlib import PurePosixPath

from tests.support.form import RULES
from tests.support.source_files import PRODUCT, ROOT, SourceFile, product_files


def files_of_revision(revision: str) -> list[SourceFile]:
    """The product's files as they are in a revision of git."""
    listing = _git("ls-tree", "-r", "--name-only", revision, *PRODUCT).decode().splitlines()
    names = [name for name in listing if PurePosixPath(name).suffix == ".py"]
    sources = []
    for name in names:
        text = _git("show", f"{revision}:{name}").decode("utf-8")
        sources.append(SourceFile(ROOT / name, text, ast.parse(text)))
    return sources


def _git(*arguments: str) -> bytes:
    return subprocess.run(["git", *arguments], cwd=ROOT, check=True, stdout=subprocess.PIPE).stdout


def nodes_by_room(files: list[SourceFile]) -> Counter[str]:
    """Room → syntax nodes."""
    sizes: Counter[str] = Counter()
    for source in files:
        sizes[source.room] += source.nodes
    return sizes


def places(rule: str, files: list[SourceFile]) -> list[str]:
    """The places where a rule is broken, as ``file:line``."""
    return [
        f"{source.path.relative_to(ROOT)}:{line}"
        for source in files
        for line in sorted(RULES[rule](source))
    ]


def table(now: Counter[str], before: Counter[str] | None) -> list[str]:
    """One line a room, the sum last."""
    lines = []
    for room in sorted(now | (before or Counter())):
        lines.append(_line(room, now[room], before[room] if before is not None else None))
    return [*lines, _line("all", now.total(), before.total() if before is not None else None)]


def _line(name: str, now: int, before: int | None) -> str:
    if before is None:
        return f"{name:52} {now:8,}"
    change = f"{100 * (now / before - 1):+.1f} %" if before else "new"
    return f"{name:52} {now:8,} {before:8,} {change:>8}"


def main() -> None:
    """Print the report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", help="a revision of git that is shown beside today's files")
    parser.add_argument("--rule", choices=RULES, help="list each place that breaks this rule")
    arguments = parser.parse_args()
    files = product_files()
    if arguments.rule:
        print(*places(arguments.rule, files), sep="\n")
        return
    others = files_of_revision(arguments.against) if arguments.against else None
    print("Syntax nodes (expressions and statements)")
    print(*table(nodes_by_room(files), nodes_by_room(others) if others else None), sep="\n")
    print("\nPlaces that break a rule of form")
    for rule in RULES:
        before = len(places(rule, others)) if others else None
        print(_line(rule, len(places(rule, files)), before))


if __name__ == "__main__":
    main()
