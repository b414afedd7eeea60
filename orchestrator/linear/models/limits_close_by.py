"""A limit or a dead band close to the operating point, by how a component answers perturbations.

An answer that meets it with one size and not with another differs by more than the curvature of something smooth. One
that meets it upwards and not downwards is one-sided: a linear model then takes the side upwards, and says so."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Matrix, Vector

Answer = tuple[Matrix, Matrix]
"""The states' change and d(y), a column for each state or input that was perturbed; of one component, or stacked of
several alike."""

Columns = NDArray[np.bool_]

_AGREE = 5e-3
"""Two sizes agree if every element differs by less than this part of its size. In smooth systems, up to IEEE 118-bus
systems, the part is at most 3e-4; if a signal runs into its limit it is a half."""

_EVEN = 0.1
"""An element whose answers up and down differ by more than this part belongs to a limit on one side; in smooth systems
it is at most 0.05."""

_FAR = 1e-3
"""Movement of a state [pu] in a step, or of an output, by which a limit that it meets is not at the operating point:
the perturbation is multiplied by a large gain, such as that of a stabiliser before a regulator with a derivative."""


@dataclass(frozen=True)
class AnswersOfSize:
    """Answers to one size: central differences with it and with twice it, and the difference upwards.

    ``floors``: rounding of the states' change and of d(y), by which elements may differ as well."""

    once: Answer
    twice: Answer
    upwards: Answer
    floors: tuple[float, float]

    @property
    def disagree(self) -> Columns:
        """Return the columns in which the two sizes tell of a limit or a dead band between them."""
        return self._apart(self.twice, _AGREE)

    @property
    def uneven(self) -> Columns:
        """Return the columns that are answered differently up and down."""
        return self._apart(self.upwards, _EVEN)

    def _apart(self, other: Answer, share: float) -> Columns:
        """Columns in which an answer differs from the first by more than a share of what is there."""
        first = self.once[0]
        far = np.zeros((*first.shape[:-2], first.shape[-1]), dtype=bool)
        for a, b, floor in zip(self.once, other, self.floors, strict=True):
            for some in () if a is b else _columns(a):
                size = np.abs(a[..., some])
                apart = np.abs(a[..., some] - b[..., some]) > share * (size + floor)
                far[..., some] |= apart.any(axis=-2)
        return far


class OneSidedColumns:
    """The columns that a limit on one side answers, from the first size on."""

    def __init__(self, first: AnswersOfSize, size: float) -> None:
        self.now = first.uneven
        self._distant = self.now.copy()
        if self.now.any():
            self._distant &= _movement(first.once) * size > _FAR

    def take_back(self, columns: Sequence[int], smaller: AnswersOfSize) -> None:
        """Take back those that a smaller size answers evenly, where the larger one went to a limit far away."""
        even = ~smaller.uneven & ~smaller.disagree
        self.now[columns] &= ~(even & self._distant[columns])


def _movement(answer: Answer) -> Vector:
    """Return the largest movement per unit in each column of an answer, of the states or of the outputs."""
    largest = np.zeros((*answer[0].shape[:-2], answer[0].shape[-1]))
    for part in answer:
        for some in _columns(part):
            movement = np.abs(part[..., some]).max(axis=-2, initial=0.0)
            largest[..., some] = np.maximum(largest[..., some], movement)
    return largest


_TOGETHER = 64
"""Columns that are looked at together: those of a large network would leave the processor's cache between two looks."""


def _columns(matrix: Matrix) -> Iterator[slice]:
    for first in range(0, matrix.shape[-1], _TOGETHER):
        yield slice(first, first + _TOGETHER)


def without_curvature(once: Answer, twice: Answer) -> Answer:
    """Answers to one side without their curvature, from two sizes of which the second is twice the first.

    The curvature of something smooth adds a part that grows with the size, and it is gone here; a corner, or a limit
    within the sizes, stays."""
    after, outputs = (a if a is b else 2 * a - b for a, b in zip(once, twice, strict=True))
    return after, outputs
