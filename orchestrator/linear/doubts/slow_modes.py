"""Slow modes of a step map that its accuracy does not reach, told beside the eigenvalues without a communication step.

Without governors angle and speed are free, and their zeros lie close to other slow eigenvalues. An error of a step map
splits eigenvalues that lie together by its root, and their signs and frequencies then say nothing."""

from collections.abc import Sequence

import numpy as np

from orchestrator.core.errors import few
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.critical_modes import DENSE
from orchestrator.linear.spectra.modes import Mode, eigenvalues
from orchestrator.linear.spectra.stability import SLOW

# distance from the nearest exact eigenvalue, as a part of its own size, from which a slow mode is told of
_APART = 0.1
_LISTED = 4  # eigenvalues that a sentence lists


def tell_slow_modes(
    model: LinearModel, system: LinearModel | None, shown: Sequence[Mode]
) -> tuple[str, ...]:
    """Return a sentence where a shown mode of a step map is slow and has no exact eigenvalue beside it.

    Parameters
    ----------
    model, system
        The step map, and the continuous model of the same system; None where a component gives no derivatives.
    shown
        Modes of the step map that a table shows.
    """
    slow = [mode.eigenvalue for mode in shown if abs(mode.eigenvalue) <= SLOW]
    if not slow or model.step_size is None or system is None or len(system.names) > DENSE:
        return ()
    exact = eigenvalues(system)
    off = [value for value in slow if abs(exact - value).min() > _APART * abs(value)]
    if not off:
        return ()
    near = exact[(np.abs(exact) <= SLOW) & (exact.imag >= 0)]
    right = near[np.argsort(np.abs(near))].tolist()
    return (
        f"slower than {SLOW:g} rad/s the step map's eigenvalues are not those of the system: it has {_list(off)}, and "
        f"without a communication step there are {_list(right)}; the verdict is by the latter",
    )


def _list(values: Sequence[complex]) -> str:
    return few([_in_words(value) for value in values], _LISTED)


def _in_words(value: complex) -> str:
    real = f"{round(value.real, 4) + 0.0:+.4f}"  # no -0.0000
    return real if abs(value.imag) < 5e-5 else f"{real} ± j{abs(value.imag):.4f}"
