"""What would make a validation wrong in silence, each planted in a good recording and asked about."""

import re

import numpy as np
import pandas as pd
import pytest

import orchestrator as gfor_in_python
from orchestrator.output.results.readers import LINE_FREQUENCY
from orchestrator.studies.validation.clipped import clipped_run
from orchestrator.studies.validation.limits import EXAMPLE
from orchestrator.studies.validation.questions import QuestionKind
from orchestrator.studies.validation.record import PortBases, read_recording
from orchestrator.studies.validation.words import sentence
from tests.studies.validation.recordings import (
    SOLVER,
    limits_of_errors,
    of_pmu,
    run,
    table,
    waves,
    with_noise,
)
from tests.support.late import LateLibrary

scipy_signal = LateLibrary("scipy.signal")
ON = {"pod_p.enabled": True}
PHASOR, EMT = "gfor_phasor", "gfor"
STEPS = {PHASOR: "1 ms", EMT: "500 us"}
"""Of the device, so that less time goes; a good recording is tried in steps of a coupled run as well.

What is planted is in the recording: a phasor model shows it as the EMT model does, in a fifth of the time."""

LENGTH = 4.0
"""Time after which a recording ends [s]: three after the event, which all that is planted needs."""


@pytest.fixture(scope="module")
def good():
    whole = with_noise(table(run()))
    return whole[whole.time <= LENGTH]


def asked(frame, values=None, device=PHASOR, **more):
    given = {"values": ON | (values or {}), "step": STEPS[device]} | more
    found = gfor_in_python.validate(device, frame.set_index("time"), **given).as_json()
    return found["events"][0]["questions"]


def late(frame, seconds=0.03):
    shifted = {c: np.interp(frame.time - seconds, frame.time, frame[c]) for c in ("p_mw", "q_mvar")}
    return frame.assign(**shifted)


def held(frame, samples=10):
    first = np.arange(len(frame)) // samples * samples
    return frame.assign(angle_deg=frame.angle_deg.to_numpy()[first])


def held_power(frame, samples=100):
    return frame.assign(p_mw=frame.p_mw.to_numpy()[np.arange(len(frame)) // samples * samples])


def of_filtered_frequency(frame, seconds=0.1):
    """The angle as the integral of a frequency behind a first-order lag."""
    turns = 2 * np.pi * np.diff(frame.angle_deg / 360, prepend=frame.angle_deg[0] / 360) / 1e-3
    part = 1e-3 / seconds
    filtered = scipy_signal.lfilter([part], [1, part - 1], turns)
    return frame.assign(angle_deg=np.rad2deg(np.cumsum(filtered) * 1e-3))


def filled(frame, low, high, columns=("v_pu", "angle_deg", "p_mw", "q_mvar")):
    """A gap that the recorder filled with the last value."""
    gap = (frame.time > low) & (frame.time <= high)
    return frame.assign(**{c: frame[c].mask(gap).ffill() for c in columns})


def without(frame, low, high):
    return frame[(frame.time <= low) | (frame.time > high)]


def of_frequency(frame, sign=1.0):
    """The frequency of the voltage beside the angle."""
    turns = np.gradient(np.deg2rad(frame.angle_deg), frame.time) / (2 * np.pi)
    return frame.assign(f_hz=50 + sign * turns)


def moving_before(frame):
    """P that swings by 4 % of the rating before the event and ends with it."""
    swing = 60 * np.sin(2 * np.pi * 1.3 * frame.time) * (frame.time < 1)
    return frame.assign(p_mw=frame.p_mw + swing)


def beyond_transformer(frame, reactance=0.12):
    """The same plant by a meter at the grid's side of a transformer, whose reactance is in pu of 1500 MVA."""
    v = frame.v_pu * np.exp(1j * np.deg2rad(frame.angle_deg))
    i = np.conj((frame.p_mw + 1j * frame.q_mvar) / 1500 / v)
    seen = v - 1j * reactance * i
    power = 1500 * seen * np.conj(i)
    angle = np.rad2deg(np.unwrap(np.angle(seen)))
    return frame.assign(
        v_pu=np.abs(seen), angle_deg=angle, p_mw=np.real(power), q_mvar=np.imag(power)
    )


def of_angle_behind_a_lag(frame, seconds=0.02):
    part = 1e-3 / seconds
    first = frame.angle_deg[0]
    behind = scipy_signal.lfilter([part], [1, part - 1], frame.angle_deg - first) + first
    return frame.assign(angle_deg=behind)


def lagged(frame, column, seconds):
    """One column behind a first-order lag, as of a transducer."""
    part = 1e-3 / seconds
    first = frame[column][0]
    return frame.assign(
        **{column: scipy_signal.lfilter([part], [1, part - 1], frame[column] - first) + first}
    )


def with_angle_jump(frame, degrees, at=3.0):
    return frame.assign(angle_deg=frame.angle_deg + degrees * (frame.time > at))


def with_block_twice(frame, at, samples):
    """A block that is stored again in place of the one after it."""
    rows = np.arange(len(frame))
    first = int(np.searchsorted(frame.time, at))
    rows[first + samples : first + 2 * samples] -= samples
    return frame.iloc[rows].reset_index(drop=True).assign(time=frame.time)


def clipped(frame, column, upper=None, lower=None):
    ends = {
        name: None if part is None else frame[column].quantile(part)
        for name, part in (("upper", upper), ("lower", lower))
    }
    return frame.assign(**{column: frame[column].clip(**ends)})


def alone_beyond(frame, *columns):
    """The same, where some columns alone are measured beyond the transformer."""
    return frame.assign(**{name: beyond_transformer(frame)[name] for name in columns})


def of_ramp(frame, low=2.0, high=3.5):
    return frame.assign(p_mw=frame.p_mw + 100 * np.clip((frame.time - low) / (high - low), 0, 1))


def in_waves(frame):
    units = {"v": "kv", "i": "ka"}
    named = {f"{name}_{units[name[0]]}": values for name, values in waves(frame).items()}
    return frame[["time"]].assign(**named)


PLANTED = {
    "P and Q are 1/10 of the plant's: another prefix of the unit, or so many units": (
        lambda f: f.assign(p_mw=f.p_mw / 10, q_mvar=f.q_mvar / 10),
        "read otherwise",
    ),
    "Q is 1/1000 of the plant's: another prefix of the unit, or so many units": (
        lambda f: f.assign(q_mvar=f.q_mvar / 1000),
        "read otherwise",
    ),
    "the angle is of a filtered frequency": (of_filtered_frequency, "angle lacks a jump"),
    "samples are missing at the event": (lambda f: without(f, 0.98, 1.06), "gap at the event"),
    "P is missing beside a known voltage": (
        lambda f: f.assign(p_mw=f.p_mw.mask(f.time.between(1.2, 1.5))),
        "P or Q missing",
    ),
    "a gap at the event is filled": (lambda f: filled(f, 0.98, 1.06), "gap at the event"),
    "P counts into the plant": (lambda f: f.assign(p_mw=-f.p_mw), "read otherwise"),
    "Q counts into the plant": (lambda f: f.assign(q_mvar=-f.q_mvar), "read otherwise"),
    "P and Q are of one phase": (
        lambda f: f.assign(p_mw=f.p_mw / 3, q_mvar=f.q_mvar / 3),
        "read otherwise",
    ),
    "P is of one phase": (lambda f: f.assign(p_mw=f.p_mw / 3), "read otherwise"),
    "Q is of one phase": (lambda f: f.assign(q_mvar=f.q_mvar / 3), "read otherwise"),
    "P and Q are in each other's place": (
        lambda f: f.assign(p_mw=f.q_mvar, q_mvar=f.p_mw),
        "read otherwise",
    ),
    "the angle is in radians": (
        lambda f: f.assign(angle_deg=np.deg2rad(f.angle_deg)),
        "read otherwise",
    ),
    "the angle has the other sign": (
        lambda f: f.assign(angle_deg=-f.angle_deg),
        "read otherwise",
    ),
    "60 Hz": (lambda f: f.assign(angle_deg=f.angle_deg + 3600 * f.time), "rated frequency"),
    "clocks": (late, "clocks"),
    "the clock of P alone": (lambda f: f.assign(p_mw=late(f).p_mw), "clocks"),
    "P drifts before the event": (
        lambda f: f.assign(p_mw=f.p_mw + 12 * f.time),
        "no steady state before",
    ),
    "P and Q are in per unit of the rating": (
        lambda f: f.assign(p_mw=f.p_mw / 1500, q_mvar=f.q_mvar / 1500),
        "read otherwise",
    ),
    "P and Q are in per unit of 100 MVA": (
        lambda f: f.assign(p_mw=f.p_mw / 100, q_mvar=f.q_mvar / 100),
        "read otherwise",
    ),
    "Q has no sign": (lambda f: f.assign(q_mvar=f.q_mvar.abs()), "magnitude"),
    "P ends at the recorder's range": (lambda f: clipped(f, "p_mw", upper=0.97), "clipped"),
    "P ends at the lower end of the range": (lambda f: clipped(f, "p_mw", lower=0.1), "clipped"),
    "Q ends at the recorder's range": (lambda f: clipped(f, "q_mvar", upper=0.95), "clipped"),
    "Q ends at the lower end of the range": (lambda f: clipped(f, "q_mvar", lower=0.05), "clipped"),
    "Q alone is behind a lag of 20 ms": (lambda f: lagged(f, "q_mvar", 0.02), "behind a lag"),
    "Q alone is behind a lag of 300 ms": (lambda f: lagged(f, "q_mvar", 0.3), "behind a lag"),
    "P alone is behind a lag": (lambda f: lagged(f, "p_mw", 0.05), "behind a lag"),
    "the magnitude is behind a lag of 20 ms": (
        lambda f: lagged(f, "v_pu", 0.02),
        "magnitude lacks a step",
    ),
    "the magnitude is behind a lag of 200 ms": (
        lambda f: lagged(f, "v_pu", 0.2),
        "magnitude lacks a step",
    ),
    "the angle jumps by 10 degrees": (lambda f: with_angle_jump(f, 10), "angle jumps alone"),
    "the angle jumps back by 60 degrees": (lambda f: with_angle_jump(f, -60), "angle jumps alone"),
    "the angle jumps in slow samples": (
        lambda f: with_angle_jump(f, 30).iloc[::20],
        "angle jumps alone",
    ),
    "50 ms are stored twice": (lambda f: with_block_twice(f, 2.0, 50), "stored twice"),
    "a second of slow samples is stored twice": (
        lambda f: with_block_twice(f.iloc[::20].reset_index(drop=True), 2.0, 50),
        "stored twice",
    ),
    "Q was not recorded": (lambda f: f.assign(q_mvar=0.0), "channel does not move"),
    "one sample of P is wild": (
        lambda f: f.assign(p_mw=f.p_mw.where(f.index != 3000, -8765.4)),
        "spike",
    ),
    "held": (held, "angle held"),
    "P is stored every 0.1 s": (held_power, "power held"),
    "P is stored every 15 ms": (lambda f: held_power(f, 15), "power held"),
    "the magnitude is stored every 0.1 s": (
        lambda f: f.assign(v_pu=f.v_pu.to_numpy()[np.arange(len(f)) // 100 * 100]),
        "magnitude held",
    ),
    "the frequency turns the other way": (
        lambda f: of_frequency(f, -1),
        "angle and frequency differ",
    ),
    "there is a frequency alone": (
        lambda f: of_frequency(f).drop(columns="angle_deg"),
        "frequency alone",
    ),
    "the event begins outside of steady state": (moving_before, "no steady state before"),
    "nothing happens": (lambda f: f[f.time < 0.95], "no event"),
    "the angle is behind a lag of 20 ms": (of_angle_behind_a_lag, "angle lacks a jump"),
    "the angle was not recorded": (lambda f: f.assign(angle_deg=3.0), "channel does not move"),
    "the voltage alone is measured beyond a transformer": (
        lambda f: alone_beyond(f, "v_pu", "angle_deg"),
        "meter elsewhere",
    ),
    "P and Q alone are measured beyond a transformer": (
        lambda f: alone_beyond(f, "p_mw", "q_mvar"),
        "meter elsewhere",
    ),
    "the times are in minutes": (lambda f: f.assign(time=f.time / 60), "time unit"),
    "a setpoint ramps": (of_ramp, "setpoint"),
    "setpoint": (lambda f: f.assign(p_mw=f.p_mw + 100 * (f.time > 2)), "setpoint"),
    "setpoint within the event": (
        lambda f: f.assign(p_mw=f.p_mw + 68 * (f.time > 1.05)),
        "setpoint",
    ),
}


OF_FLUXES = {
    "Q alone is behind a lag of 20 ms",
    "the magnitude is behind a lag of 20 ms",
    "the magnitude is behind a lag of 200 ms",
    "the angle is behind a lag of 20 ms",
    "the angle is of a filtered frequency",
}
"""Rows that take a model with fluxes, as the plant has: they are told by how the first 20 ms after a jump go."""


@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_mistake_is_asked_about(good, name):
    spoil, kind = PLANTED[name]
    questions = asked(spoil(good), device=EMT if name in OF_FLUXES else PHASOR)
    (found,) = [one for one in questions if one["kind"] == kind]
    assert found["keeps_open"]
    assert found["figures"].get("reading", name) == name


@pytest.mark.parametrize(
    ("column", "seconds", "kind", "told"),
    [
        ("q_mvar", 0.05, "behind a lag", "lag"),
        ("p_mw", 0.1, "behind a lag", "lag"),
        ("v_pu", 0.1, "magnitude lacks a step", "length"),
    ],
)
def test_the_time_of_a_lag_is_told(good, column, seconds, kind, told):
    (found,) = asked(lagged(good, column, seconds), device=EMT)
    assert found["kind"] == kind
    assert found["figures"][told] == pytest.approx(seconds, rel=0.2)


def test_a_jump_of_the_angle_is_told_with_its_size_and_time_and_nothing_beside_it(good):
    (found,) = asked(with_angle_jump(good, -20), device=EMT)
    assert found["figures"]["jump"] == pytest.approx(-20, abs=0.2)
    assert found["figures"]["at"] == pytest.approx(3.0, abs=0.002)


def test_a_jump_of_the_grids_own_angle_is_not_accused():
    """The plant answers it."""
    times = np.arange(0, 3, 1e-3)
    angle = 5.7 - 8.0 * (times > 1.5)
    stiff = {"v_pu": 1.0 + 0 * times, "angle_deg": angle, "p_mw": 900.0, "q_mvar": 0.0}
    frame = pd.DataFrame({"time": times} | stiff)
    own = gfor_in_python.validate("gfor", frame.set_index("time"), values=ON).curves()
    power = {"p_mw": own["p_simulated"].to_numpy(), "q_mvar": own["q_simulated"].to_numpy()}
    plant = frame.assign(**{name: 1500 * values for name, values in power.items()})
    assert "angle jumps alone" not in [one["kind"] for one in asked(with_noise(plant))]
    assert "angle jumps alone" in [one["kind"] for one in asked(with_noise(frame))]


def test_a_block_that_is_stored_twice_is_told_with_its_times(good):
    (found,) = asked(with_block_twice(good, 1.5, 100), device=EMT)
    figures = found["figures"]
    assert figures["count"] == 100
    assert figures["first"] == pytest.approx(1.5, abs=0.0015)
    assert figures["at"] == pytest.approx(1.6, abs=0.0015)


def test_a_plant_that_falls_out_of_step_itself_leaves_no_verdict_on_its_own_model():
    fault = {"time": 1.0, "component": "grid", "type": "bus_fault", "bus": "bus_2"}
    deep = fault | {"X": 0.002, "duration": 0.25}
    case = gfor_in_python.load("two_area").with_(events=[deep], solver=SOLVER)
    frame = with_noise(table(case.scenario("pod_p").run(stop=3.0).dataset))
    found = gfor_in_python.validate("gfor", frame.set_index("time"), values=ON, limits=EXAMPLE)
    (question,) = [
        one
        for one in found.as_json()["events"][0]["questions"]
        if one["kind"] == "plant out of step"
    ]
    assert 1.25 < question["figures"]["at"] < 2.9
    assert found.verdict == "open"


@pytest.mark.parametrize(("device", "step"), [(PHASOR, "1 ms"), (EMT, "500 us"), (EMT, "100 us")])
def test_a_good_recording_is_not_asked_about(good, device, step):
    assert asked(good, device=device, step=step) == []


def test_a_transient_that_the_model_lacks_is_no_setpoint(good):
    """A ring-down of 5 Hz dies out, and the plant is where the model is again."""
    slow = good.iloc[::20]
    since = slow.time.to_numpy() - 1.1
    ring = np.exp(-since / 0.15) * np.cos(2 * np.pi * 5 * since + 2)
    spoilt = slow.assign(p_mw=slow.p_mw + 300 * np.where(since > 0, ring, 0))
    assert "setpoint" not in [one["kind"] for one in asked(spoilt)]


def test_an_angle_at_rest_before_the_event_is_not_held(good):
    """A recording of a plant at rest has an angle that stays, but for rounding, until the event comes."""
    short = good[good.time < 3.0]
    rest = short.time.to_numpy() < 0.9
    angle = short.angle_deg.to_numpy().copy()
    angle[rest] = angle[rest][0] * (1 + 1e-15 * (np.arange(rest.sum()) % 17 == 3))
    assert np.mean(np.diff(angle) == 0) > 0.2
    assert "angle held" not in [one["kind"] for one in asked(short.assign(angle_deg=angle))]


def test_the_remedy_that_is_printed_works_when_it_is_given(good):
    turned = good.assign(p_mw=-good.p_mw)
    (question,) = asked(turned)
    (remedy,) = question["figures"]["remedy"]
    assert remedy == "p=-p_mw"
    assert asked(turned, channels=[remedy]) == []


def test_per_unit_that_was_read_as_mw_is_read_as_the_remedy_says(good):
    small = good.assign(p_mw=good.p_mw / 1500, q_mvar=good.q_mvar / 1500)
    (question,) = [one for one in asked(small) if one["keeps_open"]]
    assert question["figures"]["remedy"] == ["p=p_mw in pu", "q=q_mvar in pu"]
    assert asked(small, channels=question["figures"]["remedy"]) == []


def test_power_in_kw_is_named_alone_though_the_device_does_not_start(good):
    in_kw = good.assign(p_mw=1000 * good.p_mw, q_mvar=1000 * good.q_mvar)
    with pytest.raises(gfor_in_python.CosimError) as refused:
        asked(in_kw)
    said = str(refused.value)
    typed = re.findall(r"--channel '([^']*)'", said)
    assert typed == ["p=p_mw in kW", "q=q_mvar in kvar"]
    assert said.count("?") == 1
    assert "S_n" not in said
    assert asked(in_kw, channels=typed) == []


def test_a_plant_at_its_limit_is_not_clipped():
    limits = {"gfor__current_limit__kind": 1, "gfor__current_limit__I_max": 1.02}
    limited = table(run("pod_p", stop=3.0, scale=1.12, **limits))
    values = {"current_limit.kind": 1, "current_limit.I_max": 1.02}
    for frame in (limited, with_noise(limited)):
        assert "clipped" not in [one["kind"] for one in asked(frame, values, device=EMT)]


def test_a_signal_that_stands_still_by_itself_is_not_clipped():
    """At rest before a step, after one, and where it comes to rest slowly."""
    times = np.arange(0, 2, 1e-3)
    swing = np.where(times > 1, np.sin(5 * (times - 1)), 0.0)
    for sign in (1, -1):
        low, high = clipped_run(np.minimum(swing, 0.8) * sign)
        assert times[low] == pytest.approx(1 + np.arcsin(0.8) / 5, abs=2e-3)
        assert times[high - 1] == pytest.approx(1 + (np.pi - np.arcsin(0.8)) / 5, abs=2e-3)
        assert clipped_run(sign * swing) is None
        assert clipped_run(sign * (times > 1)) is None
        assert clipped_run(np.round(sign * (times > 1) * (1 - np.exp(1 - times) ** 9), 4)) is None
        assert clipped_run(sign * np.repeat(np.minimum(swing, 0.8)[::20], 20)) is None


def test_a_q_that_passes_through_zero_has_its_sign(good):
    """Beside a model whose Q is a little lower, and one whose sign is the other one."""
    assert (good.q_mvar.min(), good.q_mvar.max()) == (
        pytest.approx(-22, abs=9),
        pytest.approx(30, abs=9),
    )
    assert "magnitude" not in [one["kind"] for one in asked(good, {"droop.R_V": 0.05})]
    turned = asked(good.assign(q_mvar=-good.q_mvar))
    assert [one["kind"] for one in turned] == ["read otherwise"]


def test_a_model_out_of_step_is_in_no_reading_the_right_one(good):
    """The angle is taken against a bus that swings; exchanged, P and Q would let the model stay in step."""
    since = np.clip(good.time - 1, 0, None)
    swing = 8 * np.exp(-0.4 * since) * np.sin(2 * np.pi * 0.7 * since)
    spoilt = good.assign(angle_deg=good.angle_deg - swing)
    assert "read otherwise" not in [one["kind"] for one in asked(spoilt)]


def test_channels_in_each_others_place_are_read_as_the_remedy_says(good):
    swapped = good.assign(p_mw=good.q_mvar, q_mvar=good.p_mw)
    (question,) = asked(swapped)
    assert asked(swapped, channels=question["figures"]["remedy"]) == []


def test_a_voltage_to_ground_is_named_though_the_device_does_not_start(good):
    with pytest.raises(gfor_in_python.CosimError, match=r"measured to ground.*1.732"):
        asked(good.assign(v_pu=good.v_pu / np.sqrt(3)))


def test_the_rating_of_one_unit_of_two_is_asked_about_though_the_device_does_not_start(good):
    with pytest.raises(gfor_in_python.CosimError, match=r"1\.8 pu of its rating.*--set S_n="):
        asked(good.assign(p_mw=2 * good.p_mw, q_mvar=2 * good.q_mvar))


def test_an_angle_that_is_wrapped_is_the_same(good):
    wrapped = good.assign(angle_deg=(good.angle_deg + 350) % 360 - 180)
    assert asked(wrapped) == []


HONEST = {
    "a PMU's means over two periods": of_pmu,
    "a twentieth of the samples is missing": lambda f: f.sample(
        frac=0.95, random_state=1
    ).sort_index(),
    "samples are missing after the event": lambda f: without(f, 2.0, 2.1),
    "P is missing for a moment": lambda f: f.assign(p_mw=f.p_mw.mask(f.time.between(1.6, 1.65))),
    "a twentieth of the samples without a mean": lambda f: f.iloc[::20],
    "the angle is wrapped and coarse": lambda f: f.assign(
        angle_deg=((f.angle_deg + 179.5) % 360 - 180).round(2)
    ),
    "all channels are coarse": lambda f: f.round(
        {"v_pu": 3, "angle_deg": 2, "p_mw": 0, "q_mvar": 0}
    ),
    "a recorder of four digits": lambda f: f.round({"v_pu": 4, "angle_deg": 2, "p_mw": 1}),
}


@pytest.mark.parametrize("name", HONEST)
def test_an_honest_recording_is_not_accused(good, name):
    assert not [one for one in asked(HONEST[name](good), device=EMT) if one["keeps_open"]]


def test_a_filled_gap_is_told_and_counts_as_missing(good):
    gap = 1.6, 1.8
    (question,) = asked(filled(good, *gap))
    assert question["kind"] == "filled samples"
    assert question["figures"]["at"] == pytest.approx(gap[0], abs=0.0015)
    found = gfor_in_python.validate("gfor", filled(good, *gap).set_index("time"), values=ON)
    after = found.table().query("window == 'after' and signal == 'p'")
    assert after["max_error_pu"].item() < 0.006


def test_a_gap_at_the_event_leaves_no_verdict(good, tmp_path):
    gaps = {"missing": without(good, 0.98, 1.06), "none": good}
    verdicts = {
        name: gfor_in_python.validate(
            "gfor", frame.set_index("time"), values=ON, limits=limits_of_errors(tmp_path)
        ).verdict
        for name, frame in gaps.items()
    }
    assert verdicts == {"missing": "open", "none": "met"}


def test_samples_that_are_too_slow_name_the_controls_that_they_do_not_show(good):
    questions = asked(good.iloc[::40], device=EMT)
    (found,) = [one for one in questions if one["kind"] == "slow samples"]
    assert "current_control.tau" in found["text"]
    assert "voltage_control.tau" not in found["text"]  # 3.2 Hz, and 4 Hz are told


def test_slow_samples_end_no_right_model_with_not_met(good):
    for every in (20, 100):
        frame = good.iloc[::every].set_index("time")
        found = gfor_in_python.validate("gfor", frame, values=ON, limits=EXAMPLE)
        assert found.verdict != "not met", every


def test_a_transformer_between_meter_and_port_is_counted_where_it_is_given(good):
    seen = beyond_transformer(good)
    assert asked(seen, transformer="X 0.12") == []
    (question,) = [one for one in asked(seen) if one["keeps_open"]]
    assert question["kind"] == "meter elsewhere"
    assert question["figures"]["reactance"] == pytest.approx(0.12, rel=0.05)
    assert "--transformer 'X 0.1" in question["text"]


def test_a_control_that_is_faster_than_the_samples_is_not_fitted(good):
    frame = good.iloc[::100].set_index("time")
    found = gfor_in_python.validate("gfor", frame, values=ON, fit="voltage_control.tau").fitted()
    assert found.why_not.item() == "too fast"
    assert found.value.item() == found.start.item()


def test_a_model_of_another_rated_frequency_is_asked_about(good):
    (question,) = asked(good, values={"f_n": 60.0})
    assert question["kind"] == "rated frequency"
    assert "--set f_n=50" in question["text"]


def test_a_line_that_the_file_names_is_no_other_than_the_devices(good):
    dataset = good.set_index("time").to_xarray()
    for column, unit in (("v_pu", "pu"), ("angle_deg", "deg"), ("p_mw", "MW"), ("q_mvar", "Mvar")):
        dataset[column].attrs["units"] = unit
    for line, rated, count in ((50.0, 60.0, 1), (50.0, 50.0, 0), (0.0, 60.0, 0)):
        named = dataset.assign_coords({LINE_FREQUENCY: line})
        questions = read_recording(named, "rec", PortBases(1500.0, rated)).questions
        assert [one.kind for one in questions] == count * [QuestionKind.RATED_FREQUENCY]
        assert all("--set f_n=50" in sentence(one) for one in questions)


@pytest.mark.parametrize("order", ["bca", "cab", "acb"])
def test_currents_of_other_phases_are_asked_about_and_read_as_the_remedy_says(good, order):
    recorded = in_waves(good[good.time < 3.0])
    assert asked(recorded, voltage=230) == []
    moved = {f"i{x}_ka": recorded[f"i{y}_ka"] for x, y in zip("abc", order, strict=True)}
    first, *_ = [one for one in asked(recorded.assign(**moved), voltage=230) if one["keeps_open"]]
    assert first["kind"] == ("phase order" if order == "acb" else "read otherwise")
    given = first["figures"]["remedy"]
    assert asked(recorded.assign(**moved), voltage=230, channels=given) == []


@pytest.mark.parametrize(
    ("columns", "given"),
    [(("v_pu", "angle_deg"), "X 0.12 of V"), (("p_mw", "q_mvar"), "X 0.12 of PQ")],
)
def test_a_transformer_before_one_meter_is_counted_where_it_is_given(good, columns, given):
    assert asked(alone_beyond(good, *columns), transformer=given) == []


def test_times_in_minutes_are_read_as_the_remedy_says(good):
    in_minutes = good.assign(time=good.time / 60)
    (question,) = [one for one in asked(in_minutes) if one["kind"] == "time unit"]
    assert asked(in_minutes, channels=[question["figures"]["remedy"]]) == []


@pytest.mark.parametrize("wrong", [{"droop.R_f": 0.02}, {"transformer.X_t": 0.25}, {"pod_p.K": 50}])
def test_an_honest_recording_beside_a_wrong_model_is_not_accused(good, wrong):
    assert asked(good, values=wrong, device=EMT) == []


def test_a_jump_of_the_phase_by_six_degrees_is_no_wrap_of_radians(good):
    jumped = good.assign(angle_deg=good.angle_deg - good.angle_deg[0] + 6.2 * (good.time > 1))
    assert "angle unit" not in [one["kind"] for one in asked(jumped)]


def test_an_angle_that_an_ideal_source_holds_is_not_asked_about():
    still = table(run()).assign(angle_deg=0.0)
    assert "channel does not move" not in [one["kind"] for one in asked(still)]
