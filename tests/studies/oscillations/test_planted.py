"""What would make a source wrong in silence: each ends in the right place or in none."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from orchestrator.core.errors import InputError
from orchestrator.studies.oscillations.detection import Signals, find_oscillations
from orchestrator.studies.oscillations.location import DEF, QV_PHASE
from orchestrator.studies.oscillations.measurements import Site, made_ready
from orchestrator.studies.oscillations.verdict import locate
from tests.support.forced_records import load_noise, model, record, sine, times_of, unit_models_of
from tests.support.late import LateLibrary

scipy_signal = LateLibrary("scipy.signal")
TIMES = times_of(50.0)


def at(found, frequency):
    """The oscillation of a frequency, which must be there."""
    (one,) = [x for x in found if abs(x.found.frequency - frequency) < 0.01]
    return one


def forced(name, reference, frequency, **further):
    return at(
        locate(record(name, {reference: sine(TIMES, frequency, 0.02)}, times=TIMES, **further)),
        frequency,
    )


@pytest.mark.parametrize("unit", ["gfor.droop", "sg1.governor", "sg2.governor"])
def test_at_resonance_with_the_mode_of_the_two_areas(unit):
    found = forced("two_area", f"{unit}.delta_P_ref", 0.5817, loads=0.0005, measuring=5e-5)
    assert found.drives == unit.split(".")[0]


@pytest.mark.parametrize("unit", ["gfor31", "gfor35"])
def test_where_energy_flow_names_the_machine_beside_the_converter_that_drives_it(unit):
    """As in the Danish event: a converter whose Q-V phase gives it away."""
    found = forced("ieee39", f"{unit}.droop.delta_U_ref", 0.722)
    flow = next(o for o in found.opinions if o.method == DEF)
    assert flow.ranking[0][0] == unit.replace("gfor", "sg")
    assert not flow.applies
    assert found.drives == unit


def test_the_begin_of_a_forcing_beside_a_mode_lies_in_its_interval():
    """A mode of 0.961 Hz and 2.9 %, forced with 0.95 Hz from 5.0 s on: half of the level is there seconds later.

    `tests/benchmarks/begins.py` measures how often the interval holds the begin."""
    times, size = times_of(60.0), 2 * np.pi * 0.961
    mode = ([size**2], [1.0, 2 * 0.029 * size, size**2])
    _, swing, _ = scipy_signal.lsim(mode, sine(times, 0.95, 1.0, 5.0), times)
    for seed in range(4):
        noise = load_noise(len(times), 1, 30.0, 0.2, seed)
        (line,) = find_oscillations(Signals(times, ("unit.p",), swing[:, None] + noise))
        assert line.begin > 7.0
        assert line.onset.earliest <= 5.0 <= line.onset.latest
        assert line.onset.latest - line.onset.earliest < 6.0


PAIRS = [
    ("sg33.governor.delta_P_ref", "sg37.governor.delta_P_ref", 0.9, 0.9),
    # without a case, one alone leads
    ("sg39.exciter.delta_V_ref", "sg33.governor.delta_P_ref", 1.25, 1.25),
    # both at the mode of the areas
    ("gfor37.droop.delta_U_ref", "sg33.governor.delta_P_ref", 0.722, 0.722),
    ("sg33.governor.delta_P_ref", "gfor37.droop.delta_P_ref", 0.722, 1.1),  # one at the mode
]


@pytest.mark.parametrize(("one", "other", "f_one", "f_other"), PAIRS)
def test_two_sources(one, other, f_one, f_other):
    """Of one frequency neither is the source, with the units' models or without; of two frequencies each is."""
    measured = record(
        "ieee39",
        {one: sine(TIMES, f_one, 0.02), other: sine(TIMES, f_other, 0.02)},
        times=TIMES,
        loads=5e-4,
        measuring=5e-5,
    )
    plain, known = locate(measured), locate(measured, unit_models_of(model("ieee39")))
    units = [reference.partition(".")[0] for reference in (one, other)]
    assert all(x.source is None for x in plain)
    for unit, frequency in zip(units, (f_one, f_other), strict=True):
        assert at(plain, frequency).drives in (None, *units)
        assert at(known, frequency).source == (unit if f_one != f_other else None)
        if f_one != f_other:
            assert at(plain, frequency).drives == unit
    if f_one == f_other:
        assert all(unit in at(known, f_one).reason for unit in units)


@pytest.mark.parametrize(
    "reference",
    ["sg35.governor.delta_P_ref", "gfor35.droop.delta_U_ref", "sg35.exciter.delta_V_ref"],
)
@pytest.mark.parametrize("frequency", [0.4, 0.722])
def test_a_source_at_a_bus_that_is_not_observed(reference, frequency):
    found = forced("ieee39", reference, frequency, without=("bus_35",))
    assert found.drives is None


def turned(unit, p=True, q=True):
    def change(places):
        return [
            replace(x, p=-x.p if p else x.p, q=-x.q if q else x.q) if unit in (x.name, "all") else x
            for x in places
        ]

    return change


@pytest.mark.parametrize(
    ("reference", "unit", "q"),
    [  # each two of the values meet
        (f"{source}.delta_P_ref", unit, (i + k) % 2 == 0)
        for i, source in enumerate(("gfor.droop", "sg1.governor", "sg2.governor"))
        for k, unit in enumerate(("gfor", "sg1", "sg2", "all"))
    ],
)
def test_wrong_signs_of_power_or_current(reference, unit, q):
    found = forced("two_area", reference, 0.8, change=turned(unit, q=q))
    assert found.drives in (None, reference.split(".")[0])


@pytest.mark.parametrize("unit", ["sg36", "gfor36"])
@pytest.mark.parametrize("reference", ["sg35.governor.delta_P_ref", "gfor35.droop.delta_U_ref"])
def test_wrong_signs_in_a_larger_grid(unit, reference):
    for p, q in ((True, True), (True, False), (False, True)):
        found = forced("ieee39", reference, 0.722, change=turned(unit, p, q))
        assert found.drives in (None, reference.split(".")[0])


def late(unit, seconds, signals=("v", "angle", "p", "q")):
    def change(places):
        def moved(x):
            return np.interp(TIMES - seconds, TIMES, x)

        return [
            replace(x, **{s: moved(getattr(x, s)) for s in signals}) if x.name == unit else x
            for x in places
        ]

    return change


@pytest.mark.parametrize("unit", ["gfor", "sg1", "sg2"])
@pytest.mark.parametrize("signals", [("v", "angle", "p", "q"), ("p", "q")])
def test_a_clock_that_is_a_millisecond_off(unit, signals):
    found = forced("two_area", "sg1.governor.delta_P_ref", 0.5817, change=late(unit, 1e-3, signals))
    assert found.drives == "sg1"


def test_a_clock_that_is_off_between_voltages_and_currents():
    """A millisecond between both turns P and Q by 18 degrees at 50 Hz."""

    def change(places):
        turn = np.exp(1j * 2 * np.pi * 50 * 1e-3)
        power = [(x.p + 1j * x.q) * (turn if x.name == "sg2" else 1) for x in places]
        return [replace(x, p=s.real, q=s.imag) for x, s in zip(places, power, strict=True)]

    for reference in ("sg1.governor.delta_P_ref", "sg2.governor.delta_P_ref"):
        assert forced("two_area", reference, 0.8, change=change).drives in (
            None,
            reference.split(".")[0],
        )


def test_leakage_of_the_line_frequency():
    def change(places):
        hum = 0.02 * np.sin(2 * np.pi * 49.97 * TIMES)  # aliased: samples are 30 a second
        return [replace(x, p=x.p + hum, v=x.v + 0.1 * hum) for x in places]

    found = locate(
        record(
            "two_area",
            {"sg1.governor.delta_P_ref": sine(TIMES, 0.8, 0.02)},
            times=TIMES,
            change=change,
        )
    )
    assert at(found, 0.8).drives == "sg1"
    assert {x.drives for x in found} <= {None, "sg1"}


@pytest.mark.parametrize("who", ["sg1", "all"])
def test_leakage_that_looks_like_a_swing(who):
    """A reporting rate of 30 Hz shows a hum at 60.4 Hz as 0.4 Hz, at one device or at all."""

    def change(phase, places):
        hum = [np.sin(2 * np.pi * 60.4 * TIMES + a) for a in phase]
        return [
            replace(
                x,
                p=x.p + 0.1 * hum[0],
                q=x.q + 0.02 * hum[1],
                v=x.v + hum[2] / 500,
                angle=x.angle + hum[3] / 500,
            )
            if who in ("all", x.name)
            else x
            for x in places
        ]

    for phase in ((0.0, 0.0, 0.0, 0.0), (1.0, 2.0, 3.0, 2.5), (4.0, 0.5, 5.5, 2.0)):
        measured = record(
            "two_area", {}, times=TIMES, loads=5e-4, measuring=5e-5, change=partial(change, phase)
        )
        for models in (None, unit_models_of(model("two_area"))):
            found = at(locate(measured, models), 0.4)
            assert (found.drives, found.source) == (None, None)


def test_angles_that_wrap_and_run_away():
    def change(places):
        drift = 2 * np.pi * 0.05 * TIMES
        return [replace(x, angle=np.angle(np.exp(1j * (x.angle + drift)))) for x in places]

    found = forced("two_area", "sg1.governor.delta_P_ref", 0.8, change=change)
    assert found.drives == "sg1"


def missing(rows, unit=None):
    def change(places):
        for x in places:
            if unit in (None, x.name):
                for values in (x.v, x.angle, x.p, x.q):
                    values[rows] = np.nan
        return places

    return change


def test_missing_samples_are_bridged_or_the_place_is_left_out():
    few = np.random.default_rng(3).choice(len(TIMES), 40, replace=False)
    measured = record(
        "two_area",
        {"sg1.governor.delta_P_ref": sine(TIMES, 0.8, 0.02)},
        change=missing(few),
        times=TIMES,
    )
    assert at(locate(measured), 0.8).drives == "sg1"
    assert any("interpolated" in text for text in measured.remarks)
    gone = record(
        "two_area",
        {"sg1.governor.delta_P_ref": sine(TIMES, 0.8, 0.02)},
        change=missing(slice(600, 700), "sg1"),
        times=TIMES,
    )
    assert any("sg1 is left out" in text for text in gone.remarks)
    assert at(locate(gone), 0.8).drives is None


def test_missing_rows_cut_the_record_and_doubled_times_count_once():
    whole = record("two_area", {"sg1.governor.delta_P_ref": sine(TIMES, 0.8, 0.02)}, times=TIMES)
    keep = np.r_[0:200, 260:1500]
    places = [
        replace(x, **{s: getattr(x, s)[keep] for s in ("v", "angle", "p", "q")})
        for x in whole.places
    ]
    cut = made_ready("cut", TIMES[keep], places)
    assert any("rows are missing" in text for text in cut.remarks)
    assert cut.times[0] == TIMES[260]
    assert at(locate(cut), 0.8).drives == "sg1"
    twice = np.sort(np.r_[0:1500, 300])
    places = [
        replace(x, **{s: getattr(x, s)[twice] for s in ("v", "angle", "p", "q")})
        for x in whole.places
    ]
    doubled = made_ready("twice", TIMES[twice], places)
    assert len(doubled.times) == 1500
    assert any("1 times are written twice" in text for text in doubled.remarks)
    with pytest.raises(InputError, match="do not rise"):
        made_ready("back", TIMES[::-1], whole.places)


def test_a_load_of_constant_power_is_no_source():
    """A place that takes power, whatever its voltage does, neither feeds nor takes energy."""

    def change(places):
        x = places[0]
        return [
            *places,
            Site(
                "load",
                "unit",
                x.bus,
                x.v,
                x.angle,
                np.full(len(x.v), -5.0),
                np.full(len(x.v), -1.0),
            ),
        ]

    for reference in ("sg1.governor.delta_P_ref", "gfor.droop.delta_P_ref"):
        assert forced("two_area", reference, 0.8, change=change).drives == reference.split(".")[0]


def driven_by_noise(damping, seed, frequency=0.58, length=120.0):
    """A mode of a machine against a grid that loads shake, at one place."""
    t = times_of(length)
    w = 2 * np.pi * frequency
    step = t[1] - t[0]
    pole = np.exp((-damping + 1j * np.sqrt(1 - damping**2)) * w * step)
    white = np.random.default_rng(seed).standard_normal((len(t), 2)) @ np.array([1, 1j])
    z = np.zeros(len(t), complex)
    for k in range(1, len(t)):
        z[k] = pole * z[k - 1] + white[k]
    shape = {"sg1": 1.0, "sg2": -0.4}
    rng = np.random.default_rng(seed + 1)
    scale = 0.02 / np.abs(z).std()
    places = []
    for name, part in shape.items():
        own = 1e-3 * rng.standard_normal((4, len(t)))
        p, angle = part * scale * z.real, part * 0.1 * scale * z.imag
        places.append(
            Site(
                name,
                "unit",
                f"bus of {name}",
                1 + 0.01 * p + 0.01 * own[0],
                angle + 0.01 * own[1],
                5 + p + own[2],
                1 + own[3],
            )
        )
    return made_ready("ambient", t, places)


@pytest.mark.parametrize("damping", [0.003, 0.01, 0.03])
def test_a_mode_that_noise_shakes_is_not_called_forced(damping):
    kinds = [x.evidence.kind for seed in range(12) for x in locate(driven_by_noise(damping, seed))]
    assert len(kinds) >= 6
    assert kinds.count("forced") == 0


def test_a_mode_without_damping_after_a_step_is_not_called_forced():
    t = TIMES
    ring = 0.05 * (t >= 10) * np.sin(2 * np.pi * 0.6 * (t - 10))
    step = 0.08 * (t >= 10)
    noise = 1e-4 * np.random.default_rng(1).standard_normal((2, len(t)))
    places = [
        Site(
            "sg1",
            "unit",
            "a",
            1 + 0.01 * ring,
            0.1 * ring,
            5 + ring + step + noise[0],
            1 + 0.1 * ring,
        ),
        Site("sg2", "unit", "b", 1 - 0.01 * ring, -0.1 * ring, 5 - ring + noise[1], 1 - 0.1 * ring),
    ]
    assert at(locate(made_ready("ring", t, places)), 0.6).evidence.kind == "not known"


@pytest.mark.parametrize("rate", [-0.08, 0.05])
def test_what_decays_or_grows_is_a_mode(rate):
    t = TIMES
    ring = 0.02 * np.exp(rate * (t - 25)) * np.sin(2 * np.pi * 0.6 * t)
    places = [Site("sg1", "unit", "a", 1 + 0.01 * ring, 0.1 * ring, 5 + ring, 1 + 0.1 * ring)]
    found = at(locate(made_ready("ring", t, places)), 0.6)
    assert found.evidence.kind == "mode"
    assert found.drives is None
    assert found.evidence.damping_percent == pytest.approx(-100 * rate / (2 * np.pi * 0.6), rel=0.1)


def test_what_swells_and_fades_again_is_no_mode():
    """A line through its amplitude falls by a third, and explains little of it."""
    swell = 1 + 0.4 * np.sin(2 * np.pi * 1.25 * TIMES / TIMES[-1])
    ring = 0.02 * swell * np.sin(2 * np.pi * 0.6 * TIMES)
    places = [Site("sg1", "unit", "a", 1 + 0.01 * ring, 0.1 * ring, 5 + ring, 1 + 0.1 * ring)]
    assert at(locate(made_ready("swell", TIMES, places)), 0.6).evidence.kind == "not known"


def test_two_forcings_at_close_frequencies_beat_and_are_no_mode():
    t = times_of(60.0)
    beat = sine(t, 0.7, 0.02) + sine(t, 0.725, 0.016)
    measured = record(
        "two_area", {"gfor.droop.delta_P_ref": beat}, times=t, loads=5e-4, measuring=5e-5
    )
    found = at(locate(measured), 0.7)
    assert found.evidence.kind == "not known"
    assert "two steady sines" in found.reason


@pytest.mark.parametrize(
    "sines",
    [{0.7: 0.02, 0.75: 0.02}, {0.7: 0.02, 0.712: 0.012}, {0.68: 0.015, 0.7: 0.015, 0.725: 0.015}],
)
def test_forcings_at_close_frequencies_in_several_units_are_no_mode(sines):
    """The phase of each between the units is its own, so that no signal beats as another does."""
    t, rng = times_of(60.0), np.random.default_rng(2)
    noise = load_noise(len(t), 3, 30.0, 5e-4, 4).T
    places = []
    for k, name in enumerate(("sg1", "sg2", "sg3")):
        parts = [
            rng.uniform(0.5, 1.0) * a * np.exp(2j * np.pi * (f * t + 0.3 * rng.uniform()))
            for f, a in sines.items()
        ]
        x = sum(parts)
        places.append(
            Site(
                name,
                "unit",
                f"bus {name}",
                1 + 0.01 * x.real,
                0.1 * x.imag,
                5 + x.real + noise[k],
                1 + 0.1 * x.real,
            )
        )
    found = locate(made_ready("close", t, places))
    assert {one.evidence.kind for one in found} == {"not known"}
    assert all(one.source is None for one in found)


# frequency [Hz], rate [1/s], amplitude, phase; the kind of the line at the first, and what its
# reason says
CLOSE = {
    "two modes": (
        [(0.486, -0.0178, 0.0171, 2.47), (0.552, -0.0313, 0.006, 4.24)],
        30,
        "0.486, 0.552 Hz",
    ),
    "a sine beside a mode": (
        [(1.1952, 0, 0.0097, 5.74), (1.2252, -0.1336, 0.0188, 3.84)],
        40,
        "1.195, 1.225 Hz",
    ),
    "three sines": (
        [(1.2966, 0, 0.0074, 5.09), (1.2604, 0, 0.0071, 2.85), (1.2275, 0, 0.015, 1.23)],
        60,
        "1.227, 1.260, 1.297 Hz",
    ),
    "two sines": (
        [(0.6025, 0, 0, 0), (0.6, 0, 0.02, 0), (0.605, 0, 0.02, 1.5)],
        60,
        "(0.600, 0.605 Hz)",
    ),
    "a sine and the mode that it excited": ([(0.8, 0, 0.02, 0), (0.745, -0.2, 0.006, 2)], 60, None),
}


@pytest.mark.parametrize("name", CLOSE)
def test_what_a_line_is_beside_its_close_neighbours(name):
    parts, length, said = CLOSE[name]
    t, places = np.arange(0, length, 0.04), []
    noise = 1e-6 * np.random.default_rng(1).standard_normal((3, 4, len(t)))
    for unit, size, own in zip("ABC", (1.0, 0.5, -0.8), noise, strict=True):
        z = size * sum(
            a * np.exp((rate + 2j * np.pi * f) * t + 1j * phase) for f, rate, a, phase in parts
        )
        shown = own + np.array([0.2 * z.real, 0.3 * z.imag, z.real, 0.4 * (z * np.exp(1j)).real])
        places.append(
            Site(unit, "unit", unit, 1 + shown[0], shown[1], 3 + shown[2], 0.5 + shown[3])
        )
    evidence = at(locate(made_ready(name, t, places)), parts[0][0]).evidence
    assert evidence.kind == ("not known" if said else "forced")
    assert said is None or said in evidence.reasons[0]


def test_noise_of_loads_alone_forces_nothing():
    for name in ("two_area", "ieee39"):
        found = locate(record(name, {}, loads=0.002, measuring=5e-5, times=times_of(60.0)))
        assert all(x.drives is None for x in found)


def test_a_square_has_its_odd_multiples():
    t = TIMES
    measured = record(
        "two_area", {"gfor.droop.delta_P_ref": sine(t, 0.4, 0.02, shape="square")}, times=t
    )
    found = at(locate(measured), 0.4)
    assert 3 in found.found.harmonics
    assert found.evidence.kind == "forced"
    assert found.drives == "gfor"


def test_the_begin_is_found():
    found = forced("two_area", "sg1.governor.delta_P_ref", 1.2)
    assert found.found.begin == pytest.approx(10.0, abs=1.0)


def test_loads_wander_with_the_deviation_that_was_asked_for():
    assert load_noise(20_000, 1, 30.0, 0.01, 1).std() == pytest.approx(0.01, rel=0.1)
    assert len(model("ieee39").references) == 47 - 9  # of Q and U, which move the same, one


def test_the_two_physical_methods_have_names():
    assert {o.method for o in forced("two_area", "sg1.governor.delta_P_ref", 0.8).opinions} >= {
        DEF,
        QV_PHASE,
    }
