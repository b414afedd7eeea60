"""Which schedule a tool runs is told from its output, whatever that looks like; FMPy, always there, is asked."""

import json
from functools import cache

import numpy as np
import pytest

from orchestrator.core.errors import InputError
from orchestrator.face.cli import main
from orchestrator.simulation.interop.probe_result import (
    EXTRAPOLATIONS,
    SIGNALS,
    candidates,
    probe_system,
    read_probe_result,
)
from orchestrator.simulation.interop.rules import MASTERS
from orchestrator.simulation.interop.which_master import PROPERTIES, identify
from tests.simulation.interop import drivers
from tests.simulation.interop.jobs import job_of, write_ssp
from tests.support.once import computed_once

H, N = 0.1, 20
HEADS = ["time", *SIGNALS]


@computed_once
def every():
    return [pair for extrapolation in EXTRAPOLATIONS for pair in candidates(H, N, extrapolation)]


def table(rows, heads=HEADS, separator=",", text=repr):
    lines = [
        separator.join(heads),
        *(separator.join(text(float(value)) for value in row) for row in rows),
    ]
    return "\n".join(lines) + "\n"


def rows_of(trajectory):
    """With labels; where nothing is known there is no row."""
    rows = np.column_stack([np.arange(len(trajectory)) * H, trajectory])
    return rows[~np.isnan(rows).any(axis=1)]


@pytest.fixture
def told(tmp_path):
    """Text of a result → verdict."""

    def tell(text, **settings):
        path = tmp_path / "result.csv"
        path.write_text(text, encoding="utf-8")
        return identify(read_probe_result(path, settings.pop("named", None)), **settings)

    return tell


def one(**properties):
    """Rows of the schedule with these properties; the rest as our own."""
    usual = {
        "order": "side by side",
        "first_inputs": "consistent",
        "extrapolation": 0.0,
        "early_label": 0,
    }
    wanted = usual | {"after_exchange": False, "wire_by_wire": False} | properties
    ((candidate, rows),) = [
        p for p in every() if all(getattr(p[0], name) == wanted[name] for name in PROPERTIES)
    ]
    return candidate, rows_of(rows)


# -- every schedule --------------------------------------------------------------------------------


def test_every_schedule_is_told(told):
    """From all signals with all digits: nothing else fits but what gives the very same values."""
    assert len(every()) == 228
    for candidate, rows in every():
        verdict = told(table(rows_of(rows)))
        assert candidate in verdict.fits
        for fit in verdict.fits:
            other = dict(every())[fit]
            both = ~np.isnan(rows) & ~np.isnan(other)
            assert np.abs(rows - other)[both].max() < 1e-9


def test_every_schedule_is_told_from_two_outputs_with_six_digits(told):
    for candidate, rows in every():
        verdict = told(table(rows_of(rows)[:, :3], HEADS[:3], text=lambda value: f"{value:.6g}"))
        assert candidate in verdict.fits
        for name in ("order", "extrapolation", "early_label"):
            assert verdict.answers(name) == [getattr(candidate, name)], candidate


def test_steps_are_counted(told):
    _, rows = one(first_inputs="once", order="a, then b", early_label=1)
    assert told(table(rows)).steps == N + 1
    assert told(table(rows)).masters == ("pathsim",)
    assert told(table(rows[:-1])).steps == N
    assert told(table(rows[:-1])).masters == ("mosaik",)


def test_an_ambiguous_result_lists_all_answers(told):
    """b steps first and is told a's state, propagated or read once; the row before that step is not recorded."""
    candidate, rows = one(order="b, then a", early_label=1)
    verdict = told(table(rows))
    assert verdict.answers("first_inputs") == ["consistent", "once"]
    assert verdict.answers("order") == ["b, then a"]
    assert candidate in verdict.fits


# -- other people's files --------------------------------------------------------------------------


@cache
def plain():
    """Rows of the schedule that the files below hold; computed by the first test that asks."""
    return one(first_inputs="zero", early_label=1)[1]


def as_plain(verdict):
    return verdict.answers("first_inputs") == ["zero"] and verdict.answers("early_label") == [1]


@pytest.mark.parametrize(
    "heads",
    [
        ["Time [s]", "probe_a::y[REAL]", "probe_b::y[REAL]"],
        ["t", "System/A/y", "System/B/y"],
        ["time", '"recorded.a.y"', "recorded.b.y (1)"],
        ["zeit", "a_y", "b_y"],
    ],
)
def test_columns_are_told_by_their_endings(told, heads):
    assert as_plain(told(table(plain()[:, :3], heads)))


def test_columns_of_any_name_are_taken_as_said(told):
    text = table(plain()[:, :3], ["clock", "Lag1", "Lag2"])
    assert as_plain(told(text, named={"time": "clock", "a.y": "Lag1", "b.y": "Lag2"}))


def test_semicolons_with_decimal_commas(told):
    assert as_plain(
        told(table(plain(), separator=";", text=lambda value: f"{value:.12g}".replace(".", ",")))
    )


def test_every_third_row_is_enough(told):
    assert as_plain(told(table(plain()[::3])))


def test_rows_between_communication_points_are_left_out(told):
    middle = (plain()[1:] + plain()[:-1]) / 2
    mixed = np.concatenate([plain(), middle])
    mixed = mixed[np.argsort(mixed[:, 0])]
    mixed[:, -2:] = np.round(mixed[:, -2:] / H) * H  # the counted time is not interpolated
    verdict = told(table(mixed))
    assert as_plain(verdict)
    assert verdict.rows == len(plain())


def test_of_rows_with_one_time_the_last_counts(told):
    before = plain().copy()
    before[:, 1:] += 0.3
    before[:, -2:] = 0
    both = np.stack([before, plain()], axis=1).reshape(-1, plain().shape[1])
    assert as_plain(told(table(both)))


def test_another_step_and_duration(told):
    (rows,) = [
        r
        for c, r in candidates(0.05, 30)
        if (c, None) == (one(first_inputs="zero", early_label=1)[0], None)
    ]
    labelled = np.column_stack([np.arange(31) * 0.05, rows])
    assert as_plain(told(table(labelled), step_size=0.05, stop_time=1.5))


def test_what_no_schedule_gives_fits_none(told):
    strange = plain().copy()
    strange[5:, 1] += 0.05
    verdict = told(table(strange))
    assert verdict.fits == ()
    assert verdict.masters == ()
    assert verdict.steps is None
    assert verdict.nearest.early_label == 1
    assert 0.01 < verdict.difference < 0.1


@pytest.mark.parametrize(
    ("text", "settings", "message"),
    [
        (str, {}, "it has no heading with rows below it"),
        (
            lambda: table(plain()[:, :3], ["when", "a.y", "b.y"]),
            {},
            "no column is seen to be time; columns: when, a.y, b.y",
        ),
        (
            lambda: table(plain()[:, :3], ["time", "p", "q"]),
            {},
            "no column is seen to be a.y and b.y",
        ),
        (
            lambda: table(plain()[:, :3], ["time", "1.a.y", "2.a.y"]),
            {},
            "a.y may be any of 1.a.y, 2.a.y; say which with --column",
        ),
        (
            lambda: table(plain()[:, :3], HEADS[:3]),
            {"named": {"a.y": "Lag"}},
            "it has no column 'Lag'; columns: time, a.y, b.y",
        ),
        (
            lambda: table(plain()[:, :3], HEADS[:3]),
            {"named": {"a.x": "a.y"}},
            "there is no signal a.x; signals: time, a.y",
        ),
        (lambda: "time,a.y\n0,1\n0.1,x\n", {}, "row 2, column 'a.y': 'x' is not a finite number"),
        (lambda: "time,a.y\n0,1\n0.1\n", {}, "row 2, column 'a.y': '' is not a finite number"),
        (lambda: table(plain()[:3]), {}, "only 3 of 3 rows are at multiples of 0.1 s up to 2 s"),
        (
            lambda: table(plain()),
            {"step_size": 0.03},
            "2 s are not a whole number of steps of 0.03 s",
        ),
        (
            lambda: table(plain()),
            {"step_size": 0.2},
            "a.stepped is 0.1 s in a row, no multiple of 0.2 s",
        ),
    ],
)
def test_what_cannot_be_read_gets_one_clear_error(told, text, settings, message):
    with pytest.raises(InputError) as error:
        told(text(), **settings)
    assert message in str(error.value)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="cannot be read: No such file"):
        read_probe_result(tmp_path / "none.csv")


def test_a_file_that_is_not_text(tmp_path):
    (tmp_path / "result.mat").write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match="it is not text"):
        read_probe_result(tmp_path / "result.mat")


# -- a master that is always there, and the command ------------------------------------------------


@pytest.mark.parametrize(
    ("master", "alike"), [("fmpy_ssp", {"fmpy_ssp", "cofmupy"}), ("fmpy_container", None)]
)
def test_fmpy_is_recognised(master, alike, told, tmp_path):
    system = probe_system()
    job = job_of(system, H, N * H, list(SIGNALS)) | {"ssp": str(tmp_path / "probes.ssp")}
    write_ssp(system, job, tmp_path / "probes.ssp")
    rows, _ = drivers.MASTERS[master](job)
    verdict = told(table(rows))
    assert set(verdict.masters) == (alike or {master})
    assert verdict.difference == 0
    assert len(rows) == MASTERS[master].rows(H, N * H)


def test_the_command_builds_the_pair_and_reads_what_it_gave(tmp_path, capsys):
    kit = tmp_path / "kit"
    assert main(["master", "which", "--build", str(kit)]) == 0
    assert sorted(path.name for path in kit.iterdir()) == [
        "INSTRUCTIONS.md",
        "probe_a.fmu",
        "probe_b.fmu",
    ]
    page = (kit / "INSTRUCTIONS.md").read_text(encoding="utf-8")
    assert "`a.y` → `b.u`" in page
    assert "**0.1 s**" in page
    job = job_of(probe_system(), H, N * H, list(SIGNALS))
    job["fmus"] = {name: str(kit / f"probe_{name}.fmu") for name in "ab"}
    rows, _ = drivers.fmpy_container(job)
    result = tmp_path / "result.csv"
    result.write_text(table(rows), encoding="utf-8")
    capsys.readouterr()
    assert main(["master", "which", str(result)]) == 0
    out = capsys.readouterr().out
    assert "one after the other" in out
    assert "fmpy_container" in out
    assert "These schedules give the same values here:" in out
    assert main(["master", "which", str(result), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["told"]["wire_by_wire"] is True
    assert found["told"]["first_inputs"] is None
    assert (found["steps"], found["intervals"]) == (N, N)


def test_the_command_says_when_nothing_fits(tmp_path, capsys):
    strange = plain().copy()
    strange[5:, 1] += 0.05
    result = tmp_path / "result.csv"
    result.write_text(table(strange), encoding="utf-8")
    assert main(["master", "which", str(result)]) == 1
    assert "None of the schedules known here gives these values" in capsys.readouterr().out


@pytest.mark.parametrize("arguments", [[], ["result.csv", "--build", "kit"]])
def test_either_a_result_or_a_folder(arguments, capsys):
    assert main(["master", "which", *arguments]) == 2
    assert "give either the tool's RESULT.csv, or --build DIR" in " ".join(
        capsys.readouterr().err.split()
    )


def test_a_column_without_a_heading(tmp_path, capsys):
    assert main(["master", "which", str(tmp_path / "r.csv"), "--column", "a.y"]) == 2
    assert "write SIGNAL=HEADING" in capsys.readouterr().err
