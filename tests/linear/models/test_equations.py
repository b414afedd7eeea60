"""Blocks of components become sparse matrices: the sums of the blocks, alike for few numbers and for many."""

import numpy as np
import pytest

from orchestrator.linear.models import linear_model
from orchestrator.linear.models.linear_model import Equations

STATES, WIRES = 7, 5


def equations():
    """Two components; the second writes into places of the first, and cancels one of its numbers."""
    made = Equations(STATES, WIRES)
    draw = np.random.default_rng(3)
    A, B = draw.standard_normal((4, 4)), draw.standard_normal((4, 2))
    A[0, 1] = B[2, 0] = 0.0
    made.next_state(slice(0, 4), slice(0, 4), A, np.array([4, 1]), B)
    made.next_state(slice(3, 7), slice(0, 4), -A[::-1], np.array([1, 1]), B)
    made.output(np.array([3, 0]), slice(2, 4), A[:2, :2], np.array([2, 4]), B[:2])
    F, G, K = np.zeros((STATES, STATES)), np.zeros((STATES, WIRES)), np.zeros((WIRES, WIRES))
    F[:4, :4] = A
    F[3:, :4] -= A[::-1]
    G[:4, [4, 1]] = B
    G[3:, 1] += B.sum(axis=1)
    K[np.ix_([3, 0], [2, 4])] = B[:2]
    return made, {"F": F, "G": G, "K": K}


def model(made):
    return made.model([f"a.x{k}" for k in range(STATES)], 1e-3, 0.0, {})


def test_matrices_are_the_sums_of_the_blocks():
    made, expected = equations()
    found = model(made)
    for name, matrix in expected.items():
        assert getattr(found, name).toarray() == pytest.approx(matrix, abs=1e-15)


def test_few_numbers_and_many_are_put_together_to_the_same_bits(monkeypatch):
    few = model(equations()[0])
    monkeypatch.setattr(linear_model, "_FEW", 0)
    many = model(equations()[0])
    for name in ("F", "G", "H", "K"):
        for part in ("data", "indices", "indptr"):
            one, other = (getattr(getattr(found, name), part) for found in (few, many))
            assert one.dtype == other.dtype
            assert one.tobytes() == other.tobytes()


def test_a_state_that_nothing_moves_is_told_whatever_it_moves_itself():
    made = Equations(3, 1)
    made.next_state(slice(0, 1), slice(0, 1), np.eye(1), np.array([0]), np.zeros((1, 1)))
    made.next_state(
        slice(1, 2), slice(0, 2), np.array([[0.5, 1.0]]), np.array([0]), np.zeros((1, 1))
    )
    made.next_state(slice(2, 3), slice(2, 3), np.eye(1), np.array([0]), np.ones((1, 1)))
    assert made.model(["a.clock", "a.x", "a.y"], 1e-3, 0.0, {}).unmoved == ("a.clock",)
