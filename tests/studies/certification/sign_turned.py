"""FMUs of our converter with one damping controller's sign turned, to see the damping test fail.

The converter itself takes no negative gain. ``python -m tests.studies.certification.sign_turned FOLDER`` writes
``gfor_pod_p_turned.fmu`` and ``gfor_pod_q_turned.fmu``; ``gfor certify`` on them with ``--pod p`` or ``--pod q`` gives
the rows "sign turned" of the page on the damping test, with ``--set pod_p.K=2000`` or ``--set pod_q.K=2000`` those of
the tenfold gain.
"""

import shutil
import sys
from pathlib import Path
from unittest import mock

import gfor_fmu.converter as converter_module
from fmus.toolchain.exporter import cached
from fmus.toolchain.model import Model
from fmus.toolchain.native_fmu import NativeFmu


def turned(controller: str) -> Model:
    """The converter with the sign of ``pod_p`` or ``pod_q`` turned around."""
    original = converter_module.pod

    def other_sign(m, name, deviation, *, sign, **settings):
        return original(m, name, deviation, sign=-sign if name == controller else sign, **settings)

    with mock.patch.object(converter_module, "pod", other_sign):
        return converter_module.grid_forming_converter()


def write(folder: Path) -> list[Path]:
    """Both FMUs, as files in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    return [
        Path(shutil.copyfile(cached(NativeFmu(turned(name))), folder / f"gfor_{name}_turned.fmu"))
        for name in ("pod_p", "pod_q")
    ]


if __name__ == "__main__":
    for path in write(Path(sys.argv[1])):
        print(path)
