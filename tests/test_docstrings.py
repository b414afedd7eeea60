"""On the public face and on models docstrings are complete; inside they stand only where they tell something."""

import ast
import re
from inspect import cleandoc
from pathlib import Path

import pytest

from tests.support.all_code import asked_of_all_code
from tests.support.source_files import product_files, read_source

ROOT = Path(__file__).parents[1]
PLACES = ("orchestrator/face/api", "gfor_fmu")
"""The public face and the product's models."""

INSIDE = ("orchestrator", "fmus/control_dll", "fmus/toolchain", "fmus/vendor_dll")

FILLER = re.compile(
    r"(As (for )?`[\w.]+`( (has|gives|does) (it|them))?|Arguments of ``gfor [\w -]+``"
    r"|(Of|For|In) the (command|same|study|run|case|model|system|component|scenario)s?)\.?"
)
"""Sentences that say nothing of what they stand at."""

LITTLE_WORDS = frozenset(
    re.findall(
        r"\w+",
        "a all an and are as at by for from has in is it its of on one or that the their this to was what with",
    )
)

MANY = 4
"""From so many arguments on, names and types alone no longer say enough."""


def public_functions(node, prefix=""):
    """Public functions of a module, and public methods of its public classes, each with its dotted name."""
    for inner in node.body:
        if not isinstance(
            inner, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
        ) or inner.name.startswith("_"):
            continue
        if isinstance(inner, ast.ClassDef):
            yield from public_functions(inner, f"{prefix}{inner.name}.")
        else:
            yield f"{prefix}{inner.name}", inner


def arguments(function):
    """Names of the arguments, but for ``self`` and ``cls``."""
    listed = function.args
    every = [*listed.posonlyargs, *listed.args, listed.vararg, *listed.kwonlyargs, listed.kwarg]
    return [argument.arg for argument in every if argument and argument.arg not in ("self", "cls")]


def explained(docstring):
    """Names in the section `Parameters`; several of a kind share a line."""
    section = re.search(
        r"^Parameters\n-+\n(.*?)(?=\n\n\w+\n-+\n|\Z)", docstring, re.MULTILINE | re.DOTALL
    )
    lines = section[1].splitlines() if section else []
    heads = [line for line in lines if line and not line.startswith(" ")]
    return [name.strip().lstrip("*") for head in heads for name in head.split(",")]


def functions_of_many_arguments():
    """Place and syntax tree of each."""
    for package in PLACES:
        for path in sorted((ROOT / package).rglob("*.py")):
            place = path.relative_to(ROOT).as_posix()
            for name, function in public_functions(read_source(path).tree):
                if len(arguments(function)) >= MANY:
                    yield f"{place}:{function.lineno} {name}", function


def test_docstrings_explain_every_argument():
    unlike, seen = [], 0
    for place, function in functions_of_many_arguments():
        docstring = cleandoc(ast.get_docstring(function) or "")
        seen += 1
        if not re.match(r"As `[\w.]+`", docstring) and sorted(explained(docstring)) != sorted(
            arguments(function)
        ):
            unlike.append(f"{place}: {explained(docstring)} and not {arguments(function)}")
    assert seen
    assert not unlike, "list every argument under Parameters, and none besides:\n" + "\n".join(
        unlike
    )


DEFINITIONS = (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def documented(nodes):
    """Functions and classes among some nodes that have more to them than a docstring, with its text."""
    for inner in nodes:
        if isinstance(inner, DEFINITIONS) and len(inner.body) > 1:
            text = ast.get_docstring(inner)
            if text and not (
                isinstance(inner.body[1], ast.Expr)
                and isinstance(inner.body[1].value, ast.Constant)
            ):
                yield inner, text


def words(text):
    return {
        word.lower().rstrip("s") for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+", text)
    }


def says_nothing(node, text):
    """Whether a docstring is a filler, or has no word that the name and the arguments do not have."""
    named = words(node.name) | (
        set() if isinstance(node, ast.ClassDef) else words(" ".join(arguments(node)))
    )
    return bool(FILLER.fullmatch(text)) or not (
        words(text) - named - {word.rstrip("s") for word in LITTLE_WORDS}
    )


def inside():
    for source in product_files(*INSIDE):
        if not source.path.is_relative_to(ROOT / "orchestrator/face/api"):
            yield source


@asked_of_all_code
def empty_docstrings():
    """Where a docstring says nothing, and its text."""
    return [
        f"{source.place}:{node.lineno} {node.name}: {text!r}"
        for source in inside()
        for node, text in documented(source.of(*DEFINITIONS))
        if says_nothing(node, cleandoc(text))
    ]


def test_inside_a_docstring_says_what_the_name_does_not():
    empty = empty_docstrings()
    assert not empty, "say what the name does not, or nothing:\n" + "\n".join(empty)


@pytest.mark.parametrize(
    ("source", "empty"),
    [
        ('def run(x):\n    "Of the command."\n    return x', True),
        ('def pointer(self):\n    "As `Component` has it."\n    return 1', True),
        ('def read_details(path):\n    "Read the details."\n    return 1', True),
        ('def read_details(path):\n    "Read the details [pu]."\n    return 1', False),
        ('def zeros(values):\n    "Values below 1e-9."\n    return 1', False),
        ('def end(self):\n    "The end."', False),
    ],
)
def test_an_empty_docstring_is_told_from_one_that_says_something(source, empty):
    nodes = ast.walk(ast.parse(source))
    assert any(says_nothing(node, text) for node, text in documented(nodes)) == empty
