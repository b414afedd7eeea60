"""The form of code, counted: what makes a statement hard to read at once, and the size in syntax nodes.

A rule finds places in the syntax tree of one file. Its limit stands in ``tests/form.toml``.
"""

import ast
import io
import re
import tokenize
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).parents[2]
PRODUCT = ("fmus", "gfor_fmu", "orchestrator")

MOST_IN_A_STATEMENT = 2
"""Comprehensions, conditional expressions and lambdas that a statement may hold."""

MOST_POSITIONAL = 6
"""Arguments that a call may pass by their place; a reader cannot tell the seventh from the sixth."""

MOST_IN_A_FUNCTION = 450
"""Syntax nodes of a function: about 60 lines, which hold several ideas that could have names."""

MANY_FIELDS = 4
"""Arguments from which on a constructor is looked at for comprehensions in most of them."""

_NESTED = (ast.GeneratorExp, ast.ListComp, ast.SetComp, ast.DictComp, ast.IfExp, ast.Lambda)
_COMPREHENSIONS = (ast.GeneratorExp, ast.ListComp, ast.SetComp, ast.DictComp)


@dataclass(frozen=True)
class SourceFile:
    """One file of Python with its syntax tree."""

    path: Path
    text: str
    tree: ast.Module

    @classmethod
    def read(cls, path: Path) -> "SourceFile":
        text = path.read_text(encoding="utf-8")
        return cls(path, text, ast.parse(text))

    @property
    def room(self) -> str:
        """The package and its folder, such as ``orchestrator/studies/sweep``."""
        parts = self.path.relative_to(ROOT).parts
        return "/".join(parts[: min(2, len(parts) - 1)])

    @cached_property
    def walked(self) -> list[ast.AST]:
        """All nodes of the tree, in the order of `ast.walk`, which takes longer than the rules."""
        return list(ast.walk(self.tree))

    @property
    def nodes(self) -> int:
        """Expressions and statements, which no layout changes."""
        return sum(isinstance(node, ast.expr | ast.stmt) for node in self.walked)


Finder = Callable[[SourceFile], Iterator[int]]


def marks_for_the_formatter(source: SourceFile) -> Iterator[int]:
    """Lines that keep code from the formatter."""
    if "# fmt:" not in source.text:  # tokens take a second of all files
        return
    for token in tokenize.generate_tokens(io.StringIO(source.text).readline):
        if token.type == tokenize.COMMENT and re.match(r"# fmt: (skip|off)", token.string):
            yield token.start[0]


def nested_conditionals(source: SourceFile) -> Iterator[int]:
    """Conditional expressions that hold another."""
    for node in source.walked:
        if isinstance(node, ast.IfExp):
            parts = [*ast.iter_child_nodes(node)]
            if any(isinstance(inner, ast.IfExp) for part in parts for inner in ast.walk(part)):
                yield node.lineno


def crowded_statements(source: SourceFile) -> Iterator[int]:
    """Statements with more comprehensions, conditionals and lambdas than one reads at once."""
    for node in source.walked:
        if isinstance(node, ast.stmt):
            expressions = [*_own_expressions(node)]
            cells = {id(value) for inner in expressions for value in _cells_of_a_column(inner)}
            held = sum(isinstance(x, _NESTED) and id(x) not in cells for x in expressions)
            if held > MOST_IN_A_STATEMENT:
                yield node.lineno


def _cells_of_a_column(node: ast.AST) -> list[ast.expr]:
    """The lambdas of a table's column: a list of columns is read row by row, however many it has."""
    if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Column":
        return [value for value in node.args if isinstance(value, ast.Lambda)]
    return []


def _own_expressions(statement: ast.stmt) -> Iterator[ast.AST]:
    """What a statement holds, without the statements inside it."""
    waiting: list[ast.AST] = [*ast.iter_child_nodes(statement)]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.stmt | ast.ExceptHandler | ast.match_case):
            continue
        yield node
        waiting.extend(ast.iter_child_nodes(node))


def long_calls(source: SourceFile) -> Iterator[int]:
    """Calls with more arguments by place than one can tell apart."""
    for node in source.walked:
        if not isinstance(node, ast.Call) or len(node.args) <= MOST_POSITIONAL:
            continue
        if not any(isinstance(argument, ast.Starred) for argument in node.args):
            yield node.lineno


def packs_of_constants(source: SourceFile) -> Iterator[int]:
    """Assignments of several constants at once, which have no place for a reason each."""
    for node in source.walked:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Tuple):
            values = node.value.elts if isinstance(node.value, ast.Tuple) else []
            if len(values) > 1 and all(isinstance(value, ast.Constant) for value in values):
                yield node.lineno


def walruses_outside_conditions(source: SourceFile) -> Iterator[int]:
    """Assignments inside expressions, but for the conditions of if, while and comprehensions."""
    conditions: list[ast.expr] = []
    for node in source.walked:
        if isinstance(node, ast.If | ast.While):
            conditions.append(node.test)
        elif isinstance(node, ast.comprehension):
            conditions.extend(node.ifs)
    allowed = {
        id(inner)
        for condition in conditions
        for inner in ast.walk(condition)
        if isinstance(inner, ast.NamedExpr)
    }
    for node in source.walked:
        if isinstance(node, ast.NamedExpr) and id(node) not in allowed:
            yield node.lineno


def walruses(source: SourceFile) -> Iterator[int]:
    """Assignments inside expressions, wherever they stand."""
    for node in source.walked:
        if isinstance(node, ast.NamedExpr):
            yield node.lineno


def crowded_constructors(source: SourceFile) -> Iterator[int]:
    """Calls of a class with a comprehension in most of their arguments."""
    for node in source.walked:
        if isinstance(node, ast.Call) and _names_a_class(node.func):
            values = [*node.args, *(keyword.value for keyword in node.keywords)]
            crowded = sum(isinstance(value, _COMPREHENSIONS) for value in values)
            if len(values) >= MANY_FIELDS and 2 * crowded > len(values):
                yield node.lineno


def _names_a_class(function: ast.expr) -> bool:
    name = getattr(function, "attr", getattr(function, "id", ""))
    return name[:1].isupper()


def fragments_as_docstrings(source: SourceFile) -> Iterator[int]:
    """Docstrings that begin as half a sentence."""
    for node in source.walked:
        if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Module | ast.AsyncFunctionDef):
            text = ast.get_docstring(node) or ""
            if re.match(r"(What|Whether|Of|As)\b", text):
                yield getattr(node, "lineno", 1)


PARTICIPLES = re.compile(
    r"_?(told|said|named|judged|settled|kept|found|given|taken|made|left|held|meant|shown|asked|gone|put|done|counted|"
    r"listed|sorted|placed|moved|spoilt|spoiled|proven|proved|missed|wanted)$"
)
"""Names that say that something was done, and neither what it is nor what the function does."""


def participles_as_functions(source: SourceFile) -> Iterator[int]:
    """Functions whose name is a bare participle."""
    for node in source.walked:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and PARTICIPLES.match(
            node.name
        ):
            yield node.lineno


def long_functions(source: SourceFile) -> Iterator[int]:
    """Functions that grew beyond what one reads as one idea; no layout changes their size."""
    for node in source.walked:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            held = sum(isinstance(inner, ast.expr | ast.stmt) for inner in ast.walk(node))
            if held > MOST_IN_A_FUNCTION:
                yield node.lineno


RULES: dict[str, Finder] = {
    "marks for the formatter": marks_for_the_formatter,
    "conditionals inside conditionals": nested_conditionals,
    "crowded statements": crowded_statements,
    "calls with more than six positional arguments": long_calls,
    "packs of constants": packs_of_constants,
    "walruses outside of conditions": walruses_outside_conditions,
    "walruses": walruses,
    "constructors full of comprehensions": crowded_constructors,
    "docstrings that begin with What, Whether, Of or As": fragments_as_docstrings,
    "functions named by a bare participle": participles_as_functions,
    "functions that grew too long": long_functions,
}


def product_files() -> list[SourceFile]:
    """The files of the three packages, in the order of their paths."""
    return [
        SourceFile.read(path)
        for package in PRODUCT
        for path in sorted((ROOT / package).rglob("*.py"))
    ]


def count_places(files: list[SourceFile]) -> dict[str, Counter[str]]:
    """Rule → room → number of places."""
    return {
        rule: Counter(source.room for source in files for _ in finder(source))
        for rule, finder in RULES.items()
    }
