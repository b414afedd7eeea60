"""Cuts through cases: the verdict of the loop is that of the modes, and a measured device gives the same limit."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

import orchestrator as gfor
from orchestrator.core.errors import InputError
from orchestrator.studies.black_box.frequency_response import Excitation
from orchestrator.studies.immittance import cut as cut_module
from orchestrator.studies.immittance import judgement
from orchestrator.studies.immittance.cut import cut_of
from orchestrator.studies.immittance.judgement import judge_loop
from orchestrator.studies.immittance.loop import CutLoop, SeriesCapacitors
from orchestrator.studies.immittance.measured import scan_fmu
from orchestrator.studies.immittance.sides import Sampled, Together
from orchestrator.studies.immittance.strength import critical


@pytest.mark.parametrize(
    ("scenario", "names", "stable"),
    [("gfor", ("gfor",), True), ("gfor", (), True), ("base", ("sg1",), False)],
)
def test_the_verdict_at_a_cut_is_that_of_the_modes(scenario, names, stable):
    cut = cut_of(gfor.load("two_area").scenario(scenario).prepared, None, names)
    found = judge_loop(CutLoop(cut.device, cut.network))
    assert cut.modes_stable == stable
    assert (found.verdict == "stable") == stable
    assert found.growing == (0 if stable else 2)


def test_a_disagreement_with_the_modes_is_no_verdict(monkeypatch):
    monkeypatch.setattr(
        "orchestrator.studies.immittance.judgement._count", lambda path, turns, exact: 2
    )
    found = gfor.nyquist("two_area", scenario="gfor", components=["gfor"])
    assert found.verdict == "not known"
    assert "eigenvalues of the closed system say stable" in found.reasons[0]
    monkeypatch.setattr(
        "orchestrator.studies.immittance.judgement._count", lambda path, turns, exact: 4
    )
    found = gfor.nyquist("two_area", scenario="base", components=["sg1"])
    assert "say unstable (2 grow), the encirclements unstable (4)" in found.reasons[0]


def growth(cut, x):
    """Of the closed system with capacitors of a reactance in series at the port, from its states [1/s]."""
    d, n, omega = cut.device, cut.network, 2 * np.pi * 50
    J = np.array([[0.0, -1.0], [1.0, 0.0]])
    nothing = np.zeros((len(n.A), 2))
    A = np.block(
        [
            [d.A, d.B @ n.C, -d.B],
            [-n.B @ d.C, n.A, nothing],
            [x * omega * d.C, nothing.T, -omega * J],
        ]
    )
    modes = np.linalg.eigvals(A)
    return modes[np.abs(modes) > 1e-3].real.max()


def test_a_scan_by_fmi_alone_gives_the_stability_limit_of_the_modes_to_a_thousandth(tmp_path):
    """The converter behind capacitors that are too large swings; its FMU is scanned once, without its states."""
    values = {"S_n": 1500.0, "P_0": 0.6, "Q_0": 0.05, "v_0": 1.0}
    fmu = gfor.build("gfor", tmp_path, native=True)
    scan = scan_fmu(fmu, None, values, 1e-4, Excitation(lowest_hz=1.0, highest_hz=1000.0, lines=80))
    cut = cut_of(gfor.load("infinite_bus").scenario("dip", {"grid.X": 0.01}).prepared, None, ())
    exact = cut.device.at(2j * np.pi * scan.frequencies)
    error = np.linalg.norm(scan.values - exact, axis=(1, 2)) / np.linalg.norm(exact, axis=(1, 2))
    assert error[scan.frequencies < 300].max() < 1e-4
    limit = brentq(lambda x: growth(cut, x), 0.01, 0.02)
    for device in (cut.device, Sampled("scan", scan.frequencies, scan.values, scan.bounds)):
        for x, verdict in ((0.999 * limit, "stable"), (1.001 * limit, "unstable")):
            found = judge_loop(CutLoop(device, cut.network, SeriesCapacitors(x, 2 * np.pi * 50)))
            assert (found.verdict, found.reasons) == (verdict, ())


def test_what_is_no_device_and_no_bus_is_refused():
    prepared = gfor.load("two_area").scenario("gfor").prepared
    with pytest.raises(InputError, match="--component grid: it is no device"):
        cut_of(prepared, None, ("grid",))
    with pytest.raises(InputError, match="--bus nowhere: no device stands there"):
        cut_of(prepared, "nowhere", ())


def test_the_rated_frequency_is_that_of_the_components_and_not_50_hz():
    case = gfor.load("infinite_bus")
    values = {
        f"{name}.f_n": 60.0
        for name, plan in case.scenario("load_step").prepared.system.components.items()
        if "f_n" in plan.description.variables
    }
    assert cut_of(case.scenario("load_step", values).prepared, None, ()).rated_hz == 60
    assert cut_of(case.scenario("load_step").prepared, None, ()).rated_hz == 50


def test_a_case_of_phasor_models_is_refused_with_the_way_out():
    with pytest.raises(InputError, match="phasor models have another port: cut its EMT models"):
        cut_of(gfor.load("two_area_rms").scenario("gfor").prepared, None, ())


def test_each_bus_of_a_whole_case_is_what_a_cut_there_finds():
    """At a bus, the poles of all else are eigenvalues; of the whole, they are what the count leaves over."""
    prepared = gfor.load("two_area").scenario("gfor").prepared
    whole = cut_of(prepared, None, ())
    found = judge_loop(CutLoop(whole.device, whole.network), modes=whole.eigenvalues)
    assert [devices for _, devices in whole.ports] == [("gfor", "sg1"), ("sg2",)]
    for one, bus in zip(found.buses, ("bus_2", "bus_3"), strict=True):
        cut = cut_of(prepared, bus, ())
        alone = judge_loop(CutLoop(cut.device, cut.network))
        assert (alone.growing, alone.encirclements) == (found.growing, one.encirclements)
        assert len(cut.network.unstable) == one.without
        assert alone.margins.distance.value == pytest.approx(one.margins.distance.value, rel=5e-3)
        assert alone.margins.phase_deg.value == pytest.approx(one.margins.phase_deg.value, rel=5e-3)


def test_a_bus_whose_counts_differ_leaves_the_whole_open(monkeypatch):
    count = judgement.encirclements
    odd = lambda path, exact: (0, 1) if path.L.shape[-1] == 2 else count(path, exact=exact)  # noqa: E731
    monkeypatch.setattr(judgement, "encirclements", odd)
    cut = cut_of(gfor.load("two_area").scenario("gfor").prepared, None, ())
    found = judge_loop(CutLoop(cut.device, cut.network))
    assert (found.verdict, found.reasons[0][:47]) == (
        "not known",
        "at port 1 the determinant goes round 0 times an",
    )


def test_what_a_device_does_to_the_distance_is_what_more_of_it_does():
    cut = cut_of(gfor.load("two_area").scenario("gfor").prepared, None, ())
    loop = CutLoop(cut.device, cut.network)
    nearest = critical(loop, judge_loop(loop), cut)[0]
    s, h = np.array([2j * np.pi * nearest.frequency_hz]), 1e-5
    assert sum(nearest.buses.values()) == pytest.approx(1)
    for unit in cut.units:
        grown = replace(
            unit, side=replace(unit.side, C=(1 + h) * unit.side.C, D=(1 + h) * unit.side.D)
        )
        units = tuple(grown if other is unit else other for other in cut.units)
        L = CutLoop(replace(cut.device, units=units), cut.network).values(s)[0]
        moved = np.linalg.svd(np.eye(len(L)) + L, compute_uv=False)[-1] - nearest.distance
        assert moved == pytest.approx(h * nearest.devices[", ".join(unit.devices)], rel=0.01)


def test_a_loop_that_is_not_of_the_system_is_seen_by_the_modes(monkeypatch):
    """With a device left out, all is stable as well, but det(1 + L) is of another system; no margin is told then."""
    sides = Together.at
    monkeypatch.setattr(
        Together, "at", lambda self, s: sides(replace(self, units=self.units[1:]), s)
    )
    found = gfor.nyquist("two_area", scenario="gfor").as_json()
    assert found["verdict"] == "not known"
    assert "det(1 + L) is not that of the eigenvalues and poles" in found["reasons"][0]
    assert set(found["margins"].values()) == {None}
    assert found["buses"] == found["critical"] == []


def test_undamped_poles_are_passed_on_the_right(monkeypatch):
    """Stators without resistance: three poles on the axis, at one place, on either side of it by rounding."""
    cut = cut_of(gfor.load("wscc9").scenario("pod_q").prepared, None, ())
    assert ((np.abs(cut.device.poles.real) < 1e-7) & (cut.device.poles.imag > 300)).sum() == 3
    found = judge_loop(CutLoop(cut.device, cut.network), modes=cut.eigenvalues)
    assert (found.verdict, found.growing, cut.modes_stable) == ("stable", 0, True)
    monkeypatch.setattr(CutLoop, "_on_axis", lambda self, low, high: np.zeros(0))
    monkeypatch.setattr("orchestrator.studies.immittance.sides.ON_AXIS", 0.0)
    assert gfor.nyquist("wscc9", scenario="pod_q").verdict != "unstable"


def test_a_device_that_measures_at_another_bus_cannot_be_cut_off(monkeypatch):
    """Its voltage is read from elsewhere, too, as a wide-area controller does."""
    whole = cut_module._Opened._open

    def measured(self, rows):
        A, B, C, D = whole(self, rows)
        B = B.copy()
        # the first state of the first device from the voltage of the third, at another bus
        B[0, 4] = 1.0
        return [A, B, C, D]

    monkeypatch.setattr(cut_module._Opened, "_open", measured)
    with pytest.raises(InputError, match="no cut separates gfor from the network: other signals"):
        cut_of(gfor.load("two_area").scenario("gfor").prepared, None, ())
