"""The list of mutations has not rotted, and the script tells a mistake that is noticed from one that is not."""

import ast
import subprocess
from collections import Counter
from pathlib import Path

import pytest

from tests.benchmarks.mutations import (
    CAUGHT,
    NOT_APPLICABLE,
    ROOT,
    SURVIVED,
    TOO_SLOW,
    UNCLEAR,
    Mutation,
    Outcome,
    page,
    read_list,
    run_all,
)

MUTATIONS = read_list()


def test_the_list_is_as_long_as_it_should_be_and_names_each_mistake_once():
    assert len(MUTATIONS) >= 100
    assert not [name for name, count in Counter(m.name for m in MUTATIONS).items() if count > 1]


def test_every_mistake_can_still_be_made():
    """Where this fails the code has moved on: give the entry the text of today, or take it out."""
    gone = [
        m.name
        for m in MUTATIONS
        if m.old == m.new or m.applied((ROOT / m.file).read_text(encoding="utf-8")) is None
    ]
    tests = {
        test.partition("::")[0] for m in MUTATIONS for test in m.tests if test.startswith("tests/")
    }
    assert not gone
    assert not [test for test in tests if not (ROOT / test).exists()]


def test_every_mistake_leaves_a_program():
    """Else its tests cannot even be collected, and any test would catch it."""
    for m in MUTATIONS:
        text = m.applied((ROOT / m.file).read_text(encoding="utf-8"))
        if m.file.endswith(".py") and text is not None:
            ast.parse(text, m.name)


def test_indentation_and_line_ends_around_a_mistake_stay():
    one = Mutation("", "", "    return a\n", "    return b\n", ())
    assert one.applied("def f():\n    x = 1\n    return a\n") == (
        "def f():\n    x = 1\n    return b\n"
    )


CODE = """
import time

def double(x):
    return 2 * x

def slow():
    time.sleep(0)
"""
TESTS = """
from code_under_test import double, slow

def test_double(): assert double(3) == 6

def test_zero(): assert double(0) == 0

def test_slow(): slow()

def test_broken(): assert False
"""


def mutation(name, old, new, *tests):
    return Mutation(name, "code_under_test.py", old, new, ("test_it.py", *tests))


@pytest.mark.slow
@pytest.mark.nightly
def test_verdicts_and_the_users_tree(tmp_path):
    """On a repository of two files."""
    root = tmp_path / "repository"
    root.mkdir()
    (root / "code_under_test.py").write_text(CODE, encoding="utf-8")
    (root / "test_it.py").write_text(TESTS, encoding="utf-8")
    subprocess.run(["git", "init", "-q"], cwd=root, check=True)
    before = {path: path.read_bytes() for path in sorted(Path(root).glob("*.py"))}
    cases = {
        CAUGHT: mutation("noticed", "2 * x", "3 * x", "-k", "double"),
        SURVIVED: mutation("not noticed", "2 * x", "3 * x", "-k", "zero"),
        NOT_APPLICABLE: mutation("gone", "4 * x", "3 * x", "-k", "double"),
        UNCLEAR: mutation("fails anyway", "2 * x", "3 * x", "-k", "broken"),
    }
    nothing = mutation("selects nothing", "2 * x", "3 * x", "-k", "no_such_test")
    found = {}
    run_all(
        [*cases.values(), nothing],
        root,
        2,
        100.0,
        lambda m, outcome: found.update({m.name: outcome}),
    )
    for_ever = mutation("for ever", "sleep(0)", "sleep(100)", "-k", "slow")
    run_all([for_ever], root, 1, 4.0, lambda m, outcome: found.update({m.name: outcome}))
    assert {m.name: found[m.name].verdict for m in cases.values()} == {
        m.name: v for v, m in cases.items()
    }
    assert found["selects nothing"].verdict == UNCLEAR
    assert found["for ever"].verdict == TOO_SLOW
    assert found["noticed"].by == "test_it.py::test_double"
    assert {path: path.read_bytes() for path in sorted(Path(root).glob("*.py"))} == before


def test_the_page_counts_what_was_run():
    outcomes = {
        MUTATIONS[0].name: Outcome(CAUGHT, 1.0, "tests/a.py::test_b"),
        MUTATIONS[1].name: Outcome(SURVIVED),
    }
    text = page(MUTATIONS, outcomes)
    assert "**1 of 2 caught**" in text
    assert f"{len(MUTATIONS) - 2} of the list were not run" in text
    # what survived stands first
    assert text.index(f"| {MUTATIONS[1].name} |") < text.index(f"| {MUTATIONS[0].name} |")
