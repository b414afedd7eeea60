"""Signals named in a case file: a recorded variable, or the difference of two."""

import numpy as np
import xarray as xr

from orchestrator.cases.names import variables_of


def signal(dataset: xr.Dataset, expression: str) -> xr.DataArray | None:
    """``"a.b"`` or ``"a.b - c.d"`` from a recorded dataset; None if a variable was not recorded.

    Raises
    ------
    InputError
        If the expression has another form.
    """
    names = variables_of(expression)
    if any(name not in dataset for name in names):
        return None
    first = dataset[names[0]]
    return first if len(names) == 1 else first - dataset[names[1]]


def relative_difference(simulated: xr.DataArray, linear: xr.DataArray) -> float:
    """Largest difference of two responses at the same times, as a share of the first one's largest deviation."""
    deviation = float(np.abs(simulated.values - simulated.values[0]).max())
    both = min(len(simulated), len(linear))  # a run that failed is shorter
    return float(np.abs(simulated.values[:both] - linear.values[:both]).max()) / deviation if deviation else np.nan
