"""The nine buses beside DPsim's EMT solver: ``python -m tests.benchmarks.dpsim_peers`` (``pip install dpsim``).

DPsim has three machines of sixth order with constant excitation and torque, and three phases. Our case has 72 states:
machines with their stators' transients, exciters and governors, and the network in one frame that turns. Both take
100,000 steps of 100 µs. Steps per second are those of the stepping alone, DPsim's once with nothing recorded and once
with 12 signals of every step, ours with the case's signals every 5 ms. Seconds are those of the whole command, ours
with modes, tables, pictures and files.
"""

import math
import re
import subprocess
import sys
import tempfile
import time
from typing import Any

from tests.reference.published import with_subtransients, wscc9

VOLTS, BASE, HERTZ = 230e3, 100e6, 60.0
OHMS, OMEGA = VOLTS**2 / BASE, 2 * math.pi * HERTZ
STEP, STOP = 1e-4, 10.0
LEAST = 1e-4
"""Resistance of the transformers in DPsim [pu]: its lines without any carry no current."""
SYSTEM = with_subtransients(wscc9())
DPSIM = ("python", "-m", "tests.benchmarks.dpsim_peers", "--dpsim")


def flow(d: Any) -> Any:
    """DPsim's power flow, from which its machines start."""
    buses = {k: d.sp.SimNode(f"B{k}", d.PhaseType.Single) for k in range(1, SYSTEM.buses + 1)}
    parts = []
    for machine in SYSTEM.machines:
        part = d.sp.ph1.SynchronGenerator(f"G{machine.bus}", d.LogLevel.off)
        kind = d.PowerflowBusType.VD if machine.bus == SYSTEM.slack else d.PowerflowBusType.PV
        part.set_parameters(BASE, VOLTS, machine.P * BASE, machine.V * VOLTS, kind)
        part.set_base_voltage(VOLTS)
        part.connect([buses[machine.bus]])
        parts.append(part)
    for load in SYSTEM.loads:
        part = d.sp.ph1.Load(f"L{load.bus}", d.LogLevel.off)
        part.set_parameters(load.P * BASE, load.Q * BASE, VOLTS)
        part.modify_power_flow_bus_type(d.PowerflowBusType.PQ)
        part.connect([buses[load.bus]])
        parts.append(part)
    for line in SYSTEM.branches:
        part = d.sp.ph1.PiLine(f"T{line.a}{line.b}", d.LogLevel.off)
        part.set_parameters(line.R * OHMS, line.X * OHMS / OMEGA, line.B / OHMS / OMEGA, 0.0)
        part.set_base_voltage(VOLTS)
        part.connect([buses[line.a], buses[line.b]])
        parts.append(part)
    system = d.SystemTopology(HERTZ, list(buses.values()), parts)
    simulation = d.Simulation("flow", d.LogLevel.off)
    simulation.set_system(system)
    simulation.set_domain(d.Domain.SP)
    simulation.set_solver(d.Solver.NRP)
    simulation.set_solver_component_behaviour(d.SolverBehaviour.Initialization)
    simulation.set_time_step(0.1)
    simulation.set_final_time(0.1)
    simulation.run()
    return system


def simulation(d: Any, *, recorded: bool) -> tuple[Any, list[Any]]:
    """DPsim's EMT simulation of the same system, with the signals of every step in a file if they are wanted, and
    its machines."""
    three = d.Math.single_phase_parameter_to_three_phase
    power = d.Math.single_phase_power_to_three_phase
    buses = {k: d.emt.SimNode(f"B{k}", d.PhaseType.ABC) for k in range(1, SYSTEM.buses + 1)}
    parts, machines = [], []
    for m in SYSTEM.machines:
        part = d.emt.ph3.SynchronGenerator6bOrderVBR(f"G{m.bus}", d.LogLevel.off)
        part.set_operational_parameters_per_unit(
            BASE,
            VOLTS,
            HERTZ,
            m.H,
            m.X_d,
            m.X_q,
            m.X_l,
            m.X_d1,
            m.X_q1,
            m.T_d10,
            m.T_q10,
            m.X_d2,
            m.X_d2,
            m.T_d20,
            m.T_q20,
        )
        part.connect([buses[m.bus]])
        machines.append(part)
    for load in SYSTEM.loads:
        part = d.emt.ph3.RXLoad(f"L{load.bus}", d.LogLevel.off)
        part.set_parameters(power(load.P * BASE), power(load.Q * BASE), VOLTS)
        part.connect([buses[load.bus]])
        parts.append(part)
    for line in SYSTEM.branches:
        part = d.emt.ph3.PiLine(f"T{line.a}{line.b}", d.LogLevel.off)
        part.set_parameters(
            three(max(line.R, LEAST) * OHMS),
            three(line.X * OHMS / OMEGA),
            three(line.B / OHMS / OMEGA),
            three(0.0),
        )
        part.connect([buses[line.a], buses[line.b]])
        parts.append(part)
    system = d.SystemTopology(HERTZ, list(buses.values()), [*machines, *parts])
    system.init_with_powerflow(flow(d), d.Domain.EMT)
    made = d.Simulation("nine_buses", d.LogLevel.off)
    made.set_system(system)
    made.set_domain(d.Domain.EMT)
    made.set_solver(d.Solver.MNA)
    made.set_time_step(STEP)
    made.set_final_time(STOP)
    made.do_system_matrix_recomputation(True)  # its machines change the network's matrix
    if recorded:
        log = d.Logger("nine_buses")
        for name, bus in buses.items():
            log.log_attribute(f"v{name}", "v", bus)
        for machine in machines:
            log.log_attribute(machine.name(), "w_r", machine)
        made.add_logger(log)
    return made, machines


def step_in_dpsim(*, recorded: bool) -> None:
    """Print DPsim's steps per second, after a look at its speeds: it starts at rest."""
    import dpsimpy  # noqa: PLC0415 - is not installed everywhere

    made, machines = simulation(dpsimpy, recorded=recorded)
    made.start()
    begin = time.perf_counter()
    while made.next() < STOP:
        pass
    seconds = time.perf_counter() - begin
    made.stop()
    speeds = [float(machine.attr("w_r").get()) for machine in machines]
    if not all(0.99 < speed < 1.01 for speed in speeds):
        raise SystemExit(f"DPsim's machines do not stay at rest: {speeds}")
    print(f"{STOP / STEP / seconds:.0f} steps/s")


def timed(command: list[str], pattern: str) -> tuple[float, float]:
    """Steps per second that a command prints, and the seconds that all of it takes."""
    with tempfile.TemporaryDirectory() as folder:
        words = [word.format(folder=folder) for word in command]
        begin = time.perf_counter()
        done = subprocess.run(words, check=True, capture_output=True, text=True)
        seconds = time.perf_counter() - begin
    found = re.search(pattern, done.stdout)
    assert found, done.stdout
    return float(found[1].replace(",", "")), seconds


def main() -> None:
    """Print one line for each, the better of two, and the ratios."""
    run = [
        sys.executable,
        "-m",
        "orchestrator.face.cli",
        "run",
        "wscc9",
        "--scenario",
        "base",
        "--step",
        "100 us",
    ]
    run += ["--stop", f"{STOP:g}", "--out", "{folder}/out"]
    peer = [sys.executable, *DPSIM[1:]]
    ours = r"│ +100000 │ +([\d,]+) │"
    rows = {
        "DPsim, nothing recorded": (peer, r"(\d+) steps/s"),
        "DPsim, 12 signals": ([*peer, "recorded"], r"(\d+) steps/s"),
        "native FMUs": ([*run, "--native"], ours),
        "Python-backed FMUs": (run, ours),
    }
    best = {}
    for name, (command, pattern) in rows.items():
        timed(command, pattern)  # fills the caches
        best[name] = max(timed(command, pattern), timed(command, pattern))
        print(f"{name}: {best[name][0]:,.0f} steps/s, {best[name][1]:.2f} s in all", flush=True)
    for name in ("native FMUs", "Python-backed FMUs"):
        silent, full = (
            best[name][0] / best[f"DPsim, {kind}"][0] for kind in ("nothing recorded", "12 signals")
        )
        print(
            f"{name}: {silent:.2f} times DPsim that records nothing, {full:.2f} times DPsim with 12 signals"
        )


if __name__ == "__main__":
    if "--dpsim" in sys.argv:
        step_in_dpsim(recorded="recorded" in sys.argv)
    else:
        main()
