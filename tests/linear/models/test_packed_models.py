"""The linear model packed in an FMU, forged one element at a time: refused, or of no effect on the modes."""

import dataclasses
import json
import re
import zipfile

import numpy as np
import pytest
import scipy.io

from orchestrator.cases.case import load_case
from orchestrator.core.errors import AnalysisError
from orchestrator.devices.fmi.linear_model import FOLDER, read_embedded_model
from orchestrator.face.cli import main
from orchestrator.linear.models import component_linearization, response_check
from orchestrator.linear.models.component_linearization import linearize_component
from orchestrator.linear.models.linearization import Blocks, compose
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.modes import eigenvalues
from orchestrator.studies.modes.linear_model_files import component_model
from orchestrator.studies.modes.modes import compute_modes, running
from tests.support.scenarios import prepare_one

MODEL = f"{FOLDER}/linear_model.json"
MOVES = 1e-5
"""A mode of 0.1 to 2 Hz that a forged element moves by this part of its eigenvalue, or more, gives it away."""


def rewritten(path, target, changes):
    """A copy of an archive with some members changed by functions from bytes to bytes."""
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            new.writestr(name, changes.get(name, lambda content: content)(old.read(name)))
    return target


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("packed")


@pytest.fixture(scope="module")
def closed(folder):
    """Our converter with its model inside, and states that cannot be set, as other people's are."""
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
    assert main([*arguments, "--scenario", "pod_pq", "--dest", str(folder)]) == 0
    unsettable = {
        "modelDescription.xml": lambda text: text.replace(b'settable="true"', b'settable="false"')
    }
    return rewritten(folder / "gfor.fmu", folder / "closed.fmu", unsettable)


@pytest.fixture(scope="module")
def system_with(folder, closed):
    """A function from a change of the packed model's JSON to the two-area system with that FMU."""
    ours = folder / "ours.ssp"
    arguments = [
        "export",
        "ssp",
        "two_area",
        "--scenario",
        "pod_pq",
        "--set",
        "*.native=true",
        "--out",
        str(ours),
    ]
    assert main(arguments) == 0

    def make(change=lambda model: None, name="honest"):
        def edited(content):
            model = json.loads(content)
            change(model)
            return json.dumps(model).encode()

        fmu = rewritten(closed, folder / f"{name}.fmu", {MODEL: edited})
        return rewritten(
            ours, folder / f"{name}.ssp", {"resources/gfor.fmu": lambda _: fmu.read_bytes()}
        )

    return make


@pytest.fixture(scope="module")
def master(system_with):
    prepared = prepare_one(system_with(), "pod_pq")
    with running(prepared) as running_system:
        find_operating_point(running_system)
        yield running_system


@pytest.fixture
def with_model(master, monkeypatch):
    """Linearise the converter as if another model were inside. What the FMU does is measured once."""
    measured = {}
    real = response_check._Courses.course

    def remembered(self, size):
        if size not in measured:
            measured[size] = real(self, size)
        return measured[size]

    monkeypatch.setattr(response_check._Courses, "course", remembered)
    exchange = master.exchanges["gfor"]

    def linearised(model):
        monkeypatch.setattr(component_linearization, "embedded_model", lambda component: model)
        return linearize_component(exchange, master.time, master.clock.step_size)

    return linearised


def names_of(model, key, i, k):
    rows = list(model.states if key in "AB" else model.outputs)
    columns = list(model.states if key in "AC" else model.inputs)
    return f"{key}[{rows[i]}, {columns[k]}]"


def forged(model, key, i, k, factor):
    matrix = getattr(model, key).copy()
    matrix[i, k] *= factor
    return dataclasses.replace(model, **{key: matrix})


def test_an_element_that_made_a_damped_mode_unstable_is_refused(system_with, capsys):
    """23.9 % of damping became −9.6 %, with the FMU's binary as it was."""

    def change(model):
        names = [v["name"] for v in model["states"]]
        model["A"][names.index("droop.theta")][names.index("droop.P_f")] *= 0.3

    assert main(["modes", str(system_with(change, "forged"))]) == 1
    said = capsys.readouterr().err
    assert "component 'gfor': the linear model inside its FMU is not what the FMU does" in said
    assert re.search(
        r"\d s into small steps of v_re, v_im, der\(droop\.theta\) is \S+ per unit", said
    )
    assert re.search(r"off by \d+\S* % of its largest value", said)
    assert "gfor modes --black-box" in said


def test_every_single_element_that_matters_is_seen(master, with_model):
    """All that are not zero, wrong by 1 % or of the other sign, one after the other."""
    model = read_embedded_model(master.components["gfor"].description.path)
    blocks = Blocks(master)

    def modes(component):
        blocks.components["gfor"] = component
        return eigenvalues(compose(blocks, master.schedule))

    honest = modes(with_model(model))
    judged = [v for v in honest if 0.1 <= v.imag / (2 * np.pi) <= 2.0]
    assert len(judged) == 5
    used = [list(model.outputs).index(name) for name in ("i_re", "i_im")]
    refused, unseen = [], {}
    for key in "ABCD":
        for i, k in zip(*np.nonzero(getattr(model, key)), strict=True):
            if key in "CD" and i not in used:
                continue
            for factor in (1.01, -1.0):
                try:
                    found = modes(with_model(forged(model, key, i, k, factor)))
                except AnalysisError as error:
                    refused.append(str(error))
                else:
                    moved = max(np.abs(found - v).min() / abs(v) for v in judged)
                    unseen[names_of(model, key, i, k), factor] = moved
    assert len(refused) > 300
    assert all("is not what the FMU does" in text for text in refused)
    assert len(unseen) < 20
    # What slips through are paths of the POD into the fast inner loops, which hardly see it.
    assert max(unseen.values()) < MOVES, max(unseen, key=unseen.get)
    assert all(factor > 0 for _, factor in unseen)


def test_an_element_that_should_be_zero(master, with_model):
    model = read_embedded_model(master.components["gfor"].description.path)
    random = np.random.default_rng(12)
    rows, columns = np.nonzero(model.A == 0)
    for n in random.choice(len(rows), 20, replace=False):
        A = model.A.copy()
        A[rows[n], columns[n]] = np.abs(A[rows[n]]).max()
        with pytest.raises(AnalysisError, match="is not what the FMU does"):
            with_model(dataclasses.replace(model, A=A))


@pytest.mark.parametrize(
    "change", [{"gfor.droop.R_f": 0.051}, {"gfor.P_0": 0.62}, {"gfor.pod_q.enabled": False}]
)
def test_matrices_of_another_point_under_the_right_names(master, with_model, change):
    """What the file says of its operating point is right, the matrices are of another one."""
    honest = read_embedded_model(master.components["gfor"].description.path)
    prepared = prepare_one("two_area", "pod_pq", {"*.native": True, **change})
    other = component_model(prepared, "gfor")
    matrices = {key: getattr(other, key) for key in "ABCD"}
    with pytest.raises(AnalysisError, match="is not what the FMU does"):
        with_model(dataclasses.replace(honest, **matrices))


@pytest.mark.slow
def test_the_honest_model_is_used_and_said_to_be_packed(system_with, folder, capsys):
    case = load_case(system_with())
    (prepared,) = case.prepare(["pod_pq"])
    result = compute_modes(prepared)
    others = dict.fromkeys(("sg1", "sg2", "grid"), "perturbed")
    assert result.linearised == {"gfor": "packed", **others}
    assert min(abs(mode.damping_percent - 23.91) for mode in result.modes) < 0.01
    assert main(["modes", str(system_with())]) == 0
    assert (
        "Linear models: gfor from the model packed in its FMU, which was compared"
        in capsys.readouterr().out
    )
    assert main(["modes", str(system_with()), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["scenarios"][0]["linearised"] == result.linearised
    out = folder / "run"
    assert main(["run", str(system_with()), "--stop", "20 ms", "--out", str(out)]) == 0
    assert "gfor from the model packed in its FMU" in capsys.readouterr().out
    assert (
        json.loads((out / "summary.json").read_text())["scenarios"][0]["linearised"]
        == result.linearised
    )
    assert main(["report", str(out), "--out", str(folder / "report.html")]) == 0
    page = (folder / "report.html").read_text()
    assert "gfor from the model packed in its FMU" in page
    assert "Modes come from perturbing the running FMUs" not in page
    capsys.readouterr()
    assert (
        main(
            [
                "export",
                "linear",
                str(system_with()),
                "--input",
                "sg1.governor.delta_P_ref",
                "--out",
                str(out),
            ]
        )
        == 0
    )
    assert "gfor from the model packed in its FMU" in capsys.readouterr().out
    written = scipy.io.loadmat(out / "pod_pq" / "linear_model.mat")
    assert json.loads(written["provenance"][0])["linearised"]["gfor"] == "packed"


def test_where_all_is_perturbed_the_terminal_says_nothing_of_it(capsys):
    assert main(["modes", "two_area", "--scenario", "base"]) == 0
    assert "Linear models" not in capsys.readouterr().out
    assert main(["modes", "two_area", "--scenario", "base", "--json"]) == 0
    assert set(json.loads(capsys.readouterr().out)["scenarios"][0]["linearised"].values()) == {
        "perturbed"
    }


def test_the_fmu_is_left_where_it_was(master):
    component, names = master.components["gfor"], master.components["gfor"].description.variables
    shown = [n for n, v in names.items() if v.type == "Real"]
    before = component.get(shown)
    response_check._AGREED.clear()
    Blocks(master)
    assert component.get(shown) == before
