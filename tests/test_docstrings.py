"""Who calls a function with many arguments reads in its docstring what each of them is."""

import ast
import re
from inspect import cleandoc
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PLACES = ("orchestrator/api", "gfor_fmu")
"""The public face and the product's models. Inside, a docstring says what name and types do not."""

MANY = 4
"""From so many arguments on, names and types alone no longer say enough."""


def public_functions(node, prefix=""):
    """Public functions of a module, and public methods of its public classes, each with its dotted name."""
    for inner in node.body:
        if not isinstance(inner, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) or inner.name.startswith("_"):
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
    section = re.search(r"^Parameters\n-+\n(.*?)(?=\n\n\w+\n-+\n|\Z)", docstring, re.MULTILINE | re.DOTALL)
    lines = section[1].splitlines() if section else []
    heads = [line for line in lines if line and not line.startswith(" ")]
    return [name.strip().lstrip("*") for head in heads for name in head.split(",")]


def found():
    for package in PLACES:
        for path in sorted((ROOT / package).rglob("*.py")):
            place = path.relative_to(ROOT).as_posix()
            for name, function in public_functions(ast.parse(path.read_text(encoding="utf-8"), place)):
                if len(arguments(function)) >= MANY:
                    yield pytest.param(function, id=f"{place}:{name}")


@pytest.mark.parametrize("function", list(found()))
def test_docstring_explains_every_argument(function):
    docstring = cleandoc(ast.get_docstring(function) or "")
    if re.match(r"As `[\w.]+`", docstring):
        return
    assert sorted(explained(docstring)) == sorted(arguments(function)), (
        f"line {function.lineno}: list every argument of {function.name} under Parameters, and none besides"
    )
