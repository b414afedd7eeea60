"""What it costs to run an FMU in a process of its own: microseconds a communication step, in process and isolated.

python -m tests.benchmarks.isolation
"""

import sys
import tempfile
from pathlib import Path
from time import perf_counter

from fmus.toolchain.catalogue import build_model
from fmus.toolchain.exporter import cached
from fmus.toolchain.python_fmu import PythonFmu
from orchestrator.devices.fmi.description import read_description
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import jacobi
from orchestrator.systems.coupling.system import System
from tests.devices.acceptance.gallery.build import build
from tests.devices.acceptance.gallery.members import converter

STEPS = 50_000


def microseconds(path: Path, *, isolated: bool) -> tuple[float, float]:
    """Of a communication step with inputs and outputs, in the compiled loop; and seconds to start."""
    system = System()
    system.add("box", read_description(path), isolated=isolated)
    system.add("grid", read_description(path), inputs={"v_re": 1.0, "v_im": 0.0}, isolated=False)
    system.connect("grid.omega", "box.v_re")
    system.connect("grid.omega", "box.v_im")
    begin = perf_counter()
    with Master(system, jacobi(("grid", "box")), 1e-4) as master:
        started = perf_counter() - begin
        master.advance(1000)
        before = master._loop.seconds()[1]
        master.advance(STEPS)
        return 1e6 * (master._loop.seconds()[1] - before) / STEPS, started


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        paths = {
            "C, 5 states": build(converter("converter"), Path(folder)),
            "gfor, Python-backed": cached(PythonFmu(build_model("gfor"))),
        }
        for name, path in paths.items():
            inside, _ = microseconds(path, isolated=False)
            outside, start = microseconds(path, isolated=True)
            print(
                f"{name}: {inside:.2f} us in process, {outside:.2f} us isolated, started in {start:.2f} s"
            )


if __name__ == "__main__":
    sys.exit(main())
