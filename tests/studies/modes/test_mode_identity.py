"""A name stays with its mode where a gain makes other shapes of the modes."""

from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.linalg

from orchestrator.cases.case import load_case
from orchestrator.cases.form.schema import ScenarioTable
from orchestrator.core.errors import CosimError
from orchestrator.face.api.results import Modes
from orchestrator.linear.models.linear_model import IDENTIFIED, LinearModel
from orchestrator.linear.spectra.mode_names import name_modes
from orchestrator.linear.spectra.modes import Mode, find_modes, make_mode
from orchestrator.studies.modes import mode_identity
from orchestrator.studies.modes.all_modes import compute_all_modes
from orchestrator.studies.modes.mode_identity import NamedSystem, settle_names
from orchestrator.studies.modes.modes import compute_modes, modes_json
from orchestrator.systems.coupling.system import ComponentPlan, System
from tests.support.scenarios import prepare_one

STATES = ("a.x", "a.v", "b.x", "b.v")
OF_A = {"mine": partial(Mode.participation_of, states=("a.x", "a.v"))}


def two_masses(hertz_a, hertz_b, spring):
    """Two masses, each on its own spring [Hz], with one between them [Hz²]."""
    A = np.zeros((4, 4))
    A[[0, 2], [1, 3]] = 1.0
    stiff = (2 * np.pi) ** 2 * np.array(
        [[hertz_a**2 + spring, -spring], [-spring, hertz_b**2 + spring]]
    )
    A[np.ix_([1, 3], [0, 2])] = -stiff
    A[[1, 3], [1, 3]] = -0.1, -0.3
    return A


def scenario(
    name, A, *, modes=None, names=STATES, flow=None, states=None, others=None, measures=OF_A
):
    """A scenario of a case with an earlier one, ``off``, as far as names need it."""
    model = LinearModel.from_matrix(A, names, None)
    found = find_modes(model, 0.1, 5.0) if modes is None else modes
    table = SimpleNamespace(scenarios={"off": ScenarioTable(), "on": ScenarioTable()})
    schedule = SimpleNamespace(name="gauss-seidel")
    prepared = SimpleNamespace(
        system=System(),
        name=name,
        case=table,
        power_flow=flow,
        schedule=schedule,
        beside=others,
        given={},
    )
    point = SimpleNamespace(states=states or dict.fromkeys(names, 0.0))
    return NamedSystem(prepared, point, model, found, name_modes(found, measures))


def never(_):
    raise AssertionError("no other scenario is needed")


OFF, FAR = two_masses(1.0, 1.2, 0.0), two_masses(1.0, 1.2, 3.0)


def hertz_of(system):
    return {name: mode.frequency_hz for name, mode in system.naming.named.items()}


@pytest.mark.parametrize(("a", "b", "place"), [(1.0, 1.2, 0), (1.2, 1.0, 1)])
def test_a_tie_goes_to_the_mode_that_it_was(a, b, place):
    """With the spring both masses take part alike in both modes; the shapes alone tell nothing."""
    on = scenario("on", two_masses(a, b, 3.0))
    assert on.naming.named == {}
    assert on.naming.doubts[0].startswith("no mode is named 'mine': those at ")
    found = settle_names(on, never, {"off": scenario("off", two_masses(a, b, 0.0))})
    low, high = sorted(mode.frequency_hz for mode in on.modes)
    assert hertz_of(found) == {"mine": (low, high)[place]}
    assert found.naming.reasons == {}


def test_order_rotation_and_scaling_change_no_name():
    """Eigenvectors of any length and angle, in any order, of states in any order."""
    random = np.random.default_rng(7)
    wanted = hertz_of(settle_names(scenario("on", FAR), never, {"off": scenario("off", OFF)}))
    assert wanted
    for _ in range(20):
        order = random.permutation(4)
        systems = []
        for name, A in (("off", OFF), ("on", FAR)):
            names, turned = tuple(STATES[k] for k in order), A[np.ix_(order, order)]
            values, left, right = scipy.linalg.eig(turned, left=True, right=True)
            above = random.permutation(np.flatnonzero(values.imag > 0))
            factors = [
                complex(*random.normal(size=2)) * 10 ** random.uniform(-6, 6)
                for _ in range(2 * len(above))
            ]
            modes = [
                make_mode(values[k], left[:, k] * factors[i], right[:, k] * factors[-1 - i], names)
                for i, k in enumerate(above)
            ]
            systems.append(scenario(name, turned, modes=modes, names=names))
        assert hertz_of(settle_names(systems[1], never, {"off": systems[0]})) == pytest.approx(
            wanted, rel=1e-9
        )


def test_a_clear_shape_is_followed_from_nowhere():
    clear = scenario("on", two_masses(1.0, 1.2, 0.02))
    assert clear.naming.contested == ()
    assert settle_names(clear, never, {}) is clear


@pytest.mark.parametrize("change", ["states", "another operating point"])
def test_where_no_way_leads_a_tie_stays_free(change):
    on = scenario("on", FAR)
    off = (
        scenario("off", OFF, names=("a.x", "a.v", "b.x", "b.w"))
        if change == "states"
        else scenario("off", OFF, states=dict.fromkeys(STATES, 0.01))
    )
    found = settle_names(on, never, {"off": off})
    assert found.naming.named == {}
    assert "fit it about equally" in found.naming.doubts[0]


def test_modes_that_merge_on_the_way_are_told_with_the_place():
    """From an oscillation to two real eigenvalues: behind the double one nothing tells which was which."""

    def damped(ratio):
        def one(w, ratio):
            return [[0, 1], [-(w**2), -2 * ratio * w]]

        return scipy.linalg.block_diag(one(6.0, ratio), one(12.0, 0.02), one(12.5, 0.02))

    names = ("a.x", "a.v", "b.x", "b.v", "c.x", "c.v")
    measures = {"mine": lambda mode: 1.0 if mode.frequency_hz < 1.5 else 0.3}
    off, on = (
        scenario(n, damped(r), names=names, measures=measures)
        for n, r in (("off", 0.02), ("on", 2.02))
    )
    assert hertz_of(off) == {"mine": pytest.approx(6.0 / (2 * np.pi), rel=1e-3)}
    found = settle_names(on, never, {"off": off})
    assert found.naming.named == {}
    assert "meets another one 49 % of the way from there" in found.naming.reasons["mine"]


def test_two_names_never_go_to_one_mode():
    """'other' is the upper mode by its shape; following may not take it away."""
    measures = OF_A | {"other": lambda mode: float(mode.frequency_hz > 1.5)}
    on = scenario("on", FAR, measures=measures)
    found = settle_names(
        on, never, {"off": scenario("off", two_masses(1.2, 1.0, 0.0), measures=OF_A)}
    )
    assert list(found.naming.named) == ["other"]
    assert found.naming.reasons["mine"].endswith("which has another name")


@pytest.mark.parametrize(
    ("gain", "hertz", "percent"), [(150, 0.668, 34.59), (200, 0.726, 30.79), (250, 0.768, 27.60)]
)
def test_a_name_does_not_pass_to_another_mode_because_a_gain_grew(gain, hertz, percent):
    values = {"grid.X_L": 0.3, "gfor.pod_p.K": gain}
    prepared = prepare_one("two_area", "pod_p", values)
    found = compute_modes(prepared)
    mode = found.named["electromechanical"]
    assert (round(mode.frequency_hz, 3), round(mode.damping_percent, 2)) == (hertz, percent)
    both = "the mode of 0.350 Hz, 25.92 % without its damping controllers is followed to "
    assert all(text.startswith(f"'electromechanical': {both}") for text in found.warnings)
    # there the other one fits as well, or is damped less
    assert bool(found.warnings) is (gain < 250)


def test_alone_and_with_all_scenarios_the_names_are_the_same():
    case = load_case("two_area")
    together = compute_all_modes(case.prepare((), {"grid.X_L": 0.3}))
    for result in together:
        (prepared,) = case.prepare([result.prepared.name], {"grid.X_L": 0.3})
        alone = compute_modes(prepared)
        assert {n: m.eigenvalue for n, m in alone.named.items()} == {
            n: m.eigenvalue for n, m in result.named.items()
        }
        assert alone.warnings == result.warnings
    last = together[-1]
    assert last.named == {}
    as_json = modes_json([together[0], last])["scenarios"]
    assert (
        as_json[0]["named"]["electromechanical"]["imag"]
        == together[0].named["electromechanical"].eigenvalue.imag
    )
    assert as_json[1]["named"] == {"electromechanical": None}
    with pytest.raises(KeyError, match="exchanges its nature") as seen:
        Modes(last).named["electromechanical"]
    assert isinstance(seen.value, CosimError)
    with pytest.raises(
        CosimError, match=r"has no mode named 'inter-area' in the range; its named modes: none"
    ):
        Modes(last).named["inter-area"]
    assert Modes(last).named.get("inter-area") is None
    assert "exchanges its nature with the one of 0.796 Hz, 29.90 %" in last.warnings[0]


def with_part(system, gain, *, path="own", earlier=None, variables=("pod_p.K", "pod_p.enabled")):
    """A scenario that has a component with a gain, and what it was before."""
    info = {name: SimpleNamespace(start=1.0) for name in variables}
    plan = ComponentPlan(SimpleNamespace(variables=info, path=Path(path)), {variables[0]: gain})
    p = system.prepared
    p.system, p.given = SimpleNamespace(components={"dev": plan}), {f"dev.{variables[0]}": gain}
    p.beside = None if earlier is None else lambda name, plain, further=None: earlier.prepared
    return system


CLEAR = {"mine": lambda mode: 0.3 if 1.05 < mode.frequency_hz < 1.5 else 1.0}
"""The lower mode of `OFF`, which is followed to the lower one of `FAR`, and there clearly the upper one."""


def moved():
    off, on = scenario("off", OFF, measures=CLEAR), scenario("on", FAR, measures=CLEAR)
    assert off.naming.contested == on.naming.contested == ()
    assert (hertz_of(off)["mine"], hertz_of(on)["mine"] > 2) == (pytest.approx(1.0, rel=1e-3), True)
    return off, on


def test_a_clear_shape_that_a_damping_controller_made_leaves_the_name_free(monkeypatch):
    monkeypatch.setattr(mode_identity, "is_ours", lambda _: True)
    off, on = moved()
    asked = []
    found = settle_names(
        with_part(on, 100.0), never, {}, undamped=lambda gains: asked.append(gains) or off
    )
    assert asked == [{"dev.pod_p.K": 0.0}]
    assert found.naming.named == {}
    assert "exchanges its nature with the one of 2.6" in found.naming.reasons["mine"]
    assert (
        settle_names(with_part(on, 0.0), never, {}, undamped=never) is on
    )  # the controller is off


@pytest.mark.parametrize("a", [1.05, 1.5])
def test_a_clear_shape_that_stays_keeps_its_name_without_a_word(a):
    """With hardly a spring the frequencies cross, and each mode remains what it was."""
    off, on = scenario("off", two_masses(1.0, 1.2, 0.01)), scenario("on", two_masses(a, 1.2, 0.01))
    found = settle_names(with_part(on, 100.0), never, {}, undamped=lambda _: off)
    assert (hertz_of(found), found.naming.doubts) == (hertz_of(on), ())


@pytest.mark.parametrize("ours", [True, False])
def test_a_value_of_a_foreign_fmu_is_followed_and_one_of_ours_has_its_shape(monkeypatch, ours):
    """The shape of a system of ours is what the case describes; a vendor's gain may be a damping controller's."""
    monkeypatch.setattr(mode_identity, "is_ours", lambda _: ours)
    monkeypatch.setattr(mode_identity, "is_isolated", lambda *_: True)
    off, on = moved()
    with_part(off, 0.0, path="vendor", variables=("gain",))
    found = settle_names(
        with_part(on, 40.0, path="vendor", variables=("gain",), earlier=off), lambda _: off, {}
    )
    assert hertz_of(found) == (hertz_of(on) if ours else {})
    assert [text.endswith("which fits the name better now") for text in found.naming.doubts] == [
        True
    ] * (not ours)


def test_scenarios_that_are_shown_together_tell_where_modes_exchanged_their_nature():
    off, on = moved()
    found = settle_names(on, never, {"off": off})
    assert hertz_of(found) == hertz_of(on)
    (told,) = found.naming.doubts
    assert told.startswith("'mine', by its shape, may be another mode than there: the mode of 1.0")
    assert "exchanges its nature" in told


def test_fitted_models_of_other_states_are_compared_by_those_that_both_have(monkeypatch):
    """A black box has other states each time; a name that cannot be followed along its gain is left free."""
    monkeypatch.setattr(mode_identity, "is_ours", lambda _: False)
    monkeypatch.setattr(mode_identity, "is_isolated", lambda *_: True)

    def boxed(name, spring, gain, poles):
        A = scipy.linalg.block_diag(two_masses(1.0, 1.2, spring), -50.0 * np.eye(poles))
        A[1, 4] = A[4, 0] = 0.01
        names = (*STATES, *(f"dev.x{k}" for k in range(poles)))
        system = scenario(name, A, names=names, measures=CLEAR)
        object.__setattr__(system.model, "sources", {"dev": IDENTIFIED})
        return with_part(system, gain, path="vendor", variables=("gain",))

    for spring, known in ((0.02, True), (3.0, False)):
        off, on = boxed("off", 0.0, 0.0, 1), boxed("on", spring, 40.0, 2)
        steps = []

        def beside(name, plain, further=None, off=off, steps=steps):
            steps.append(further)
            return off.prepared

        on.prepared.beside = beside
        found = settle_names(on, lambda _, off=off: off, {})
        assert ("mine" in found.naming.named) is known
        assert all(0 < step["dev.gain"] < 40 for step in steps if step)
        assert len([step for step in steps if step]) <= 7


@pytest.mark.parametrize(
    ("X_L", "hertz"), [(0.36, 0.308), (0.41, 0.266), (0.44, None), (0.6, 0.193)]
)
def test_a_name_is_followed_along_the_reactance_from_the_value_of_the_file(X_L, hertz):
    """At 0.43 the swing meets another mode; beyond, what has its shape may be the one or the other."""
    prepared = prepare_one("two_area", "gfor", {"grid.X_L": X_L})
    found = compute_modes(prepared)
    mode = found.named.get("electromechanical")
    assert (None if mode is None else round(mode.frequency_hz, 3)) == hertz
    assert bool(found.warnings) is (X_L > 0.43)
    assert all(
        "in 'gfor' with the values of its file meets another one" in text for text in found.warnings
    )


def test_a_damping_controller_that_is_off_is_one_with_gain_0_on_the_way():
    case = load_case("two_area")
    (off,) = case.prepare(["gfor"], {"grid.X_L": 0.1})
    (on,) = case.prepare(["pod_p"], {"grid.X_L": 0.3, "gfor.pod_p.K": 80})
    assert mode_identity._differing(off, on) == {
        "grid.X_L": (0.1, 0.3),
        "gfor.pod_p.enabled": (True, True),
        "gfor.pod_p.K": (0.0, 80.0),
    }
