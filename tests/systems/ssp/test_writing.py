"""``gfor export ssp``: archives that are valid, complete for us, and open to others."""

import ctypes
import json
import sysconfig
import zipfile
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import Parameter, ParameterSet, find_components, read_ssd, read_ssv, validate_tree
from lxml import etree

from orchestrator.cases.case import load_case
from orchestrator.face.cli import main
from orchestrator.studies.modes.modes import compute_modes
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.schedule import jacobi
from tests.support.scenarios import prepare_one
from tests.systems.coupling.small_fmus import small_fmu

pytestmark = pytest.mark.usefixtures("undrawn")

SMALL_CASE = f"""
name = "small"
title = "Two integrators and a source"
[solver]
step_size = "1 ms"
stop_time = "0.3 s"
record_interval = "2 ms"
groups = [["b"], ["a", "spare"], ["source"]]
[components.a]
fmu = "{small_fmu("integrator").path.as_posix()}"
parameters = {{ gain = 30.0, x_0 = 0.1 }}
[components.b]
fmu = "{small_fmu("integrator").path.as_posix()}"
parameters = {{ gain = -20.0 }}
[components.spare]
fmu = "{small_fmu("gain").path.as_posix()}"
inputs = {{ u = 0.7 }}
[components.source]
fmu = "{small_fmu("power_source").path.as_posix()}"
parameters = {{ P = "1500 kW" }}
[[connections]]
from = "a.y"
to = "b.u"
[[connections]]
from = "b.y"
to = "a.u"
[[events]]
type = "parameter_change"
time = "0.1 s"
component = "source"
parameter = "on"
value = false
[[events]]
type = "parameter_change"
time = "0.2 s"
component = "spare"
parameter = "K"
value = 0.1
[[events]]
type = "parameter_change"
time = "0.2 s"
component = "spare"
parameter = "u"
value = 0.3333333333333333
"""


def response(scenario):
    """Everything that is recorded of a scenario, as one array."""
    recorder = Recorder(scenario.record, scenario.record_every)
    with Master(
        scenario.system, scenario.schedule, scenario.step_size, scenario.stop_time
    ) as master:
        master.run(scenario.stop_time, scenario.events, [recorder])
    return recorder.names, np.column_stack([recorder.times, recorder.values])


@pytest.fixture
def small(tmp_path):
    """A small case and its SSP."""
    case, target = tmp_path / "small.toml", tmp_path / "out" / "small.ssp"
    case.write_text(SMALL_CASE, encoding="utf-8")
    assert main(["export", "ssp", str(case), "--out", str(target)]) == 0
    return case, target


@pytest.fixture(scope="module")
def two_area(tmp_path_factory):
    """SSPs of the two-area system, one a scenario."""
    folder = tmp_path_factory.mktemp("two_area")
    assert main(["export", "ssp", "two_area", "--out", str(folder)]) == 0
    return {
        name: folder / f"two_area_{name}.ssp"
        for name in ("base", "gfor", "pod_p", "pod_q", "pod_pq")
    }


# -- round trip ------------------------------------------------------------------------------------


def test_a_small_case_comes_back_as_it_was(small):
    case, ssp = small
    (before,), (after,) = load_case(case).prepare(), load_case(ssp).prepare()
    assert [str(e) for e in after.events] == [str(e) for e in before.events]
    assert len(after.events) == 3
    for attribute in (
        "name",
        "title",
        "schedule",
        "step_size",
        "stop_time",
        "record",
        "record_every",
        "values",
    ):
        assert getattr(after, attribute) == getattr(before, attribute), attribute
    assert after.system.connections == before.system.connections
    (names, values), (names_again, values_again) = response(before), response(after)
    assert names == names_again
    assert np.array_equal(values, values_again)
    spare, source = values[:, 1 + names.index("spare.y")], values[:, 1 + names.index("source.p")]
    assert set(spare.tolist()) == {0.7, 0.1 * 0.3333333333333333}
    assert set(source.tolist()) == {1.5, 0.0}


@pytest.mark.parametrize("name", ["base", "pod_pq"])
def test_the_two_area_system_comes_back_to_the_last_bit(two_area, name):
    case, again = load_case("two_area"), load_case(two_area[name])
    (before,), (after,) = case.prepare([name], stop_time=1.5), again.prepare(stop_time=1.5)
    assert after.values == before.values
    (names, values), (names_again, values_again) = response(before), response(after)
    assert names == names_again
    assert np.ptp(values[:, 1 + names.index("sg1.omega")]) > 1e-5
    assert np.array_equal(values, values_again)
    modes, modes_again = compute_modes(before), compute_modes(after)
    assert np.array_equal(modes.model.A, modes_again.model.A)
    assert modes.electromechanical.eigenvalue == modes_again.electromechanical.eigenvalue
    assert modes_again.references == modes.references


@pytest.mark.slow
def test_many_units_and_a_unit_s_trip_come_back_too(tmp_path):
    target = tmp_path / "trip.ssp"
    assert main(["export", "ssp", "ieee39", "--scenario", "unit_trip", "--out", str(target)]) == 0
    assert_valid(target)
    (before,), (after,) = (
        load_case("ieee39").prepare(["unit_trip"], stop_time=1.2),
        load_case(target).prepare(stop_time=1.2),
    )
    (names, values), (names_again, values_again) = response(before), response(after)
    assert names == names_again
    assert np.ptp(values[:, 1 + names.index("sg36.p")]) > 0.5  # it feeds nothing any more
    assert np.array_equal(values, values_again)


def test_all_commands_take_an_ssp(two_area, tmp_path, capsys):
    ssp = str(two_area["pod_p"])
    assert main(["modes", ssp, "--set", "gfor.pod_p.K=300", "--json"]) == 0
    with_ssp = json.loads(capsys.readouterr().out)
    assert (
        main(["modes", "two_area", "--scenario", "pod_p", "--set", "gfor.pod_p.K=300", "--json"])
        == 0
    )
    without = json.loads(capsys.readouterr().out)
    assert with_ssp["scenarios"][0].pop("power_flow") is None  # an SSP holds its result alone
    assert without["scenarios"][0].pop("power_flow")["machines"]
    assert with_ssp["scenarios"][0].pop("models") is None  # nor which kind of models its FMUs are
    assert without["scenarios"][0].pop("models") == "emt"
    bases = [found["scenarios"][0].pop("basis") for found in (with_ssp, without)]
    assert bases[0]["machines"] == bases[1]["machines"], bases
    assert with_ssp == without
    assert main(["run", ssp, "--stop", "0.2", "--out", str(tmp_path / "run")]) == 0
    assert main(["report", str(tmp_path / "run")]) == 0
    assert main(["export", "linear", ssp, "--out", str(tmp_path / "linear")]) == 0
    assert "62 states, 1 inputs, 7 outputs" in capsys.readouterr().out
    assert (tmp_path / "linear" / "pod_p" / "A.csv").exists()


def test_mistakes_in_values_are_told_with_their_place(two_area, capsys):
    assert main(["modes", str(two_area["base"]), "--set", "sg1.S_n=-5"]) == 2
    assert "--set sg1.S_n: S_n = -5 MVA; it must be at least" in capsys.readouterr().err


# -- the archive -----------------------------------------------------------------------------------


def test_equal_contents_give_equal_files(small, tmp_path):
    case, ssp = small
    again = tmp_path / "again.ssp"
    assert main(["export", "ssp", str(case), "--out", str(again)]) == 0
    assert again.read_bytes() == ssp.read_bytes()


def test_several_scenarios_do_not_go_into_one_file(tmp_path, capsys):
    assert main(["export", "ssp", "two_area", "--out", str(tmp_path / "all.ssp")]) == 2
    assert "an SSP holds one scenario, not base, gfor" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_each_fmu_is_packed_once(small):
    with zipfile.ZipFile(small[1]) as archive:
        members = archive.namelist()
    assert sorted(m for m in members if m.endswith(".fmu")) == [
        "resources/small_gain.fmu",
        "resources/small_integrator.fmu",
        "resources/small_power_source.fmu",
    ]
    assert members[0] == "SystemStructure.ssd"


def assert_valid(path):
    """All files of an archive against the schemas of SSP 1.0, and every unit against its definition."""
    with zipfile.ZipFile(path) as archive:
        for member in archive.namelist():
            if member.endswith(".fmu"):
                continue
            root = etree.fromstring(archive.read(member))
            schema = "Description" if member.endswith(".ssd") else "ParameterValues"
            validate_tree(root, f"SystemStructure{schema}.xsd")
            defined = set(root.xpath("//*[local-name()='Unit']/@name"))
            assert set(root.xpath("//*[local-name()='Real']/@unit")) <= defined
            assert defined


def test_the_files_are_valid(small, two_area):
    for path in (small[1], *two_area.values()):
        assert_valid(path)


# -- other tools -----------------------------------------------------------------------------------


def typed_values(path):
    """What the archive's bindings say, as fmpy's `simulate_ssp` wants to be told; it does not look at them itself."""
    given = ParameterSet(name="all")
    for component in find_components(read_ssd(str(path)).system):
        for binding in component.parameterBindings:
            for p in read_ssv(str(path), resource=binding.source).parameters:
                value = p.value == "true" if p.type == "Boolean" else float(p.value)
                given.parameters.append(
                    Parameter(name=f"{component.name}.{p.name}", type=p.type, value=value)
                )
    return given


def test_fmpy_reads_the_structure(two_area):
    description = read_ssd(str(two_area["gfor"]))
    assert [c.name for c in description.system.elements] == ["gfor", "sg1", "sg2", "grid"]
    assert len(description.system.connections) == 12
    assert {u.name for u in description.units} >= {"pu", "rad"}


@pytest.mark.interop
def test_fmpy_runs_the_small_system_as_its_own_schedule_has_it(small):
    """fmpy holds all inputs at zero over the first step, and then steps all components side by side."""
    result = simulate_ssp(
        str(small[1]), stop_time=0.0505, step_size=1e-3, parameter_set=typed_values(small[1])
    )
    a, b, u_a, u_b = 0.1, 0.0, 0.0, 0.0
    for row in result:
        a, b = a + 1e-3 * 30 * u_a, b - 1e-3 * 20 * u_b
        u_a, u_b = b, a
        assert row["a.y"] == pytest.approx(a, abs=1e-14)
        assert row["b.y"] == pytest.approx(b, abs=1e-14)
    assert len(result) == 51
    assert result["source.p"] == pytest.approx(1.5)


@pytest.mark.interop
def test_fmpy_runs_the_two_area_system(two_area):
    """It takes its first step at zero voltage; what is left of that kick is the difference to our run."""
    result = simulate_ssp(
        str(two_area["pod_p"]),
        stop_time=0.5,
        step_size=1e-4,
        parameter_set=typed_values(two_area["pod_p"]),
    )
    scenario = prepare_one(two_area["pod_p"], stop_time=0.5)
    names, values = response(scenario)
    for name in ("sg1.omega", "sg2.omega"):
        theirs, ours = result[name][:5000:50], values[:100, 1 + names.index(name)]
        assert theirs == pytest.approx(ours, abs=2e-5)
    assert all(b > a for a, b in pairwise(result["time"]))


def libcosim(path):
    """Step on the archive as it is; structure, values and step come from it. Yields a function that reads a value."""
    cosim = pytest.importorskip("libcosimpy.CosimExecution")
    observers = pytest.importorskip("libcosimpy.CosimObserver")
    execution = cosim.CosimExecution.from_ssp_file(ssp_path=str(path))
    observer = observers.CosimObserver.create_last_value()
    execution.add_observer(observer)
    slaves = {slave.name.decode(): slave.index for slave in execution.slave_infos()}
    while True:
        execution.step()
        yield lambda component, info: observer.last_real_values(
            slaves[component], [info.reference]
        )[0]


def ecos(path):
    """The same; it has to be told the step, and which parameter set to apply."""
    with suppress(OSError):  # pip's tbb lies where no loader looks
        ctypes.CDLL(
            str(Path(sysconfig.get_path("data")) / "lib" / "libtbb.so.12"), ctypes.RTLD_GLOBAL
        )
    module = pytest.importorskip("ecospy.EcosSimulation")
    with module.EcosSimulation(1e-3, ssp_path=str(path)) as simulation:
        simulation.init(parameter_set="initialValues")
        while True:
            simulation.step()
            yield lambda component, info: simulation.get_real(f"{component}::{info.name}")


@pytest.mark.interop
@pytest.mark.parametrize("tool", [libcosim, ecos])
def test_other_tools_run_it_as_our_jacobi_schedule(small, tool):
    """They step side by side and see no events."""
    scenario = prepare_one(small[1])
    components = scenario.system.components
    steps = tool(small[1])
    with Master(scenario.system, jacobi(tuple(components)), scenario.step_size) as master:
        for _ in range(50):
            read = next(steps)
            master.advance(1)
            for component, variable in (("a", "y"), ("b", "y"), ("spare", "y"), ("source", "p")):
                info = components[component].description.variables[variable]
                ours = master.components[component].get([variable])[variable]
                assert read(component, info) == pytest.approx(ours, abs=1e-15), (
                    f"{component}.{variable}"
                )
    steps.close()
