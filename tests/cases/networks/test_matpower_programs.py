"""A MATPOWER case is a program: what its statements do to the tables counts, and what is not understood is refused."""

import numpy as np
import pytest

from orchestrator.cases.networks.matpower.program import case_tables
from orchestrator.cases.networks.sources import read_matpower
from orchestrator.core.errors import InputError

TABLES = """\
function mpc = town
%TOWN  a feeder in kW and ohms; 2 % of it is [lost
%{
mpc.bus = 'a comment of several lines
%}
mpc.version = '2';
mpc.baseMVA = 10;
mpc.bus = [ %% PD in kW
    1  3  0    0   0 0 1 1 0 20 1 1.1 0.9;
    2  1  600  100 0 0 1 1 0 20 1 1.1 0.9
    3  1  400, 50, 0 0 1 1 0 20 1 1.1 0.9;
];
mpc.gen = [1 0 0 Inf -Inf 1.02 100 1 Inf 0];
mpc.branch = [
    1 2 0.5 0.4 0 Inf 0 0 0 0 1 -360 360;
    2 3 0.2 0.1 0 0   0 0 0 0 1 -360 360;
];
mpc.bus_name = {'it''s %1'; 'two; three'};
"""

PD, QD, BR_R, BR_X = 2, 3, 2, 3


def tables(tmp_path, program):
    path = tmp_path / "town.m"
    path.write_text(TABLES + program)
    return read_matpower(path)


def refusal(tmp_path, program):
    with pytest.raises(InputError) as caught:
        tables(tmp_path, program)
    return str(caught.value)


def test_the_tables_alone(tmp_path):
    source = tables(tmp_path, "")
    assert source.base_mva == 10
    assert source.bus[:, PD].tolist() == [0, 600, 400]
    assert source.gen[0, 3] == np.inf  # no limit
    assert source.gen[0, 8] == 0  # a rating is not known


@pytest.mark.parametrize(
    ("program", "total"),
    [
        ("mpc.bus(:, [3, 4]) = mpc.bus(:, [3, 4]) * 2;", 2000),
        ("mpc.bus(:, 3:4) = mpc.bus(:, 3:4) / 1e3", 1),
        ("mpc.bus(2:end, 3) = 2*mpc.bus(2:end, 3);", 2000),
        ("mpc.bus(end, 3) = 0;", 600),
        ("mpc.bus(mpc.bus(:, 3) > 500, 3) = 500;", 900),
        ("k = find(mpc.bus(:, 3) > 500);\nmpc.bus(k, 3) = 500;", 900),
        ("define_constants;\nmpc.bus(:, PD) = mpc.bus(:, PD) .* [1; 1; -1];", 200),
        (
            "[PQ, PV, REF, NONE, BUS_I, BUS_TYPE, ...\n  PD] = idx_bus;\nmpc.bus(:, PD) = -mpc.bus(:, PD);",
            -1000,
        ),
        ("pf = 0.8; mpc.bus(:, 3) = mpc.bus(:, 3) * sin(acos(pf));", 600),
        ("big = 0;\nif big\n mpc.bus(:, 3) = 9;\nelse\n mpc.bus(:, 3) = 1;\nend", 3),
        ("if size(mpc.bus, 1) == 3, mpc.bus(:, 3) = [1 -2 5]'; end", 4),
        ("mpc.bus(:, 3) = [1; 2 - 1; 2 -1](1);", None),
        ("mpc.bus = [mpc.bus; 4 1 70 0 0 0 1 1 0 20 1 1.1 0.9];", 1070),
        ("mpc.note = strcat('a', date); mpc.gencost = foo(3);", 1000),
        ("disp('done');\nreturn;", 1000),
    ],
)
def test_statements_after_the_tables_are_carried_out(tmp_path, program, total):
    if total is None:
        assert "line 19" in refusal(tmp_path, program)
    else:
        assert tables(tmp_path, program).bus[:, PD].sum() == pytest.approx(total)


def test_ohms_and_kilowatts_become_pu_and_megawatts(tmp_path):
    source = tables(
        tmp_path,
        "[PQ, PV, REF, NONE, BUS_I, BUS_TYPE, PD, QD, GS, BS, BUS_AREA, VM, ...\n"
        "    VA, BASE_KV] = idx_bus;\n"
        "[F_BUS, T_BUS, BR_R, BR_X] = idx_brch;\n"
        "Vbase = mpc.bus(1, BASE_KV) * 1e3;      %% in volts\n"
        "Sbase = mpc.baseMVA * 1e6;\n"
        "mpc.branch(:, [BR_R BR_X]) = mpc.branch(:, [BR_R BR_X]) / (Vbase^2 / Sbase);\n"
        "mpc.bus(:, [PD, QD]) = mpc.bus(:, [PD, QD]) / 1e3;\n",
    )
    assert source.bus[:, [PD, QD]].sum(axis=0) == pytest.approx([1.0, 0.15])
    assert source.branch[:, [BR_R, BR_X]] == pytest.approx(np.array([[0.5, 0.4], [0.2, 0.1]]) / 40)


@pytest.mark.parametrize(
    ("program", "says"),
    [
        ("mpc = scale_load(2, mpc);", "the function 'scale_load' is not known"),
        ("\nmpc.bus(:, 3) = factor * mpc.bus(:, 3);", "line 20: the statement"),
        ("f = rand(1);\nmpc.bus(:, 3) = f * mpc.bus(:, 3);", "'f' comes from line 19"),
        ("for k = 1:3\n mpc.bus(k, 3) = 0;\nend", "only assignments"),
        ("toggle(mpc)", "only assignments"),
        ("mpc.bus(5, 99) = 1;", "does not fit"),
        ("mpc.bus(:, 3) = [1; 2];", "does not fit"),
        ("mpc.branch(:, 4) = 1./zeros(2, 1);", "row 1 of mpc.branch holds Inf"),
        ("mpc.bus = [1 2; 3 4", "line 19: a bracket is not closed"),
        ("mpc.bus = [1 3 0 0 0 0 1 1 0 20];", None),
        ("mpc.bus = 5;", "must be a table of numbers with 9 columns"),
    ],
)
def test_what_is_not_understood_is_refused_by_its_line(tmp_path, program, says):
    if says is None:
        assert len(tables(tmp_path, program).bus) == 1
    else:
        assert says in refusal(tmp_path, program)


def test_a_function_with_several_results(tmp_path):
    path = tmp_path / "old.m"
    path.write_text(
        "function [baseMVA, bus, gen, branch] = old\nbaseMVA = 100;\nbus = [1 3 0 0 0 0 1 1 0];\n"
        "gen = [1 0 0 9 -9 1 100 1 10 0];\nbranch = [];\nbus(1, 3) = 7;\n"
    )
    assert case_tables(path).tables["bus"][0, 2] == 7
