"""An FMU of our converter with one droop's sign turned, to see the envelopes notice it."""

import shutil
from dataclasses import replace
from pathlib import Path
from unittest import mock

import gfor_fmu.converter as converter_module
from fmus.toolchain.exporter import cached
from fmus.toolchain.native_fmu import NativeFmu


def write_wrong(droop: str, folder: Path) -> Path:
    """The FMU, in a folder.

    Parameters
    ----------
    droop
        ``R_f`` or ``R_V``.
    folder
        Where the file goes.
    """
    name = {"R_f": "frequency", "R_V": "voltage_reference"}[droop]
    original = getattr(converter_module, name)

    def turned(d, supplementary):
        return original(replace(d, **{droop: -getattr(d, droop)}), supplementary)

    with mock.patch.object(converter_module, name, turned):
        model = converter_module.grid_forming_converter()
    return Path(shutil.copyfile(cached(NativeFmu(model)), folder / f"gfor_{droop}_turned.fmu"))
