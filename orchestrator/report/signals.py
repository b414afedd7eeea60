"""Signals named in a case file: a recorded variable, or the difference of two."""

import xarray as xr

from orchestrator.errors import InputError


def signal(dataset: xr.Dataset, expression: str) -> xr.DataArray | None:
    """``"a.b"`` or ``"a.b - c.d"`` from a recorded dataset; None if a variable was not recorded.

    Raises
    ------
    InputError
        If the expression has another form.
    """
    names = [part.strip() for part in expression.split(" - ")]
    if not 1 <= len(names) <= 2 or not all(names):
        raise InputError(
            f"signal {expression!r}: write 'component.variable' or 'component.variable - component.variable'"
        )
    if any(name not in dataset for name in names):
        return None
    first = dataset[names[0]]
    return first if len(names) == 1 else first - dataset[names[1]]
