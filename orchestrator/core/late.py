"""Libraries that are imported where they are first used: pandas, xarray and parts of SciPy take a second, and the
modes of a case need none of them.

A module that may do without them imports them from here, and defers its annotations (``from __future__ import
annotations``), which would use the library at once."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import LazyLoader
from typing import TYPE_CHECKING, Any

_PARTS_OF_NUMPY = ("numpy.f2py", "numpy.testing")
"""SciPy takes over every name of NumPy, and so imports these: 45 modules, with unittest, for 0.08 s of processor."""


class Late:
    """A stand-in for a module, which is imported when one of its names is first asked for.

    ``module``: its name, such as ``"xarray"``."""

    def __init__(self, module: str) -> None:
        self._module = module

    def __getattr__(self, name: str) -> Any:
        if (
            name == "__wrapped__"
        ):  # for which `inspect`, and doctest by it, ask every name of a module
            raise AttributeError(name)
        return getattr(import_module(self._module), name)


if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from scipy import interpolate, optimize, signal, stats
else:
    pd, xr = (Late(name) for name in ("pandas", "xarray"))
    interpolate, optimize = (Late(f"scipy.{name}") for name in ("interpolate", "optimize"))
    signal, stats = (Late(f"scipy.{name}") for name in ("signal", "stats"))


class _PutOff:
    """A finder of `_PARTS_OF_NUMPY`, each of which runs when one of its names is first asked for."""

    @staticmethod
    def find_spec(
        name: str, path: Sequence[str] | None = None, target: Any = None
    ) -> ModuleSpec | None:
        spec = PathFinder.find_spec(name, path, target) if name in _PARTS_OF_NUMPY else None
        if spec is not None and spec.loader is not None:
            spec.loader = LazyLoader(spec.loader)
        return spec


def put_off_parts_of_numpy() -> None:
    """Let SciPy import NumPy without its parts that no command uses; whoever uses one has it as ever."""
    if _PutOff not in sys.meta_path:
        sys.meta_path.insert(0, _PutOff)


def import_xarray_alone() -> None:
    """Import xarray as if dask and pint were not installed: its first array would import both, which takes a second.

    xarray remembers what it found: this is for a process that reads files of numbers and ends with its answer. One that
    has xarray already keeps it as it is."""
    if "xarray" in sys.modules:
        return
    with _hidden():
        xr.Dataset({"numbers": ("time", [0.0])}, coords={"time": [0.0]}).isel(time=0).load()
    _Xarray.alone = True


@contextmanager
def xarray_alone() -> Iterator[None]:
    """Keep xarray from importing dask to write a file, in a process that has `import_xarray_alone` behind it.

    It would ask dask who else writes, for which it imports distributed too: half a second."""
    with _hidden() if _Xarray.alone else nullcontext():
        yield


class _Xarray:
    alone = False  # whether it was imported as if dask were not installed


@contextmanager
def _hidden() -> Iterator[None]:
    """Let dask and pint not be found, unless somebody has imported them already."""
    hidden = [name for name in ("dask", "pint") if name not in sys.modules]
    sys.modules.update(dict.fromkeys(hidden))  # type: ignore[arg-type] # None: is not to be found
    try:
        yield
    finally:
        for name in hidden:
            del sys.modules[name]


__all__ = [
    "import_xarray_alone",
    "interpolate",
    "optimize",
    "pd",
    "put_off_parts_of_numpy",
    "signal",
    "stats",
    "xarray_alone",
    "xr",
]
