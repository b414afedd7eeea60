"""Derivatives of modes by parameters: against formulas, against modes computed anew, and what makes them doubtful."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

import orchestrator as gfor
from fmus.toolchain.exporter import cached
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.python_fmu import PythonFmu
from fmus.toolchain.symbols import fabs, fmin, sin
from orchestrator.core.errors import AnalysisError, ComponentError
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.modes import Mode
from orchestrator.studies.modes.modes import running
from orchestrator.studies.operating_points import bench
from orchestrator.studies.sensitivities import sensitivities
from orchestrator.studies.sensitivities.parameters import Parameter
from orchestrator.studies.sensitivities.sensitivities import Sensitivity, _not_least, _with_switch
from orchestrator.studies.sensitivities.view import sensitivity_table

# Perturbed over a step of 1 ms, λ is right to about 1e-7 rad/s; over 2 % of 0.6 or of 0.1 that is what is allowed here.
K, C = 25.0, 0.6
"""Of the oscillator: λ = −C/2 ± j·√(K − C²/4)."""


@pytest.fixture(scope="module")
def two_area():
    """The paper's system, loaded once."""
    return gfor.load("two_area")


def oscillator(twin=False):
    """ẍ = −k·x − c·ẋ, with parameters that are hard to differentiate by; on request two equal ones."""
    m = ModelBuilder("sensitive_twin" if twin else "sensitive", "Oscillator")
    k = m.parameter("k", K, "1", "Stiffness", tunable=True)
    c = m.parameter("c", C, "1", "Damping", tunable=True)
    idle = m.parameter("idle", 3.0, "1", "Does nothing", tunable=True)
    kink = m.parameter("kink", 0.0, "1", "Damps on both sides of 0", tunable=True)
    edge = m.parameter("edge", 0.0, "1", "Damps from 0 on", minimum=0.0, tunable=True)
    rough = m.parameter("rough", 1.0, "1", "Damps without order", tunable=True)
    narrow = m.parameter(
        "narrow", 1.0, "1", "Has one value", minimum=1.0, maximum=1.0, tunable=True
    )
    offset = m.parameter("offset", 1.0, "1", "Where it rests", tunable=True)
    roof = m.parameter("roof", 1.0, "1", "Moves where it rests, below 1", tunable=True)
    late = m.parameter("late", 0.2, "1", "Damps, by its value at the start", tunable=True)
    taken = m.state("taken", late, "1", "What was taken up of it")
    m.derivative(taken, 0 * late)
    fixed = m.parameter("fixed", 0.1, "1", "More damping")
    c_all = (
        c
        + fixed
        + taken
        - 0.2
        + fabs(kink)
        + edge
        + 0.02 * sin(1e5 * rough)
        - 0.02 * np.sin(1e5)
        + 0 * narrow * idle
    )
    rest = offset + fmin(roof - 1, 0)
    force = k * rest**2  # the stiffness goes with the place of rest
    u = m.input("u", "1", "Not used", start=0.0)
    for name in ("one", "other") if twin else ("one",):
        x = m.state(f"{name}.x", rest, "1", "Place")
        v = m.state(f"{name}.v", 0.0, "1", "Speed")
        m.derivative(x, v)
        m.derivative(v, -force * (x - rest) - c_all * v + 0 * u)
        m.output(f"{name}.y", x, "1", "Place")
    return cached(PythonFmu(m.build()))


def scenario_of(tmp_path, path):
    """A case of one FMU alone."""
    file = tmp_path / "case.toml"
    file.write_text(
        f"name = 'one'\n[solver]\nstep_size = 1e-3\nstop_time = 1.0\n[components.osc]\nfmu = '{path}'\n"
        "inputs = { u = 0.0 }\n[scenarios.base]\n"
    )
    return gfor.load(file).scenario()


def rows_of(found):
    return {row.parameter.name: row for row in found.result.rows}


def expected(damping=C + 0.1, stiffness=K):
    """ω of the oscillator, and ∂λ/∂c and ∂λ/∂k."""
    omega = np.sqrt(stiffness - damping**2 / 4)
    return omega, -0.5 - 1j * damping / (4 * omega), 1j / (2 * omega)


def test_a_formula_gives_the_same(tmp_path):
    found = scenario_of(tmp_path, oscillator()).sensitivities()
    rows = rows_of(found)
    omega, by_c, by_k = expected()
    assert found.result.mode.eigenvalue == pytest.approx(-0.35 + 1j * omega, abs=1e-6)
    assert rows["osc.c"].derivative == pytest.approx(by_c, rel=1e-4)
    assert rows["osc.c"].continuous == pytest.approx(by_c, rel=1e-4)
    assert rows["osc.k"].derivative == pytest.approx(by_k, rel=1e-4)
    size = abs(found.result.mode.eigenvalue)
    # ζ = c/(2·√k), |λ| = √k
    assert rows["osc.c"].damping_per_unit == pytest.approx(100 / (2 * size), rel=1e-4)
    assert rows["osc.k"].damping_per_percent == pytest.approx(
        -100 * 0.7 / (4 * K**1.5) * K / 100, rel=1e-4
    )
    assert rows["osc.k"].frequency_per_unit == pytest.approx(by_k.imag / (2 * np.pi), rel=1e-4)
    points = [
        abs(row.damping_per_percent)
        for row in found.result.rows
        if row.damping_per_percent is not None
    ]
    assert points == sorted(points, reverse=True)
    placed = [row.parameter.name for row in found.result.rows]
    assert placed.index("osc.late") < placed.index("osc.edge") < placed.index("osc.idle")
    assert found.warnings == ()


def test_what_a_figure_cannot_say_is_said(tmp_path):
    rows = rows_of(scenario_of(tmp_path, oscillator()).sensitivities())
    by_c = expected()[1]
    assert rows["osc.idle"].derivative == 0
    assert rows["osc.idle"].doubts == ()
    assert "upwards it moves the mode by" in " ".join(rows["osc.kink"].doubts)
    assert rows["osc.kink"].derivative == pytest.approx(0, abs=1e-6)
    assert rows["osc.edge"].derivative == pytest.approx(by_c, rel=1e-3)  # upwards only
    assert rows["osc.edge"].doubts == ()
    assert rows["osc.edge"].damping_per_percent is None
    assert "two sizes of change disagree" in " ".join(rows["osc.rough"].doubts)
    assert rows["osc.roof"].operating_point == "moves"  # downwards only
    assert "upwards it moves the mode by" in " ".join(rows["osc.roof"].doubts)
    # while it runs nothing is seen of it
    assert rows["osc.late"].derivative == pytest.approx(by_c, rel=1e-3)
    assert rows["osc.narrow"].derivative is None
    assert "no room" in rows["osc.narrow"].reason
    assert "osc.fixed" not in rows
    assert rows["osc.c"].operating_point == "stays"


def test_a_parameter_that_moves_the_operating_point_is_differentiated_with_it(tmp_path):
    """The stiffness is k·offset², and the place of rest is the offset itself."""
    scenario = scenario_of(tmp_path, oscillator())
    (total,) = scenario.sensitivities(parameters="osc.offset").result.rows
    assert total.operating_point == "moves"
    assert total.derivative == pytest.approx(2 * K * expected()[2], rel=1e-4)


def test_a_fixed_parameter_is_taken_where_it_is_asked_for(tmp_path):
    scenario = scenario_of(tmp_path, oscillator())
    (row,) = scenario.sensitivities(parameters="osc.fixed").result.rows
    assert row.derivative == pytest.approx(expected()[1], rel=2e-4)
    assert not row.parameter.tunable
    (held,) = scenario.sensitivities(parameters="osc.fixed", held=True).result.rows
    assert held.derivative is None
    assert "fixed" in held.reason


@pytest.mark.parametrize(
    ("error", "more", "says"),
    [
        (AnalysisError("it swings"), 1, "no steady state"),
        (ComponentError("osc", "fmi2DoStep", "it fails", ""), 2, "it fails"),
    ],
)
def test_fmus_are_opened_once_and_again_only_after_one_failed(
    error, more, says, tmp_path, monkeypatch
):
    """A start without a steady state leaves nothing behind: the rows after it are those of a study without it."""
    scenario = scenario_of(tmp_path, oscillator())
    asked = ["osc.fixed", "osc.offset", "osc.roof"]
    opened = []
    monkeypatch.setattr(bench, "running", lambda one: opened.append(one) or running(one))
    whole = rows_of(scenario.sensitivities(parameters=asked))
    assert len(opened) == 1

    def fails_once(master):
        starts.append(master)
        if len(starts) == 2:
            raise error
        return find_operating_point(master)

    starts = []
    monkeypatch.setattr(sensitivities, "find_operating_point", fails_once)
    rows = rows_of(scenario.sensitivities(parameters=asked))
    assert len(opened) == 1 + more
    (failed,) = (name for name, row in rows.items() if row.derivative is None)
    assert says in rows[failed].reason
    others = whole.keys() - {failed}
    assert {n: rows[n].derivative for n in others} == {n: whole[n].derivative for n in others}


def test_a_mode_that_was_taken_for_its_name_is_told_where_another_is_damped_less():
    """The explorer takes the least damped mode, and orders other values first."""
    least, named = (
        SimpleNamespace(
            is_oscillation=True, eigenvalue=eigenvalue, by_component={"sg1": 0.6, "sg2": 0.3}
        )
        for eigenvalue in (-2 + 9.6j, -1.6 + 5.4j)
    )
    both = SimpleNamespace(modes=[least, named])
    (told,) = _not_least(both, named)
    assert "damped less is 1.528 Hz, 20.40 % (sg1 0.60, sg2 0.30)" in told
    assert "--mode critical" in told
    assert _not_least(both, least) == ()


def test_a_double_eigenvalue_is_doubted_in_every_row(tmp_path):
    found = scenario_of(tmp_path, oscillator(twin=True)).sensitivities(
        parameters=["osc.c", "osc.idle"]
    )
    assert "double eigenvalue" in " ".join(found.warnings)
    rows = rows_of(found)
    assert rows["osc.c"].doubts == ("double eigenvalue",)
    assert rows["osc.idle"].doubts == ()  # 0 it is, whatever the eigenvectors


MOVED = {
    "gfor.pod_p.K": "stays",
    "gfor.droop.R_f": "stays",
    "grid.X_L": "moves",
    "gfor.P_0": "moves",
}


def test_the_two_area_system_moves_as_when_it_is_computed_anew(two_area):
    scenario = two_area.scenario("pod_p")
    found = scenario.sensitivities(parameters=[*MOVED, "gfor.pod_q.K", "sg2.P_0", "gfor.Q_0"])
    rows = rows_of(found)
    for name, operating_point in MOVED.items():
        row = rows[name]
        assert row.operating_point == operating_point
        assert row.doubts == ()
        up, down = (
            two_area.scenario("pod_p", {name: row.parameter.value * (1 + sign)})
            .modes()
            .named["electromechanical"]
            for sign in (0.01, -0.01)
        )
        change = (up.eigenvalue - down.eigenvalue) / (0.02 * row.parameter.value)
        assert row.derivative == pytest.approx(change, rel=1e-3)
        assert row.continuous == pytest.approx(change, rel=2e-3)
        assert row.frequency_per_percent == pytest.approx(
            (up.frequency_hz - down.frequency_hz) / 2, rel=2e-3, abs=1e-6
        )
        assert row.damping_per_percent == pytest.approx(
            (up.damping_percent - down.damping_percent) / 2, rel=2e-3
        )
    assert rows["gfor.pod_q.K"].derivative == 0  # the controller is off
    assert rows["sg2.P_0"].derivative == 0  # the slack feeds what is left, whatever it is set to
    assert "are both set" in rows["gfor.Q_0"].reason
    assert "\n" not in rows["gfor.Q_0"].reason


def test_the_partial_derivative_differs_where_the_operating_point_moves(two_area):
    scenario = two_area.scenario("gfor")
    names = ["grid.X_L", "gfor.droop.R_f", "gfor.droop.delta_P_ref"]
    total, held = (
        rows_of(scenario.sensitivities(parameters=names, held=held)) for held in (False, True)
    )
    assert abs(held["grid.X_L"].derivative - total["grid.X_L"].derivative) > 5e-3 * abs(
        total["grid.X_L"].derivative
    )
    assert held["gfor.droop.R_f"].derivative == total["gfor.droop.R_f"].derivative
    assert {row.operating_point for row in held.values()} == {"held"}
    assert "no steady state" in total["gfor.droop.delta_P_ref"].reason
    assert held["gfor.droop.delta_P_ref"].derivative is not None


def test_a_controller_with_no_gain_has_the_effect_of_its_first_gain(two_area):
    """What ranks converters before any of them has a controller in use."""
    values = {"gfor.pod_p.enabled": True, "gfor.pod_p.K": 0.0}
    (row,) = two_area.scenario("gfor", values).sensitivities(parameters="gfor.pod_p.K").result.rows
    assert row.doubts == ()
    with_gain = (
        two_area.scenario("gfor", values | {"gfor.pod_p.K": 1.0}).modes().named["electromechanical"]
    )
    assert row.derivative == pytest.approx(with_gain.eigenvalue - row.eigenvalue, rel=0.01)
    assert row.damping_per_percent is None


@pytest.mark.slow
def test_exact_derivatives_of_native_fmus_give_the_same(two_area):
    native = two_area.scenario("pod_p", {"*.native": True})
    rows = rows_of(
        native.sensitivities(parameters=["gfor.pod_p.K", "gfor.droop.R_f"], directional=True)
    )
    plain = rows_of(
        two_area.scenario("pod_p").sensitivities(parameters=["gfor.pod_p.K", "gfor.droop.R_f"])
    )
    for name, row in rows.items():
        assert row.derivative == pytest.approx(plain[name].derivative, rel=1e-3)


def test_a_limit_that_acts_is_doubted_in_the_rows_of_its_component(two_area):
    """Limited to 0, the controller has no effect whatever its gain; nearly so, the edge is beside every value."""
    names = ["gfor.pod_p.K", "grid.X_L"]
    shut = rows_of(
        two_area.scenario("pod_p", {"gfor.pod_p.limit": 0.0}).sensitivities(
            parameters=names, held=True
        )
    )
    assert shut["gfor.pod_p.K"].derivative == 0
    assert "a limit acts in this component: output limit of POD-P" in shut["gfor.pod_p.K"].doubts
    assert not any("a limit acts" in text for text in shut["grid.X_L"].doubts)
    near = rows_of(
        two_area.scenario("pod_p", {"gfor.pod_p.limit": 1e-8}).sensitivities(
            parameters=names, held=True
        )
    )
    assert "edge of a limit" in " ".join(near["gfor.pod_p.K"].doubts)
    free = rows_of(two_area.scenario("pod_p").sensitivities(parameters=names, held=True))
    assert free["gfor.pod_p.K"].doubts == ()


@pytest.mark.parametrize(("moved", "stays"), [(0.0, True), (5e-14, True), (5e-13, False)])
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e4])
def test_what_moves_by_no_more_than_rounding_stays(size, moved, stays, monkeypatch):
    """By rounding of its size, or of 1 where it is smaller."""
    answers = [np.array([size]), *[np.array([size + moved * max(1.0, size)])] * 2]
    monkeypatch.setattr(sensitivities, "_answer", lambda master, name: answers.pop(0))
    monkeypatch.setattr(sensitivities, "changed", lambda *_: nullcontext())
    assert sensitivities._stays(None, Parameter("a", "K", "pu", 2.0, tunable=True), 1) is stays


def row_of(variable, derivative, reason=""):
    of_part = Parameter("gfor", variable, unit="pu", value=2.0, tunable=True)
    return Sensitivity(of_part, -1 + 8j, derivative, None, "moves", reason=reason)


def test_a_row_of_0_says_what_is_off():
    """Seven rows of 0 did not say that POD-Q was off."""
    plan = SimpleNamespace(
        description=SimpleNamespace(variables=("pod_q.enabled", "pod_q.T_W", "limit")),
        number=lambda key: 0.0,
        value=lambda key: False,
    )
    wired = SimpleNamespace(components={"gfor": plan}, connections=())
    rows = [row_of("pod_q.T_W", 0j), row_of("limit", 0j), row_of("pod_q.T_W", 0.1j)]
    told = [_with_switch(SimpleNamespace(system=wired), row).reason for row in rows]
    assert told == ["cannot act: gfor.pod_q.enabled is false", "", ""]


def test_a_remark_of_several_rows_stands_once_below_a_table_in_parts():
    rows = (
        row_of("K", 0.1j),
        *(row_of(name, 0j, "POD-Q is off") for name in ("a", "b")),
        row_of("c", None, "no steady state"),
    )
    mode = Mode(-1 + 8j, (("sg1.omega", 0.6), ("sg2.omega", 0.3)), {})
    modes = SimpleNamespace(
        prepared=SimpleNamespace(title="Base"), name_of=lambda mode: "slow", modes=[mode]
    )
    found = SimpleNamespace(rows=rows, mode=mode, modes=modes, held=False)
    table = sensitivity_table(found)
    assert table.title.startswith("Base, slow, 1.273 Hz, 12.40 % (sg1 0.60, sg2 0.30): ")
    modes.modes = [mode, Mode(-0.5 + 9j, (), {}), Mode(-0.7 + 9j, (), {}), Mode(-0.01 + 0j, (), {})]
    less = (
        "(sg1 0.60, sg2 0.30), not the least damped, which is 1.432 Hz, 5.55 % (--mode critical): "
    )
    assert less in sensitivity_table(found).title
    remark = table.columns[-1]
    assert [remark.cell(row) for row in rows] == ["", "note 1", "note 1", "no steady state"]
    assert table.note == "Note 1: POD-Q is off."
    assert [table.part(row) for row in rows] == [
        "in percent",
        "moves nothing",
        "moves nothing",
        "not known",
    ]
    assert [record["reason"] for record in table.records()][1] == "POD-Q is off"  # whole in files
