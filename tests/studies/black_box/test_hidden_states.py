"""`gfor modes` with a converter that saves its state but hides its states: named remedy, and the remedy itself."""

import io
import json
import zipfile

import pandas as pd
import pytest

import orchestrator as gfor_face
from orchestrator.core.errors import AnalysisError
from orchestrator.face.cli import main
from orchestrator.studies.black_box.coupled_modes import linearize_with_box
from orchestrator.systems.coupling.master import Master
from tests.studies.black_box import boxes


@pytest.fixture(scope="module")
def hidden(tmp_path_factory):
    """The two-area system with such a converter: nothing of its file is ours but the equations."""
    folder = tmp_path_factory.mktemp("hidden")
    ours, target = folder / "ours.ssp", folder / "hidden.ssp"
    arguments = [
        "export",
        "ssp",
        "two_area",
        "--scenario",
        "pod_p",
        "--set",
        "*.native=true",
        "--out",
        str(ours),
    ]
    assert main(arguments) == 0
    with zipfile.ZipFile(ours) as old:
        fmu = zipfile.ZipFile(io.BytesIO(old.read("resources/gfor.fmu")))
    with zipfile.ZipFile(folder / "gfor.fmu", "w") as new:
        for name in fmu.namelist():
            content = fmu.read(name)
            if name == "modelDescription.xml":
                assert b'settable="true"' in content
                content = content.replace(b'settable="true"', b'settable="false"')
            new.writestr(name, content)
    with zipfile.ZipFile(ours) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            swapped = name == "resources/gfor.fmu"
            new.writestr(name, (folder / "gfor.fmu").read_bytes() if swapped else old.read(name))
    return target


def test_the_error_names_the_commands_that_do_it(hidden, gfor):
    code, _, said = gfor("modes", hidden)
    said = " ".join(said.split())
    assert code == 1
    assert "component 'gfor': its FMU does not let a master set its continuous states" in said
    assert "`gfor modes CASE --black-box`" in said
    assert "`gfor modes CASE --black-box --component gfor`" in said


def test_one_way_to_linearise_at_a_time(gfor):
    code, _, said = gfor("modes", "two_area", "--scenario", "base", "--black-box", "--directional")
    assert code == 2
    assert "give one of them" in said


def test_where_nothing_hides_nothing_is_identified(gfor):
    shown = [
        gfor("modes", "two_area", "--scenario", "base", "--json", *more)[1]
        for more in ([], ["--black-box"])
    ]
    assert shown[0] == shown[1]


def test_runs_sweeps_and_linear_models_take_the_keyword():
    case = gfor_face.load("infinite_bus")
    scenario, values = case.scenario("dip"), {"gfor.droop.R_f": [0.02, 0.03]}
    asked = ["gfor.droop.delta_P_ref"], ["gfor.p"]
    for one in (
        lambda **how: scenario.run(stop=1e-3, **how).modes.table(),
        lambda **how: pd.DataFrame(scenario.linearize(*asked, **how).A),
        lambda **how: case.sweep(values, scenarios="dip", workers=1, **how).table(),
    ):
        assert one(black_box=True).equals(one())


@pytest.mark.slow
def test_the_modes_of_an_fmu_that_hides_its_states(hidden, gfor):
    code, shown, _ = gfor("modes", hidden, "--black-box", "--json")
    assert code == 0
    (found,) = json.loads(shown)["scenarios"]
    assert found["linearised"] == {
        "gfor": "identified",
        "sg1": "perturbed",
        "sg2": "perturbed",
        "grid": "perturbed",
    }
    assert 0 < found["fit_errors"]["gfor"] < 1e-4
    (white,) = json.loads(gfor("modes", "two_area", "--scenario", "pod_p", "--json")[1])[
        "scenarios"
    ]
    for mode in white["modes"]:
        if mode["damping_percent"] > 60:
            continue
        same = min(
            found["modes"],
            key=lambda m: abs(m["real"] - mode["real"]) + abs(m["imag"] - mode["imag"]),
        )
        assert same["frequency_hz"] == pytest.approx(mode["frequency_hz"], abs=1e-3)
        assert same["damping_percent"] == pytest.approx(mode["damping_percent"], abs=0.01)
        assert same["name"] == mode["name"]


def test_a_system_that_moves_beside_the_box_is_no_steady_state():
    """An angle that is 1e-7 off: 3e-8 in a step, 3e-4 in a second."""
    prepared = boxes.prepared("gfor")
    parameters = prepared.system.components["sg2"].parameters
    parameters["theta_0"] += 1e-7
    with (
        Master(prepared.system, prepared.schedule, prepared.step_size) as master,
        pytest.raises(
            AnalysisError, match=r"no steady state.*step changes a state of component .grid."
        ),
    ):
        linearize_with_box(master, "gfor")
