"""The project's files with their syntax trees, each parsed and walked once by a process for all tests of code."""

import ast
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

from orchestrator.core.uncollected import uncollected

ROOT = Path(__file__).parents[2]
PRODUCT = ("fmus", "gfor_fmu", "orchestrator")


_WITHOUT_NODES = {"id", "attr", "arg", "name", "asname", "module", "level", "kind", "type_comment"}
"""Fields of nodes that hold texts and numbers."""


@cache
def _fields_with_nodes(kind: type[ast.AST]) -> tuple[str, ...]:
    return tuple(name for name in kind._fields if name not in {"ctx", *_WITHOUT_NODES})


@dataclass(frozen=True)
class SourceFile:
    """One file of Python with its syntax tree."""

    path: Path
    text: str
    tree: ast.Module

    @property
    def place(self) -> str:
        """Path from the project on, such as ``orchestrator/studies/sweep/point.py``."""
        return self.path.relative_to(ROOT).as_posix()

    @property
    def module(self) -> str:
        """Name by which it is imported."""
        return ".".join(Path(self.place).with_suffix("").parts).removesuffix(".__init__")

    @property
    def room(self) -> str:
        """The package and its folder, such as ``orchestrator/studies/sweep``."""
        parts = self.path.relative_to(ROOT).parts
        return "/".join(parts[: min(2, len(parts) - 1)])

    @cached_property
    def _walked(self) -> tuple[list[ast.AST], dict[int, int], dict[int, int]]:
        """All nodes in their order in the text, and by a node's identity where it stands and where what it holds ends.

        Contexts (load, store) are left out: there is one for each name, and no rule asks for them."""
        nodes: list[ast.AST] = []
        begins: dict[int, int] = {}
        ends: dict[int, int] = {}

        def visit(node: ast.AST) -> None:
            begins[id(node)] = len(nodes)
            nodes.append(node)
            for name in _fields_with_nodes(type(node)):
                value = getattr(node, name, None)
                if isinstance(value, ast.AST):
                    visit(value)
                elif isinstance(value, list):
                    for inner in value:
                        if isinstance(inner, ast.AST):
                            visit(inner)
            ends[id(node)] = len(nodes)

        with uncollected():  # a million nodes stay, among which no garbage is
            visit(self.tree)
        return nodes, begins, ends

    @cached_property
    def _by_kind(self) -> dict[type[ast.AST], list[ast.AST]]:
        found = defaultdict(list)
        for node in self._walked[0]:
            found[type(node)].append(node)
        return found

    def of(self, *kinds: type[ast.AST]) -> Iterator[ast.AST]:
        """Nodes of some kinds, kind by kind."""
        for own, nodes in self._by_kind.items():
            if issubclass(own, kinds):
                yield from nodes

    def within(self, node: ast.AST) -> list[ast.AST]:
        """A node of the tree, and all that it holds."""
        nodes, begins, ends = self._walked
        return nodes[begins[id(node)] : ends[id(node)]]

    @property
    def nodes(self) -> int:
        """Expressions and statements, which no layout changes."""
        return sum(1 for _ in self.of(ast.expr, ast.stmt))


@cache
def read_source(path: Path) -> SourceFile:
    text = path.read_text(encoding="utf-8")
    return SourceFile(path, text, ast.parse(text))


@cache
def product_files(*folders: str) -> list[SourceFile]:
    """The files of some folders, by default of the three packages, in the order of their paths."""
    with uncollected():  # else the search for garbage takes twice as long as the reading
        return [
            read_source(path)
            for folder in folders or PRODUCT
            for path in sorted((ROOT / folder).rglob("*.py"))
        ]


def forget_sources() -> None:
    """Let go of the syntax trees."""
    product_files.cache_clear()
    read_source.cache_clear()
