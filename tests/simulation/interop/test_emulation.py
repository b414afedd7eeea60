"""Rules of other masters on our coupling: what they say, what they refuse, and ``gfor run --like``."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
import xarray as xr

from orchestrator.core.errors import InputError
from orchestrator.face.cli import main
from orchestrator.simulation.interop.probe_result import probe_system
from orchestrator.simulation.interop.rules import MASTERS, LastLabel, Steps
from orchestrator.studies.runs.like import emulate
from orchestrator.systems.coupling.events import ParameterChange
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.schedule import FirstInputs, jacobi
from tests.simulation.interop import drivers, table
from tests.simulation.interop.jobs import job_of, write_ssp
from tests.support.scenarios import prepare_one

COFMUPY_GAUSS_SEIDEL, ECOS_EXECUTABLE, FMPY_SSP, FMUCONTAINER, LIBCOSIM, MOSAIK, PATHSIM = (
    MASTERS[name]
    for name in (
        "cofmupy_gauss_seidel",
        "ecos_executable",
        "fmpy_ssp",
        "fmucontainer",
        "libcosim",
        "mosaik",
        "pathsim",
    )
)

H = 1e-4


def test_every_master_says_where_its_rules_are_from():
    assert all(len(rules.source) > 30 for rules in MASTERS.values())
    assert {rules.steps for rules in MASTERS.values()} == {*get_args(Steps)}
    assert {rules.last_label for rules in MASTERS.values()} == {*get_args(LastLabel)}
    assert {rules.first_inputs for rules in MASTERS.values()} <= {*get_args(FirstInputs)}


def test_the_page_lists_every_master_with_its_schedule():
    shown = table.on_page()
    rows = {title: cells[0] for title, cells in table.verdicts(shown).items()}
    assert rows == {rules.title: table.in_short(rules) for rules in MASTERS.values()}


def test_consistent_side_by_side_is_our_own_jacobi():
    recorder = Recorder(["a.y", "b.y"], 2)
    with Master(probe_system(), jacobi(("a", "b")), 0.1) as master:
        master.run(2.0, observers=[recorder])
    emulation = emulate(probe_system(), FMUCONTAINER, 0.1, 2.0, ["a.y", "b.y"], every=2)
    assert np.array_equal(emulation.times, recorder.times)
    assert np.array_equal(emulation.values, recorder.values)


def test_early_labels_show_the_step_after():
    on_time = emulate(probe_system(), replace(PATHSIM, early_label=0), 0.1, 2.0, ["a.y"])
    early = emulate(probe_system(), PATHSIM, 0.1, 2.0, ["a.y"])
    assert len(early.times) == 21
    assert np.array_equal(early.values[:-1], on_time.values[1:])
    assert np.array_equal(
        emulate(probe_system(), PATHSIM, 0.1, 2.0, ["a.y"], every=5).values, early.values[::5]
    )


def test_a_time_summed_up_step_by_step_may_need_one_row_more():
    """Ten times 0.1 is less than 1 in floating point, so that FMPy takes eleven steps."""
    assert (FMPY_SSP.rows(0.1, 1.0), FMPY_SSP.rows(0.125, 1.0), LIBCOSIM.rows(0.1, 1.0)) == (
        11,
        8,
        11,
    )
    assert [MOSAIK.rows(H, N * H) for H, N in ((0.1, 10), (0.125, 16))] == [10, 16]
    found = [
        ECOS_EXECUTABLE.rows(H, N * H)
        for H, N in ((0.1, 20), (0.1, 10), (0.3, 10), (0.125, 16), (1e-4, 500))
    ]
    assert found == [20, 11, 11, 17, 500]  # as the executable wrote them
    assert len(emulate(probe_system(), FMPY_SSP, 0.1, 1.0, ["a.y"]).times) == 11
    assert len(emulate(probe_system(), FMPY_SSP, 0.125, 1.0, ["a.y"]).times) == 8


def test_the_order_of_those_that_take_turns_is_the_users():
    first_a = emulate(probe_system(), COFMUPY_GAUSS_SEIDEL, 0.1, 2.0, ["a.y"])
    first_b = emulate(probe_system(), COFMUPY_GAUSS_SEIDEL, 0.1, 2.0, ["a.y"], order=["b", "a"])
    assert np.abs(first_a.values - first_b.values).max() > 0.01


@pytest.mark.parametrize(
    ("rules", "order", "message"),
    [
        (LIBCOSIM, ["a", "b"], "steps all components side by side, so that they have no order"),
        (PATHSIM, ["a"], "not in any group: b"),
        (PATHSIM, ["a", "b", "c"], "not components: c"),
    ],
)
def test_an_order_that_does_not_fit(rules, order, message):
    with pytest.raises(InputError, match=message):
        emulate(probe_system(), rules, 0.1, 2.0, ["a.y"], order=order)


def test_a_stop_between_communication_points():
    with pytest.raises(InputError, match="not a communication point"):
        emulate(probe_system(), LIBCOSIM, 0.1, 0.25, ["a.y"])


def test_events_happen_before_the_step_that_starts_at_their_time():
    events = [
        ParameterChange(0.0, "a", "internal_step", 2e-4),
        ParameterChange(0.1, "b", "internal_step", 2e-4),
    ]
    # so both are tried, also the one at t = 0
    with pytest.raises(Exception, match="internal_step is fixed"):
        emulate(probe_system(), PATHSIM, 0.1, 1.0, ["a.y"], events=events[:1])
    with pytest.raises(Exception, match="internal_step is fixed"):
        emulate(probe_system(), PATHSIM, 0.1, 1.0, ["a.y"], events=events[1:])


def test_run_like_gives_what_fmpy_gives(tmp_path, capsys):
    """The whole way, from the command line to a file, with the steady start that our own run would have."""
    command = ["run", "two_area", "--scenario", "pod_pq", "--stop", "0.02", "--like", "fmpy_ssp"]
    assert main([*command, "--out", str(tmp_path / "like")]) == 0
    # 200 times 1e-4 is less than 0.02: FMPy takes 201 steps
    assert "5 rows" in capsys.readouterr().out
    ours = xr.open_dataset(tmp_path / "like" / "pod_pq" / "trajectory.nc")
    assert "simulate_ssp" in ours.attrs["like"]
    assert ours.attrs["schedule"] == "fmpy_ssp: gfor, sg1, sg2, grid"
    prepared = prepare_one("two_area", "pod_pq")
    names = ["sg1.omega", "gfor.p", "grid.bus_2.v"]
    job = job_of(prepared.system, H, 0.02, names) | {"ssp": str(tmp_path / "system.ssp")}
    write_ssp(prepared.system, job, tmp_path / "system.ssp")
    rows = np.array(drivers.fmpy_ssp(job)[0])[::50]
    assert np.abs(rows[:, 0] - ours["time"].values).max() < 1e-9
    assert np.array_equal(rows[:, 1:], np.column_stack([ours[name].values for name in names]))
    others = emulate(prepared.system, COFMUPY_GAUSS_SEIDEL, H, 0.02, names, every=50)
    # another schedule would not have done
    assert np.abs(rows[:, 2] - others.values[:, 1]).max() > 0.01


def test_run_like_an_unknown_master(capsys):
    assert main(["run", "two_area", "--like", "dymola"]) == 2
    assert (
        "there is no master 'dymola' to run like; known are: libcosim, ecos"
        in capsys.readouterr().err
    )


def test_an_order_without_a_master_to_follow(capsys):
    assert main(["run", "two_area", "--order", "grid,gfor"]) == 2
    assert "--order goes with --like" in capsys.readouterr().err
