"""Networks of MATPOWER and pandapower: the same voltages as pandapower finds, and what is refused."""

import cmath
import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.io import savemat

from fmus.grid.element_data import Zip
from orchestrator.cases.flow.balance import FlowLine, FlowLoad, FlowShunt
from orchestrator.cases.flow.power_flow import FlowUnit, solve_power_flow
from orchestrator.cases.form.schema import NetworkTable
from orchestrator.cases.networks.data import network_data
from orchestrator.core.errors import InputError
from tests.support.late import LateLibrary
from tests.support.pandapower_networks import pandapower_network

pp = LateLibrary("pandapower")

SMALL = """\
function mpc = small
%% three buses on 200 MVA: a phase shifter, two circuits, a reactor, a generator that is off
mpc.version = '2';
mpc.baseMVA = 200;
mpc.bus = [
    7   3   0    0    0   0   1  1.00  0  345  1  1.1  0.9;
    12  1   90   30   4  -25  1  1.00  0  345  1  1.1  0.9;
    20  2   50   10   0   0   1  1.00  0  345  1  1.1  0.9;
    99  4   0    0    0   0   1  1.00  0  345  1  1.1  0.9;
];
mpc.gen = [
    7   0    0  100  -100  1.02  100  1  250  0;
    20  40   0  60   -60   1.01  100  1  80   0;
    20  20   0  60   -60   1.01  100  1  40   0;
    12  70   0  60   -60   1.01  100  0  80   0;
];
mpc.branch = [
    7   12  0.01   0.08  0.10  0 0 0  0      0    1  -360 360;
    7   12  0.02   0.12  0.06  0 0 0  0      0    1  -360 360;
    12  20  0.005  0.06  0     0 0 0  0.96   -12  1  -360 360;
    7   20  0.01   0.10  0.04  0 0 0  1.03   0    1  -360 360;
    7   20  0.01   0.10  0.04  0 0 0  0      0    0  -360 360;
    7   99  0.01   0.10  0.04  0 0 0  0      0    1  -360 360;
];
"""


def solved(data):
    """Our power flow of a source's network."""
    lines = [
        FlowLine(x.name, x.from_bus, x.to_bus, x.R, x.X, x.B, x.tap, x.shift) for x in data.lines
    ]
    loads = [FlowLoad(x.bus, x.p_mw, x.q_mvar) for x in data.loads]
    shunts = [FlowShunt(x.bus, x.g_mw / 100, x.b_mvar / 100) for x in data.shunts]
    units = [
        FlowUnit(f"u{bus}", bus, 100.0, g.p_mw / 100, g.v_pu) for bus, g in data.generation.items()
    ]
    return solve_power_flow(data.buses, lines, loads, units, data.slack, shunts)


def reference(net):
    """pandapower's own voltages by the label of the bus."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pp.runpp(net, calculate_voltage_angles=True, numba=False, tolerance_mva=1e-10)
    found = net.res_bus[net.bus.in_service]
    return {
        f"bus_{net.bus.name[k]}": cmath.rect(v.vm_pu, np.deg2rad(v.va_degree))
        for k, v in found.iterrows()
    }


def compare(flow, wanted):
    assert set(flow.voltages) == set(wanted)
    slack = min(wanted)
    turn = cmath.phase(wanted[slack]) - cmath.phase(flow.voltages[slack])
    for bus, v in flow.voltages.items():
        assert abs(v) == pytest.approx(abs(wanted[bus]), abs=1e-6)
        assert cmath.phase(v * cmath.exp(1j * turn) / wanted[bus]) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("name", ["case39", "case14", "case118", "case24_ieee_rts"])
def test_a_pandapower_network_has_pandapowers_voltages(name, tmp_path):
    data = network_data(NetworkTable(pandapower=name), tmp_path)
    net = pandapower_network(name)
    assert data.frequency == net.f_hz
    flow = solved(data)
    assert flow.residual <= 1e-9
    compare(flow, reference(net))


def test_a_pandapower_network_with_everything_from_a_file(tmp_path):
    """Switches that join and part, a three-winding transformer, magnetisation, phase shift, things out of service."""
    net = pp.create_empty_network(f_hz=60.0)
    names = ["north", "north copy", "south", "mine", "village", "far", "dead", "harbour"]
    levels = (110, 110, 110, 20, 10, 110, 110, 20)
    a, b, c, d, e, f, g, h = (
        pp.create_bus(net, kv, name=n) for kv, n in zip(levels, names, strict=True)
    )
    pp.create_ext_grid(net, a, vm_pu=1.02, va_degree=20.0)
    pp.create_switch(net, a, b, et="b", closed=True)
    for target in (c, f):
        pp.create_line(net, b, target, 40, "149-AL1/24-ST1A 110.0")
    opened = pp.create_line(net, c, f, 30, "149-AL1/24-ST1A 110.0")
    pp.create_switch(net, c, opened, et="l", closed=False)
    pp.create_line(net, c, g, 30, "149-AL1/24-ST1A 110.0", in_service=False)
    net.bus.loc[g, "in_service"] = False
    pp.create_transformer3w(net, c, d, e, "63/25/38 MVA 110/20/10 kV")
    pp.create_transformer(net, f, h, "40 MVA 110/20 kV", tap_pos=-2)
    pp.create_gen(net, f, p_mw=15, vm_pu=1.01)
    pp.create_load(net, d, 20, 5)
    pp.create_load(net, h, 12, 3)
    pp.create_load(net, e, 9, 2)
    pp.create_sgen(net, e, 4, 1)
    pp.create_shunt(net, c, q_mvar=-6, p_mw=0.2)
    pp.to_json(net, str(tmp_path / "region.json"))
    data = network_data(NetworkTable(pandapower="region.json"), tmp_path)
    outer = {"bus_north", "bus_south", "bus_mine", "bus_village", "bus_far", "bus_harbour"}
    inner = set(data.buses) - outer
    assert len(inner) == 2  # the star point of the transformer, and the open end of the line
    flow, wanted = solved(data), reference(net)
    compare(
        replace(flow, voltages={bus: flow.voltages[bus] for bus in outer}),
        {bus: wanted[bus] for bus in outer},
    )
    assert data.slack == "bus_north"
    assert next(x for x in data.loads if x.bus == "bus_village").p_mw == pytest.approx(5)


def test_a_matpower_file_has_the_voltages_of_the_same_network_in_pandapower(tmp_path):
    (tmp_path / "small.m").write_text(SMALL)
    data = network_data(NetworkTable(matpower="small.m"), tmp_path)
    assert data.buses == ("bus_7", "bus_12", "bus_20")
    assert [x.name for x in data.lines] == ["line_7_12", "line_7_12_2", "line_12_20", "line_7_20"]
    assert (data.slack, data.frequency) == ("bus_7", None)
    assert data.lines[2].shift == pytest.approx(np.deg2rad(-12))
    assert pytest.approx(0.04) == data.lines[0].X  # on 100 MVA
    assert pytest.approx(0.2) == data.lines[0].B
    (shunt,) = data.shunts
    assert (shunt.name, shunt.g_mw, shunt.b_mvar) == ("shunt_12", 4, -25)
    assert data.generation["bus_20"].p_mw == 60
    assert data.generation["bus_20"].rating_mva == pytest.approx(120 / 0.9, abs=0.1)
    compare(solved(data), reference(as_pandapower()))
    tables = {"version": "2", "baseMVA": 200.0} | {n: matrix(n) for n in ("bus", "gen", "branch")}
    savemat(tmp_path / "small.mat", {"mpc": tables})
    again = network_data(NetworkTable(matpower="small.mat"), tmp_path)
    assert [change.text for change in again.changes] == [change.text for change in data.changes]
    assert replace(again, changes=data.changes) == data


def matrix(name):
    rows = SMALL.partition(f"mpc.{name} = [")[2].partition("];")[0].strip().splitlines()
    return np.array([[float(x) for x in row.rstrip("; ").split()] for row in rows])


def as_pandapower():
    net = pp.create_empty_network(sn_mva=200)
    at = {n: pp.create_bus(net, 345, name=str(n)) for n in (7, 12, 20)}
    z = 345**2 / 200
    for f, t, r, x, b, *_, ratio, shift, status, _, _ in matrix("branch"):
        if not status or t == 99:
            continue
        if ratio:
            pp.create_transformer_from_parameters(
                net,
                at[f],
                at[t],
                200,
                ratio * 345,
                345,
                100 * r,
                100 * abs(complex(r, x)),
                0,
                0,
                shift_degree=shift,
            )
            for end, tap in ((f, ratio), (t, 1)):
                pp.create_shunt(net, at[end], q_mvar=-b / 2 * 200 / tap**2)
        else:
            c = b / z / (2 * np.pi * 50) * 1e9
            pp.create_line_from_parameters(net, at[f], at[t], 1, r * z, x * z, c, 1)
    pp.create_ext_grid(net, at[7], 1.02)
    pp.create_gen(net, at[20], 60, 1.01)
    pp.create_load(net, at[12], 90, 30)
    pp.create_load(net, at[20], 50, 10)
    pp.create_shunt(net, at[12], q_mvar=25, p_mw=4)
    return net


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"matpower": "none.m"}, "none.m: there is no such file; give the path of a MATPOWER case"),
        (
            {"matpower": "notes.txt"},
            "notes.txt: a MATPOWER case ends in .m or .mat, and this file in '.txt'",
        ),
        ({"matpower": "script.m"}, "script.m: it (is not|cannot be read as) a MATPOWER case"),
        ({"matpower": "broken.mat"}, "broken.mat: it cannot be read as a MATPOWER case"),
        (
            {"matpower": "short.m"},
            r"short.m: mpc.branch must be a table of numbers with 11 columns or more",
        ),
        (
            {"pandapower": "case93"},
            "there is no pandapower network 'case93'; did you mean case9 or",
        ),
        # a module that it imports
        ({"pandapower": "logging"}, "there is no pandapower network 'logging'"),
        (
            {"pandapower": "quite_different"},
            "'quite_different'; give one of pandapower.networks, or the path",
        ),
        (
            {"pandapower": "none.json"},
            r"none.json: there is no such file; save a network with pandapower.to_json",
        ),
        ({"pandapower": "text.json"}, "text.json: it is no network saved with pandapower.to_json"),
    ],
)
def test_a_source_that_cannot_be_used(table, words, tmp_path):
    (tmp_path / "notes.txt").write_text("buses")
    (tmp_path / "script.m").write_text("x = 3;\ndisp(x)\n")
    (tmp_path / "broken.mat").write_bytes(b"no matrices here")
    (tmp_path / "text.json").write_text("[1, 2")
    head, _, tail = SMALL.partition("mpc.branch")
    short = "\n".join(
        " ".join(line.split()[:7]) + ";" if line.startswith("    ") else line
        for line in tail.splitlines()
    )
    (tmp_path / "short.m").write_text(f"{head}mpc.branch{short}")
    with pytest.raises(InputError, match=words):
        network_data(NetworkTable(**table), tmp_path)


def test_a_negative_load_is_static_generation(tmp_path):
    """A constant current, unless the case says otherwise of generation; what holds for loads does not hold for it."""
    (tmp_path / "feeding.m").write_text(SMALL.replace("12  1   90 ", "12  1   -50 "))
    laws = {"load_model": {"active": "power"}}
    found = {}
    told = {"generation_model": {"active": {"z": 0.5, "i": 0.5}, "v_min": 0.5}}
    for name, more in (("usual", {}), ("told", told)):
        table = NetworkTable.model_validate({"matpower": "feeding.m"} | laws | more)
        found[name] = {load.bus: load for load in network_data(table, tmp_path).loads}["bus_12"]
    assert found["usual"].p_mw == -50
    assert (found["usual"].active, found["usual"].reactive) == (Zip(i=1.0), Zip(i=1.0))
    assert (found["told"].active, found["told"].v_min) == (Zip(z=0.5, i=0.5), 0.5)
