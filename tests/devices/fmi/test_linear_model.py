"""The linear model inside an FMU: what other tools find there, and whether it is the FMU's."""

import io
import json
import zipfile

import numpy as np
import pytest
import scipy.io
from fmpy import simulate_fmu
from lxml import etree

from fmus.toolchain.catalogue import build_model
from orchestrator.cases.case import load_case
from orchestrator.core.errors import FmuFileError, InputError
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.linear_model import FOLDER, NAME, read_embedded_model
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from orchestrator.devices.fmi.validation import fmpys_problems
from orchestrator.face.cli import main
from orchestrator.linear.models.state_space import read_linear_model
from orchestrator.linear.spectra.modes import eigenvalues
from orchestrator.studies.modes.modes import compute_modes
from tests.support.jacobians import jacobians

H = 1e-4


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    """The converter with its model at the steady state of the case study with both PODs."""
    folder = tmp_path_factory.mktemp("fmu")
    arguments = [
        "fmu",
        "build",
        "gfor",
        "--with-linear-model",
        "two_area",
        "--scenario",
        "pod_pq",
        "--dest",
        str(folder),
    ]
    assert main(arguments) == 0
    return folder / "gfor.fmu"


def rewritten(path, target, changes):
    """A copy of an archive with some members changed by functions from bytes to bytes."""
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            new.writestr(name, changes.get(name, lambda content: content)(old.read(name)))
    return target


# -- the model -------------------------------------------------------------------------------------


def exact(model):
    """Jacobians of the equations, from nothing but what the FMU carries."""
    equations = build_model("gfor")
    p = np.array([float(model.parameters.get(v.name, v.start)) for v in equations.parameters])
    c, x = equations.initialise(p)
    u = np.array([model.inputs[i.name] for i in equations.inputs])
    assert np.array(x).ravel() == pytest.approx(list(model.states.values()), abs=1e-12)
    assert np.array(equations.derivatives(x, u, p, c)).ravel() == pytest.approx(
        np.zeros(x.shape[0]), abs=1e-9
    )
    return [np.array(block) for block in jacobians(equations)(x, u, p, c)]


def test_the_matrices_are_the_equations_jacobians(fmu):
    model = read_embedded_model(fmu)
    for found, wanted in zip((model.A, model.B, model.C, model.D), exact(model), strict=True):
        assert found.shape == wanted.shape
        assert np.abs(found - wanted).max() < 1e-9 * max(1.0, np.abs(wanted).max())


def test_the_poles_are_those_of_the_fmu_s_own_step(fmu):
    """The step of the FMU by perturbation, against the continuous model in it."""
    model = read_linear_model(fmu)
    assert (model.step_size, model.inputs) == (None, ("v_re", "v_im"))
    description, inside = read_description(fmu), read_embedded_model(fmu)
    with LoadedComponent("gfor", description) as component:
        component.set(inside.parameters)
        component.setup(0.0, None)
        component.enter_initialization_mode()
        component.set(inside.inputs)
        component.exit_initialization_mode()
        step = perturbed_step(component, list(inside.states))
    poles = np.log(np.linalg.eigvals(step).astype(complex)) / H
    wanted = [v for v in np.linalg.eigvals(model.A) if abs(v) < 100]
    assert len(wanted) > 5
    for pole in wanted:
        assert np.abs(poles - pole).min() < 1e-6 * max(1.0, abs(pole))


def perturbed_step(component, names):
    x = component.get(names)
    columns = []
    for name in names:
        ends = []
        for sign in (1, -1):
            saved = component.save_state()
            component.set({name: x[name] + sign * 1e-5})
            component.step(0.0, H)
            ends.append(np.array(list(component.get(names).values())))
            component.restore_state(saved)
            component.free_state(saved)
        columns.append((ends[0] - ends[1]) / 2e-5)
    return np.column_stack(columns)


def test_the_fmu_answers_a_small_step_as_its_model_does(fmu):
    inside = read_embedded_model(fmu)
    change, times = 1e-4, 5e-3 * np.arange(1, 101)
    inputs = [("time", float), *((name, float) for name in inside.inputs)]
    signal = np.array([(0.0, inside.inputs["v_re"] + change, inside.inputs["v_im"])], dtype=inputs)
    simulated = simulate_fmu(
        str(fmu),
        stop_time=0.5,
        step_size=H,
        output_interval=5e-3,
        start_values=inside.parameters,
        input=signal,
        output=["p", "q", "omega"],
    )
    model = read_linear_model(fmu)
    linear = model.step_response([change, 0.0], times)
    for name in ("p", "q", "omega"):
        wanted = simulated[name][1:] - inside.outputs[name]
        found = linear[:, model.outputs.index(name)]
        assert np.abs(found - wanted).max() < 5e-3 * np.abs(wanted).max()


# -- the files -------------------------------------------------------------------------------------


def test_the_fmu_is_valid_and_the_same_beside_it(fmu, fmu_path):
    assert fmpys_problems(fmu) == []
    with zipfile.ZipFile(fmu) as with_model, zipfile.ZipFile(fmu_path("gfor")) as without:
        plain = {name: without.read(name) for name in without.namelist()}
        assert {
            n: with_model.read(n) for n in with_model.namelist() if not n.startswith("extra/")
        } == plain
        assert {n for n in with_model.namelist() if n.startswith(FOLDER)} == {
            f"{FOLDER}/{name}"
            for name in ("fmi-ls-manifest.xml", "linear_model.json", "linear_model.mat")
        }


def test_the_manifest_is_that_of_a_layered_standard(fmu):
    with zipfile.ZipFile(fmu) as archive:
        root = etree.fromstring(archive.read(f"{FOLDER}/fmi-ls-manifest.xml"))
    assert root.tag == "fmiLayeredStandardManifest"
    attributes = {etree.QName(key).localname: value for key, value in root.attrib.items()}
    assert {etree.QName(key).namespace for key in root.attrib} == {
        "http://fmi-standard.org/fmi-ls-manifest"
    }
    assert attributes.keys() == {"fmi-ls-name", "fmi-ls-version", "fmi-ls-description"}
    assert (attributes["fmi-ls-name"], FOLDER) == (NAME, f"extra/{NAME}")


def test_json_and_matlab_files_say_the_same(fmu):
    with zipfile.ZipFile(fmu) as archive:
        content = json.loads(archive.read(f"{FOLDER}/linear_model.json"))
        matlab = scipy.io.loadmat(
            io.BytesIO(archive.read(f"{FOLDER}/linear_model.mat")), simplify_cells=True
        )
    for key in "ABCD":
        assert np.array_equal(matlab[key], np.array(content[key]))
    for kind in ("states", "inputs", "outputs", "parameters"):
        assert list(matlab[kind]) == [v["name"] for v in content[kind]]
        assert list(matlab[f"{kind[:-1]}_values"]) == [float(v["value"]) for v in content[kind]]
    assert content["origin"]["scenario"] == "pod_pq"
    assert {"name": "pod_p.enabled", "unit": "", "value": True} in content["parameters"]
    assert {v["unit"] for v in content["states"]} == {"pu", "rad"}


def test_equal_models_give_equal_files(fmu, tmp_path):
    arguments = [
        "fmu",
        "build",
        "gfor",
        "--with-linear-model",
        "two_area",
        "--scenario",
        "pod_pq",
        "--dest",
        str(tmp_path),
    ]
    assert main(arguments) == 0
    assert (tmp_path / "gfor.fmu").read_bytes() == fmu.read_bytes()


def test_native_fmus_carry_it_too_and_exactly(tmp_path, fmu):
    arguments = [
        "fmu",
        "build",
        "gfor",
        "--native",
        "--platform",
        "linux64",
        "--with-linear-model",
        "two_area",
    ]
    assert main([*arguments, "--scenario", "pod_pq", "--dest", str(tmp_path)]) == 0
    path = tmp_path / "gfor.fmu"
    assert fmpys_problems(path) == []
    model = read_embedded_model(path)
    for found, wanted in zip((model.A, model.B, model.C, model.D), exact(model), strict=True):
        assert found == pytest.approx(wanted, rel=1e-13, abs=1e-9)
    assert model.origin["derivatives"] == "directional derivatives"
    assert read_embedded_model(fmu).origin["derivatives"] == "central differences of 1e-05"


@pytest.mark.slow
def test_fmus_of_fmi_3_carry_it_too(tmp_path):
    arguments = [
        "fmu",
        "build",
        "synchronous_generator_st4b",
        "--native",
        "--fmi",
        "3.0",
        "--platform",
        "linux64",
    ]
    arguments += ["--with-linear-model", "two_area", "--scenario", "gfor", "--component", "sg1"]
    assert main([*arguments, "--dest", str(tmp_path)]) == 0
    path = tmp_path / "synchronous_generator_st4b.fmu"
    assert fmpys_problems(path) == []
    assert read_embedded_model(path).origin["component"] == "sg1"


def test_info_tells_of_it(fmu, fmu_path, capsys):
    assert main(["fmu", "info", str(fmu)]) == 0
    said = capsys.readouterr().out
    assert (
        "linear model inside: 27 states, 2 inputs, 10 outputs, at the operating point of case two_area"
        in said
    )
    assert "scenario pod_pq, component gfor" in said
    assert main(["fmu", "info", str(fmu_path("gfor"))]) == 0
    assert "linear model" not in capsys.readouterr().out


# -- what cannot be done ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (
            ["gfor", "--with-linear-model", "two_area"],
            "several scenarios in the case 'two_area'; choose with --scenario",
        ),
        (
            ["gfor", "--with-linear-model", "two_area", "--scenario", "podp"],
            "there is no scenario 'podp'",
        ),
        (
            ["gfor", "--with-linear-model", "two_area", "--scenario", "base"],
            "has no component of the model 'gfor'",
        ),
        (
            ["gfor", "--with-linear-model", "two_area", "--scenario", "gfor", "--component", "sg1"],
            "no component of the model 'gfor' 'sg1'",
        ),
        (
            ["--all", "--with-linear-model", "two_area", "--scenario", "gfor"],
            "needs one model to build",
        ),
        (["gfor", "--scenario", "gfor"], "say more of --with-linear-model"),
    ],
)
def test_what_is_not_clear_is_asked(arguments, word, tmp_path, capsys):
    assert main(["fmu", "build", *arguments, "--dest", str(tmp_path)]) == 2
    assert word in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_models_that_cannot_be_read(fmu, fmu_path, tmp_path):
    with pytest.raises(InputError, match="there is no linear model inside"):
        read_linear_model(fmu_path("gfor"))
    member = f"{FOLDER}/linear_model.json"
    faults = {
        "newer": (b'"version": "1.0.0"', b'"version": "2.0.0"', "version 2.0.0 of its form"),
        "cut": (b'"D": [', b'"D": [[1.0],', "cannot be read"),
        "none": (b'"A":', b'"Z":', "cannot be read: 'A'"),
    }
    for name, (old, new, word) in faults.items():
        path = rewritten(
            fmu, tmp_path / f"{name}.fmu", {member: lambda c, o=old, n=new: c.replace(o, n)}
        )
        with pytest.raises(FmuFileError, match=word):
            read_linear_model(path)


# -- in place of perturbation ----------------------------------------------------------------------


@pytest.fixture(scope="module")
def foreign(fmu, tmp_path_factory):
    """The system with a converter whose states cannot be set, as other people's FMUs are."""
    folder = tmp_path_factory.mktemp("foreign")
    description = {
        "modelDescription.xml": lambda text: text.replace(b'settable="true"', b'settable="false"')
    }
    closed = rewritten(fmu, folder / "gfor.fmu", description)
    assert (
        main(
            ["export", "ssp", "two_area", "--scenario", "pod_pq", "--out", str(folder / "ours.ssp")]
        )
        == 0
    )
    return rewritten(
        folder / "ours.ssp",
        folder / "foreign.ssp",
        {"resources/gfor.fmu": lambda _: closed.read_bytes()},
    )


@pytest.mark.slow
def test_modes_of_an_fmu_that_cannot_be_perturbed(foreign):
    """They come from the model inside it, and are those that perturbation gives where it can be done."""
    results = []
    for case in (load_case(foreign), load_case("two_area")):
        (prepared,) = case.prepare(["pod_pq"])
        results.append(compute_modes(prepared))
    inside, perturbed = results
    assert inside.operating_point.residual < 1e-12
    assert inside.model.names == perturbed.model.names
    # No system without its POD can be made of a closed FMU, so that two modes keep fitting the name.
    assert inside.electromechanical is None
    assert (
        "those at 0.8116 Hz and 0.3524 Hz fit it about equally"
        in inside.unnamed["electromechanical"]
    )
    assert (
        min(abs(m.eigenvalue - perturbed.electromechanical.eigenvalue) for m in inside.modes) < 1e-6
    )
    # Above 1000 1/s the FMU's own Runge-Kutta steps of 100 µs tell: 10 000 1/s becomes 9808 1/s in them.
    slow = [v for v in eigenvalues(perturbed.model) if abs(v) < 500]
    found = eigenvalues(inside.model)
    assert len(slow) == 50
    for value in slow:
        assert np.abs(found - value).min() < 1e-6 * max(1.0, abs(value))


@pytest.mark.parametrize(
    ("value", "name"),
    [("gfor.pod_q.enabled=false", "pod_q.enabled"), ("gfor.droop.R_f=0.06", "droop.R_f")],
)
def test_a_model_of_another_point_is_not_used(foreign, capsys, value, name):
    assert main(["modes", str(foreign), "--set", value]) == 1
    said = capsys.readouterr().err
    assert "the linear model inside its FMU is of another operating point" in said
    assert name in said


def test_an_input_that_the_model_does_not_have(foreign, tmp_path, capsys):
    arguments = [
        "export",
        "linear",
        str(foreign),
        "--input",
        "gfor.droop.delta_P_ref",
        "--out",
        str(tmp_path),
    ]
    assert main(arguments) == 1
    assert "the linear model inside its FMU has no 'droop.delta_P_ref'" in capsys.readouterr().err
