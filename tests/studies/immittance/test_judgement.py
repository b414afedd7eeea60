"""The count of encirclements against eigenvalues, and every planted reason for which a verdict is not known."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.core.errors import InputError
from orchestrator.studies.immittance import judgement, study
from orchestrator.studies.immittance import loop as looping
from orchestrator.studies.immittance.judgement import judge_loop
from orchestrator.studies.immittance.loop import CutLoop, SeriesCapacitors
from orchestrator.studies.immittance.poles import unstable_poles
from orchestrator.studies.immittance.sides import Exact, Sampled
from orchestrator.studies.immittance.strength import SourceBehind
from tests.studies.immittance import plants
from tests.studies.immittance.plants import (
    OMEGA,
    Line,
    Noise,
    constant_power,
    eigenvalues,
    is_stable,
)

F = np.geomspace(0.1, 1000, 300)
STRONG, WEAK = Line(0.05, 0.8 / OMEGA), Line(0.05, 1.2 / OMEGA)


def a_side(values, f=F):
    return Sampled("scan", f, values, np.zeros(len(f)))


def judged(plant, line, f=F, **options):
    capacitors = SeriesCapacitors(line.share * OMEGA * line.L, OMEGA) if line.share else None
    device, network = a_side(plant.admittance(f), f), a_side(line.impedance(f, capacitor=False), f)
    return judge_loop(CutLoop(device, network, capacitors), **options)


def test_a_constant_power_is_stable_at_a_strong_line_and_not_at_a_weak_one():
    plant = constant_power(g=1.2, h=0.6, T=0.003, G=0.2)
    for line, verdict in ((STRONG, "stable"), (WEAK, "unstable")):
        assert is_stable(plant, line) == (verdict == "stable")
        found = judged(plant, line)
        assert (found.verdict, found.reasons) == (verdict, ())
        growing = (eigenvalues(plant, line).real > 0).sum()
        assert found.growing == found.encirclements == found.by_loci == growing


def test_the_gain_and_delay_margins_are_those_at_which_an_eigenvalue_reaches_the_axis():
    """The gain is scaled in the device, all of it, until the eigenvalues of the closed system say unstable."""
    plant = constant_power(g=1.2, h=0.6, T=0.003, G=0.2)
    margin = judged(plant, STRONG).margins.gain_up

    def scaled(k):
        return replace(plant, C=k * plant.C, G=k * plant.G)

    for k, stable in ((margin.value * 0.999, True), (margin.value * 1.001, False)):
        assert is_stable(scaled(k), STRONG) == stable
    critical = eigenvalues(scaled(margin.value), STRONG)
    w = abs(critical[np.argmax(critical.real)].imag)
    assert w / (2 * np.pi) == pytest.approx(margin.frequency_hz, rel=2e-3)


@pytest.mark.parametrize("line", [STRONG, Line(0.05, 0.5 / OMEGA)])
def test_the_phase_and_delay_margins_are_those_of_a_dense_scan(line):
    plant = constant_power(g=1.2, h=0.6, T=0.003, G=0.2)
    dense = np.geomspace(0.1, 1000, 20_000)
    loci = np.linalg.eigvals(line.impedance(dense, capacitor=False) @ plant.admittance(dense))
    at = np.abs(np.diff(np.sort(np.log(np.abs(loci)), axis=1) > 0, axis=0))
    k, j = np.nonzero(at)
    order = np.argsort(np.abs(loci), axis=1)
    angles = np.angle(-loci[k, order[k, j]])
    found = judged(plant, line).margins
    assert found.phase_deg.value == pytest.approx(np.rad2deg(np.abs(angles).min()), abs=0.2)
    assert found.delay_s.value == pytest.approx(
        (angles % (2 * np.pi) / (2 * np.pi * dense[k])).min(), rel=0.01
    )


def test_compensation_destabilises_where_the_eigenvalues_say():
    plant = constant_power(g=1.2, h=0.6, T=0.01, G=0.05)
    verdicts = {}
    for percent in range(0, 80, 10):
        line = Line(0.0222, 0.5 / OMEGA, percent / 100)
        verdicts[percent] = (
            judged(plant, line, np.unique(np.concatenate([F, np.linspace(40, 60, 81)]))).verdict,
            is_stable(plant, line),
        )
    known = {k: v for k, v in verdicts.items() if v[0] != "not known"}
    assert all((found == "stable") == stable for found, stable in known.values())
    assert {stable for _, stable in known.values()} == {True, False}
    assert len(known) > 5


def test_no_random_plant_gets_the_wrong_verdict():
    """Scans of 25 to 400 frequencies, with noise, narrow modes, and devices that are unstable by themselves."""
    rng = np.random.default_rng(11)
    counts = {"right": 0, "not known": 0}
    for k in range(24):
        plant, line = plants.random_plant(rng, unstable=k % 8 == 7), plants.random_line(rng)
        f = np.geomspace(
            rng.choice([0.1, 1.0]), rng.choice([450.0, 2000.0]), rng.choice([25, 60, 150, 400])
        )
        f = f[np.abs(f - 50) > 1e-6]
        Y = Noise(rng).on(plant.admittance(f), rng.choice([0, 1e-5, 1e-4, 1e-3]))
        capacitors = SeriesCapacitors(line.share * OMEGA * line.L, OMEGA) if line.share else None
        found = judge_loop(
            CutLoop(a_side(Y, f), a_side(line.impedance(f, capacitor=False), f), capacitors)
        )
        if found.verdict == "not known":
            counts["not known"] += 1
        else:
            assert (found.verdict == "stable") == is_stable(plant, line), k
            counts["right"] += 1
    assert counts["right"] > 8


def narrow(zeta, f_0=20.0, size=1.0):
    """A plant with one narrow mode."""
    w = 2 * np.pi * f_0
    A = w * (np.sqrt(1 - zeta**2) * plants.J - zeta * np.eye(2))
    return plants.Plant(A, np.eye(2) * w * zeta * size, -np.diag([1.0, 0.3]), 0.08)


def test_a_narrow_mode_between_sparse_frequencies_is_not_passed_over():
    plant, line = narrow(0.01, size=1.5), Line(0.05, 0.8 / OMEGA)
    dense = np.unique(np.concatenate([F, np.linspace(17, 23, 400)]))
    truth = is_stable(plant, line)
    assert (judged(plant, line, dense).verdict == "stable") == truth
    sparse = judged(plant, line, np.geomspace(0.1, 1000, 90))
    assert sparse.verdict == "not known"
    assert "do not tell on which side" in sparse.reasons[0]


def test_an_encirclement_beyond_the_last_frequency_is_not_ruled_out():
    plant, line = narrow(0.2, f_0=180.0, size=6.0), Line(0.02, 0.8 / OMEGA)
    assert not is_stable(plant, line)
    assert judged(plant, line).verdict == "unstable"
    # where the loci are small, and grow again
    early = judged(plant, line, np.geomspace(0.1, 4, 100))
    assert np.abs(early.path.loci).max() < 0.95
    assert any("loci may grow again" in reason for reason in early.reasons)
    cut_short = judged(plant, line, np.geomspace(0.1, 120, 300))
    assert cut_short.verdict == "not known"
    assert any("scan higher frequencies" in reason for reason in cut_short.reasons)


def test_a_scan_that_begins_above_the_begin_of_the_loop_is_seen():
    plant, line = narrow(0.2, f_0=1.0, size=4.0), Line(0.05, 0.8 / OMEGA)
    assert judged(plant, line, np.geomspace(0.02, 1000, 400)).verdict == "stable"
    cut_short = judged(plant, line, np.geomspace(1.0, 1000, 400))
    assert len(cut_short.reasons) == 1
    assert "at 1 Hz the loop is not yet where it begins" in cut_short.reasons[0]
    assert "scan lower ones, from 0.5 Hz" in cut_short.reasons[0]
    late = judged(
        constant_power(g=1.2, h=0.6, T=0.003, G=0.2), STRONG, np.geomspace(2.2, 1000, 300)
    )
    assert "at 2.2 Hz the loop is not yet where it begins" in late.reasons[0]


def test_a_device_that_is_unstable_by_itself_is_seen():
    rng = np.random.default_rng(3)
    for _ in range(3):
        plant = plants.random_plant(rng, unstable=True)
        found = judged(plant, STRONG)
        assert found.verdict == "not known"
        assert unstable_poles(F, plant.admittance(F))
        assert not unstable_poles(F, plants.random_plant(rng).admittance(F))


def test_without_the_test_of_poles_a_negative_count_is_no_verdict(monkeypatch):
    """A stable system with an unstable device: the loci go round against the clock."""
    monkeypatch.setattr(
        "orchestrator.studies.immittance.sides.unstable_poles", lambda f, values: ()
    )
    w = 2 * np.pi * 5
    plant = plants.Plant(w * (plants.J + 0.05 * np.eye(2)), np.eye(2) * w, np.eye(2) * 0.6, 0.5)
    line = Line(0.3, 0.6 / OMEGA)
    assert is_stable(plant, line)
    found = judged(plant, line)
    assert found.verdict == "not known"
    assert any("against the clock" in reason for reason in found.reasons)


def test_unstable_poles_of_a_model_count_for_what_encirclements_take_away():
    """The device at R + jX by its model; with a direct conductance the loop does not end, and nothing is known."""
    w, R, X = 2 * np.pi * 5, 0.3, 0.6
    for C, truth in ((0.6, 0), (0.05, 2)):
        A, B = w * (plants.J + 0.05 * np.eye(2)), w * np.eye(2)
        fed = (R * np.eye(2) + X * plants.J) * C + X / OMEGA * C * A
        closed = A - B @ np.linalg.solve(np.eye(2) + X / OMEGA * C * B, fed)
        assert (np.linalg.eigvals(closed).real > 0).sum() == truth
        device, line = (
            Exact("model", A, B, C * np.eye(2), np.zeros((2, 2))),
            SourceBehind("line", R, X, OMEGA),
        )
        found = judge_loop(CutLoop(device, line))
        assert (found.verdict, found.growing) == ("unstable" if truth else "stable", truth)
        assert (found.encirclements, len(found.open_loop)) == (truth - 2, 2)
    found = judge_loop(CutLoop(replace(device, D=0.5 * np.eye(2)), line))
    assert "not yet where it ends" in found.reasons[0]


def test_a_capacitor_inside_the_scan_whose_rated_frequency_is_left_out():
    """The pole lies in the gap from 49.5 to 50.5 Hz; as an option it is known exactly."""
    plant, line = constant_power(g=0.9, h=0.2, T=0.02, G=0.03), Line(0.01, 0.5 / OMEGA, 0.4)
    f = np.concatenate([np.arange(0.5, 50, 0.5), np.arange(50.5, 500, 0.5)])
    assert judged(plant, line, f).verdict != "not known"
    inside = judge_loop(CutLoop(a_side(plant.admittance(f), f), a_side(line.impedance(f), f)))
    assert inside.verdict == "not known"


def test_loci_that_change_places_change_no_count_and_a_turn_too_many_is_seen(monkeypatch):
    plant = constant_power(g=1.2, h=0.6, T=0.003, G=0.2)
    right = judged(plant, WEAK)
    assert right.verdict == "unstable"

    def swapped(eigenvalues):
        found = looping_followed(eigenvalues)
        # at the first point where one locus is beyond −1 below the axis, it becomes the other
        k = int(np.argmax((found.real < -1).any(axis=1))) + 1
        found[k:] = found[k:, ::-1]
        return found

    looping_followed = looping.followed
    monkeypatch.setattr(looping, "followed", swapped)
    found = judged(plant, WEAK)
    assert (found.by_loci, found.encirclements, found.verdict) == (
        right.by_loci,
        right.encirclements,
        right.verdict,
    )
    turns = looping.LoopPath.loci_turns.func
    monkeypatch.setattr(
        looping.LoopPath,
        "loci_turns",
        property(lambda path: turns(path) + 2 * np.pi / len(path.turns)),
    )
    found = judged(plant, WEAK)
    assert found.verdict == "not known"
    assert "some loci were not followed rightly" in found.reasons[-1]


def salient(f, angle=0.0):
    """A network that is not the same in every frame: stiff in one direction, weak across."""
    c, s = np.cos(angle), np.sin(angle)
    T = np.array([[c, -s], [s, c]])
    Z = (
        Line(0.05, 0.4 / OMEGA).impedance(f)
        + np.diag([1.6, 0.0])[None] * (1 / (1 + 2j * np.pi * f * 0.05))[:, None, None]
    )
    return T @ Z @ T.T


def test_frames_that_are_not_known_leave_the_verdict_open_where_it_depends_on_them():
    plant = constant_power(g=1.2, h=0.2)
    Y, found = plant.admittance(F), set()
    for angle in (0.0, np.pi / 2):
        loop = CutLoop(a_side(Y), a_side(salient(F, angle)))
        found.add(judge_loop(loop).verdict)
        open_ = judge_loop(loop, frames_known=False)
        assert open_.verdict == "not known"
        assert "angle between the frames" in open_.reasons[0]
    assert found == {"stable", "unstable"}
    # a line is the same in every frame
    assert judged(plant, STRONG, frames_known=False).verdict == "stable"


def test_bounds_of_a_measurement_that_reach_the_critical_point_leave_it_open():
    plant = constant_power(g=1.2, h=0.6, T=0.003, G=0.2)
    Y, Z = plant.admittance(F), STRONG.impedance(F)
    sure = Sampled("scan", F, Y, 1e-3 * np.linalg.norm(Y, axis=(1, 2)))
    assert judge_loop(CutLoop(sure, a_side(Z))).verdict == "stable"
    unsure = replace(sure, bounds=0.9 * np.linalg.norm(Y, axis=(1, 2)))
    assert judge_loop(CutLoop(unsure, a_side(Z))).verdict == "not known"


def test_a_gain_at_which_it_grows_without_a_swing_is_a_margin():
    """A locus begins on the negative real axis: nothing crosses it there, and the eigenvalue that grows is real."""
    plant, line = constant_power(g=0.9, h=0.6, T=0.003, G=0.2), Line(0.05, 1.2 / OMEGA)
    margin = judged(plant, line).margins.gain_up
    assert margin.frequency_hz == 0
    for k, stable in ((0.995, True), (1.005, False)):
        scaled = replace(line, R=k * margin.value * line.R, L=k * margin.value * line.L)
        assert is_stable(plant, scaled) == stable


def test_capacitors_compensate_the_reactance_at_one_port():
    """A line of R + jX in the frame of the network: X = 0.2 pu stands beside its diagonal."""
    Z = np.array([[[0.01, -0.2], [0.2, 0.01]]])
    request = SimpleNamespace(compensation=0.5, frequency=50.0)
    loop = SimpleNamespace(network=SimpleNamespace(name="net", is_exact=True, at=lambda s: Z))
    made = study._capacitors(loop, request)
    assert (made.reactance, made.omega) == pytest.approx((0.1, 100 * np.pi))
    for other in (np.kron(np.eye(2), Z[0])[None], -Z):
        loop.network.at = lambda s, other=other: other
        with pytest.raises(InputError, match="net has no inductive reactance at one port"):
            study._capacitors(loop, request)


def test_a_device_that_is_a_model_has_its_frame():
    assert judgement._frames(SimpleNamespace(device=object()), None, 0) == []


def test_a_mode_of_a_model_that_is_narrower_than_any_grid_is_seen(monkeypatch):
    """Damped by 1e-6 of its frequency, it grows at the line as slowly."""
    plant = narrow(1e-6, f_0=20.0, size=200.0)
    loop = CutLoop(
        Exact("model", plant.A, plant.B, plant.C, np.zeros((2, 2))),
        SourceBehind("line", 0.02, 0.8, OMEGA),
    )
    assert (judge_loop(loop).verdict, judge_loop(loop).growing) == ("unstable", 2)
    monkeypatch.setattr("orchestrator.studies.immittance.loop._NARROW", 0.0)
    assert judge_loop(loop).growing != 2


@pytest.mark.parametrize("n", [2, 4])
def test_loci_are_followed_in_whatever_order_eigenvalues_come(n):
    rng, t = np.random.default_rng(2), np.linspace(0, 1, 300)[:, None]
    circles = (1 + np.arange(n)) * np.exp(2j * np.pi * t * (n - np.arange(n)))
    found = looping.followed(np.array([rng.permutation(row) for row in circles]))
    assert found[:, np.argsort(np.abs(found[0]))] == pytest.approx(circles)


def test_points_are_added_where_the_loop_turns_far_between_the_frequencies():
    """A narrow mode that encircles −1 between two of 12 frequencies, of which the sides are known much better."""
    plant, line = narrow(0.01, f_0=31.0, size=10.0), STRONG
    dense = np.unique(np.concatenate([F, np.linspace(28, 34, 600)]))
    loop = CutLoop(a_side(plant.admittance(dense), dense), a_side(line.impedance(dense), dense))
    nodes = np.geomspace(0.1, 1000, 12)
    path = loop.path(nodes)
    growing = int((eigenvalues(plant, line).real > 0).sum())
    assert growing
    assert judgement.encirclements(path, exact=False) == (growing, growing)
    assert np.abs(path.turns).max() <= looping._STEP
    assert len(path.s) < 400
