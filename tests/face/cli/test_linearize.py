"""``gfor export linear`` and ``gfor run --linear``: the linear model as files, and beside the simulation."""

import csv
import json

import numpy as np
import pytest
import scipy.io
import xarray as xr

from orchestrator.face.cli import main
from orchestrator.linear.models.state_space import StateSpace


def test_the_files_hold_the_model_with_its_names(tmp_path, capsys):
    code = main(
        [
            "export",
            "linear",
            "two_area",
            "--scenario",
            "gfor",
            "--continuous",
            "--out",
            str(tmp_path),
        ]
    )
    assert code == 0
    said = capsys.readouterr().out
    assert "62 states, 1 inputs, 7 outputs" in said
    assert "one eigenvalue is zero, taken for that of the free angle, and left out" in said
    content = scipy.io.loadmat(tmp_path / "gfor" / "linear_model.mat", simplify_cells=True)
    assert content["step_size"] == 0
    assert content["A"].shape == (62, 62)
    assert list(np.atleast_1d(content["inputs"])) == ["grid.load_2.scale"]
    swing = [v for v in np.linalg.eigvals(content["A"]) if 3 < v.imag < 4]
    assert min(abs(v - complex(-0.3894, 3.6548)) for v in swing) < 2e-3
    with (tmp_path / "gfor" / "A.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row[""] for row in rows] == list(content["states"])
    assert float(rows[3][rows[5][""]]) == pytest.approx(content["A"][3, 5], rel=1e-12)
    assert json.loads(content["provenance"])["scenario"] == "gfor"


@pytest.mark.slow
def test_a_fault_is_no_input_and_this_is_told(tmp_path, capsys):
    """Its reactance has no effect before it begins, and the fault at no reactance is none."""
    assert main(["export", "linear", "k2a", "--scenario", "pss", "--out", str(tmp_path)]) == 0
    said = capsys.readouterr()
    assert " 0 inputs, " in said.out
    assert "these events are no inputs: t = " in said.err
    assert "fault" in said.err.partition("these events are no inputs")[2]


def test_the_exported_model_answers_as_the_simulation_does(tmp_path, capsys):
    folder = tmp_path / "out"
    code = main(
        ["run", "two_area", "--scenario", "gfor", "--linear", "--stop", "6", "--out", str(folder)]
    )
    assert code == 0
    assert "Linear model against the simulation" in capsys.readouterr().out
    (scenario,) = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["scenarios"]
    assert 0 < scenario["linear_difference"]["sg1.omega"] < 0.01
    with (
        xr.open_dataset(folder / "gfor" / "linear.nc") as linear,
        xr.open_dataset(folder / "gfor" / "trajectory.nc") as run,
    ):
        assert np.array_equal(linear["time"], run["time"])
        before = run["time"] <= 1.0
        assert float(abs(linear["sg1.omega"] - run["sg1.omega"])[before].max()) < 1e-12
        assert float(abs(linear["sg1.omega"] - 1).max()) > 1e-5


def test_a_continuous_and_a_stepped_model_answer_alike():
    A, B = np.array([[-2.0]]), np.array([[3.0]])
    H = 1e-3
    names = (("x",), ("u",), ("y",))
    stepped = StateSpace(
        np.exp(A * H), (np.exp(-2 * H) - 1) / -2 * B, np.eye(1), np.zeros((1, 1)), *names, H
    )
    whole = StateSpace(A, B, np.eye(1), np.zeros((1, 1)), *names, None)
    times = 0.004 + 0.01 * np.arange(100)
    exact = 1.5 * (1 - np.exp(-2 * times))
    for model in (stepped, whole):
        assert model.step_response([1.0], times)[:, 0] == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["export", "linear", "two_area", "--input", "sg1.S_n"], "fixed parameter"),
        (["export", "linear", "two_area", "--output", "sg1.speed"], "no variable 'sg1.speed'"),
        (
            ["run", "two_area", "--linear", "--stop", "0.5"],
            "no event that a linear model could answer to",
        ),
    ],
)
def test_what_cannot_be_linear_is_said(arguments, word, tmp_path, capsys):
    assert main([*arguments, "--scenario", "base", "--out", str(tmp_path)]) == 2
    assert word in capsys.readouterr().err


def test_a_parameter_at_its_bound_is_perturbed_to_the_other_side(gfor, tmp_path):
    """The dip's depth is 0, and may not be less."""
    code, shown, said = gfor(
        "export", "linear", "infinite_bus", "--scenario", "dip", "--out", str(tmp_path)
    )
    assert (code, said) == (0, "")
    assert "1 inputs" in shown
