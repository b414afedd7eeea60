"""What is wrong with a code's table or words is one clear error; help, page and errors name all codes."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orchestrator.core.errors import InputError
from orchestrator.studies.certification.codes import criteria as c
from orchestrator.studies.certification.codes import known, row
from orchestrator.studies.certification.codes.all_codes import CODES
from orchestrator.studies.certification.codes.bench_point import INTERVAL, BenchResult
from orchestrator.studies.certification.codes.known import KNOWN, code_for
from orchestrator.studies.certification.codes.miso import MISO
from orchestrator.studies.certification.codes.nts631 import NTS
from orchestrator.studies.certification.codes.programme import voltage
from orchestrator.studies.certification.codes.row import CodeRow, GridCode
from orchestrator.studies.certification.codes.row_verdict import judge_row, try_criteria

PAGE = Path(__file__).parents[4] / ".docs" / "how-to" / "certify.md"
RTE = code_for("rte", {"X_eff": 0.15, "D": 20.0, "H": 1.0})
WORDS = row._WORDS["miso"]


def without(name):
    return {key: word for key, word in WORDS.items() if key != name}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (None, "words.toml has no section [cei]; a code has its words there: title, source"),
        (
            WORDS | {"reading": []},
            "words.toml, [cei]: 'reading' is no word of a code; its words are title",
        ),
        (without("f_n"), "words.toml, [cei]: f_n is missing; give the rated frequency [Hz]"),
        (
            WORDS | {"left_out": "much"},
            "words.toml, [cei]: left_out = 'much'; give a list of texts",
        ),
    ],
)
def test_words_that_are_not_as_they_should_be_are_told_and_help_lives(monkeypatch, words, said):
    monkeypatch.setattr(row, "_WORDS", {**row._WORDS, **({"cei": words} if words else {})})
    # no error yet: help and other codes live on
    monkeypatch.setattr(known, "KNOWN", {**KNOWN, "cei": GridCode.of("cei", MISO.rows)})
    with pytest.raises(InputError, match=re.escape(said)):
        code_for("cei", {})
    assert "cei" in row.in_words("cei")


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ((), "code 'miso' has no row; give it one at least"),
        (
            (*MISO.rows, MISO.rows[0]),
            "two rows are named 'llsm_charging', and would be judged as one",
        ),
        (
            (replace(MISO.rows[0], name="a/b"),),
            "row 'a/b': a file is named so; take letters, digits and _",
        ),
        (
            (replace(MISO.rows[0], criteria=()),),
            "row 'llsm_charging' asks for nothing; give it a criterion",
        ),
    ],
)
def test_rows_that_cannot_be_are_told(monkeypatch, rows, said):
    monkeypatch.setattr(known, "KNOWN", {**KNOWN, "miso": GridCode.of("miso", rows)})
    with pytest.raises(InputError, match=re.escape(said)):
        code_for("miso", {})


@pytest.mark.parametrize(
    "judge", [c.opposes_jump(4, 1, 0.2), c.settles(events=(-5,)), c.inertia(9, 1, 1, 1)]
)
def test_an_event_that_a_row_lacks_is_told_before_the_run(judge):
    jumps = next(one for one in MISO.rows if one.name == "phase_jumps")
    bad = replace(jumps, criteria=(*jumps.criteria, judge))
    with pytest.raises(
        InputError,
        match=r"code 'miso', row 'phase_jumps': a criterion asks for event -?\d, and "
        "there are 4, numbered from 0",
    ):
        try_criteria(GridCode.of("miso", (*MISO.rows[:2], bad)), 60.0)


def test_a_row_in_which_nothing_happens_is_told():
    still = replace(
        MISO.rows[3], programme=lambda f: replace(MISO.rows[3].programme(f), changes=())
    )
    with pytest.raises(
        InputError, match="row 'rocof': a criterion asks for event 1, and there are 0"
    ):
        try_criteria(GridCode.of("miso", (still,)), 60.0)


@pytest.mark.parametrize("code", [*CODES.values(), RTE], ids=lambda code: code.key)
def test_all_codes_can_be_used(code):
    assert (code.fault, NTS.fault) == ("", "")
    try_criteria(code, code.f_n)


def broken(one, times, kind):
    """A response of half power with one thing wrong: it slips, trips, gives no number, ends early, carries too much."""
    angle = one.programme(50.0).source_angle(times, 50.0)
    turned = 0.0 if angle is None else angle
    p = np.full(times.shape, 0.5 if kind != "trip" else 0.0)
    p[times < 0.9] = 0.5
    v, q = (
        np.ones(times.shape),
        np.full(times.shape, 9.0 if kind == "current" else 0.1 if kind != "trip" else 0.0),
    )
    if kind == "nan":
        p[-1] = np.nan
    signals = {
        "p": p,
        "q": q,
        "v": v,
        "v_re": np.cos(turned) * v,
        "v_im": np.sin(turned) * v,
        "duplicate.p": p,
        "source.p": v,
    }
    found = (
        [{"kind": "loss_of_synchronism", "time": 1.3, "message": "it slips"}]
        if kind == "slip"
        else []
    )
    cut = slice(None, -400 if kind == "early" else None)
    return BenchResult(one.name, times[cut], {n: s[cut] for n, s in signals.items()}, found)


@pytest.mark.parametrize("kind", ["slip", "trip", "nan", "early", "current"])
def test_a_row_that_fails_has_a_reason_in_words(kind):
    """Of all codes, with each criterion alone and with all, so also where none asks for holding together."""
    rows = {
        (type(one), one.name[:5], len(one.criteria)): one
        for code in (*CODES.values(), RTE)
        for one in code.rows
    }
    for one in rows.values():
        times = np.arange(0, one.programme(50.0).stop + INTERVAL, INTERVAL)
        for criteria in (one.criteria, *((judge,) for judge in one.criteria)):
            alone = CodeRow(one.name, "", "", one.programme, criteria)
            verdict = judge_row(alone, broken(one, times, kind), 50.0)
            assert verdict.accepted is False, (one.name, criteria)
            assert verdict.failed, (one.name, criteria)
            assert all(f.text.strip() and f.criterion for f in verdict.failed)


def test_the_page_has_the_codes_that_there_are():
    table = [
        [cell.strip() for cell in line.split("|")[1:]]
        for line in PAGE.read_text("utf-8").splitlines()
        if line.startswith("| `")
    ]
    said = {
        cells[0].split("`")[1]: (cells[1], cells[2]) for cells in table if cells[2] in ("50", "60")
    }
    assert said == {
        key: (row._WORDS[key]["where"], f"{row._WORDS[key]['f_n']:g}") for key in row._WORDS
    }
    assert set(row._WORDS) == {*KNOWN, NTS.key, "gb", "frequency"}


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("NTS-631", "nts631"),
        ("spain", "nts631"),
        ("NERC PRC-029-1", "prc029"),
        ("texas", "ercot or nogrr245"),
        ("misa", "miso"),
        ("italy", ""),
    ],
)
def test_a_code_that_there_is_not_has_near_ones(gfor, typed, meant):
    code, _, said = gfor("certify", "x.fmu", "--code", typed)
    assert code == 2
    assert (f"did you mean {meant}?" if meant else "tr331 (Denmark, 50 Hz)") in " ".join(
        said.split()
    )


def test_a_dip_is_pairs_of_a_time_and_a_factor():
    dip = voltage(5.0, 0.5, ((0.0, 0.7), (0.15, 1.0)), 6.0)
    assert [(c.time, c.value) for c in dip.changes] == [(1.0, 0.7), (1.15, 1.0)]


@pytest.mark.parametrize("factors", [((0.7, 0.0), (1.0, 0.15)), ((0.0, 0.7), (0.0, 1.0)), ()])
def test_a_dip_that_is_written_the_other_way_round_is_refused(factors):
    """Read as it stands, it takes the voltage away for good."""
    dip = replace(MISO.rows[0], name="dip", programme=lambda _: voltage(5.0, 0.5, factors, 6.0))
    says = r"code 'miso', row 'dip': voltage: .* pairs \(time, factor\) whose first time is 0"
    with pytest.raises(InputError, match=says):
        try_criteria(replace(MISO, rows=(dip,)), 60.0)
