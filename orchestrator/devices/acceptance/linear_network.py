"""A linear network around one instance, stepped where the instance is: no exchange between processes at each step."""

from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Numbers


@dataclass
class LinearNetwork:
    """Equations of one communication step: the inputs are a row + C·x; then x becomes A·x + B·y, with what is read.

    Attributes
    ----------
    A, B, C
        Matrices of shapes (n, n), (n, outputs) and (inputs, n); at most 16 states.
    x
        Its state, shape (n,); every run moves it on.
    """

    A: Numbers
    B: Numbers
    C: Numbers
    x: Numbers

    @property
    def numbers(self) -> Numbers:
        """State and matrices, one after another, as mailbox.c takes them."""
        return np.concatenate([part.ravel() for part in (self.x, self.A, self.B, self.C)])
