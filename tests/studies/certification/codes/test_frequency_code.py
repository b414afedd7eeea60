"""Voltage source behaviour from an admittance: against sources, masses and loops whose answer is known."""

import json
from dataclasses import replace

import numpy as np
import pytest

import orchestrator as gfor
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.studies.black_box.frequency_response import Excitation, measure
from orchestrator.studies.black_box.port import bench_at
from orchestrator.studies.certification.codes.frequency import files, measurement
from orchestrator.studies.certification.codes.frequency.figures import (
    impedances,
    springs,
    swing,
)
from orchestrator.studies.certification.codes.frequency.limits import asked_stiffness
from orchestrator.studies.certification.codes.frequency.point import (
    POINTS,
    AtPoint,
    ScannedPoint,
)
from orchestrator.studies.certification.codes.frequency.strength import (
    RATIOS,
    AtRatio,
    Strengths,
    closed_loop,
    least_damped,
)
from orchestrator.studies.certification.codes.frequency.verdict import sentence_of, verdict_of
from orchestrator.studies.certification.codes.stiffness import Stiffness, stiffness
from orchestrator.studies.immittance.forms import powers_over
from tests.studies.certification.codes.impostor import write_impostor

F = np.geomspace(0.05, 300.0, 400)
S = 2j * np.pi * F
RATED = 50.0
OMEGA = 2 * np.pi * RATED
TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


def behind(R, X):
    """Admittance, out of the device, of a source that stands still behind R + jX, shape (f, 2, 2) [pu]."""
    Z = (R + S * X / OMEGA)[:, None, None] * np.eye(2) + X * TURN
    return -np.linalg.inv(Z)


def stiffness_of(Y, current=0.5 + 0j):
    return Stiffness(F, powers_over(F, Y, 1.0 + 0j, current, RATED))


def powers(**given):
    nothing = np.zeros(len(F), dtype=complex)
    return Stiffness(F, {"P/theta": nothing, "Q/V": nothing, "P/omega": nothing} | given)


@pytest.mark.parametrize("angle", [0.0, 0.7, -2.0])
def test_the_reactance_of_a_source_behind_an_impedance_is_its_own(angle):
    found = impedances(F, behind(0.02, 0.25), angle, RATED)
    assert found.frequencies[0] >= 1.0
    assert found.reactance == pytest.approx(0.25, rel=1e-9)
    assert found.sequences[:, 0, 0].real == pytest.approx(0.02, rel=1e-9)
    assert abs(found.sequences[:, 0, 1]).max() < 1e-12
    assert found.rows()[0]["|Z_dq| [pu]"] == pytest.approx(0.25)


@pytest.mark.parametrize(("X", "met"), [(0.1, True), (0.3, True), (1.0, False)])
def test_a_source_is_one_behind_an_impedance_that_lets_its_power_through(X, met):
    assert springs(stiffness_of(behind(0.1 * X, X)), RATED).met is met


def test_a_source_opposes_slow_changes_by_the_power_over_its_reactance():
    """With V = 1 pu and E² = (1 + X·Q)² + (X·P)² the sine law's slope is (V² + X·Q)/X."""
    X, P, Q = 0.2, 0.5, 0.3
    slow = stiffness_of(behind(0.0, X), P - 1j * Q).powers["P/theta"][0]
    assert -slow.real == pytest.approx((1 + X * Q) / X, rel=1e-4)


@pytest.mark.parametrize("current", [0.5 + 0j, 0.9 - 0.3j, 0.9 + 0.3j])
def test_a_current_source_is_no_voltage_source(current):
    assert not springs(stiffness_of(np.zeros((len(F), 2, 2)), current), RATED).met


def test_a_mass_of_the_measured_frequency_is_no_spring_whatever_its_size():
    """Power against the rate of change of the frequency: stiff enough by its size, and of the wrong sign."""
    inertia = powers(**{"P/theta": -2 * 5.0 * S**2 / OMEGA})
    assert asked_stiffness(inertia, RATED).met
    found = springs(inertia, RATED)
    assert found.angle.value < 0
    assert not found.met


def test_a_mass_behind_a_slow_loop_holds_the_angle_and_not_the_magnitude():
    wide = 2 * np.pi * 3.0
    loop = wide**2 / (S**2 + 1.4 * wide * S + wide**2)
    found = springs(powers(**{"P/theta": -2 * 5.0 * S**2 / OMEGA * loop}), RATED)
    assert found.angle.value > found.asked.value
    assert found.magnitude.value == 0
    assert not found.met


def test_inertia_and_damping_are_read_from_slow_changes():
    found = swing(powers(**{"P/omega": -(20.0 + 2 * 4.0 * S)}))
    assert (found.inertia, found.damping) == pytest.approx((4.0, 20.0))
    assert found.misses < 1e-12


@pytest.mark.parametrize(("R", "X"), [(0.05, 0.3), (0.2, 0.5), (0.01, 1.0)])
def test_a_coil_at_a_coil_has_the_mode_of_both(R, X):
    """di/dt = −(v + (R + jX)·i)·ω/X; with the grid's 0.02 + 0.1j in series it rings at 50 Hz."""
    own, none = (R * np.eye(2) + X * TURN), np.zeros((2, 2))
    model = -own * OMEGA / X, -np.eye(2) * OMEGA / X, np.eye(2), none
    damping, hertz = least_damped(closed_loop(model, 0.02, 0.1, RATED))
    sigma = (R + 0.02) * OMEGA / (X + 0.1)
    assert hertz == pytest.approx(RATED)
    assert damping == pytest.approx(100 * sigma / np.hypot(sigma, OMEGA))


def measured(*least):
    found = []
    for X in least:
        one = springs(stiffness_of(behind(0.1 * X, X)), RATED)
        found.append(AtPoint(ScannedPoint(0.5, 0.0, 1.0), springs=one))
    return found


def test_a_stiff_device_that_is_stable_in_no_network_is_no_proven_source():
    """As one whose virtual inertia is a derivative of its phase-locked loop."""
    (stiff,) = measured(0.1)
    ratios = tuple(
        AtRatio(scr, "not known", "scan higher", None, None, None, None) for scr in (20, 1.25)
    )
    lost = replace(stiff, strengths=Strengths(ratios, None))
    assert verdict_of([stiff, lost]) is None
    assert "stable at no short-circuit ratio from 20 to 1.25 (scan higher)" in sentence_of([lost])
    assert verdict_of([replace(stiff, strengths=Strengths(ratios, 0.0))]) is True


def test_one_bad_point_is_enough_and_one_that_is_not_measured_leaves_no_verdict():
    lost = AtPoint(ScannedPoint(0.9, 0.3, 1.0), failure="it does not come to rest")
    assert verdict_of(measured(0.1, 0.2)) is True
    assert verdict_of(measured(0.1, 1.0)) is False
    assert verdict_of([*measured(1.0), lost]) is False
    assert verdict_of([*measured(0.1), lost]) is None
    assert "P 0.9, Q 0.3, V 1 pu" in sentence_of([*measured(0.1), lost])


@pytest.fixture(name="gfor_command")
def _gfor_command(request):
    """The command of the same name as the module that is imported here."""
    return request.getfixturevalue("gfor")


SOFT = Excitation(lowest_hz=2.0, highest_hz=40.0, lines=12, settled=1e-3)


def test_a_grid_following_one_with_a_virtual_inertia_is_none_at_any_operating_point(tmp_path):
    description = bound_fmu(write_impostor(4.0, tmp_path), None)
    for point in POINTS:
        given = {"S_n": 100.0, "P_0": point.active, "Q_0": point.reactive, "v_0": point.voltage}
        bench = bench_at(description, given, 1e-4)
        response = measure(bench, SOFT)
        found = springs(stiffness(response, complex(*bench.rest), RATED), RATED)
        # more than without the inertia, whose power then opposes the angle by next to nothing
        assert 0.5 < found.angle.value < found.asked.value
        assert found.magnitude.value < 0.1
        assert not found.met


# as low as the swing and as high as the whole one: a count of encirclements wants both ends
QUICK = Excitation(lowest_hz=1.0, lines=40, settled=1e-3)


@pytest.mark.parametrize(("model", "is_one"), [("gfor", True), ("gfl", False)])
def test_the_command_tells_ours_apart(
    gfor_command, fmu_path, tmp_path, monkeypatch, undrawn, model, is_one
):
    monkeypatch.setattr(measurement, "WHOLE", QUICK)
    monkeypatch.setattr(measurement, "POINTS", POINTS[:1])
    fmu, out = fmu_path(model, native=True), tmp_path / "out"
    code, printed, _ = gfor_command("certify", fmu, "--code", "frequency", "--out", out, "--json")
    figures = json.loads(printed)
    assert code == (0 if is_one else 1)
    assert figures["verdict"] is is_one
    assert figures == json.loads((out / "frequency.json").read_text(encoding="utf-8"))
    assert {file.name for file in out.iterdir()} >= {
        "frequency.json",
        "impedance.csv",
        "impedance.png",
    }
    ratios = [row["scr"] for row in figures["points"][0]["strength"]["ratios"]]
    assert ratios == list(RATIOS)


def test_python_gives_what_the_command_gives(fmu_path, tmp_path, monkeypatch):
    (stiff,) = measured(0.1)
    seen = impedances(F, behind(0.01, 0.1), 0.0, RATED)
    points = [replace(stiff, impedances=seen, strengths=Strengths((), 0.0))]
    monkeypatch.setattr(measurement, "measure_points", lambda request, f_n, report: points)
    found = gfor.voltage_source(fmu_path("gfor"))
    assert found.verdict is True
    assert "it behaves as a voltage source" in found.sentence
    assert found.as_json() == files.figures_of(points, "gfor", RATED)
    row = dict(found.table().iloc[0])
    assert (row["met"], row["angle"], row["scr_limit"]) == (True, stiff.springs.angle.value, 0.0)
    (file, *_) = found.save(tmp_path / "out")
    assert json.loads(file.read_text("utf-8")) == found.as_json()
    with pytest.raises(gfor.CosimError, match=r"ask .verdict"):
        bool(found)
