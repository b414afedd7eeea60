"""Steps a second with a vendor's DLL beside native FMUs of ours: the droop of the tests behind its circuit.

python -m tests.benchmarks.vendor_dlls [DEVICE.toml]
"""

import sys
import tempfile
from pathlib import Path
from time import perf_counter

from fmus.toolchain.catalogue import build_model
from fmus.toolchain.exporter import cached
from fmus.toolchain.native_fmu import NativeFmu
from orchestrator.devices.fmi.description import read_description
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import gauss_seidel
from orchestrator.systems.coupling.system import System
from tests.support.vendor_dlls import droop_device

SECONDS = 2.0
"""Wall-clock time of each measurement [s]."""

STEP = 1e-4


def steps_per_second(path: Path, *, isolated: bool) -> float:
    """Of a device at a bus whose voltage stands, in the compiled loop."""
    system = System()
    system.add("device", read_description(path), isolated=isolated)
    plan = system.components["device"]
    plan.parameters.update({"P_0": 0.6, "Q_0": 0.05, "v_0": 1.0})
    plan.inputs.update({"v_re": 1.0, "v_im": 0.0})
    with Master(system, gauss_seidel([["device"]]), STEP) as master:
        master.advance(1000)
        begin, steps = perf_counter(), 0
        while perf_counter() - begin < SECONDS:
            master.advance(1000)
            steps += 1000
        return steps / (perf_counter() - begin)


def main() -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory() as folder:
        native = cached(NativeFmu(build_model("gfor")))
        devices = {"gfor, native": native}
        for sample in (1e-4, 2e-5, 1e-5):
            place = Path(folder) / f"{sample:g}"
            place.mkdir()
            devices[f"droop as DLL, {1e6 * sample:g} µs"] = droop_device(place, sample=sample)
        devices |= {Path(name).stem: Path(name) for name in sys.argv[1:]}
        print("steps of 100 µs a second")
        print(f"{'device':<24} {'own process':>12} {'in process':>12} {'ratio to gfor':>14}")
        base = 0.0
        for name, path in devices.items():
            apart, inside = (
                steps_per_second(path, isolated=isolated) for isolated in (True, False)
            )
            base = base or apart
            print(f"{name:<24} {apart:>12.0f} {inside:>12.0f} {apart / base:>14.2f}")


if __name__ == "__main__":
    main()
