"""Eigenvalues, damping and participation factors of systems whose answer is known."""

import cmath
import copy
import json
import math
import pickle

import numpy as np
import pytest
import scipy.linalg

from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.modes import Mode, find_modes

OMEGA, ZETA = 2 * np.pi * 0.7, 0.08
OSCILLATOR = np.array([[0.0, 1.0], [-(OMEGA**2), -2 * ZETA * OMEGA]])


def model(A: np.ndarray, step_size: float | None, prefix: str = "x") -> LinearModel:
    return LinearModel.from_matrix(A, tuple(f"{prefix}{k}" for k in range(len(A))), step_size)


@pytest.mark.parametrize("step_size", [None, 1e-4, 5e-3])
def test_a_damped_oscillator_is_found_from_either_form(step_size):
    A = OSCILLATOR if step_size is None else scipy.linalg.expm(OSCILLATOR * step_size)
    (mode,) = find_modes(model(A, step_size))
    assert mode.damping_ratio == pytest.approx(ZETA, abs=1e-9)
    assert mode.frequency_hz == pytest.approx(0.7 * np.sqrt(1 - ZETA**2), abs=1e-9)
    assert abs(mode.eigenvalue) == pytest.approx(OMEGA, abs=1e-8)


def test_participation_belongs_to_the_states_of_the_mode_and_sums_to_one():
    A = scipy.linalg.block_diag(OSCILLATOR, [[-3.0]], 4 * OSCILLATOR / 4)
    A[3:, 3:] = [[0.0, 1.0], [-((2 * np.pi * 1.5) ** 2), -1.0]]
    slow, fast = sorted(find_modes(model(A, None)), key=lambda m: m.frequency_hz)
    for mode, own in ((slow, {"x0", "x1"}), (fast, {"x3", "x4"})):
        assert sum(f for _, f in mode.participation) == pytest.approx(1)
        assert mode.participation_of(own) == pytest.approx(1)
        assert mode.participation == tuple(sorted(mode.participation, key=lambda e: -e[1]))
    # both states of an oscillator carry half of it
    assert dict(slow.participation)["x0"] == pytest.approx(0.5)


def test_participation_does_not_depend_on_units():
    T = np.diag([1.0, 1e4])
    plain, scaled = (
        find_modes(model(a, None))[0] for a in (OSCILLATOR, T @ OSCILLATOR @ np.linalg.inv(T))
    )
    assert dict(plain.participation) == pytest.approx(dict(scaled.participation), abs=1e-9)


def test_modes_come_least_damped_first_and_only_in_range():
    frequencies, damping = (0.3, 0.9, 1.4, 5.0), (0.2, 0.05, 0.1, 0.01)
    blocks = [
        [[0, 1], [-((2 * np.pi * f) ** 2), -2 * z * 2 * np.pi * f]]
        for f, z in zip(frequencies, damping, strict=True)
    ]
    modes = find_modes(model(scipy.linalg.block_diag(*blocks, [[-1.0]]), None), 0.1, 2.0)
    assert [m.damping_ratio for m in modes] == pytest.approx([0.05, 0.1, 0.2])
    assert all(m.eigenvalue.imag > 0 for m in modes)
    assert len(find_modes(model(scipy.linalg.block_diag(*blocks, [[-1.0]]), None), 0.0, 2.0)) == 4


def test_what_dies_within_one_step_is_no_mode():
    A = scipy.linalg.block_diag(scipy.linalg.expm(OSCILLATOR * 1e-3), [[0.0]], [[1e-14]])
    assert len(find_modes(model(A, 1e-3), 0.0, 600.0)) == 1


def test_mode_shape_shows_who_swings_against_whom():
    k = 30.0
    A = np.array([[0, 1, 0, 0], [-k, -0.1, k, 0], [0, 0, 0, 1], [k / 2, 0, -k / 2, -0.1]])
    mode = max(find_modes(model(A, None), 0.1, 3), key=lambda m: m.frequency_hz)
    ratio = mode.shape["x2"] / mode.shape["x0"]
    assert ratio == pytest.approx(-0.5, abs=1e-6)
    assert max(abs(v) for v in mode.shape.values()) == pytest.approx(1)


def coupled_pair():
    """Two areas: swings of a.x and a.y against b.x, with c at rest."""
    A = np.zeros((6, 6))
    k = 30.0
    stiffness = np.array([[-k, k, 0], [k / 2, -k / 2, 0], [0, 0, -400.0]])
    A[:3, 3:], A[3:, :3], A[3:, 3:] = np.eye(3), stiffness, -0.1 * np.eye(3)
    names = ("a.angle", "b.angle", "c.angle", "a.speed", "b.speed", "c.speed")
    return max(
        find_modes(LinearModel.from_matrix(A, names, None), 0.5, 2), key=lambda m: m.frequency_hz
    )


def test_participation_of_components_and_groups_is_the_sum_over_their_states():
    mode = coupled_pair()
    factors = dict(mode.participation)
    assert mode.by_component["a"] == pytest.approx(factors["a.angle"] + factors["a.speed"])
    assert list(mode.by_component) == ["a", "b", "c"]
    assert sum(mode.by_component.values()) == pytest.approx(1)
    areas = {"a": "north", "b": "north"}
    assert mode.by_group(lambda state: areas.get(state.partition(".")[0])) == pytest.approx(
        {"north": 1.0}
    )


def test_swing_tells_both_sides_and_leaves_out_what_does_not_move():
    mode = coupled_pair()
    assert mode.swing(["b.speed", "a.speed", "c.speed"]) == (["a.speed"], ["b.speed"])
    assert mode.swing(["b.speed", "a.speed"], least=0.6) == (["a.speed"], [])
    assert mode.swing([]) == ([], [])


def test_who_stands_across_is_neither_together_nor_against():
    """Four machines at 0, 40, 87 and 172 degrees; by a cut at 90 the third would swing with the first."""
    angles = {"sg1": 0.0, "sg2": 40.0, "sg3": 87.0, "sg4": 172.0}
    shape = {
        f"{name}.omega": (1.0 - 0.1 * k) * cmath.exp(1j * math.radians(angle))
        for k, (name, angle) in enumerate(angles.items())
    }
    mode = Mode(complex(-0.1, 6.0), (("sg1.omega", 1.0),), shape)
    groups = mode.swing_groups(shape)
    assert groups.together == ("sg1.omega", "sg2.omega")
    assert groups.against == ("sg4.omega",)
    assert groups.between == {"sg3.omega": pytest.approx(87.0)}
    assert groups.words(", ".join) == "sg1, sg2 against sg4; sg3 leads by 87°"
    alone = mode.swing_groups(["sg1.omega", "sg3.omega"])
    assert alone.words(", ".join) == "sg1; sg3 leads by 87°"
    assert mode.swing_groups(["sg3.omega", "sg2.omega"]).words(", ".join) == "sg2; sg3 leads by 47°"
    assert mode.swing_groups(["sg3.omega"]).words(", ".join) == "sg3 alone"
    turned = mode.swing_groups(["sg2.omega", "sg4.omega"])
    assert turned.words(", ".join) == "sg2; sg4 leads by 132°"
    assert mode.swing_groups([]).words(", ".join) == ""


@pytest.mark.parametrize(
    ("part", "said"),
    [
        (0.11, "sg3, sg4 against sg1"),
        (0.09, "sg3, sg4 against sg1 (9 %)"),
        (0.011, "sg3, sg4 against sg1 (1 %)"),
        (0.009, "sg3, sg4, and the others hardly move"),
        (-0.09, "sg3, sg4, and the others hardly move"),  # with them, not against them
    ],
)
def test_the_other_side_of_a_swing_is_named_also_where_it_moves_little(part, said):
    """Who counts as moving is as before; an empty other side is what a swing between areas cannot have."""
    small = part * cmath.exp(1j * math.radians(172))
    shape = {"sg3.omega": 1.0 + 0j, "sg4.omega": 0.8 + 0j, "sg1.omega": small}
    mode = Mode(complex(-0.1, 3.5), (("sg3.omega", 1.0),), shape)
    groups = mode.swing_groups(shape)
    assert groups.words(", ".join) == said
    assert groups.against == (("sg1.omega",) if part > 0.1 else ())
    assert mode.swing_groups(["sg3.omega", "sg4.omega"]).words(", ".join) == "sg3, sg4"


def test_a_mode_that_is_handed_out_cannot_be_changed():
    """A shape or a participation that somebody writes into would change a result that others read."""
    (mode,) = find_modes(model(OSCILLATOR, None))
    for table in (mode.shape, mode.left, mode.by_component):
        name = next(iter(table))
        for change in (
            lambda table=table, name=name: table.__setitem__(name, 0),
            lambda table=table: table.update(a=1),
            lambda table=table: table.clear(),
        ):
            with pytest.raises(TypeError, match="change a copy"):
                change()
        assert dict(table) | {name: 0} != table
        assert json.loads(json.dumps({name: abs(x) for name, x in table.items()}))
    for copied in (pickle.loads(pickle.dumps(mode)), copy.deepcopy(mode)):
        assert copied == mode
