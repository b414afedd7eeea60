"""Branches of negative reactance: joined in series where that is exact, and refused by name where it is not."""

import numpy as np
import pytest

from fmus.grid.network import Line, Load, Network
from orchestrator.cases.flow.balance import FlowLine, FlowLoad, FlowShunt, inner_buses, legs_of
from orchestrator.cases.flow.power_flow import FlowUnit, solve_power_flow
from orchestrator.cases.form.schema import NetworkTable
from orchestrator.cases.networks.conversion import without_negative_reactances, without_star_points
from orchestrator.cases.networks.data import network_data
from tests.cases.events.test_switching import RING, watch
from tests.support.scenarios import prepare_one


def two_port(lines, buses, ends):
    """Admittances between two buses, every other one eliminated: MATPOWER's matrix, reduced by Kron."""
    Y = np.zeros((len(buses),) * 2, complex)
    for x in lines:
        f, t = buses.index(x.from_bus), buses.index(x.to_bus)
        y, n = 1 / complex(x.R, x.X), x.tap * np.exp(1j * x.shift)
        Y[f, f] += y / abs(n) ** 2
        Y[t, t] += y
        Y[f, t] -= y / np.conj(n)
        Y[t, f] -= y / n
    outer = [buses.index(b) for b in ends]
    inner = [k for k in range(len(buses)) if k not in outer]
    if not inner:
        return Y
    return Y[np.ix_(outer, outer)] - Y[np.ix_(outer, inner)] @ np.linalg.solve(
        Y[np.ix_(inner, inner)], Y[np.ix_(inner, outer)]
    )


@pytest.mark.parametrize("turned", [(False, False), (True, False), (False, True), (True, True)])
def test_two_in_series_become_one_exactly(turned):
    ends = [("m", "a") if turned[0] else ("a", "m"), ("b", "m") if turned[1] else ("m", "b")]
    ratio = {} if turned[0] else {"tap": 1.05, "shift": 0.2}
    lines = [Line("am", *ends[0], X=0.6, R=0.01, **ratio), Line("mb", *ends[1], X=-0.35)]
    found, merged = without_negative_reactances(lines, {"a", "b"})
    assert merged == {"m"}
    assert [(x.name, x.X) for x in found] == [("am", pytest.approx(0.25))]
    wanted = two_port(lines, ["a", "m", "b"], ["a", "b"])
    assert two_port(found, ["a", "b"], ["a", "b"]) == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("negative", [0, 1])
def test_two_legs_of_a_transformer_with_their_ratios_become_one_exactly(negative):
    X = (-0.35, 0.6) if negative == 0 else (0.6, -0.35)
    lines = [
        Line("am", "a", "m", X[0], R=0.01, tap=1.05, shift=0.2),
        Line("bm", "b", "m", X[1], R=0.02, tap=0.97, shift=-0.5),
    ]
    found, merged = without_negative_reactances(list(lines), {"a", "b"})
    assert (len(found), merged) == (1, {"m"})
    assert found[0].X > 0
    wanted = two_port(lines, ["a", "m", "b"], ["a", "b"])
    assert two_port(found, ["a", "b"], ["a", "b"]) == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize(
    ("lines", "kept"),
    [
        ((Line("am", "a", "m", X=0.6), Line("mb", "m", "b", X=-0.35)), {"a", "m", "b"}),
        ((Line("am", "a", "m", X=0.3), Line("mb", "m", "b", X=-0.35)), {"a", "b"}),
        ((Line("am", "a", "m", X=0.6, B=0.1), Line("mb", "m", "b", X=-0.35)), {"a", "b"}),
        (
            (
                Line("am", "a", "m", X=0.6, B=0.1),
                Line("mb", "m", "b", X=-0.1),
                Line("mc", "m", "c", X=0.2),
            ),
            {"a", "b"},
        ),
        (
            (
                Line("am", "a", "m", X=0.6),
                Line("mb", "m", "b", X=-0.3),
                Line("mc", "m", "c", X=0.2),
            ),
            {"a", "b", "c"},
        ),
    ],
)
def test_what_is_not_exact_is_left_and_refused_by_name(lines, kept):
    found, merged = without_negative_reactances(list(lines), kept)
    assert (found, merged) == (list(lines), set())
    assert without_star_points(list(lines), kept) == (list(lines), [], set())
    buses = tuple(dict.fromkeys(b for x in lines for b in (x.from_bus, x.to_bus)))
    with pytest.raises(
        ValueError, match=r"line 'mb' has the reactance -0.* pu between buses 'm' and 'b'"
    ):
        Network("n", buses, lines, tuple(Load(f"l{b}", b, 1.0) for b in buses), ())


def test_a_star_point_becomes_a_transformer_exactly():
    """Legs in both directions, each with a ratio; the legs of the power flow are those of the source."""
    lines = [
        Line("am", "a", "m", X=0.6, R=0.01, tap=1.05, shift=0.2),
        Line("mb", "m", "b", X=-0.1, tap=0.9, shift=0.5),
        Line("mc", "m", "c", X=0.2, R=0.02, tap=1.1),
    ]
    found, (transformer,), stars = without_star_points(lines, {"a", "b", "c"})
    assert (found, stars) == ([], {"m"})
    assert transformer.name == "transformer_m"
    legs, inner = legs_of(transformer), inner_buses(transformer)
    wanted = two_port(lines, ["a", "m", "b", "c"], ["a", "b", "c"])
    assert two_port(legs, ["a", "b", "c", *inner], ["a", "b", "c"]) == pytest.approx(
        wanted, abs=1e-12
    )


CASE = """
[network]
stray_B = 0.1
[network.three_winding_transformers.t]
buses = ["b1", "b2", "b3"]
X_12 = 0.02
X_13 = 0.06
X_23 = 0.03
tap = [1.0, 1.02, 1.01]
[network.loads]
town = { bus = "b3", p = "300 MW", q = "50 Mvar" }
works = { bus = "b2", p = "200 MW", q = "40 Mvar" }
house = { bus = "b1", p = "5 MW" }
"""


def test_a_transformer_of_a_case_file_starts_in_steady_state(tmp_path):
    """X_12 + X_23 < X_13: winding 2 has a negative reactance, and a ratio."""
    i, j = RING.index("[network]"), RING.index("[components.sg]")
    (tmp_path / "case.toml").write_text(RING[:i] + CASE + RING[j:], encoding="utf-8")
    ready = prepare_one(tmp_path / "case.toml")
    (found,) = watch(ready, ("grid.b3.v", "grid.b2.v", "grid.t.winding_3.p"), (0.05,))
    assert set(ready.power_flow.voltages) >= {"b1", "b2", "b3"}
    for bus in ("b2", "b3"):
        assert found[f"grid.{bus}.v"] == pytest.approx(
            abs(ready.power_flow.voltages[bus]), abs=1e-6
        )
    assert found["grid.t.winding_3.p"] == pytest.approx(-3.0, abs=1e-5)


@pytest.mark.slow
def test_case300_loads_as_it_is_shipped(tmp_path):
    """8 static generators (321.8 MW) and a branch of -0.3697 pu; the voltages are pandapower's own."""
    from pandapower import networks, runpp  # noqa: PLC0415 - seconds to import

    data = network_data(NetworkTable(pandapower="case300", stray_B=1e-9), tmp_path)
    network = Network("n", data.buses, data.lines, data.loads, (), data.shunts, 1e-9)
    feeding = [load.p_mw for load in network.loads if load.p_mw < 0]
    assert (len(feeding), sum(feeding)) == (8, pytest.approx(-321.8))
    assert len(network.buses) == 299
    flow = solve_power_flow(
        network.buses,
        [
            FlowLine(x.name, x.from_bus, x.to_bus, x.R, x.X, x.B, x.tap, x.shift)
            for x in network.lines
        ],
        [FlowLoad(x.bus, x.p_mw, x.q_mvar) for x in network.loads],
        [
            FlowUnit(b, b, g.rating_mva, g.p_mw / g.rating_mva, g.v_pu)
            for b, g in data.generation.items()
        ],
        data.slack,
        [FlowShunt(x.bus, x.g_mw / 100, x.b_mvar / 100) for x in network.shunts],
    )
    net = networks.case300()
    runpp(net, calculate_voltage_angles=True, numba=False)
    for name, v, angle in zip(net.bus.name, net.res_bus.vm_pu, net.res_bus.va_degree, strict=True):
        if f"bus_{name}" in flow.voltages:
            assert flow.voltages[f"bus_{name}"] == pytest.approx(
                v * np.exp(1j * np.deg2rad(angle)), abs=1e-6
            )
