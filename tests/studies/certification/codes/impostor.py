"""An FMU of our grid-following converter with a virtual inertia, which declares one and is no voltage source."""

import shutil
from pathlib import Path
from unittest import mock

from fmus.grid_following import outer_control
from fmus.grid_following.converter import grid_following_converter
from fmus.toolchain.exporter import cached
from fmus.toolchain.native_fmu import NativeFmu


def write_impostor(inertia: float, folder: Path, lag: float = 0.2) -> Path:
    """The FMU, in a folder.

    Parameters
    ----------
    inertia
        H by which its power follows the rate of change of the PLL's frequency [s].
    folder
        Where the file goes.
    lag
        Of the filter that takes the rate of change [s].
    """
    original = outer_control._active_error

    def with_inertia(m, P_0, P_f, w):
        error, gain = original(m, P_0, P_f, w)
        with m.scope("virtual_inertia"):
            H = m.parameter("H", inertia, "s", "Virtual inertia", tunable=True, source="made up")
            slow = m.state("w", 1, "pu", "Filtered frequency", base="f_n")
            m.derivative(slow, (w - slow) / lag)
        return error - 2 * H * (w - slow) / lag, gain

    with mock.patch.object(outer_control, "_active_error", with_inertia):
        model = grid_following_converter()
    return Path(shutil.copyfile(cached(NativeFmu(model)), folder / f"gfl_H_{inertia:g}.fmu"))
