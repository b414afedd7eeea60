"""Code keeps to the forms that a reader takes in at once; each rule has a limit, which only falls."""

import ast
import tomllib
from pathlib import Path

import pytest

from tests.support.all_code import asked_of_all_code
from tests.support.form import RULES
from tests.support.source_files import ROOT, SourceFile, product_files

LIMITS = tomllib.loads((Path(__file__).parent / "form.toml").read_text(encoding="utf-8"))

PLANTED = {
    "marks for the formatter": "x = [1,2]  # fmt: skip",
    "conditionals inside conditionals": "x = 1 if a else 2 if b else 3",
    "crowded statements": "f([i for i in a], [i for i in b], 1 if c else 2)",
    "calls with more than six positional arguments": "f(1, 2, 3, 4, 5, 6, 7)",
    "packs of constants": "MOST, LEAST = 3, 0.5",
    "walruses outside of conditions": "x = f(y := 2)",
    "walruses": "if (x := f()):\n    pass",
    "constructors full of comprehensions": "C([i for i in a], [i for i in b], {i for i in c}, d)",
    "docstrings that begin with What, Whether, Of or As": 'def f():\n    """Whether it is."""',
    "functions named by a bare participle": "def told():\n    pass",
    "functions that grew too long": "def f(x):\n" + 100 * "    x = x + 1\n",
}
PLAIN = '''
def count(values):
    """Count the values that are positive."""
    if (first := next(iter(values), None)) is None:
        return 0
    rows = [value for value in values if value > 0]
    return len(rows) if first else f(1, 2, 3, 4, 5, 6, key=7)
'''


@asked_of_all_code
def places_by_rule():
    """Where each rule is broken, as ``path:line``."""
    return {
        rule: [
            f"{source.path.relative_to(ROOT)}:{n}"
            for source in product_files()
            for n in broken_at(source)
        ]
        for rule, broken_at in RULES.items()
    }


def parsed(text):
    return SourceFile(ROOT / "orchestrator" / "studies" / "sweep" / "x.py", text, ast.parse(text))


@pytest.mark.parametrize("rule", RULES)
def test_no_rule_is_broken_more_often_than_its_limit(rule):
    places = places_by_rule()[rule]
    limit = LIMITS[rule]["limit"]
    assert len(places) <= limit, (
        f"{len(places)} {rule}, and {limit} is the most: write the new ones plainly. `python -m tests.benchmarks.form` "
        f"lists them by room and `--rule` each place"
    )


@pytest.mark.parametrize("rule", RULES)
def test_a_rule_finds_what_is_planted_and_nothing_in_plain_code(rule):
    assert list(RULES[rule](parsed(PLANTED[rule])))
    if rule != "walruses":
        assert not list(RULES[rule](parsed(PLAIN)))


def test_each_rule_has_a_limit_that_is_not_below_its_goal():
    assert LIMITS.keys() == RULES.keys()
    assert all(entry["goal"] <= entry["limit"] for entry in LIMITS.values())


def test_a_statement_is_not_charged_for_the_statements_inside_it():
    text = "for i in a:\n    x = 1 if b else 2\n    y = 1 if b else 2\n    z = 1 if b else 2\n"
    assert not list(RULES["crowded statements"](parsed(text)))


def test_nodes_do_not_depend_on_the_layout():
    assert parsed("x = f(1, 2)").nodes == parsed("x = f(\n    1,\n    2,\n)").nodes
