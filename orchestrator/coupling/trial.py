"""Whether several threads are faster than one, found out by running both ways in turns."""

_BLOCK = 50  # communication steps done one way before the other has its turn
_BLOCKS = 8  # of a trial, half of them each way: other programs on the same cores disturb both alike
_VALID = 5000
"""Communication steps for which a trial's outcome counts; another follows, because the load of a machine changes."""


class Trial:
    def __init__(self) -> None:
        self._seconds, self._left = [0.0, 0.0], _BLOCK
        self._block: int | None = 0
        self.together = False

    @property
    def most(self) -> int:
        """Communication steps until the way may change."""
        return self._left

    def took(self, steps: int, seconds: float) -> None:
        self._left -= steps
        if self._block is not None:
            self._seconds[self.together] += seconds
        if self._left > 0:
            return
        block = 0 if self._block is None else self._block + 1
        if block < _BLOCKS:
            if block == 0:
                self._seconds = [0.0, 0.0]
            self._block, self.together, self._left = block, block % 2 == 1, _BLOCK
        else:
            alone, together = self._seconds
            self._block, self.together, self._left = None, together < alone, _VALID
