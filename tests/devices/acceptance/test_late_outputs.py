"""An FMU that computes its outputs only as initialisation ends: run and modes name it, and no other component."""

import json

import numpy as np
import pytest

from orchestrator.face.cli import main
from orchestrator.systems.coupling.coupled import _jump
from orchestrator.systems.coupling.master import Master
from tests.support.scenarios import prepare_one

pytestmark = pytest.mark.usefixtures("undrawn")

CASE = """
name = "late"
title = "A converter of somebody else's"

[solver]
step_size = "100 us"
stop_time = "0.05 s"

[power_flow]
grid = "grid"
slack = "gen"

[components.grid]
model = "grid"

[network]
buses = ["north", "south"]

[network.lines]
tie = {{ from = "north", to = "south", X = 0.05, R = 0.002, B = 0.2 }}

[network.loads]
city = {{ bus = "south", p = "400 MW", q = "80 Mvar" }}

[components.gen]
model = "synchronous_generator_st1"
bus = "north"
parameters = {{ S_n = "900 MVA", v_0 = 1.02 }}

[components.box]
fmu = "{fmu}"
bus = "south"
parameters = {{ S_n = "200 MVA", P_0 = 0.5, v_0 = 1.0 }}
"""


@pytest.fixture
def case(gallery, tmp_path):
    """Make a case file with a member of the gallery in it."""

    def make(name):
        path = tmp_path / "late.toml"
        path.write_text(CASE.format(fmu=gallery(name)[0].as_posix()), encoding="utf-8")
        return path

    return make


def test_a_run_says_whose_outputs_came_late(case, tmp_path, capsys):
    assert (
        main(["run", str(case("outputs_at_exit")), "--json", "--out", str(tmp_path / "out")]) == 0
    )
    (summary,) = json.loads(capsys.readouterr().out)
    first = summary["findings"][0]
    assert (first["kind"], first["component"], first["time"]) == ("undisturbed_motion", "box", 0.0)
    assert "box.i_re is 0 before the end of initialisation" in first["message"]
    assert "--only initial_outputs" in first["message"]


def test_a_run_with_a_good_fmu_says_nothing_of_it(case, tmp_path, capsys):
    assert main(["run", str(case("converter")), "--json", "--out", str(tmp_path / "out")]) == 0
    (summary,) = json.loads(capsys.readouterr().out)
    assert "initialisation" not in json.dumps(summary["findings"])


@pytest.mark.parametrize(("name", "late"), [("outputs_at_exit", True), ("converter", False)])
def test_the_master_knows_which_outputs_came_late(name, late, case):
    prepared = prepare_one(case(name))
    with Master(prepared.system, prepared.schedule, prepared.step_size) as master:
        assert list(master.late_starts) == (["box"] if late else [])


def test_the_steady_state_error_names_it(case, capsys):
    assert main(["modes", str(case("outputs_at_exit")), "--black-box"]) == 1
    said = capsys.readouterr().err
    assert "no steady state" in said
    assert "box.i_re is 0 before the end of initialisation" in said
    assert "generation and load balance" not in said


@pytest.mark.parametrize(
    ("before", "after", "late"),
    [
        (0.0, 0.9, True),
        (1.0, 1.0 + 5e-7, False),  # as of an FMU that computes in single precision
        (1.0, 1.0 + 2e-6, True),
        (31415.9, 31415.9 * (1 + 5e-7), False),  # amperes, by their own size
        (31415.9, 31415.9 * (1 + 2e-6), True),
        (1e-4, 1.005e-4, False),  # what is near 0 is judged by 1
        (31415.9, 0.0, True),
    ],
)
def test_an_output_is_late_by_its_own_size(before, after, late):
    """Another output that stays does not hide it."""
    found = _jump(["box.other", "box.i_re"], np.array([2e6, before]), np.array([2e6, after]))
    assert (found is not None) == late
    if found:
        assert found.variable == "i_re"
