"""Every faulty FMU is caught by the name of its fault, and no good one is failed: the confusion table.

`.ci/nightly` makes the whole of it; a landing looks at a part of them.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from fmus.toolchain.catalogue import build_model
from fmus.toolchain.exporter import cached
from fmus.toolchain.native_fmu import NativeFmu
from orchestrator.devices.acceptance.checks import droop, port, ride_through
from orchestrator.devices.acceptance.runner import check_fmu
from orchestrator.devices.sandbox.resource_limits import Limits
from orchestrator.face.api.acceptance import Acceptance
from tests.devices.acceptance.gallery.build import build, check_macros
from tests.devices.acceptance.gallery.hostile import HOSTILE
from tests.devices.acceptance.gallery.members import LAG, converter, faulty, good, small

ROOT = Path(__file__).parents[3]
TABLE = Path(__file__).parent / "gallery" / "README.md"
OURS = ("gfor", "synchronous_generator_st1", "synchronous_generator_st4b", "two_area_grid")
LIMITS = Limits(seconds=6.0)
"""Less than a user's, so that what hangs is given up soon."""


def checked(path, binding=None, only=()):
    return check_fmu(path, binding, LIMITS, only, run_for=0.5)


@pytest.fixture(scope="module")
def clean(gallery):
    """Check a good one, once for each check that several faults are held against."""
    return cache(lambda name, only: check_fmu(*gallery(name), LIMITS, (only,), run_for=0.3))


@pytest.mark.parametrize(
    ("name", "only"),
    [
        ("state_of_dip_timer", "state"),
        ("clock_of_single_precision", "later_times"),
        ("gain_of_dips", "after_dips"),
        ("gain_for_a_while", "after_dips"),
        ("gain_of_the_fourth_dip", "after_dips"),
        ("undamped_at_full_power", "evenness"),
        ("angle_of_two_turns", "angles"),
        ("nan_without_power", "operating_points"),
        ("clips_its_start", "operating_points"),
        ("base_of_own_rating", "ratings"),
        ("limit_of_own_rating", "ratings"),
        ("resonance", "signs"),
        ("droop_while_charging", "evenness"),
        ("undamped_while_charging", "evenness"),
        ("damping_off_while_charging", "evenness"),
        ("sign_of_q_at_high_voltage", "signs"),
        ("angle_of_another_turn", "angles"),
        ("droop_of_q_while_charging", "signs"),
        ("refused_in_the_run", "tunables"),
        ("ignored_in_the_run", "tunables"),
        ("current_of_the_minute", "clock"),
        ("feedthrough_of_high_voltage", "feedthrough"),
        ("hidden_state", "state"),
        ("order_of_start_values", "repeatability"),
        ("order_of_inputs", "repeatability"),
        ("sign_bound", "power_balance"),
        ("delayed", "delay"),
        ("delayed_in_dips", "delay"),
        ("step_dependent", "step_invariance"),
        ("rounded_steps", "internal_step"),
        ("shared", "independence"),
        ("crash", "runs"),
        ("undeclared_feedthrough_lag", "feedthrough"),
        ("reset_parameter", "reset"),
        ("outputs_at_exit", "initial_outputs"),
        ("outputs_at_entry", "initial_outputs"),
    ],
)
def test_a_check_finds_its_fault_and_leaves_the_good_one_alone(name, only, gallery, clean):
    member = next(m for m in faulty() if m.name == name)
    found = check_fmu(*gallery(name), LIMITS, (only,), run_for=0.3)
    assert found.faults == [member.fault]
    (failure,) = found.failures
    assert failure.evidence
    assert failure.remedy
    alone = clean("lag" if name.endswith("lag") else "converter", only)
    assert alone.trusted
    assert alone.results[-1].verdict == "pass"


@pytest.mark.parametrize(
    ("name", "fault", "words"),
    [
        (
            "shows_kw_as_mw",
            "wrong units",
            "P_meas is declared in MW and shows 1000 times the P that flows",
        ),
        ("shows_pu_as_mw", "wrong units", "shows 0.0006667 times the P that flows (1/S_n)"),
        ("shows_size_of_power", "wrong sign", "P_meas shows the size of the P that flows"),
        ("converter_shows_mw", "", "no wrong unit is seen"),
        ("converter_shows_pu", "", "no wrong unit is seen"),
    ],
)
def test_power_in_another_unit_than_declared_is_told(name, fault, words, gallery):
    """An honest one shows it before its filter's losses."""
    found = check_fmu(*gallery(name), LIMITS, ("shown_power",), run_for=0.3)
    assert found.faults == ([fault] if fault else [])
    assert words in found.results[-1].evidence


@pytest.mark.parametrize(
    ("name", "faults"), [("converter_of_battery", []), ("battery_of_the_time", ["counts time"])]
)
def test_a_state_of_charge_that_falls_evenly_is_no_count_of_time(name, faults, gallery):
    """The droop of both follows the charge, by 0.4 % in a minute; that of one triples after 20 s as well."""
    found = check_fmu(*gallery(name), LIMITS, ("steady_state", "later_times"), run_for=1.0)
    assert found.faults == faults
    assert "what it stores (soc) moves by" in found.results[-1].evidence


def test_a_sum_of_times_in_single_precision_shows_after_a_rest(gallery):
    found = check_fmu(
        *gallery("sum_of_single_precision"), LIMITS, ("steady_state", "later_times"), run_for=1.0
    )
    assert found.faults == ["counts time"]


@pytest.mark.parametrize(
    ("name", "only", "words"),
    [
        (
            "held",
            "sample_time",
            "its outputs change every 1 ms only: 90 % of all steps of 100 µs do nothing",
        ),
        ("sixty_hertz", "rated_frequency", "so it is made for 60 Hz where 50 Hz is bound"),
        ("crash_in_dip", "limits", "s: its process died with SIGSEGV in fmi2DoStep"),
        ("limit_of_a_short_time", "limits", " s at 0.1"),
        ("limit_of_three_dips", "limits", "after a series of events"),
        ("limit_until_overvoltage", "limits", "in a voltage that lasts"),
        ("blocks_after_deep_dips", "limits", "it gives no current for"),
        ("trips_below_088", "limits", "it gives no current any more after the dip to 0.8"),
        ("limit_that_latches", "limits", "pu in the same dip at the start"),
    ],
)
def test_the_verdict_says_what_happened(name, only, words, gallery):
    found = check_fmu(*gallery(name), LIMITS, (only,), run_for=0.3)
    assert words in found.failures[0].evidence


def test_the_frequency_that_a_device_is_made_for_is_in_the_verdict(tmp_path):
    """Its omega is 1 at rest, and shows it only where the network's frequency moves."""
    file = build(converter("of_sixty", NOMINAL=60.0), tmp_path)
    found = check_fmu(file, None, LIMITS, ("rated_frequency", "signs"), run_for=0.3)
    assert found.results[-1].figures["made_for_hz"] == pytest.approx(60, abs=0.01)
    assert "wrong rated frequency (made for 60 Hz): give" in found.sentence


def test_a_crash_is_told_with_the_checks_that_led_to_it(tmp_path):
    """As an export whose heap is damaged by an earlier call, and which dies in a later instance."""
    lag = small("damaged_by_reset", "LAG", LAG, step_size="1e-3", stop_time="2")
    path = build(replace(lag, defines={**lag.defines, "FAULT_DAMAGED_BY_RESET": 1}), tmp_path)
    found = check_fmu(path, None, LIMITS, ("repeatability", "reset", "sample_time"), run_for=0.3)
    (failure,) = found.failures
    assert (failure.check, failure.fault) == ("sample_time", "crash")
    assert (
        "not so in a new process: what came before it, repeatability, reset, damaged"
        in failure.evidence
    )
    alone = check_fmu(path, None, LIMITS, ("sample_time",), run_for=0.3)
    assert alone.faults == []


def test_an_omega_that_lags_is_told(tmp_path):
    found = check_fmu(
        build(converter("lags", FAULT_OMEGA_LAGS=2.0), tmp_path),
        None,
        LIMITS,
        ("signs",),
        run_for=0.3,
    )
    assert found.results[-1].verdict == "remark"
    assert (
        "still on its way to the network's 0.999, and its power rests" in found.results[-1].evidence
    )


def test_an_answer_that_another_rating_changes_is_told(tmp_path):
    path = build(converter("own_droop", DROOP_OF_OWN_RATING=1), tmp_path)
    only = ("steady_state", "power_balance", "ratings")
    assert check_fmu(path, None, LIMITS, only, run_for=0.3).trusted
    *_, found = check_fmu(path, None, LIMITS, only, run_for=0.3).results
    assert found.verdict == "remark"
    assert "its answer to less voltage and frequency is" in found.evidence
    path = build(converter("blocks", FAULT_BLOCKS_BELOW=0.35), tmp_path)
    # no current in a dip, at any rating
    assert check_fmu(path, None, LIMITS, only, run_for=0.3).trusted


def test_a_limit_that_was_not_watched_to_the_end_is_said(gallery, monkeypatch):
    monkeypatch.setattr(ride_through, "scale", lambda *_: 0.3)
    found = check_fmu(*gallery("converter"), LIMITS, ("limits",), run_for=0.3)
    assert found.not_judged == ["whether its limit lasts for more than 6 s"]


def test_an_angle_that_turns_back_by_less_than_a_turn_is_told(tmp_path):
    path = build(converter("wraps", WRAPS_BY=6.0), tmp_path)
    found = check_fmu(
        path, None, LIMITS, ("steady_state", "power_balance", "signs"), run_for=0.3
    ).results[-1]
    assert found.verdict == "remark"
    assert "pu away" in found.evidence
    assert "theta_0 = 3 rad" in found.evidence


def test_a_swing_that_is_the_same_everywhere_is_not_uneven(tmp_path):
    """Of one draw in some hundred a remark tells a jump: its swing goes on while the frequency is moved on."""
    path = build(converter("swings", UNDAMPED_WHERE=1), tmp_path)
    assert check_fmu(path, None, LIMITS, ("evenness",), run_for=0.3).faults == []


def test_a_sign_that_turns_with_larger_changes_of_the_frequency_is_found(tmp_path):
    path = build(converter("turns", FAULT_TURNS_BELOW=-0.004), tmp_path)
    (*_, found) = check_fmu(path, None, LIMITS, ("evenness",), run_for=0.3).results
    assert found.fault == "wrong sign"
    assert "with 0.5 % less frequency its active power goes the wrong way" in found.evidence


@pytest.mark.parametrize(
    ("defines", "only", "fault"),
    [
        ({"FAULT_TRIPLES_IN_SWELL": 0.3}, "after_dips", "changed by a disturbance"),
        ({"FAULT_LIMIT_OFF_WHERE": "(m[Q_REF] < -0.2)"}, "limits", "no current limit"),
    ],
)
def test_what_a_lasting_overvoltage_and_a_dip_while_absorbing_bring_is_found(
    defines, only, fault, tmp_path
):
    path = build(converter("plant", **defines), tmp_path)
    assert check_fmu(path, None, LIMITS, (only,), run_for=0.3, seed=1).faults == [fault]


def test_a_drift_that_begins_after_half_a_minute_is_looked_for_where_it_showed(
    tmp_path, monkeypatch
):
    """At rest there would be no time for it; the run with small changes had."""
    monkeypatch.setattr(port, "_PART", 0.0)
    path = build(converter("drifts", FAULT_DRIFTS_AFTER=30.0, FAULT_DRIFTS_BY=0.1), tmp_path)
    assert check_fmu(path, None, LIMITS, ("steady_state",)).trusted
    assert check_fmu(path, None, LIMITS, ("runs", "steady_state")).faults == [
        "leaves its steady state"
    ]


@pytest.mark.parametrize("name", ["gain_of_the_fourth_dip", "gain_for_a_while", "wound_up"])
def test_states_that_come_back_show_the_same_after_dips(name, gallery):
    """In one run what else takes a run for each answer."""
    alone, known = (
        check_fmu(*gallery(name), LIMITS, only, run_for=0.3).results[-1]
        for only in (("after_dips",), ("reading", "state", "after_dips"))
    )
    assert known == alone
    assert alone.fault


def test_a_place_at_which_its_small_answer_jumps_is_told(tmp_path):
    path = build(converter("clips", FAULT_CLIPS_Q=0.3), tmp_path)
    (*_, found) = check_fmu(path, None, LIMITS, ("evenness",), run_for=0.3).results
    assert found.verdict == "remark"
    assert "its answer to a small change jumps by" in found.evidence


def test_power_that_moves_in_steps_is_told(tmp_path):
    path = build(converter("coarse", FAULT_COARSE_POWER=0.01), tmp_path)
    found = check_fmu(
        path, None, LIMITS, ("steady_state", "power_balance", "operating_points"), run_for=0.3
    )
    assert found.results[-1].verdict == "remark"
    assert "it takes its power in steps" in found.results[-1].evidence


def test_what_was_not_judged_stands_in_the_verdict(gallery, monkeypatch):
    """A droop of reactive power whose law is not seen, of the wrong sign besides."""
    monkeypatch.setattr(droop, "droop", lambda found: None)
    found = check_fmu(
        *gallery("q_measured"), LIMITS, ("steady_state", "power_balance", "signs"), run_for=0.3
    )
    assert found.trusted
    assert found.not_judged == ["the sign of its droop of reactive power"]
    assert "no check failed; not judged: the sign of its droop of reactive power" in repr(
        Acceptance(found)
    )


def test_a_crowded_machine_makes_no_good_fmu_hang(gallery, monkeypatch):
    monkeypatch.setattr(os, "getloadavg", lambda: (3.0 * os.cpu_count(), 0.0, 0.0))
    found = check_fmu(*gallery("hang"), Limits(seconds=1.0), ("runs",), run_for=0.3)
    assert "no answer within 3 s in fmi2DoStep" in found.failures[0].evidence


@pytest.mark.slow
def test_a_slight_leak_of_each_instance_is_a_remark(tmp_path):
    """As most FMUs of a well-known tool have it; no study would notice."""
    path = build(converter("leaking_slightly", FAULT_LEAK_INSTANCE=300), tmp_path)
    (_, found) = check_fmu(path, None, LIMITS, ("memory",), run_for=0.3).results
    assert found.verdict == "remark"
    # The interpreter keeps 2 to 4 kB a block besides; a busy machine has fewer instances in a block, ten at least.
    assert 200 < found.figures["instance"] < 300 + 4096 / 10


@pytest.mark.slow
def test_the_droop_of_a_converter_whose_q_is_reversed_is_found_in_number(gallery):
    """By static answers alone: 5 % of the gallery's converter, with the wrong sign."""
    found = check_fmu(*gallery("q_measured"), LIMITS, ("signs",), run_for=0.3)
    assert "rises by 5 % a pu of reactive power" in found.failures[0].evidence


@pytest.mark.parametrize("name", ["forged_everywhere", "forged_in_binary", "forged_and_stays"])
def test_an_fmu_does_not_reach_its_verdict(name, gallery):
    """It writes results to every path and file, and over the memory that it shares; then it ends or stays."""
    asked = ("fmi_validity", "runs", "repeatability")
    found = check_fmu(*gallery(name), LIMITS, asked, run_for=0.3)
    assert [r.check for r in found.results] == ["archive", *asked]
    assert found.results[2].verdict == "fail"
    assert not found.trusted
    assert not any("all is well" in r.evidence for r in found.results)


def test_forged_results_do_not_hide_what_is_wrong(gallery):
    found = check_fmu(*gallery("forged_results"), LIMITS, ("runs", "repeatability"), run_for=0.3)
    assert found.faults == ["not a number"]


def test_every_macro_of_a_member_is_read_by_its_c_file():
    for member in (*good(), *faulty()):
        check_macros(member.source)


def test_a_macro_that_nothing_reads_is_refused():
    with pytest.raises(ValueError, match="reads the macro FAULT_ABSOLUTE_ANGLE; plant it"):
        check_macros(converter("absolute", FAULT_ABSOLUTE_ANGLE=1))


def test_pages_and_table_count_the_galleries_members():
    """The README, the validation pages, and the gallery's own table."""
    whole = len(good()) + 2 * len(OURS)
    faults = len(faulty()) + len(HOSTILE)
    named = {m.name for m in (*good(), *faulty())} | set(HOSTILE)
    rows = [
        line.split("|")[1].strip()
        for line in TABLE.read_text(encoding="utf-8").splitlines()
        if "| yes |" in line
    ]
    assert {row for row in rows if "(" not in row} == named
    assert len(rows) == whole + faults
    pages = {
        "README.md": "{} FMUs",
        ".docs/validation/index.md": "{} FMUs",
        ".docs/validation/foreign-fmus.md": "has {} FMUs: {} good ones",
    }
    for page, words in pages.items():
        assert words.format(whole + faults, whole) in (ROOT / page).read_text(encoding="utf-8"), (
            page
        )
    assert f"{faults} faulty ones" in (ROOT / ".docs/validation/foreign-fmus.md").read_text(
        encoding="utf-8"
    )


@pytest.mark.slow
def test_some_good_ones_pass_and_some_faulty_ones_are_caught(gallery):
    """Of the whole table, which is made each night, every third good one and every sixteenth faulty one."""
    rows = [("", m) for m in good()[::3]] + [(m.fault, m) for m in faulty()[::16]]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        reports = list(pool.map(lambda row: checked(*gallery(row[1].name), row[1].only), rows))
    for (fault, member), report in zip(rows, reports, strict=True):
        assert (fault in report.faults) if fault else report.trusted, (
            f"{member.name}: {report.failures}"
        )


@pytest.mark.nightly
@pytest.mark.slow
def test_the_confusion_table(gallery, fmu_path, tmp_path):
    rows = [(m.name, "", "", *gallery(m.name), m.only) for m in good()]
    rows += [(f"{name} (Python-backed)", "", "", fmu_path(name), None) for name in OURS]
    rows += [
        (f"{name} (native)", "", "", cached(NativeFmu(build_model(name))), None) for name in OURS
    ]
    rows += [(m.name, m.fault, m.thread, *gallery(m.name), m.only) for m in faulty()]
    plain, _ = gallery("gain")
    rows += [
        (name, fault, "", make(tmp_path, plain), None) for name, (make, fault) in HOSTILE.items()
    ]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        reports = list(pool.map(lambda row: checked(*row[3:]), rows))
    lines, wrong = [], []
    for (name, fault, thread, *_), report in zip(rows, reports, strict=True):
        caught = (fault in report.faults) if fault else report.trusted
        assert not [r for r in report.results if "failed by itself" in r.evidence]
        also = ", ".join(f for f in report.faults if f != fault)
        said = (
            f"[{thread}](https://github.com/{thread.replace('#', '/issues/')})" if thread else "—"
        )
        lines.append(
            f"| {name} | {fault or '—'} | {said} | {'yes' if caught else 'NO'} | {also or '—'} |"
        )
        wrong += (
            []
            if caught
            else [f"{name}: {fault or 'good'}, found {report.faults}: {report.failures}"]
        )
    assert not wrong, "\n".join(wrong)
    table = "\n".join(
        [
            "| FMU | its fault | reported in | caught, or passed if good | also found |",
            "|---|---|---|---|---|",
            *lines,
        ]
    )
    if os.environ.get("GFOR_WRITE_TABLES"):
        before = TABLE.read_text(encoding="utf-8").partition("| FMU |")[0]
        TABLE.write_text(f"{before}{table}\n", encoding="utf-8")
    written = TABLE.read_text(encoding="utf-8")
    for line in lines:
        assert " | ".join(line.split(" | ")[:4]) in written, line
