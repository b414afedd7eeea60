"""Numbers with units, as people write them in a case file: ``"1350 MW"``, ``"100 us"``."""

from functools import cache
from typing import Any

import pint


@cache
def _registry() -> Any:
    registry: Any = pint.UnitRegistry()
    registry.define("per_unit = [per_unit] = pu")
    registry.define("volt_ampere = volt * ampere = VA")
    registry.define("volt_ampere_reactive = volt * ampere = var")
    return registry


def to_unit(value: float | int | str, unit: str) -> float:
    """Convert a value to the unit that is declared for it.

    Parameters
    ----------
    value
        A number, which is taken to be in ``unit`` already, or a text such as ``"1350 MW"``.
    unit
        The declared unit; ``"1"`` or ``""`` for a plain number.

    Raises
    ------
    ValueError
        If the text is not a quantity or its unit does not fit.
    """
    if isinstance(value, int | float):
        return float(value)
    try:
        quantity = _registry().Quantity(value)
    except Exception as error:  # pint lets its parser's errors through
        raise ValueError(f"{value!r} is not a number with a unit") from error
    if not hasattr(quantity, "units"):
        return float(quantity)
    declared = "dimensionless" if unit in ("", "1") else unit
    if quantity.dimensionless and declared != "dimensionless" and str(quantity.units) == "dimensionless":
        return float(quantity.magnitude)
    try:
        return float(quantity.to(declared).magnitude)
    except pint.DimensionalityError as error:
        raise ValueError(f"{value!r} is in {quantity.units:~}, but {unit or 'a plain number'} is needed") from error
