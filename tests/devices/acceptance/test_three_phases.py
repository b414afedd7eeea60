"""Devices with three phases at voltages that are not balanced: what is measured, and what is found."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orchestrator.core.errors import BindingError
from orchestrator.devices.acceptance import process
from orchestrator.devices.acceptance.checks import phase_source, sequences, unbalanced
from orchestrator.devices.acceptance.checks.subject import Use
from orchestrator.devices.acceptance.runner import check_fmu
from orchestrator.devices.binding.binding import bind
from orchestrator.devices.binding.draft import draft_binding
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.sandbox.resource_limits import Limits
from tests.devices.acceptance.gallery.build import build, check_macros
from tests.devices.acceptance.gallery.three_phases import honest, planted, three_phase

OMEGA = 100 * np.pi
ASKED = ("phase_order", "negative_sequence", "unbalanced_dips")
IMPEDANCE = 0.03 + 0.25j  # of phases.c [pu] at 50 Hz


def checked(member, folder, only=ASKED, **options):
    binding = folder / f"{member.name}.toml"
    binding.write_text(member.binding, encoding="utf-8")
    options.setdefault("seed", 5)
    report = check_fmu(
        build(member.source, folder), binding, Limits(seconds=6.0), only, run_for=0.3, **options
    )
    return report, {result.check: result for result in report.results}


def test_the_power_of_three_phases_swings_as_both_sequences_say():
    """Against v_a·i_a + v_b·i_b + v_c·i_c, and the same with the voltages of the two other phases for Q."""
    voltage = sequences.SequencePair(1.02 * np.exp(0.1j), 0.03 * np.exp(1.3j))
    current = sequences.SequencePair(0.6 * np.exp(-0.4j), 0.2 * np.exp(2.1j))
    times = np.arange(2000) * 1e-5
    v, i = (
        pair.positive + np.conj(pair.negative) * np.exp(-2j * OMEGA * times)
        for pair in (voltage, current)
    )
    assert sequences.pair_of(v, times, OMEGA).negative == pytest.approx(voltage.negative, abs=1e-9)
    volts, amperes = (sequences.in_phases(x, times, OMEGA) for x in (v, i))
    across = np.roll(volts, -1, axis=1) - np.roll(volts, -2, axis=1)  # v_b − v_c beside i_a
    found = sequences.ripple_of(voltage, current)
    for power, expected in (
        ((volts * amperes).sum(axis=1) * 2 / 3, found.p),
        (-(across * amperes).sum(axis=1) * 2 / 3 / np.sqrt(3), found.q),
    ):
        assert np.ptp(power) / 2 == pytest.approx(expected, rel=1e-4)
    assert np.abs(amperes).max(axis=0) == pytest.approx(current.of_phases, rel=1e-4)
    assert sequences.cycles_of(amperes, 2000)[0] == pytest.approx(current.of_phases, rel=1e-4)


def test_a_source_whose_phases_differ_has_the_sequences_of_a_text_book():
    """One phase to 0.4; two phases that meet each other, which leaves half of both sequences."""
    one = phase_source.of_phase_factors((0.4, 1, 1))
    assert one.positive == pytest.approx(0.8)
    assert one.negative == pytest.approx(-0.2)
    third = np.exp(2j * np.pi / 3)
    two = phase_source.of_phase_factors((1, -0.5 * third, -0.5 / third))
    assert two.positive == pytest.approx(0.5)
    assert two.negative == pytest.approx(0.5)


def test_an_inductance_has_its_own_admittance_in_both_sequences(tmp_path):
    """1/(R + j·2πf·L) at each frequency, nothing coupled; and the divider with the source's impedance."""
    member = three_phase("passive", PASSIVE=1)
    _, found = checked(member, tmp_path, ("phase_order", "negative_sequence"))
    figures = found["negative_sequence"].figures
    for sequence in ("Y_negative", "Y_positive"):
        assert len(figures[sequence]) >= 9
        for hertz, value in figures[sequence].items():
            exact = 1 / complex(IMPEDANCE.real, IMPEDANCE.imag * float(hertz) / 50)
            # by a voltage that is held for a step
            held = (2 * np.pi * (float(hertz) + 50) * 1e-4) ** 2 / 24
            assert complex(*value) == pytest.approx(exact, rel=held + 1e-6)
    assert max(figures["coupling"].values()) < 1e-9
    X = np.hypot(1, 6) / 6 / 10
    source = 1 / (1 / (6 * X) + 1 / (1j * X))
    assert abs(source) == pytest.approx(0.1)
    assert figures["amplified"] == pytest.approx(abs(1 / (1 + source / IMPEDANCE)), rel=5e-3)
    assert figures["I_negative"] == pytest.approx(figures["V_negative"] / abs(IMPEDANCE), rel=2e-3)
    assert "at 50 Hz Y₋ = 0.473 − j3.94 pu of its rating, as 0.03 + j0.25 pu in series" in (
        found["negative_sequence"].evidence
    )


@pytest.mark.parametrize("frame", ["", 'frame_angle = "-90 deg"'])
def test_a_dip_of_one_phase_is_the_one_of_two_sequence_networks(frame, tmp_path, monkeypatch):
    """A voltage E behind Z at a source behind Z_s: each sequence by itself, in the device's own phases."""
    factors = (1.0, 0.4, 1.0)
    event = unbalanced._Event("dip of phase b to 0.4 pu", factors, 0.5)
    monkeypatch.setattr(unbalanced, "_events", lambda draw: iter([event]))
    member = three_phase("passive", PASSIVE=1)
    bound = member.binding.replace("[voltage]", f"[voltage]\n{frame}")
    bound = bound.replace("[current]", f"[current]\n{frame}")
    _, found = checked(replace(member, binding=bound), tmp_path, ("phase_order", "unbalanced_dips"))
    X = np.hypot(1, 6) / 6 / 10
    source, start = 1 / (1 / (6 * X) + 1 / (1j * X)), 0.5 - 0.1j  # at the check's operating point
    own, E = 1 + IMPEDANCE * start, 1 - source * start
    parts = phase_source.of_phase_factors(factors)
    current = sequences.SequencePair(
        (own - E * parts.positive) / (IMPEDANCE + source),
        -E * parts.negative / (IMPEDANCE + source),
    )
    voltage = sequences.SequencePair(
        E * parts.positive + source * current.positive,
        E * parts.negative + source * current.negative,
    )
    figures = found["unbalanced_dips"].figures
    assert list(figures["phases"].values()) == pytest.approx(current.of_phases, rel=0.015)
    (lead,) = figures["leads"].values()
    assert lead == pytest.approx(180 - np.degrees(np.angle(IMPEDANCE)), abs=1.5)
    assert "asks for 90 to 100° behind a full converter" in found["unbalanced_dips"].evidence
    ripple = sequences.ripple_of(voltage, current)
    assert (figures["ripple_P"], figures["ripple_Q"]) == pytest.approx(
        (ripple.p, ripple.q), rel=0.01
    )


@pytest.mark.parametrize("member", honest(), ids=lambda member: member.name)
def test_an_honest_device_passes_whatever_it_does_with_a_negative_sequence(member, tmp_path):
    report, found = checked(member, tmp_path)
    assert report.trusted
    assert [found[name].verdict for name in ASKED] == ["pass"] * 3
    assert max(found["unbalanced_dips"].figures["phases"].values()) <= 1.05 * 1.2
    kept = {"balanced_current": 0.0, "negative_sequence_control": 0.5}.get(member.name, 1.0)
    y = complex(*found["negative_sequence"].figures["Y_negative"]["50"])
    assert y == pytest.approx(kept / IMPEDANCE, abs=2e-3)


@pytest.mark.parametrize("member", planted(), ids=lambda member: member.name)
def test_a_planted_fault_of_the_phases_is_named(member, tmp_path):
    check_macros(member.source)
    report, _ = checked(member, tmp_path, member.only or ASKED)
    assert report.faults == [member.fault]


def test_the_page_counts_the_devices():
    page = Path(__file__).parents[3] / ".docs/validation/foreign-fmus.md"
    text = page.read_text(encoding="utf-8")
    assert f"{len(honest())} honest devices with phases pass" in text
    assert f"{len(planted())} with a planted fault are named" in text


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("swapped_both", "phases b and c of its voltages and currents exchanged"),
        ("swapped_current", "phases b and c of its currents exchanged"),
        ("swapped_voltage", "phases b and c of its voltages exchanged"),
    ],
)
def test_the_order_of_the_phases_is_told_by_what_must_be_exchanged(name, words, tmp_path):
    member = next(one for one in planted() if one.name == name)
    _, found = checked(member, tmp_path, ("phase_order",))
    assert found["phase_order"].evidence.endswith(words)


@pytest.mark.parametrize(("moment", "rests"), [("middle", False), ("begin", True)])
def test_our_converter_rests_where_it_is_given_the_begin_of_a_step(
    moment, rests, fmu_path, tmp_path
):
    """Its frame stands still within a step: with the voltages of the middle it leads by half a step."""
    fmu = fmu_path("gfor_abc")
    drafted = draft_binding(read_description(fmu))
    assert 'moment = "begin"  # GUESS: frame.angle stands still' in drafted
    binding = tmp_path / "gfor_abc.toml"
    binding.write_text(
        drafted.replace('moment = "begin"', f'moment = "{moment}"'), encoding="utf-8"
    )
    (*_, found) = check_fmu(fmu, binding, Limits(), ("phase_order",), run_for=0.3).results
    assert found.verdict == "pass"
    assert (found.figures["away"] < 1e-9) is rests


@pytest.mark.parametrize(
    ("form", "table", "says"),
    [
        ("abc", "current", "'moment' is for [voltage]; remove it"),
        ("qd", "voltage", "'moment' is for form 'abc', whose values turn; remove it"),
    ],
)
def test_a_moment_is_for_voltages_in_phases(form, table, says, gallery, tmp_path):
    fmu, binding = gallery(f"converter_{form}_si")
    path = tmp_path / "binding.toml"
    text = binding.read_text(encoding="utf-8")
    path.write_text(text.replace(f"[{table}]", f'[{table}]\nmoment = "begin"'), encoding="utf-8")
    with pytest.raises(BindingError, match=re.escape(says)):
        bind(read_description(fmu), path)


@pytest.mark.slow
def test_a_limit_of_the_mean_is_one_at_balanced_voltages(tmp_path):
    member = next(one for one in planted() if one.name == "limit_of_the_mean")
    report, found = checked(member, tmp_path, ("limits",))
    assert report.faults == []
    assert found["limits"].figures["mean"] < 1.05 * 1.2


def test_a_device_without_phases_is_not_asked(gallery):
    found = check_fmu(*gallery("converter"), Limits(seconds=6.0), ASKED, run_for=0.3).results
    assert {one.verdict for one in found[1:]} == {"not applicable"}
    assert "form abc in its binding" in found[-1].evidence


def test_held_phases_of_a_long_step_are_not_judged(tmp_path):
    _, found = checked(honest()[0], tmp_path, use=Use(step_size=1e-3))
    assert found["phase_order"].verdict == "not applicable"
    assert "held for 1 ms: give a --step of 0.1 ms" in found["phase_order"].evidence


def test_a_source_goes_on_where_a_question_for_many_steps_is_cut(tmp_path, monkeypatch):
    """A run in one piece and the same in pieces, which carry the source's state over."""
    member = honest()[1]
    _, whole = checked(member, tmp_path, ("phase_order", "unbalanced_dips"))
    monkeypatch.setattr(process, "ROOM", 3000)
    _, pieces = checked(member, tmp_path, ("phase_order", "unbalanced_dips"))
    assert pieces["unbalanced_dips"].figures == whole["unbalanced_dips"].figures
