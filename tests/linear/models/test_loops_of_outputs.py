"""Loops of direct feed-through: found by outputs, in the order in which components stand, and named."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.linearization import check_loops


def blocks(direct: dict[str, list[list[int]]]):
    """Two components of two outputs each that feed each other; ``direct``: D of each."""
    return SimpleNamespace(
        output_names=("a.x", "a.y", "b.x", "b.y"),
        components={name: SimpleNamespace(D=np.array(D, float)) for name, D in direct.items()},
        sources={"a": np.array([2, 3]), "b": np.array([0, 1])},
        window={"a": slice(0, 2), "b": slice(2, 4)},
        linked=lambda name: {},
    )


def test_values_that_do_not_come_back_are_no_loop():
    check_loops(blocks({"a": [[0, 1], [0, 0]], "b": [[1, 0], [0, 0]]}))


@pytest.mark.parametrize(
    "direct",
    [
        {"a": [[1, 0], [0, 0]], "b": [[1, 0], [0, 0]]},
        {"a": [[1, 0], [0, 1]], "b": [[0, 1], [1, 0]]},
    ],
    ids=["over two outputs", "over four"],
)
def test_a_value_that_comes_back_is_a_loop(direct):
    with pytest.raises(AnalysisError, match="an algebraic loop through a, b;"):
        check_loops(blocks(direct))


def test_an_output_that_feeds_its_own_component_is_a_loop():
    one = blocks({"a": [[1, 0], [0, 0]], "b": [[0, 0], [0, 0]]})
    one.sources["a"] = np.array([0, 3])
    with pytest.raises(AnalysisError, match="loop through a;"):
        check_loops(one)


def test_a_delay_opens_a_loop():
    one = blocks({"a": [[1, 0], [0, 0]], "b": [[1, 0], [0, 0]]})
    one.linked = lambda name: {0: 0} if name == "a" else {}
    check_loops(one)
