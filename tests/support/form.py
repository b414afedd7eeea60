"""The form of code, counted: what makes a statement hard to read at once, and the size in syntax nodes.

A rule finds places in the syntax tree of one file. Its limit stands in ``tests/form.toml``.
"""

import ast
import io
import re
import tokenize
from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Callable, Iterator

from tests.support.source_files import SourceFile

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
    for node in source.of(ast.IfExp):
        if sum(isinstance(inner, ast.IfExp) for inner in source.within(node)) > 1:
            yield node.lineno


def crowded_statements(source: SourceFile) -> Iterator[int]:
    """Statements with more comprehensions, conditionals and lambdas than one reads at once."""
    lines = sorted(node.lineno for node in source.of(*_NESTED))
    for node in source.of(ast.stmt):
        decorators = getattr(node, "decorator_list", ())
        first = min([node.lineno, *(one.lineno for one in decorators)])
        if bisect_right(lines, node.end_lineno) - bisect_left(lines, first) <= MOST_IN_A_STATEMENT:
            continue
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
    for node in source.of(ast.Call):
        many = len(node.args) > MOST_POSITIONAL
        if many and not any(isinstance(argument, ast.Starred) for argument in node.args):
            yield node.lineno


def packs_of_constants(source: SourceFile) -> Iterator[int]:
    """Assignments of several constants at once, which have no place for a reason each."""
    for node in source.of(ast.Assign):
        if isinstance(node.targets[0], ast.Tuple):
            values = node.value.elts if isinstance(node.value, ast.Tuple) else []
            if len(values) > 1 and all(isinstance(value, ast.Constant) for value in values):
                yield node.lineno


def walruses_outside_conditions(source: SourceFile) -> Iterator[int]:
    """Assignments inside expressions, but for the conditions of if, while and comprehensions."""
    conditions = [node.test for node in source.of(ast.If, ast.While)]
    for node in source.of(ast.comprehension):
        conditions.extend(node.ifs)
    allowed = {
        id(inner)
        for condition in conditions
        for inner in source.within(condition)
        if isinstance(inner, ast.NamedExpr)
    }
    for node in source.of(ast.NamedExpr):
        if id(node) not in allowed:
            yield node.lineno


def walruses(source: SourceFile) -> Iterator[int]:
    """Assignments inside expressions, wherever they stand."""
    for node in source.of(ast.NamedExpr):
        yield node.lineno


def crowded_constructors(source: SourceFile) -> Iterator[int]:
    """Calls of a class with a comprehension in most of their arguments."""
    for node in source.of(ast.Call):
        if _names_a_class(node.func):
            values = [*node.args, *(keyword.value for keyword in node.keywords)]
            crowded = sum(isinstance(value, _COMPREHENSIONS) for value in values)
            if len(values) >= MANY_FIELDS and 2 * crowded > len(values):
                yield node.lineno


def _names_a_class(function: ast.expr) -> bool:
    name = getattr(function, "attr", getattr(function, "id", ""))
    return name[:1].isupper()


def fragments_as_docstrings(source: SourceFile) -> Iterator[int]:
    """Docstrings that begin as half a sentence."""
    for node in source.of(ast.FunctionDef, ast.ClassDef, ast.Module, ast.AsyncFunctionDef):
        if re.match(r"(What|Whether|Of|As)\b", ast.get_docstring(node) or ""):
            yield getattr(node, "lineno", 1)


PARTICIPLES = re.compile(
    r"_?(told|said|named|judged|settled|kept|found|given|taken|made|left|held|meant|shown|asked|gone|put|done|counted|"
    r"listed|sorted|placed|moved|spoilt|spoiled|proven|proved|missed|wanted)$"
)
"""Names that say that something was done, and neither what it is nor what the function does."""


def participles_as_functions(source: SourceFile) -> Iterator[int]:
    """Functions whose name is a bare participle."""
    for node in source.of(ast.FunctionDef, ast.AsyncFunctionDef):
        if PARTICIPLES.match(node.name):
            yield node.lineno


def long_functions(source: SourceFile) -> Iterator[int]:
    """Functions that grew beyond what one reads as one idea; no layout changes their size."""
    for node in source.of(ast.FunctionDef, ast.AsyncFunctionDef):
        inside = source.within(node)
        if len(inside) <= MOST_IN_A_FUNCTION:
            continue
        if sum(isinstance(inner, ast.expr | ast.stmt) for inner in inside) > MOST_IN_A_FUNCTION:
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


def count_places(files: list[SourceFile]) -> dict[str, Counter[str]]:
    """Rule → room → number of places."""
    return {
        rule: Counter(source.room for source in files for _ in finder(source))
        for rule, finder in RULES.items()
    }
