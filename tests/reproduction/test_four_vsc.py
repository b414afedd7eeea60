"""The four-VSC benchmark: the independent computation's limits, those of the FMUs, and every table of the page."""

from dataclasses import replace

import numpy as np
import pytest

import orchestrator as gfor
from orchestrator.cases.case import BUILT_IN
from orchestrator.studies.modes.modes import compute_modes
from orchestrator.studies.runs.run import run_scenario
from tests.reference.four_vsc import BUSES, HVDC1, HVDC2, WP1, WP2, FourVsc, emtp, report, with_all
from tests.support.scenarios import prepare_one
from tests.support.tables import figures

pytestmark = pytest.mark.reproduction

PAGE = (BUILT_IN / "four_vsc" / "README.md").read_text(encoding="utf-8")
OURS, CHANGES, FORMING = "Theirs and ours", "What makes the difference", "With forming converters"
EMTP = "The EMTP file of 2025"
MARGIN, HERTZ = 4e-3, 0.06
"""A limit stands in the tables to three digits, and is tried on both sides; a frequency to a tenth of a hertz."""

RECORDED = "Their recording"

OPEN = FourVsc(circuits_AB=1)
BY_VOLTAGE = (replace(WP1, by_voltage=True, K_pv=0.1667, K_iv=50.0), WP2, HVDC1, HVDC2)
ROWS = {
    "as published": OPEN,
    "both circuits between A and B": FourVsc(),
    "the load a resistance in series with an inductor": replace(OPEN, load="series"),
    "no load, the equivalent takes its power": replace(OPEN, load="none"),
    "R/X of the equivalent 0.1": replace(OPEN, R_X=0.1),
    "wind park 1 holds its voltage, as the others": replace(OPEN, converters=BY_VOLTAGE),
    "no ratio between B2 and B": replace(OPEN, tap_B=1.0),
    "PLL twice as slow": with_all(OPEN, T_pll=0.2),
    "PLL twice as fast": with_all(OPEN, T_pll=0.05),
    "lag of 1 ms in the voltage fed forward": replace(OPEN, fed_forward=1e-3),
    "lag of 0.5 ms in the converter's voltage": replace(OPEN, actuated=5e-4),
    "gain of the active power 33.3, as in the files": with_all(OPEN, K_pp=33.3),
    "the data of 2025": report(circuits_AB=1),
    "the data of 2025, R/X 0.04": report(circuits_AB=1, R_X=0.04),
}
QUICK = {"as published", "gain of the active power 33.3, as in the files", "the data of 2025"}


W1 = replace(OPEN, converters=BY_VOLTAGE)


def scaled(**factors):
    """The benchmark with gains of every converter multiplied."""
    of = [{name: by * getattr(u, name) for name, by in factors.items()} for u in OPEN.converters]
    return replace(
        OPEN,
        converters=tuple(replace(u, **new) for u, new in zip(OPEN.converters, of, strict=True)),
    )


CANDIDATES = {
    "as published": OPEN,
    "wind park 1 holds its voltage, as the others": W1,
    "the data of 2025": ROWS["the data of 2025"],
    "active power: both gains twice": scaled(K_pp=2, K_ip=2),
    "active power: K_p ten times": scaled(K_pp=10),
    "voltages and reactive power: both gains twice": scaled(K_pv=2, K_iv=2),
    "measurements: a lag of 10 ms": with_all(OPEN, T=0.01),
    "current control half as fast": scaled(K_pc=0.5, K_ic=0.5),
    "current control twice as fast": scaled(K_pc=2, K_ic=2),
    "PLL twice as fast": ROWS["PLL twice as fast"],
    "PLL: integral gain twice": scaled(pll_integral=2),
    "lag of 1 ms in the voltage fed forward": ROWS["lag of 1 ms in the voltage fed forward"],
    "lag of 0.5 ms in the converter's voltage": ROWS["lag of 0.5 ms in the converter's voltage"],
    "R/X of the equivalent 0.1": ROWS["R/X of the equivalent 0.1"],
    "a circuit between A and C opens instead": FourVsc(circuits_AC=1),
    "a circuit between B and C opens instead": FourVsc(circuits_BC=1),
    "a fifth of the load": replace(OPEN, load_share=0.2),
    "two: PLL: integral gain 2.2 times; a fifth of the load": replace(
        scaled(pll_integral=2.2), load_share=0.2
    ),
    "two: wind park 1 holds its voltage; lag of 0.5 ms in the voltage fed forward": replace(
        W1, fed_forward=5e-4
    ),
    "three: these; a fifth of the load": replace(W1, fed_forward=5e-4, load_share=0.2),
    "two: the data of 2025; a circuit between A and C opens instead": report(circuits_AC=1),
    "cables: charging twice": replace(OPEN, cables=2.0),
    "cables: half the charging": replace(OPEN, cables=0.5),
    "capacitors for reactors": replace(OPEN, capacitors=True),
    "delay of 0.1 ms in the converter's voltage": replace(OPEN, delay=1e-4),
    "two: this delay; lag of 0.25 ms in the voltage fed forward": replace(
        OPEN, delay=1e-4, fed_forward=2.5e-4
    ),
    "two: wind park 1 holds its voltage; capacitors for reactors": replace(W1, capacitors=True),
    "two: wind park 1 holds its voltage; cables: charging 1.35 times": replace(W1, cables=1.35),
    "three: the data of 2025; delay of 0.1 ms; lag of 0.25 ms in the voltage fed forward": report(
        circuits_AB=1, delay=1e-4, fed_forward=2.5e-4
    ),
}


@pytest.mark.parametrize("label", CANDIDATES)
def test_the_candidates_beside_the_recording(label):
    """Rate and frequency of the oscillation: 17.7 GVA, 16 GVA, and 17.7 GVA without the load."""
    system = CANDIDATES[label]
    cells = [cell[0] for cell in figures(PAGE, RECORDED, label)]
    tried = ({"S_sc": 17700.0}, {"S_sc": 16000.0}, {"S_sc": 17700.0, "load": "none"})
    found = [z for change in tried for z in [replace(system, **change).oscillation()]]
    assert cells[::2] == pytest.approx([z.real for z in found], abs=0.011)
    assert cells[1::2] == pytest.approx([z.imag / 2 / np.pi for z in found], abs=0.011)


def test_no_single_change_comes_near_the_recording():
    """What the page says: nearer than 1.2 1/s and 0.4 Hz in all three are two rows, both with a fifth of the load."""
    theirs = np.array(
        [cell[0] for cell in figures(PAGE, RECORDED, "**theirs, read from their pictures**")]
    )
    near = set()
    for label in CANDIDATES:
        apart = np.abs(np.array([cell[0] for cell in figures(PAGE, RECORDED, label)]) - theirs)
        if apart[::2].max() < 1.2 and apart[1::2].max() < 0.4:
            near.add(label)
    assert near == {
        "two: PLL: integral gain 2.2 times; a fifth of the load",
        "three: these; a fifth of the load",
    }


def assert_limit(system, gva, hertz):
    """It is unstable just below the limit, at that frequency, and stable just above it."""
    below = replace(system, S_sc=1e3 * gva * (1 - MARGIN)).critical()
    above = replace(system, S_sc=1e3 * gva * (1 + MARGIN)).critical()
    assert below.real > 0 > above.real
    assert below.imag / 2 / np.pi == pytest.approx(hertz, abs=HERTZ)


@pytest.mark.parametrize(
    "label", [k if k in QUICK else pytest.param(k, marks=pytest.mark.slow) for k in ROWS]
)
@pytest.mark.parametrize("network", ["EMT", "phasors"])
def test_each_change_has_the_limit_of_the_page(label, network):
    cells = [cell[0] if cell else None for cell in figures(PAGE, CHANGES, label)]
    gva, hertz = cells[:2] if network == "EMT" else cells[2:]
    system = replace(ROWS[label], dynamic=network == "EMT")
    if gva is None:
        assert replace(system, S_sc=40000.0).critical().real > 0
    else:
        assert_limit(system, gva, hertz)


SLIPS = {"charging": 0.5, "capacitors": True}
ENTERED = {
    "as published": (emtp(), ("four_vsc", "report")),
    "half the charging, `half_charging`": (emtp(charging=0.5), ("four_vsc", "half_charging")),
    "capacitors for reactors, `charging`": (emtp(capacitors=True), ("four_vsc_emtp", "charging")),
    "both, as entered: `entered`": (emtp(**SLIPS), ("four_vsc_emtp", "entered")),
    "both, lag of 0.08 ms in the voltage fed forward": (emtp(**SLIPS, fed_forward=8e-5), None),
    "both, wind park 1 with K_p 0.0333, K_i 10: `gains`": (
        emtp(0.0333, 10.0, **SLIPS),
        ("four_vsc_emtp", "gains"),
    ),
}


@pytest.mark.parametrize("label", ENTERED)
def test_the_slips_of_the_emtp_file_have_the_limits_of_the_page(label):
    system, _ = ENTERED[label]
    gva, hertz, open_gva, open_hertz = (cell[0] for cell in figures(PAGE, EMTP, label)[2:])
    assert_limit(system, gva, hertz)
    assert_limit(replace(system, circuits_AB=1), open_gva, open_hertz)


@pytest.mark.slow
@pytest.mark.parametrize("label", [label for label, (_, case) in ENTERED.items() if case])
def test_so_have_the_fmus(label):
    gva, hertz = (cell[0] for cell in figures(PAGE, EMTP, label)[:2])
    assert_fmus(*ENTERED[label][1], gva, hertz)


def test_with_both_slips_the_power_flow_is_biger_s_listing():
    """Angles in degrees, reactive powers in Mvar, from the listing itself; the FMUs' flow is the same."""
    angles = {"A": 2.383844949, "B": 2.065609536, "E": 10.77028684, "F": 11.21314439}
    reactive = {"A": -28.10257028, "B": 419.2922914, "E": -361.5673091, "F": -777.8517597}
    v, s = emtp(**SLIPS).power_flow()
    buses = gfor.load("four_vsc_emtp").scenario("entered").modes().power_flow()["buses"]
    for bus, angle in angles.items():
        k = BUSES.index(bus)
        assert np.degrees(np.angle(v[k])) == pytest.approx(angle, abs=5e-5)
        assert 100 * s[k].imag == pytest.approx(reactive[bus], abs=0.05)
        assert buses.angle_deg[f"bus_{bus}"] == pytest.approx(angle, abs=5e-5)


def test_the_power_flow_is_that_of_the_published_files():
    """Voltages of lf_2.dat [pu, rad]: A, A2, B, B2, E and F."""
    v, _ = FourVsc().power_flow()
    published = {
        0: (1.0075727, 0.041624702),
        1: (1.0318733, 0.15892537),
        2: (1.0054174, 0.036073673),
        3: (0.9824509, 0.16556362),
        5: (1.0475620, 0.18895444),
        6: (0.9997311, 0.19815885),
    }
    for k, (magnitude, angle) in published.items():
        assert abs(v[k]) == pytest.approx(magnitude, abs=1e-5)
        assert np.angle(v[k]) == pytest.approx(angle, abs=2e-5)


def test_with_the_files_gain_the_phasor_system_has_the_limit_of_the_slides():
    """5.5 GVA and 8 Hz, for a response that they call marginal."""
    gva, hertz = (
        cell[0]
        for cell in figures(PAGE, CHANGES, "gain of the active power 33.3, as in the files")[2:]
    )
    assert gva == pytest.approx(5.5, rel=0.06)
    assert hertz == pytest.approx(8.0, rel=0.03)
    marginal = replace(with_all(OPEN, K_pp=33.3), dynamic=False, S_sc=5500.0).oscillation()
    # their picture: the same
    assert marginal == pytest.approx(complex(-1.03, 2 * np.pi * 7.93), abs=0.05)


# -- the FMUs -----------------------------------------------------------------------------------


def stability(name, scenario, S_sc, step=None, **overrides):
    ready = prepare_one(name, scenario, {"equivalent.S_n": S_sc} | overrides, step_size=step)
    return compute_modes(ready, (1.0, 60.0)).stability


def assert_fmus(name, scenario, gva, hertz, step=None, **overrides):
    below = stability(name, scenario, 1e3 * gva * (1 - 2 * MARGIN), step, **overrides)
    above = stability(name, scenario, 1e3 * gva * (1 + 2 * MARGIN), step, **overrides)
    assert (below.stable, above.stable) == (False, True)
    assert below.mode.frequency_hz == pytest.approx(hertz, abs=HERTZ)


@pytest.mark.slow
@pytest.mark.parametrize("label", ["FMUs, `following`", "FMUs, `report`"])
def test_the_fmus_have_the_limits_of_the_page(label):
    scenario = label.split("`")[1]
    emt, emt_hz, rms, rms_hz = (cell[0] for cell in figures(PAGE, OURS, label))
    assert_fmus("four_vsc", scenario, emt, emt_hz)
    assert_fmus("four_vsc_rms", scenario, rms, rms_hz)


@pytest.mark.slow
def test_the_fmus_with_the_files_gain():
    *_, gva, hertz = figures(PAGE, OURS, "FMUs, `file` with `--step 2e-4`")
    assert_fmus("four_vsc_rms", "file", gva[0], hertz[0], step=2e-4)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_vsc", "four_vsc_rms"])
@pytest.mark.parametrize("S_sc", [20000.0, 5000.0])
def test_every_independent_eigenvalue_is_one_of_the_fmus(name, S_sc):
    """Without a communication step. Only the phasor FMUs have lags of the bus voltage, here of 1 ms: (s·τ)² apart."""
    emt = name == "four_vsc"
    lags = (
        {}
        if emt
        else {f"{unit}.bus_voltage.tau": 1e-3 for unit in ("wp1", "wp2", "hvdc1", "hvdc2")}
    )
    ready = prepare_one(name, "following", {"equivalent.S_n": S_sc} | lags)
    fmus = np.linalg.eigvals(compute_modes(ready).system.A)
    exact = FourVsc(S_sc=S_sc, R_X=0.001, dynamic=emt).eigenvalues()
    exact = exact[np.abs(exact + 1000) > 1e-3]  # the lags of what is not in the benchmark
    for z in exact if emt else exact[np.abs(exact) < 150]:
        assert np.abs(fmus - z).min() < (2e-4 if emt else 2e-2) * max(abs(z), 10.0)


SHARES = {"48 MVA": 48, "120 MVA": 120, "240 MVA, `forming_tenth`": 240, "600 MVA": 600}


@pytest.mark.slow
@pytest.mark.parametrize("label", SHARES)
def test_how_much_forming_rating_a_weak_grid_needs(label):
    forming = SHARES[label]
    cells = figures(PAGE, FORMING, label)
    shares = {"wp2.S_n": 2400.0 - forming, "gfor_wp2.S_n": float(forming)}
    assert_fmus("four_vsc", "forming_tenth", cells[0][0], cells[1][0], **shares)
    if len(cells) == 4:  # else it says "below 0.3"
        assert_fmus("four_vsc_rms", "forming_tenth", cells[2][0], cells[3][0], **shares)
    else:
        assert stability("four_vsc_rms", "forming_tenth", 300.0, **shares).stable


@pytest.mark.slow
def test_damping_controllers_hardly_move_the_limit():
    cells = figures(PAGE, FORMING, "240 MVA with POD, `forming_tenth_pod`")
    assert_fmus("four_vsc", "forming_tenth_pod", cells[0][0], cells[1][0])
    assert_fmus("four_vsc_rms", "forming_tenth_pod", cells[2][0], cells[3][0])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_vsc", "four_vsc_rms"])
@pytest.mark.parametrize(
    "scenario", ["forming_1", "forming_1_pod", "forming_2", "forming_3", "forming_4"]
)
def test_with_a_forming_wind_park_there_is_no_limit_above_300_mva(name, scenario):
    """The slides show it for wind park 2, with EMT and phasor models."""
    assert stability(name, scenario, 300.0).stable
    assert stability(name, scenario, 20000.0).stable


@pytest.mark.slow
def test_the_simulated_oscillation_grows_as_the_independent_eigenvalue_says(tmp_path):
    """One circuit opens at 0.1 s; at 9 GVA the voltage of wind park 2 grows by 3.5 1/s at 13.8 Hz."""
    text = (
        (BUILT_IN / "four_vsc" / "case.toml")
        .read_text(encoding="utf-8")
        .replace('time = "1 s"', 'time = "0.1 s"')
    )
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    ready = prepare_one(
        tmp_path / "case.toml", "following", {"equivalent.S_n": 9500.0}, stop_time=0.8
    )
    recorded = run_scenario(ready).dataset
    time, v = recorded["time"].values, recorded["grid.bus_F.v"].values
    exact = FourVsc(S_sc=9500.0, circuits_AB=1, R_X=0.001).critical()
    late = time > 0.35
    t, v = time[late], v[late] - v[late].mean()
    peaks = [k for k in range(1, len(v) - 1) if v[k - 1] < v[k] >= v[k + 1]]
    growth = np.polyfit(t[peaks], np.log(v[peaks]), 1)[0]
    assert growth == pytest.approx(exact.real, abs=0.5)
    assert 2 * np.pi / np.diff(t[peaks]).mean() == pytest.approx(exact.imag, rel=0.02)
