"""Other people's masters, driven as their documentation says: ``python drivers.py MASTER JOB.json RESULT.json …``.

A job says what to couple and needs nothing of this project to be read, so that this file runs under any Python that
has the master, also in an environment of its own::

    fmus        component → path of its FMU, in the order in which the master is given them
    parameters  component → variable → value
    references  component → variable → FMI value reference
    wires       [[component, output], [component, input]], ...
    step_size, stop_time   [s]
    record      [component, output], ...
    ssp, parameter_set   the same as an archive, and the name of the values in it

The result has ``rows``: [label in s, value, ...] as the master records them, one a step, and ``order``, where the
master chose one. Masters may abort when their process ends; the result is complete before.
"""

import csv
import ctypes
import json
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from contextlib import suppress
from pathlib import Path


def steps_of(job):
    return round(job["stop_time"] / job["step_size"])


# -- libcosim ------------------------------------------------------------------------------------


def libcosim_execution(job):
    """A libcosim execution and its slaves by component."""
    from libcosimpy.CosimExecution import CosimExecution  # noqa: PLC0415
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level  # noqa: PLC0415
    from libcosimpy.CosimSlave import CosimLocalSlave  # noqa: PLC0415

    log_output_level(CosimLogLevel.WARNING)
    execution = CosimExecution.from_step_size(round(job["step_size"] * 1e9))
    slaves = {
        name: execution.add_local_slave(CosimLocalSlave(path, name))
        for name, path in job["fmus"].items()
    }
    references = job["references"]
    for name, values in job["parameters"].items():
        for variable, value in values.items():
            initial = (
                execution.boolean_initial_value
                if isinstance(value, bool)
                else execution.real_initial_value
            )
            if not initial(slaves[name], references[name][variable], value):
                raise RuntimeError(f"libcosim refuses {name}.{variable} = {value}")
    for source, target in job["wires"]:
        ends = [
            (slaves[component], references[component][variable])
            for component, variable in (source, target)
        ]
        execution.connect_real_variables(*ends[0], *ends[1])
    return execution, slaves


def libcosim(job):
    from libcosimpy.CosimObserver import CosimObserver  # noqa: PLC0415

    execution, slaves = libcosim_execution(job)
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    rows = []
    for k in range(steps_of(job)):
        if not execution.step(1):
            raise RuntimeError("libcosim: a step failed")
        values = [
            observer.last_real_values(slaves[c], [job["references"][c][v]])[0]
            for c, v in job["record"]
        ]
        rows.append([(k + 1) * job["step_size"], *values])
    return rows, None


# -- Ecos ----------------------------------------------------------------------------------------


def ecos_simulation(job):
    """An initialised simulation."""
    with suppress(OSError):  # pip's tbb lies where no loader looks; Debian's is found by itself
        ctypes.CDLL(
            str(Path(sysconfig.get_path("data")) / "lib" / "libtbb.so.12"), ctypes.RTLD_GLOBAL
        )
    from ecospy import EcosSimulation, EcosSimulationStructure  # noqa: PLC0415

    structure = EcosSimulationStructure()
    for name, path in job["fmus"].items():
        structure.add_model(name, path)
    for source, target in job["wires"]:
        structure.make_real_connection("::".join(source), "::".join(target))
    start = {
        f"{name}::{variable}": value
        for name, vs in job["parameters"].items()
        for variable, value in vs.items()
    }
    structure.add_parameter_set("start", start)
    simulation = EcosSimulation(structure=structure, step_size=job["step_size"])
    simulation.init(parameter_set="start")
    return simulation


def ecospy(job):
    simulation = ecos_simulation(job)
    names = ["::".join(end) for end in job["record"]]
    rows = [[0.0, *(simulation.get_real(name) for name in names)]]
    for k in range(steps_of(job)):
        simulation.step(1)
        rows.append([(k + 1) * job["step_size"], *(simulation.get_real(name) for name in names)])
    return rows, None


# -- FMPy ----------------------------------------------------------------------------------------


def recorded(result, job, name_of):
    """Rows of a structured array."""
    columns = [name_of(end) for end in job["record"]]
    return [[float(row["time"]), *(float(row[c]) for c in columns)] for row in result]


def fmpy_ssp(job):
    from fmpy.ssp.simulation import simulate_ssp  # noqa: PLC0415
    from fmpy.ssp.ssd import Parameter, ParameterSet  # noqa: PLC0415

    values = ParameterSet()
    for component, settings in job["parameters"].items():
        for variable, value in settings.items():
            entry = Parameter()
            entry.name, entry.value = f"{component}.{variable}", value
            values.parameters.append(entry)
    result = simulate_ssp(
        job["ssp"], stop_time=job["stop_time"], step_size=job["step_size"], parameter_set=values
    )
    return recorded(result, job, ".".join), None


def fmpy_container(job):
    from attrs import evolve  # noqa: PLC0415
    from fmpy import read_model_description, simulate_fmu  # noqa: PLC0415
    from fmpy.container_fmu.cli import create_container_fmu  # noqa: PLC0415
    from fmpy.container_fmu.config import Component, Configuration, Connection  # noqa: PLC0415
    from fmpy.model_description import (  # noqa: PLC0415
        CoSimulation,
        DefaultExperiment,
        ModelDescription,
        ModelVariable,
    )

    components = {
        n: Component(n, Path(p), read_model_description(p)) for n, p in job["fmus"].items()
    }
    variables = {
        n: {v.name: v for v in c.modelDescription.modelVariables} for n, c in components.items()
    }
    model = ModelDescription(
        fmiVersion="2.0",
        modelName="Container",
        instantiationToken="{container}",
        modelVariables=[],
        defaultExperiment=DefaultExperiment(
            stopTime=str(job["stop_time"]), stepSize=str(job["step_size"])
        ),
        coSimulation=CoSimulation(fixedInternalStepSize=job["step_size"]),
    )
    model.modelVariables.append(
        ModelVariable(name="time", type="Real", causality="independent", variability="continuous")
    )
    mapping = {}

    def expose(component, name, **attributes):
        inner = variables[component][name]
        outer = ModelVariable(name=f"{component}.{name}", type=inner.type, **attributes)
        model.modelVariables.append(outer)
        mapping[outer] = [(components[component], inner)]

    for component, settings in job["parameters"].items():
        for name, value in settings.items():
            text = str(value).lower() if isinstance(value, bool) else repr(value)
            expose(
                component,
                name,
                causality="parameter",
                variability="fixed",
                initial="exact",
                start=text,
            )
    for component, name in job["record"]:
        expose(component, name, causality="output", variability="continuous", initial="calculated")

    def wired(
        component, name
    ):  # fmpy 0.3.32 writes a connection's type as FMI 2.0 calls it, which its container refuses
        return [evolve(variables[component][name], type="Float64")]

    connections = [
        Connection(components[a], wired(a, out), components[b], wired(b, into))
        for (a, out), (b, into) in job["wires"]
    ]
    folder = Path(tempfile.mkdtemp(prefix="container_"))
    try:
        configuration = Configuration(False, model, list(components.values()), connections, mapping)
        (folder / "parts").mkdir()
        create_container_fmu(configuration, folder / "parts", folder / "Container.fmu")
        result = simulate_fmu(
            folder / "Container.fmu",
            stop_time=job["stop_time"],
            step_size=job["step_size"],
            output_interval=job["step_size"],
            validate=False,
        )
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return recorded(result, job, ".".join), None


# -- FMU containers (fmu-manipulation-toolbox) ---------------------------------------------------


def container(job, folder, sequential, start=()):
    """Build a container; ``start``: values ((component, input), value) of coupled inputs."""
    from fmu_manipulation_toolbox.assembly import AssemblyNode  # noqa: PLC0415

    node = AssemblyNode(
        "container.fmu",
        step_size=job["step_size"],
        sequential=sequential,
        auto_link=False,
        auto_output=False,
    )
    for name, path in job["fmus"].items():
        node.add_fmu(f"{name}.fmu", path)
        for variable, value in job["parameters"].get(name, {}).items():
            node.add_start_value(f"{name}.fmu", variable, str(value).lower())
    for (component, variable), value in start:
        node.add_start_value(f"{component}.fmu", variable, repr(value))
    for (a, out), (b, into) in job["wires"]:
        node.add_link(f"{a}.fmu", out, f"{b}.fmu", into)
    for component, variable in job["record"]:
        node.add_output(f"{component}.fmu", variable, f"recorded.{component}.{variable}")
    node.make_fmu(Path(folder), fmi_version=2)
    return Path(folder) / "container.fmu"


def fmucontainer(job, sequential=False):
    from fmpy import simulate_fmu  # noqa: PLC0415

    with tempfile.TemporaryDirectory(prefix="container_") as folder:
        path = container(job, folder, sequential)
        result = simulate_fmu(
            str(path),
            stop_time=job["stop_time"],
            step_size=job["step_size"],
            output_interval=job["step_size"],
        )
        return recorded(result, job, lambda end: ".".join(("recorded", *end))), None


def fmucontainer_sequential(job):
    return fmucontainer(job, sequential=True)


# -- mosaik --------------------------------------------------------------------------------------


def mosaik(job):
    """Each FMU behind a simulator of mosaik's API; values go on at once in the given order, the others a step later."""
    import mosaik as package  # noqa: PLC0415

    TABLE.clear()
    world = package.World(
        {"FMU": {"python": "mosaik_adapter:Adapter"}, "Rows": {"python": "mosaik_adapter:Rows"}},
        time_resolution=job["step_size"],
    )
    place = list(job["fmus"]).index
    entities, first = {}, {}
    for name, path in job["fmus"].items():
        proxy = world.start("FMU", path=path, name=name, parameters=job["parameters"].get(name, {}))
        entities[name] = proxy.Unit()
        first[name] = proxy.outputs()
    rows = world.start("Rows", record=[".".join(end) for end in job["record"]])
    collector = rows.Table()
    for (a, out), (b, into) in job["wires"]:
        if place(a) < place(b):
            world.connect(entities[a], entities[b], (out, into))
        else:
            world.connect(
                entities[a],
                entities[b],
                (out, into),
                time_shifted=True,
                initial_data={out: first[a][out]},
            )
    for component, variable in job["record"]:
        world.connect(entities[component], collector, (variable, ".".join((component, variable))))
    world.run(until=steps_of(job), print_progress=False)
    return [[k * job["step_size"], *values] for k, values in TABLE], None


TABLE = []
"""What mosaik's collector received: [step, values]."""


# -- PathSim -------------------------------------------------------------------------------------


def pathsim(job):
    from pathsim import Connection, Simulation  # noqa: PLC0415
    from pathsim.blocks import Scope  # noqa: PLC0415
    from pathsim_fmi import CoSimulationFMU  # noqa: PLC0415

    H = job["step_size"]
    blocks = {
        name: CoSimulationFMU(
            path, instance_name=name, start_values=job["parameters"].get(name, {}), dt=H
        )
        for name, path in job["fmus"].items()
    }
    wires = [Connection(blocks[a][out], blocks[b][into]) for (a, out), (b, into) in job["wires"]]
    scope = Scope()
    wires += [Connection(blocks[c][v], scope[i]) for i, (c, v) in enumerate(job["record"])]
    simulation = Simulation([*blocks.values(), scope], wires, dt=H, log=False)
    simulation.run(job["stop_time"])
    times, signals = scope.read()
    return [
        [float(t), *map(float, values)] for t, values in zip(times, signals.T, strict=True)
    ], None


# -- CoFMuPy -------------------------------------------------------------------------------------


def cofmupy(job, method="jacobi"):
    from cofmupy import Coordinator, wrappers  # noqa: PLC0415

    def set_by_type(self, name, value):  # 1.0.0 sets every parameter of FMI 2.0 as a Real
        variable = self.var_name2attr[name]
        (self.fmu.setBoolean if variable.type == "Boolean" else self.fmu.setReal)(
            [variable.valueReference], value
        )

    wrappers.Fmu2Handler._set_variable = set_by_type
    coordinator = Coordinator()
    coordinator.start(
        {
            "fmus": [
                {"id": name, "path": path, "initialization": job["parameters"].get(name, {})}
                for name, path in job["fmus"].items()
            ],
            "connections": [
                {
                    "source": {"type": "fmu", "id": a, "variable": out, "unit": ""},
                    "target": {"type": "fmu", "id": b, "variable": into, "unit": ""},
                }
                for (a, out), (b, into) in job["wires"]
            ],
            "cosim_method": method,
            "iterative": False,
        }
    )
    coordinator.run_simulation(job["step_size"], job["stop_time"])
    results = coordinator.get_results()
    columns = [results["time"], *(results[tuple(end)] for end in job["record"])]
    order = [name for group in coordinator.master.sequence_order for name in group]
    return [
        list(map(float, row)) for row in zip(*columns, strict=True)
    ], order if method == "gauss_seidel" else None


def cofmupy_gauss_seidel(job):
    return cofmupy(job, "gauss_seidel")


# -- the executable of Ecos ----------------------------------------------------------------------


def ecos_executable(job):
    """Not run in this process, but beside it: no Python of ours in it but what is preloaded."""
    with tempfile.TemporaryDirectory(prefix="ecos_") as folder:
        options = {
            "--path": job["ssp"],
            "--parameterSet": job["parameter_set"],
            "--logLevel": "warn",
        }
        options |= {"--stepSize": repr(job["step_size"]), "--stopTime": repr(job["stop_time"])}
        command = [
            *job["command"],
            "simulate",
            *(text for option in options.items() for text in option),
        ]
        done = subprocess.run(
            command, cwd=folder, env=job["environment"], capture_output=True, text=True, check=False
        )
        found = list(Path(folder).rglob("*.csv"))
        if not found:
            raise RuntimeError(
                f"ecos: return code {done.returncode}: {done.stdout[-2000:]}{done.stderr[-2000:]}"
            )
        with found[0].open(newline="") as file:
            lines = [[entry.strip() for entry in line] for line in csv.reader(file)]
    heads = [head.split("[")[0].strip() for head in lines[0]]
    columns = [heads.index("::".join(end)) for end in job["record"]]
    return [
        [float(line[heads.index("time")]), *(float(line[c]) for c in columns)] for line in lines[1:]
    ], None


MASTERS = {
    function.__name__: function
    for function in (
        libcosim,
        ecospy,
        ecos_executable,
        fmpy_container,
        fmpy_ssp,
        fmucontainer,
        fmucontainer_sequential,
        mosaik,
        pathsim,
        cofmupy,
        cofmupy_gauss_seidel,
    )
}


def main():
    name, *paths = sys.argv[1:]
    sys.modules["drivers"] = sys.modules["__main__"]  # mosaik's adapter looks for it by that name
    for job_path, result_path in zip(paths[::2], paths[1::2], strict=True):
        job = json.loads(Path(job_path).read_text(encoding="utf-8"))
        rows, order = MASTERS[name](job)
        Path(result_path).write_text(json.dumps({"rows": rows, "order": order}), encoding="utf-8")


if __name__ == "__main__":
    main()
