"""The limit of stability is one: by Nyquist from scans, by modes, and by runs at either side of it.

A run is stirred for a moment, so that it returns to the operating point of the others, and the growth of what swings on
is read from it; it is nearly a straight line over the parameter. Steps are short where the coupling's own delay, which
neither scans nor models without a step have, moves the limit."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq, least_squares

import orchestrator as gfor
from orchestrator.cases.case import load_case
from orchestrator.studies.black_box.frequency_response import Excitation
from orchestrator.studies.immittance.cut import cut_of
from orchestrator.studies.immittance.measured import scan_fmu
from orchestrator.studies.immittance.scan_files import write_ztool
from tests.studies.immittance.test_placing import placed

PULSE = """[[events]]
type = "load_change"
time = "1.5 s"
component = "grid"
load = "load_2"
scale = 1.0

[scenarios.base]"""


def by_modes(scenario, low, high):
    def growth(value):
        found = cut_of(scenario(value).prepared, None, ()).eigenvalues
        return float(found[np.abs(found) > 1e-3].real.max())

    return brentq(growth, low, high, rtol=1e-6)


def growth_in(time, values):
    """Of a swing and a slow rest, by least squares [1/s]."""
    t, y = time - time[0], (values - values.mean()) / np.abs(values - values.mean()).max()
    spectrum = np.abs(np.fft.rfft(y * np.hanning(len(y))))
    w = 2 * np.pi * np.fft.rfftfreq(len(y), t[1])[spectrum.argmax()]

    def misfit(p):
        return p[0] * np.exp(p[1] * t) * np.cos(p[2] * t + p[3]) + p[4] + p[5] * t - y

    found = min(
        (least_squares(misfit, [1, 0, w, phase, 0, 0]) for phase in (0, 2, 4)), key=lambda x: x.cost
    )
    return float(found.x[1])


def by_runs(scenario, signal, limit, stop, start):
    values, growths = limit * np.array([0.995, 1.005]), []
    for value in values.tolist():
        record = scenario(value).run(stop=stop).dataset.sel(time=slice(start, None))
        growths.append(growth_in(record["time"].values, signal(record)))
    return float(values[0] - growths[0] * (values[1] - values[0]) / (growths[1] - growths[0]))


def test_a_grid_following_converter_at_a_weak_infinite_bus(tmp_path):
    values = {"S_n": 1000.0, "P_0": 0.9, "Q_0": 0.0, "v_0": 1.0, "pll.f_0": 40.0}
    text = load_case("infinite_bus").path.read_text().partition("[[plots]]")[0]
    device = 'model = "gfor"\nparameters = { S_n = "1500 MVA", P_0 = 0.6, Q_0 = 0.05, v_0 = 1.0 }'
    own = 'parameters = { S_n = "1000 MVA", P_0 = 0.9, Q_0 = 0.0, v_0 = 1.0'
    changes = {
        "Q_0 = 0.75": "Q_0 = 0.0",
        "value = 0.2": "value = 0.002",
        "1.15 s": "1.01 s",
        "1 ms": "100 us",
        device: f'model = "gfl"\n{own}, pll.f_0 = "40 Hz" }}',
    }
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "own.toml").write_text(text)
    how = Excitation(lowest_hz=1.0, highest_hz=1000.0, lines=120)
    scan = scan_fmu(gfor.build("gfl", tmp_path, native=True), None, values, 1e-4, how).in_siemens(
        230.0
    )
    points = {name: replace(point, kilovolt=230.0) for name, point in scan.points.items()}
    write_ztool(replace(scan, points=points), tmp_path / "plant.txt")
    text = text.replace('model = "gfl"', 'scan = "plant.txt"\nvoltage = "230 kV"').replace(
        ', pll.f_0 = "40 Hz"', ""
    )
    (tmp_path / "scan.toml").write_text(text)

    def at(X):
        return {"grid.X": X, "grid.R": X / 10}

    case = gfor.load(tmp_path / "own.toml")
    limit = by_modes(lambda X: case.scenario("dip", at(X)), 0.03, 0.05)
    for k, verdict in ((0.999, "stable"), (1.001, "unstable")):
        found = gfor.nyquist(tmp_path / "scan.toml", scenario="dip", values=at(k * limit))
        assert (found.verdict, found.reasons) == (verdict, ())
    run = by_runs(
        lambda X: case.scenario("dip", at(X), step="10 us"),
        lambda r: r["gfor.p"].values,
        limit,
        2.0,
        1.1,
    )
    assert run == pytest.approx(limit, rel=1e-3)


def test_the_mode_between_two_areas(tmp_path):
    """A voltage regulator's integral gain takes the mode across; the converter is a scan."""
    text = (
        load_case("two_area")
        .path.read_text()
        .replace("scale = 1.01", "scale = 1.002")
        .partition("[analysis]")[0]
    )
    (tmp_path / "own.toml").write_text(text.replace("[scenarios.base]", PULSE, 1))
    case = gfor.load(tmp_path / "own.toml")

    def at(K):
        return case.scenario("gfor", {"sg1.exciter.K_IR": K})

    limit = by_modes(at, 20.0, 30.0)
    scanned = placed(tmp_path, cut_of(at(limit).prepared, None, ("gfor", "sg2")), "gfor")
    for k, verdict in ((0.999, "stable"), (1.001, "unstable")):
        found = gfor.nyquist(scanned, scenario="gfor", values={"sg1.exciter.K_IR": k * limit})
        assert (found.verdict, found.reasons) == (verdict, ())
    run = by_runs(at, lambda r: (r["sg1.omega"] - r["sg2.omega"]).values, limit, 70.0, 40.0)
    assert run == pytest.approx(limit, rel=1e-3)
