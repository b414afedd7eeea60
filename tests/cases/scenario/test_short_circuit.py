"""Short-circuit power by hand, and beside pandapower's IEC 60909 where both assume the same."""

import math
from dataclasses import replace

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.flow.balance import FlowLine
from orchestrator.cases.scenario.short_circuit import ShortCircuit
from orchestrator.core.errors import InputError
from orchestrator.studies.sweep.axes import parse_vary, resolve
from tests.studies.screening.five_machines import RATINGS, five_machines

C_MAX = 1.1
"""IEC 60909: voltage factor of networks above 1 kV."""


@pytest.fixture(scope="module")
def five(tmp_path_factory):
    case = five_machines(tmp_path_factory.mktemp("five"))
    text = case.path.read_text() + '[components.gfor]\nmodel = "gfor_phasor"\nbus = "bus_16"\n'
    case.path.write_text(text + "parameters = { S_n = 200.0, P_0 = 0.1, v_0 = 1.0 }\n")
    return load_case(case.path)


@pytest.fixture(scope="module")
def prepared(five):
    return five.prepare()[0]


@pytest.fixture
def two():
    """A source of 0.1 pu, a line of 0.15 pu, and behind a ratio of 1.05 another of 0.2 pu."""
    lines = (
        FlowLine("a", "x", "y", 0.0, 0.15, 0.3),
        FlowLine("b", "y", "z", 0.0, 0.2, 0.0, tap=1.05),
    )
    return ShortCircuit(("x", "y", "z"), lines, {"x": 1 / 0.1j}, {"c": ("y", 50.0)})


def test_by_hand(two):
    x, y, z = two.strengths()
    assert x.s_sc_mva == pytest.approx(100 / 0.1)
    assert y.s_sc_mva == pytest.approx(100 / 0.25)
    assert z.s_sc_mva == pytest.approx(100 / (0.2 + 0.25 / 1.05**2))
    assert (x.scr, y.scr) == (None, pytest.approx(8))
    assert two.strengths(rating_mva=100.0)[0].scr == pytest.approx(10)


def test_the_ratio_of_all_converters_together(two):
    """Alone and at one bus it is the SCR; at two buses the least eigenvalue of S⁻¹·B, by the roots of its square."""
    assert two.gscr() == pytest.approx(8)
    assert replace(two, converters={"c": ("y", 50.0), "d": ("y", 150.0)}).gscr() == pytest.approx(2)
    apart = replace(two, converters={"c": ("x", 50.0), "d": ("y", 150.0)})
    a, b, d = 0.05, 0.15, 0.375  # 0.1·0.5; 0.1 between, times 1.5; 0.25·1.5
    largest = (a + d + math.sqrt((a - d) ** 2 + 4 * b * 0.05)) / 2
    assert apart.gscr() == pytest.approx(1 / largest)
    assert apart.gscr() < min(x.scr for x in apart.strengths() if x.scr)
    assert replace(two, converters={}).gscr() is None


def test_a_declared_current_counts_by_its_distance(two):
    """At y all of 1.2·50 MVA; at x what the divider of 0.1 and 0.15 pu lets through."""
    x, y, _ = two.strengths(1.2)
    assert y.s_sc_mva == pytest.approx(400 + 60)
    assert x.s_sc_mva == pytest.approx(1000 + 60)


def test_impedances_for_a_wanted_power(two):
    k = two.factor_for("z", 100.0)
    assert two.power_at("z", k) == pytest.approx(100, rel=1e-9)
    assert k * 0.2 + 0.25 / 1.05**2 == pytest.approx(1, rel=1e-9)
    with pytest.raises(InputError, match="cannot be had"):
        two.factor_for("z", 5000.0)


def test_as_pandapower_by_iec_60909(prepared):
    """Machines as external grids, since IEC's correction K_G of generators has no counterpart; its c is taken out."""
    pandapower = pytest.importorskip("pandapower")
    from pandapower.shortcircuit import calc_sc  # noqa: PLC0415

    ours = ShortCircuit.of(prepared)
    assert {line.tap for line in ours.lines} == {1.0}
    net = pandapower.create_empty_network(sn_mva=100.0)
    index = {bus: pandapower.create_bus(net, vn_kv=110.0) for bus in ours.buses}
    for x in ours.lines:
        pandapower.create_impedance(
            net,
            index[x.from_bus],
            index[x.to_bus],
            rft_pu=x.R,
            xft_pu=x.X,
            sn_mva=100.0,
            rft0_pu=x.R,
            xft0_pu=x.X,
        )
    for bus, y in ours.sources.items():
        z = 1 / y
        power = C_MAX * 100 / abs(z)
        pandapower.create_ext_grid(
            net, index[bus], s_sc_max_mva=power, rx_max=z.real / z.imag, r0x0_max=1, x0x_max=1
        )
    calc_sc(net, fault="3ph", case="max", ip=False, ith=False)
    for found in ours.strengths():
        theirs = net.res_bus_sc.at[index[found.bus], "ikss_ka"] * 110 * math.sqrt(3) / C_MAX
        assert found.s_sc_mva == pytest.approx(theirs, rel=1e-6), found.bus


def test_machines_are_their_subtransient_reactance(prepared):
    sources = ShortCircuit.of(prepared).sources
    assert abs(sources["bus_1"]) == pytest.approx(RATINGS[1] / 100 / 0.25, rel=1e-3)


def test_an_axis_of_scr_gives_every_point_that_scr(five, prepared):
    axis = resolve(parse_vary("bus_16: scr=2,0.5"), [prepared])
    for value in axis.values:
        (weaker,) = five.prepare(overrides=axis.sets(value))
        (bus,) = [x for x in ShortCircuit.of(weaker).strengths() if x.bus == "bus_16"]
        assert bus.scr == pytest.approx(value, rel=1e-6)
    now = ShortCircuit.of(prepared).power_at("bus_13")
    power = resolve(parse_vary(f"bus_13: scr={now} MVA:{0.8 * now} MVA:2"), [prepared])
    (weaker,) = five.prepare(overrides=power.sets(0.8 * now))
    assert ShortCircuit.of(weaker).power_at("bus_13") == pytest.approx(0.8 * now, rel=1e-6)


@pytest.mark.parametrize(
    ("vary", "said"),
    [
        ("bus_61: scr=3,2", "no bus 'bus_61'; did you mean"),
        ("bus_13: scr=3,2", "no converter stands at bus_13"),
        ("bus_16: scr=3000,2", "cannot be had"),
    ],
)
def test_a_scr_that_cannot_be_is_refused(prepared, vary, said):
    with pytest.raises(InputError) as refused:
        resolve(parse_vary(vary), [prepared])
    assert said in str(refused.value)


def test_the_length_of_lines_multiplies_all_they_have(prepared):
    axis = resolve(parse_vary("line_11_12, line_13_1*: length=1:3:2"), [prepared])
    found = axis.sets(3.0)
    assert found["grid.X_line_11_12"] == pytest.approx(0.15)
    assert found["grid.R_line_13_16"] == pytest.approx(0.012)
    assert found["grid.B_line_13_14"] == pytest.approx(0.06)
    assert len(found) == 9


def test_the_command_prints_the_weakest_converter_first(gfor, five):
    code, text, _ = gfor("scr", five.path)
    assert code == 0
    rows = [line for line in text.splitlines() if "bus_" in line]
    assert "bus_16" in rows[0]
    assert "gfor" in rows[0]
    assert "Convention: initial three-phase short circuit from 1 pu" in text
    assert gfor("scr", "infinite_bus")[0] == 2
