"""What is said of rows in which a converter does not hold together, or on which the code gives no verdict."""

from dataclasses import replace

import numpy as np
import pytest

from orchestrator.studies.certification.codes.all_codes import CODES
from orchestrator.studies.certification.codes.bench_point import BenchResult
from orchestrator.studies.certification.codes.measured import MeasuredRow
from orchestrator.studies.certification.codes.programme import jumps, last_machine, ramps
from orchestrator.studies.certification.codes.row import RowFinding
from orchestrator.studies.certification.codes.row_verdict import RowVerdict, judge_row

pytestmark = pytest.mark.filterwarnings("error")

TIMES = np.arange(0, 21.0005, 1e-3)
"""Of AEMO's rows of jumps."""


def opposing(times=TIMES):
    """Half of the rating, and against each of the four jumps by 0.4 pu for a while."""
    power = np.full(times.shape, 0.5)
    for start, sign in ((1.0, 1), (6.0, -1), (11.0, -1), (16.0, 1)):
        power += sign * 0.4 * np.exp(-np.clip(times - start, 0, None) / 0.1) * (times > start)
    return power


def judged(p, name="jump_30", kind="", **given):
    """A row on a response with that active power, and a finding of that kind at 1.3 s."""
    row = next(row for row in CODES["aemo"].rows if row.name == name)
    signals = {"p": p, "q": np.full(TIMES.shape, 0.1), "v": np.ones(TIMES.shape)} | given
    findings = [{"kind": kind, "time": 1.3, "message": "found"}] if kind else []
    return judge_row(row, BenchResult(name, TIMES, signals, findings), 50.0)


@pytest.mark.parametrize("kind", ["loss_of_synchronism", "run_away", "growth"])
def test_beside_a_slip_nothing_reads_as_accepted(kind):
    """The same response without the slip meets every criterion."""
    assert {f.accepted for f in judged(opposing()).findings} == {True}
    verdict = judged(opposing(), kind=kind)
    stable, *others = verdict.findings
    assert (stable.accepted, verdict.is_judged, verdict.accepted) == (False, True, False)
    assert {(f.accepted, f.margin) for f in others} == {(None, None)}
    assert all("not judged, it" in f.text and "from t = 1.3 s on" in f.text for f in others)
    assert [f.criterion for f in verdict.failed] == ["stable"]
    assert verdict.word(others[0]) == "not judged"


def resonant(p):
    """A row with a slip that the bench's own resonance makes."""
    row = next(row for row in CODES["aemo"].rows if row.name == "jump_30")
    kinds = ("loss_of_synchronism", "bench_resonance")
    findings = [{"kind": kind, "time": 1.3, "message": f"{kind} is found"} for kind in kinds]
    signals = {"p": p, "q": np.full(TIMES.shape, 0.1), "v": np.ones(TIMES.shape)}
    return judge_row(row, BenchResult(row.name, TIMES, signals, findings), 50.0)


def test_what_the_bench_s_own_resonance_makes_is_no_verdict_on_the_converter():
    """Also what it misses beside the slip, which stays missed where the slip is the device's own."""
    verdict = resonant(np.full(TIMES.shape, 0.5))
    assert (verdict.is_judged, verdict.accepted, verdict.failed) == (False, None, [])
    assert verdict.not_judged == "bench_resonance is found"
    assert {(f.accepted, f.margin) for f in verdict.findings} == {(None, None)}
    assert verdict.findings[0].text.startswith(
        "loss_of_synchronism is found; not judged, the bench"
    )
    assert {verdict.word(f) for f in verdict.findings} == {"not judged"}
    assert verdict.margins() == []


def test_a_row_that_is_met_beside_the_bench_s_resonance_stays_met():
    row = next(row for row in CODES["aemo"].rows if row.name == "jump_30")
    findings = [{"kind": "bench_resonance", "time": 1.3, "message": "found"}]
    signals = {"p": opposing(), "q": np.full(TIMES.shape, 0.1), "v": np.ones(TIMES.shape)}
    verdict = judge_row(row, BenchResult(row.name, TIMES, signals, findings), 50.0)
    assert (verdict.is_judged, verdict.accepted, verdict.not_judged) == (True, True, "")


def test_beside_values_that_are_no_numbers_nothing_reads_as_accepted():
    """The last value alone: no criterion looks at it."""
    verdict = judged(np.where(TIMES > 20.9995, np.nan, opposing()))
    assert not any(f.accepted for f in verdict.findings)
    assert "not finite" in verdict.findings[0].text


def test_what_is_missed_beside_a_slip_stays_missed():
    verdict = judged(np.full(TIMES.shape, 0.5), kind="loss_of_synchronism")
    assert [f.accepted for f in verdict.findings[1:5]] == [False] * 4
    assert verdict.findings[1].margin == pytest.approx(-1)


def test_a_row_without_a_verdict_says_so_and_keeps_its_figures():
    verdict = judged(opposing(), "jump_60")
    assert (verdict.is_judged, verdict.accepted, verdict.failed) == (False, None, [])
    assert {verdict.word(f) for f in verdict.findings} == {"no verdict"}
    assert {f.accepted for f in verdict.findings} == {None}
    assert verdict.findings[1].value > 0.2


def test_what_the_watch_cannot_tell_is_said():
    """Whether a response settles is a criterion of its own, which fails where it does not."""
    verdict = judged(opposing(), kind="not_judged")
    assert (verdict.accepted, verdict.findings[0].text) == (True, "nothing was found; found")
    moving = judged(opposing() + 1e-4 * np.exp(TIMES / 2), kind="not_judged")
    assert "settles" in [f.criterion for f in moving.failed]


@pytest.mark.parametrize(("at", "lasts"), [(18.0, 99.0), (3.0, 99.0), (3.0, 0.3)])
def test_a_plant_that_trips_in_silence_is_not_stable(at, lasts):
    """Also where it is back before any criterion looks."""
    gone = (at <= TIMES) & (at + lasts > TIMES)
    found = judged(np.where(gone, 0.0, opposing()), q=np.where(gone, 0.0, 0.1)).findings
    assert not found[0].accepted
    assert f"feeds in nothing from t = {at:g} s on" in found[0].text
    assert not any(f.accepted for f in found)


@pytest.mark.parametrize("left", [0.0, 1e-3])
@pytest.mark.parametrize("lasts", [0.09, 0.1])
def test_a_plant_that_is_gone_in_parts_or_leaves_a_little_has_tripped(left, lasts):
    """0.09 s in every 0.1 s, and 0.1 % of its power: a second of it."""
    gone = (TIMES >= 3) & (TIMES < 4) & (lasts > (TIMES - 3) % 0.1)
    found = judged(np.where(gone, left, 1) * opposing(), q=np.where(gone, left, 1) * 0.1).findings
    assert not found[0].accepted
    assert "feeds in nothing from t = 3" in found[0].text
    assert not any(f.accepted for f in found)


def test_a_power_that_a_droop_takes_to_nothing_is_no_trip():
    """A droop of 4 % at 51 Hz and half power, for two seconds; with the rated frequency the same is a trip."""
    at_51_hz = np.where((TIMES > 2) & (TIMES < 5), 2 * np.pi * (TIMES - 2), 0.0)
    gone = (TIMES >= 2.5) & (TIMES < 4.5)
    for angle, tripped in ((at_51_hz, None), (0 * TIMES, pytest.approx(2.5))):
        signals = {
            "p": np.where(gone, 1e-3, 0.5),
            "q": np.where(gone, 1e-4, 0.1),
            "v": np.ones(TIMES.shape),
            "v_re": np.cos(angle),
            "v_im": np.sin(angle),
        }
        assert MeasuredRow(TIMES, signals, 50.0, (1.0,)).tripped == tripped


def slipping(angle):
    """ERCOT's jumps on a plant behind 0.15 pu whose voltage inside turns by an angle of the time [rad]."""
    programme = jumps(3.0, 0.5, (-10.0, 10.0))
    times = np.arange(0, programme.stop + 1e-3, 1e-3)
    outer = np.exp(1j * programme.source_angle(times, 60.0))
    inside = np.exp(1j * (0.25 + angle(times)))
    current = (inside - outer) / (0.15j + programme.impedance)
    v = inside - 0.15j * current
    power = v * np.conj(current)
    signals = {"p": power.real, "q": power.imag, "v": np.abs(v), "v_re": v.real, "v_im": v.imag}
    (row,) = [row for row in CODES["ercot"].rows if row.name == "phase_jumps"]
    return judge_row(row, BenchResult(row.name, times, signals), 60.0).findings[0]


@pytest.mark.parametrize("turns", [1, -1, 3])
@pytest.mark.parametrize(("begin", "told"), [(1.6, 1), (7.0, 6), (0.2, 0), (5.7, 1)])
def test_a_turn_out_and_back_within_a_hold_or_before_the_first_event_is_a_slip(turns, begin, told):
    """In 0.2 s each; the ends of all holds are where they were, but for the one in whose end it turns."""
    found = slipping(
        lambda t: 2 * np.pi * turns * np.interp(t - begin, [0, 0.2, 0.3, 0.5], [0, 1, 1, 0])
    )
    assert not found.accepted
    assert f"it slips after t = {told} s" in found.text


def test_a_turn_that_is_done_before_the_first_event_is_a_slip():
    found = slipping(lambda t: 2 * np.pi * np.clip((t - 0.2) / 0.3, 0, 1))
    assert "it slips after t = 0 s" in found.text


@pytest.mark.parametrize("degrees", [60, -60, 120])
def test_a_swing_that_turns_back_is_no_slip(degrees):
    """One second long, as after a jump."""
    assert slipping(
        lambda t: np.radians(degrees) * np.exp(-np.clip(t - 1, 0, None) / 0.3) * (t > 1)
    ).accepted


def test_a_plant_at_rest_without_power_has_not_tripped():
    assert judged(opposing() - 0.5, q=0 * TIMES).findings[0].accepted


def test_the_angle_of_the_source_is_that_of_its_programme():
    """After 1 Hz for a second it has turned once; jumps are given as sums."""
    jumped = jumps(3.0, 0.5, (-10.0, 10.0, -25.0)).source_angle(
        np.array([0.5, 1.0, 6.0, 11.0]), 60.0
    )
    assert np.degrees(jumped) == pytest.approx([0, -10, 0, -25])
    moved = ramps(10.0, 0.5, 60.0, 4.0, (1.0, -1.0), hold=1.0)
    angle = moved.source_angle(np.array([1.0, 1.25, 2.25, 2.5, 3.5]), 60.0)
    assert angle / (2 * np.pi) == pytest.approx([0, 0.125, 1.125, 1.25, 1.25])
    assert last_machine(0.0, 1.0, 1.0).source_angle(TIMES, 60.0) is None


def test_a_fault_that_leaves_no_voltage_is_no_trip():
    dip = (TIMES >= 3) & (TIMES < 3.2)
    found = judged(
        np.where(dip, 0.0, opposing()), q=np.where(dip, 0.0, 0.1), v=np.where(dip, 0.0, 1.0)
    )
    assert found.findings[0].accepted


@pytest.mark.parametrize(
    ("words", "accepted"), [((True, True), True), ((True, None), False), ((True, False), False)]
)
def test_a_row_with_a_criterion_that_is_not_judged_is_not_accepted(words, accepted):
    row = CODES["aemo"].rows[0]
    findings = tuple(
        RowFinding(f"c{k}", "rule", "code", 1.0, 1.0, None, word, "")
        for k, word in enumerate(words)
    )
    assert RowVerdict(row, findings).accepted is accepted


def over_rating(lasts, times=TIMES):
    """Six times its rating for a while, from 12 s on."""
    return np.where((times > 12.0) & (times < 12.0 + lasts), 6.0, 0.1)


def test_a_limit_that_dies_late_is_missed_in_every_row():
    current = judged(opposing(), q=over_rating(2.0)).findings[-1]
    assert (current.criterion, current.accepted, current.limit) == ("current", False, 3.3)
    assert current.value == pytest.approx(6.0, rel=0.02)
    assert judged(opposing(), q=over_rating(0.05)).findings[-1].accepted


def test_a_declared_limit_takes_the_place_of_the_widest():
    row = next(row for row in CODES["aemo"].rows if row.name == "jump_30")
    signals = {"p": opposing(), "q": np.full(TIMES.shape, 0.1), "v": np.ones(TIMES.shape)}
    told = {
        "kind": "misfit",
        "time": 12.0,
        "component": "converter",
        "message": "too much",
        "declared": 1.2,
        "mean": 1.6,
    }
    current = judge_row(row, BenchResult(row.name, TIMES, signals, [told]), 50.0).findings[-1]
    assert (current.accepted, current.value, current.limit) == (False, 1.6, pytest.approx(1.26))
    beside = BenchResult(row.name, TIMES, signals, [told | {"component": "duplicate"}])
    assert judge_row(row, beside, 50.0).findings[-1].limit == 3.3


def test_the_margin_of_a_current_is_that_to_the_declared_limit():
    """The current is 1.2 pu, of equal P and Q at a voltage of 1 pu, beside 1.05 times each declared limit."""
    row = next(row for row in CODES["aemo"].rows if row.name == "jump_30")
    part = np.full(TIMES.shape, 1.2 * np.sqrt(0.5))
    signals = {"p": part, "q": part, "v": np.ones(TIMES.shape)}
    for declared, margin in ((1.3, 1 - 1.2 / 1.365), (1.1, 1 - 1.2 / 1.155), (None, 1 - 1.2 / 3.3)):
        result = BenchResult(row.name, TIMES, signals, current_limit=declared)
        current = next(f for f in judge_row(row, result, 50.0).findings if f.criterion == "current")
        assert current.value == pytest.approx(1.2)
        assert current.margin == pytest.approx(margin)
        assert current.accepted == (margin > 0)
        assert ("declares" in current.text) == (declared is not None)


def test_a_certificate_without_that_criterion_holds_where_it_is_met():
    row = next(row for row in CODES["aemo"].rows if row.name == "jump_30")
    stated = [{"criterion": "stable"}]
    for lasts, added in ((0.05, []), (2.0, ["current"])):
        signals = {"p": opposing(), "q": over_rating(lasts), "v": np.ones(TIMES.shape)}
        found = judge_row(row, BenchResult(row.name, TIMES, signals), 50.0, stated).findings
        assert [f.criterion for f in found[len(row.criteria) :]] == added


def test_a_row_that_does_not_ask_whether_it_holds_together_says_why_it_fails():
    row = next(row for row in CODES["aemo"].rows if row.name == "jump_30")
    bare = replace(
        row,
        criteria=tuple(
            c
            for c in row.criteria
            if not getattr(c, "__qualname__", "").startswith("holds_together")
        ),
    )
    result = BenchResult(
        "jump_30",
        TIMES,
        {"p": opposing(), "q": np.full(TIMES.shape, 0.1), "v": np.ones(TIMES.shape)},
        [{"kind": "loss_of_synchronism", "time": 1.3, "message": "found"}],
    )
    assert len(bare.criteria) < len(row.criteria)
    assert [f.text for f in judge_row(bare, result, 50.0).failed] == ["found"]
