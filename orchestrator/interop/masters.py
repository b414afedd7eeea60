"""Masters whose schedules are known: each was driven with the probe pair and with whole systems (tests/interop)."""

from orchestrator.errors import InputError
from orchestrator.interop.rules import MasterRules

LIBCOSIM = MasterRules(
    name="libcosim",
    title="libcosim (libcosimpy 0.0.6)",
    steps="side by side",
    ticks_per_second=1_000_000_000,
    source="fixed-step algorithm: outputs are transferred during initialisation until each component was reached, then "
    "all step and all transfer; observers are handed what was read after the step. Time is kept in nanoseconds",
)

ECOS = MasterRules(
    name="ecos", title="Ecos (ecospy 0.7.2)", steps="side by side", after_exchange=True,
    source="as libcosim, but every property is read again after the transfer, before listeners see it",
)  # fmt: skip

ECOS_EXECUTABLE = MasterRules(
    name="ecos_executable",
    title="the executable ecos 0.7.2",
    steps="side by side",
    after_exchange=True,
    last_label="sum up to stop",
    source="Ecos behind a command line; its CSV has six decimals; how many rows it writes was measured, with steps "
    "of 0.1, 0.125 and 0.3 s",
)

FMPY_CONTAINER = MasterRules(
    name="fmpy_container",
    title="FMPy 0.3.32, container FMU in simulate_fmu",
    steps="side by side",
    first_inputs="once",
    wire_by_wire=True,
    after_exchange=True,
    source="connections are served one after the other after each step: an output with direct feed-through is read "
    "with the inputs that those before it have set",
)

FMPY_SSP = MasterRules(
    name="fmpy_ssp",
    title="FMPy 0.3.32, simulate_ssp",
    steps="side by side",
    first_inputs="zero",
    early_label=1,
    last_label="sum below stop",
    source="fmpy/ssp/simulation.py: connectors start from 0 and nothing is propagated; the row is written after the "
    "step, with the time before it; the loop runs while the summed-up time is less than the stop time",
)

FMUCONTAINER = MasterRules(
    name="fmucontainer",
    title="FMU container (fmu-manipulation-toolbox 2.0)",
    steps="side by side",
    source="a container's own master; consistent where its first FMU's outputs do not depend directly on inputs, which "
    "it initialises from their start values (it warns of such loops)",
)

FMUCONTAINER_SEQUENTIAL = MasterRules(
    name="fmucontainer_sequential",
    title="FMU container, -sequential",
    steps="in turn",
    source="as above; each FMU steps after those before it have given their outputs",
)

MOSAIK = MasterRules(
    name="mosaik",
    title="mosaik 3.6 with an FMU adapter",
    steps="in turn",
    first_inputs="once",
    early_label=1,
    last_label="before stop",
    source="a simulator's step at time k goes from k to k + 1 and what it gives bears the time k; time-shifted "
    "connections begin with initial data, here the outputs after initialisation",
)

PATHSIM = MasterRules(
    name="pathsim",
    title="PathSim 0.27 with pathsim-fmi 0.1.1",
    steps="in turn",
    first_inputs="once",
    early_label=1,
    source="CoSimulationFMU steps in an event scheduled from t = 0 on, blocks one after the other with an update in "
    "between: a run of N intervals takes N + 1 steps",
)

COFMUPY = MasterRules(
    name="cofmupy",
    title="CoFMuPy 1.0.0, Jacobi",
    steps="side by side",
    first_inputs="zero",
    early_label=1,
    last_label="sum below stop",
    source="default_master.py: inputs start from 0; the time is noted before the step; the loop runs while the "
    "summed-up time is less than the end",
)

COFMUPY_GAUSS_SEIDEL = MasterRules(
    name="cofmupy_gauss_seidel",
    title="CoFMuPy 1.0.0, Gauss-Seidel",
    steps="in turn",
    first_inputs="zero",
    early_label=1,
    last_label="sum below stop",
    source="as above; components of a loop step in the order of a Python set, which differs from process to process "
    "unless PYTHONHASHSEED is set: read coordinator.master.sequence_order",
)

MASTERS = {
    rules.name: rules
    for rules in (
        LIBCOSIM, ECOS, ECOS_EXECUTABLE, FMPY_CONTAINER, FMPY_SSP, FMUCONTAINER, FMUCONTAINER_SEQUENTIAL, MOSAIK,
        PATHSIM, COFMUPY, COFMUPY_GAUSS_SEIDEL,
    )
}  # fmt: skip


def master_rules(name: str) -> MasterRules:
    if name not in MASTERS:
        raise InputError(f"there is no master {name!r} to run like; known are: {', '.join(MASTERS)}")
    return MASTERS[name]
