"""Libraries that are imported where they are first used: pandas and xarray take most of a second, and the modes of a
case need neither.

A module that may do without them imports them from here, and defers its annotations (``from __future__ import
annotations``), which would use the library at once.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any


class Late:
    """A stand-in for a module, which is imported when one of its names is first asked for.

    ``module``: its name, such as ``"xarray"``.
    """

    def __init__(self, module: str) -> None:
        self._module = module

    def __getattr__(self, name: str) -> Any:
        return getattr(import_module(self._module), name)


if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
else:
    pd, xr = Late("pandas"), Late("xarray")

__all__ = ["pd", "xr"]
