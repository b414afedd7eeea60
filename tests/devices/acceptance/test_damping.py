"""A damping controller is tried for what it does, and each fault of it is told by its cause."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from orchestrator.devices.acceptance.checks import damping
from orchestrator.devices.acceptance.checks.subject import Use
from orchestrator.devices.acceptance.runner import check_fmu
from orchestrator.devices.binding.binding import bind
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.instance import open_component
from orchestrator.devices.sandbox.resource_limits import Limits
from tests.devices.acceptance.gallery.build import build
from tests.devices.acceptance.gallery.members import START, binding, converter, faulty

LIMITS = Limits(seconds=6.0)
QUICK = ("pod_of_dead_band", "pod_of_one_side", "pod_off_above_power", "pod_below_its_limit")
OTHERS = tuple(m.name for m in faulty() if m.name.startswith("pod_") and m.only[-1] == "pod")
SLOW = tuple(name for name in OTHERS if name not in QUICK)

UNITS = """
[signals."pod_p.enabled"]
variable = "pod_on"
[signals."pod_p.K"]
variable = "pod_gain"
unit = "pu"
[signals."pod_p.limit"]
variable = "pod_most"
unit = "pu"
"""
"""A controller under other names than ours, and without an output that shows what it does."""


def failure_of(gallery, name):
    member = next(m for m in faulty() if m.name == name)
    found = check_fmu(*gallery(name), LIMITS, (member.only[-1],), run_for=0.3)
    assert found.faults == [member.fault]
    return found.failures[0]


@pytest.mark.parametrize("name", QUICK)
def test_a_fault_of_a_damping_controller_is_told_by_its_cause(name, gallery):
    assert "POD-P" in failure_of(gallery, name).evidence


@pytest.mark.slow
@pytest.mark.parametrize("name", SLOW)
def test_what_takes_longer_to_show_is_told_as_well(name, gallery):
    assert "POD-P" in failure_of(gallery, name).evidence


@pytest.mark.parametrize(
    ("usual", "larger"), [(1e-4, [3e-4, 1.2e-3]), (1e-3, [3e-3, 6e-3]), (4e-3, [6e-3, 6e-3])]
)
def test_a_controller_is_tried_in_swings_three_and_twelve_times_as_large(usual, larger):
    """Up to 0.6 % of the rated frequency, beyond which no network swings."""
    sizes = []
    trial = damping._Trial(SimpleNamespace(effects=lambda swing: sizes.append(swing.size) or ()))
    trial._size = usual
    assert trial._larger() is None
    assert sizes == pytest.approx(larger)


@pytest.mark.parametrize(
    ("up", "down", "told"),
    [(0.04, 0.04, True), (9.0, 0.04, True), (9.0, 9.0, False), (0.09, 0.09, False)],
    ids=["both ways", "one way", "no limit", "near enough"],
)
def test_a_limit_that_is_seen_in_the_power_alone_is_reached_by_two_deviations(up, down, told):
    """Of 0.1 pu as declared; a lasting deviation brings a quarter of what a swing of its size does."""
    limit, size, peak = 0.1, 1e-3, 0.02

    def plateaus(deviation, seconds):
        return [min(0.25 * peak * abs(deviation) / size, up if deviation > 0 else down)]

    trial = damping._Trial(SimpleNamespace(plateaus=plateaus, widest=1.0))
    trial._size, trial._usual = size, (SimpleNamespace(peak=peak, title="POD-P"),)
    found = trial._limit_of_power(0, limit)
    assert (found is not None) is told
    if found is not None:
        assert "POD-P gives no more than 0.04 pu where 0.1 pu is declared" in found.words


@pytest.mark.parametrize("name", ["pod_of_the_minute", "pod_dead_after_a_date"])
def test_a_controller_that_follows_the_clock_is_found(name, gallery):
    assert "the clock of its process" in failure_of(gallery, name).evidence


def test_a_gain_that_is_taken_at_the_start_only_is_found_with_the_controller_on(gallery):
    says = failure_of(gallery, "pod_gain_of_the_start").evidence
    assert "pod_p.K is declared as tunable; set to 44 while it runs with pod_p.enabled" in says


@pytest.mark.slow
def test_a_good_controller_passes(gallery):
    only = ("pod", "clock", "tunables")
    found = check_fmu(*gallery("converter_with_pod"), LIMITS, only, run_for=0.3)
    assert [r.verdict for r in found.results[1:]] == ["pass"] * 3
    assert "6 of 6 tunable parameters act" in str([r.evidence for r in found.results])


def behind_a_binding(tmp_path, **defines):
    source = converter("foreign", pod=True, **defines)
    names = {"pod_p.enabled": "pod_on", "pod_p.K": "pod_gain", "pod_p.limit": "pod_most"}
    text = binding("rectangular", current='base = "100 MVA"', start=START) + UNITS
    path = tmp_path / "foreign.toml"
    path.write_text(text, encoding="utf-8")

    def rename(description):
        for ours, its in names.items():
            description = description.replace(f'"{ours}"'.encode(), f'"{its}"'.encode())
        return description.replace(b'"delta_p_pod"', b'"x_17"')

    return build(replace(source, change=rename), tmp_path), path


def test_a_controller_whose_output_is_not_shown_is_judged_by_the_power(tmp_path):
    file, bound = behind_a_binding(tmp_path, FAULT_POD_TIMES="(m[P_REF] < 0.8)")
    found = check_fmu(file, bound, LIMITS, ("pod",), run_for=0.3)
    assert found.faults == ["POD of some points only"]


TIRES = (
    "(1 - 0.9 * fmin(1, 2 * m[WORKED]))",
    "POD tires",
    "otherwise 3 s after strong swings, in which it gave and took 0.",
)
"""It tires until its output is 0.6 of its limit: afterwards about 40 % of its answer are missing."""


@pytest.mark.parametrize(
    ("seed", "times", "fault", "said"),
    [
        (1, "(m[AGE] > 4)", "POD changes with time", "and answers one after 10 s at rest"),
        (
            1,
            "(m[P_REF] > 0.5)",
            "POD of some points only",
            "at P_0 = 0.4, v_0 = 1, and answers one at",
        ),
        (1, *TIRES),  # swings at 0.79 Hz
        (3, *TIRES),  # at 1.24 Hz
    ],
)
def test_less_than_its_answer_is_told_by_its_cause(tmp_path, seed, times, fault, said):
    """It wakes late, acts at high power alone, or tires while its limit is tried."""
    file = build(converter("asleep", pod=True, FAULT_POD_TIMES=times), tmp_path)
    found = check_fmu(file, None, LIMITS, ("pod",), run_for=0.3, seed=seed)
    assert found.faults == [fault], found.failures
    assert said in found.failures[0].evidence


def test_a_dead_band_around_the_usual_swing_is_told(tmp_path):
    """Its gain is so large that the swing that is chosen for it lies within the dead band."""
    band = "(fabs(m[PASSED]) > 2e-4) * 100"
    file = build(converter("deaf", pod=True, FAULT_POD_TIMES=band), tmp_path)
    found = check_fmu(file, None, LIMITS, ("pod",), run_for=0.3, seed=1)
    assert found.faults == ["POD with a dead band"]
    assert "by nothing" in found.failures[0].evidence


def test_a_controller_of_another_angle_only_is_found(tmp_path):
    times = "(fabs(m[DELTA]) < 0.9)"
    file = build(converter("of_one_angle", pod=True, FAULT_POD_TIMES=times), tmp_path)
    found = check_fmu(file, None, LIMITS, ("pod",), run_for=0.3, seed=1)
    assert found.faults == ["POD of some points only"]
    assert "theta_0 = " in found.failures[0].evidence


def test_a_power_that_goes_with_the_frequency_is_asked_about(tmp_path):
    file = build(converter("turned", pod=True, DROOP=0.01, FAULT_POD_TIMES="(-1)"), tmp_path)
    (*_, found) = check_fmu(file, None, LIMITS, ("pod",), run_for=0.3, seed=1).results
    assert found.verdict == "remark"
    assert "asks for more power while the frequency is higher" in found.evidence


def test_a_limit_is_judged_by_the_power_where_no_output_shows_it(tmp_path):
    file, bound = behind_a_binding(tmp_path, FAULT_POD_LIMIT=0.5)
    found = check_fmu(file, bound, LIMITS, ("pod",), run_for=0.3)
    assert found.faults == ["POD limit not as declared"]
    assert "no more than 0.05" in found.failures[0].evidence


def in_megawatts(tmp_path, **defines):
    """Its output and its limit in MW, and a rating that it is given."""
    source = converter("in_mw", pod=True, POD_UNIT="z[S_N]", POD_MOST="(0.1 * RATING)", **defines)
    own = {
        "pod_p.enabled": {"name": "pod_on"},
        "pod_p.limit": {"name": "pod_most", "unit": "MW", "start": 150.0},
        "delta_p_pod": {"name": "pod_out", "unit": "MW"},
    }
    source = replace(
        source, variables=tuple(replace(v, **own.get(v.name, {})) for v in source.variables)
    )
    bound = {"start.S_n": "S_n"} | {f'signals."{ours}"': its["name"] for ours, its in own.items()}
    tables = "".join(f'[{place}]\nvariable = "{its}"\n' for place, its in bound.items())
    path = tmp_path / "in_mw.toml"
    usual = binding("rectangular", current='base = "100 MVA"', start=f"{START}\n{tables}")
    path.write_text(usual, encoding="utf-8")
    return build(source, tmp_path), path


@pytest.mark.parametrize("S_n", [1500.0, 750.0, 3000.0])
def test_a_limit_in_megawatts_is_that_of_the_rating_which_it_is_given(S_n, tmp_path):
    """150 MW are 0.2 pu of 750 MVA; what shows its output on the rating as delivered is told."""
    use = Use(values={"S_n": S_n})
    file, bound = in_megawatts(tmp_path)
    (*_, found) = check_fmu(file, bound, LIMITS, ("pod",), run_for=0.3, use=use, seed=1).results
    assert found.verdict == "pass", found.evidence
    file, bound = in_megawatts(tmp_path, POD_SHOWN="RATING")
    report = check_fmu(file, bound, LIMITS, ("pod",), run_for=0.3, use=use, seed=1)
    assert report.faults == ([] if S_n == 1500 else ["POD limit not as declared"])


def test_what_is_bound_in_megawatts_reads_in_per_unit_of_the_rating_it_is_given(tmp_path):
    file, bound = in_megawatts(tmp_path)
    with open_component("it", bind(read_description(file), bound), isolated=False) as component:
        component.set({"pod_p.limit": 0.12, "S_n": 500.0})
        assert component.values(["pod_p.limit"])["pod_p.limit"] == pytest.approx(0.12)
        assert component.inner.values(["pod_most"])["pod_most"] == pytest.approx(60.0)


def test_a_parameter_under_another_name_is_tried_like_any_other(tmp_path):
    file, bound = behind_a_binding(tmp_path, FAULT_POD_KEEPS_GAIN=1)
    found = check_fmu(file, bound, LIMITS, ("tunables",), run_for=0.3)
    assert found.faults == ["parameter not taken"]
    assert "pod_p.K" in found.failures[0].evidence


def test_without_a_known_switch_the_remedy_is_a_signal_of_the_binding(gallery):
    (*_, found) = check_fmu(*gallery("converter"), LIMITS, ("pod",), run_for=0.3).results
    assert found.verdict == "not applicable"
    assert '[signals."pod_p.enabled"]' in found.evidence


def pod_of(tmp_path, name, **defines):
    file = build(converter(name, pod=True, **defines), tmp_path)
    return check_fmu(file, None, LIMITS, ("pod",), run_for=0.3, seed=1).results[-1]


def test_a_part_that_a_washout_leaves_for_ever_is_told(tmp_path):
    """40 % stay: from 2 to 8 s the answer falls to 0.66, as that of a good one may."""
    found = pod_of(tmp_path, "washed_in_part", POD_WASHES=0.6)
    assert found.fault == "POD without washout"
    assert "from 34 to 40 s" in found.evidence


def test_a_washout_that_is_slower_than_declared_is_told(tmp_path):
    """Of 3 s as declared it may keep exp(-6/3), 13.5 %; of 30 s it keeps exp(-6/30), 82 %."""
    found = pod_of(tmp_path, "slow_washout", POD_SLOWER=10)
    assert found.fault == "POD washout not as declared"
    assert "keeps 81.9" in found.evidence
    assert "13.5 %" in found.evidence


def test_a_limit_beyond_any_swing_is_not_held_against_it(tmp_path):
    """It would take a swing of 0.1 pu, which no device follows."""
    source = converter("wide", pod=True, POD_MOST=1.0)
    starts = {"pod_p.limit": 1.0}
    variables = tuple(replace(v, start=starts.get(v.name, v.start)) for v in source.variables)
    file = build(replace(source, variables=variables), tmp_path)
    found = check_fmu(file, None, LIMITS, ("pod",), run_for=0.3, seed=1).results[-1]
    assert found.verdict == "pass", found.evidence
    assert "the limit of POD-P, 1 pu, is beyond what it gives in any swing" in found.evidence


def test_noise_is_not_called_unstable(tmp_path):
    noise = "1; power += 0.01 * (fmod(1e4 * m[AGE], 7.0) / 7.0 - 0.4)"
    found = pod_of(tmp_path, "noisy", FAULT_POD_TIMES=noise)
    assert found.fault == "POD moves at rest"
    assert "at rest" in found.evidence


def test_a_sampled_controller_is_good_and_its_time_is_told(tmp_path):
    """An output in stairs of 10 ms is not one that follows the communication step."""
    found = pod_of(tmp_path, "sampled", POD_SAMPLES=0.01)
    assert found.verdict == "remark", found.evidence
    assert "the output of POD-P moves once in 10" in found.evidence
