"""Networks of PSS/E: pandapower's voltages of the same network, transformers by hand, and what is refused."""

import cmath
import json
import warnings

import numpy as np
import pytest

from orchestrator.cases.form.schema import NetworkTable
from orchestrator.cases.networks.data import network_data
from orchestrator.cases.networks.psse.raw import read_raw
from orchestrator.core.errors import InputError
from tests.cases.networks.psse import BUSES, LINES, LOADS, MACHINES, TRANSFORMERS, raw, records
from tests.cases.networks.test_network_sources import solved
from tests.support.late import LateLibrary
from tests.support.pandapower_networks import pandapower_network

pp = LateLibrary("pandapower")


@pytest.fixture
def written(tmp_path):
    """Text of a RAW file, and keys of the network → its data."""

    def write(text, **keys):
        (tmp_path / "grid.raw").write_text(text, encoding="utf-8")
        return network_data(NetworkTable(raw="grid.raw", **keys), tmp_path)

    return write


def pandapowers(net):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pp.runpp(net, calculate_voltage_angles=True, numba=False, tolerance_mva=1e-10)
    return {
        f"bus_{k + 1}": cmath.rect(v.vm_pu, np.deg2rad(v.va_degree))
        for k, v in net.res_bus.iterrows()
    }


def wscc():
    """pandapower's case9 with the numbers and taps of Sauer and Pai."""
    net = pp.create_empty_network(f_hz=60.0, sn_mva=100)
    for n in sorted(BUSES):
        pp.create_bus(net, 100.0, name=str(n))
    for i, j, r, x, b in (*LINES, *((i, j, 0.0, x, 0.0) for i, j, x in TRANSFORMERS)):
        pp.create_line_from_parameters(
            net, i - 1, j - 1, 1, r * 100, x * 100, b / 100 / (2 * np.pi * 60) * 1e9, 1
        )
    for n, (p, q) in LOADS.items():
        pp.create_load(net, n - 1, p, q)
    pp.create_ext_grid(net, 0, MACHINES[1][1])
    for n in (2, 3):
        pp.create_gen(net, n - 1, MACHINES[n][0], MACHINES[n][1])
    return net


@pytest.fixture(scope="module")
def wscc_voltages():
    return pandapowers(wscc())


@pytest.mark.parametrize(
    ("revision", "named"), [(33, True), (33, False), (34, True), (35, False), (36, True)]
)
def test_the_voltages_are_pandapowers_in_every_revision(revision, named, written, wscc_voltages):
    data = written(raw(revision, named=named))
    assert (data.frequency, data.slack, data.changes) == (60.0, "bus_1", ())
    assert {bus: g.rating_mva for bus, g in data.generation.items()} == {
        "bus_1": 247.5,
        "bus_2": 192.0,
        "bus_3": 128.0,
    }
    flow = solved(data)
    for bus, v in flow.voltages.items():
        assert v == pytest.approx(wscc_voltages[bus], abs=1e-8)


def test_the_textbooks_voltages(written):
    """Sauer and Pai, table 7.2: 1.026 at -2.2 degrees at bus 4, 1.016 at 0.7 at bus 8."""
    voltages = solved(written(raw())).voltages
    for bus, size, angle in (("bus_4", 1.026, -2.2), ("bus_8", 1.016, 0.7), ("bus_2", 1.025, 9.3)):
        assert abs(voltages[bus]) == pytest.approx(size, abs=6e-4)
        assert np.rad2deg(cmath.phase(voltages[bus])) == pytest.approx(angle, abs=0.06)


def test_a_matpower_case_written_as_raw(written):
    """New England's 39 buses with off-nominal ratios, from pandapower's own tables."""
    net = pandapower_network("case39")
    pandapowers(net)
    found = {section: [] for section in records(33)}
    ppc = net._ppc["internal"] if "bus" not in net._ppc else net._ppc
    for row in ppc["bus"].real:
        found["BUS"].append(f"{row[0] + 1:.0f},'B',{row[9]},{row[1]:.0f},1,1,1,1,0")
        found["LOAD"].append(
            f"{row[0] + 1:.0f},'1',1,1,1,{row[2]:.12g},{row[3]:.12g},0,0,0,0,1,1,0"
        )
    for row in ppc["gen"].real:
        found["GENERATOR"].append(
            f"{row[0] + 1:.0f},'1',{row[1]:.12g},0,9999,-9999,{row[5]:.12g},0,2000,0,1,0,0,1,1"
        )
    for row in ppc["branch"].real:
        i, j, r, x, b, tap, shift = row[0] + 1, row[1] + 1, *row[2:5], row[8] or 1.0, row[9]
        if tap == 1 and shift == 0:
            found["BRANCH"].append(
                f"{i:.0f} {j:.0f} '1' {r:.12g} {x:.12g} {b:.12g} 0 0 0 0 0 0 0 1"
            )
            continue
        found["TRANSFORMER"] += [
            f"{i:.0f},{j:.0f},0,'1',1,1,1,0,0,2,'',1",
            f"{r:.12g},{x:.12g},100",
            f"{tap:.12g},0,{shift:.12g}",
            "1.0,0",
        ]
    flow = solved(written(raw(33, found)))
    wanted = pandapowers(net)
    assert len(flow.voltages) == 39
    turn = cmath.phase(wanted["bus_31"]) - cmath.phase(flow.voltages["bus_31"])
    for bus, v in flow.voltages.items():
        assert v * cmath.exp(1j * turn) == pytest.approx(wanted[bus], abs=1e-6)


# -- transformers ----------------------------------------------------------------------------------


def with_transformer(*lines):
    """The WSCC system whose transformer 4-1 is another one."""
    found = records(33)
    found["TRANSFORMER"][:4] = lines
    return raw(33, found)


@pytest.mark.parametrize(
    ("codes", "impedance", "first", "second", "z", "tap"),
    [
        ("1,1,1", "0.002,0.0576,100", "1.05,0,-30", "1.0,0", 0.002 + 0.0576j, 1.05),
        (
            "1,1,1",
            "0.002,0.0576,100",
            "1.05,0,-30",
            "0.98,0",
            (0.002 + 0.0576j) * 0.98**2,
            1.05 / 0.98,
        ),
        ("2,1,1", "0.002,0.0576,100", "241.5,230,-30", "16.5,16.5", 0.002 + 0.0576j, 1.05),
        (
            "3,2,1",
            "0.005,0.144,250",
            "1.05,220,-30",
            "1.0,16.5",
            (0.005 + 0.144j) * 0.4 * (220 / 230) ** 2,
            1.05 * 220 / 230,
        ),
        (
            "1,3,1",
            "500000,0.15,250",
            "1.0,0,-30",
            "1.0,0",
            complex(0.002, np.sqrt(0.15**2 - 0.002**2)) * 0.4,
            1.0,
        ),
    ],
)
def test_codes_of_ratio_and_impedance(codes, impedance, first, second, z, tap, written):
    head = f"4,1,0,'1 ',{codes},0,0,2,'T',1,1,1"
    data = written(with_transformer(head, impedance, first, second))
    line = next(x for x in data.lines if x.name == "line_4_1")
    assert complex(line.R, line.X) == pytest.approx(z)
    assert (line.tap, line.shift) == (pytest.approx(tap), pytest.approx(np.deg2rad(-30)))


def test_an_angle_of_the_second_winding_turns_the_other_way(written):
    """ANG1 − ANG2: two windings that turn alike shift nothing."""
    head = "4,1,0,'1 ',1,1,1,0,0,2,'T',1,1,1"
    data = written(with_transformer(head, "0.002,0.0576,100", "1.05,0,-30", "1.0,0,-30"))
    assert next(x for x in data.lines if x.name == "line_4_1").shift == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("codes", "magnetisation", "nominal", "wanted"),
    [
        ("1,1,1", "0.002,-0.01", 0, (0.2, -1.0)),
        ("1,1,2", "100000,0.004", 0, (0.1, -np.sqrt(1.0**2 - 0.1**2))),
        (
            "1,1,2",
            "100000,0.004",
            220,
            (0.1 * (230 / 220) ** 2, -np.sqrt(1.0**2 - 0.1**2) * (230 / 220) ** 2),
        ),
    ],
)
def test_codes_of_magnetisation(codes, magnetisation, nominal, wanted, written):
    """CM = 2: loss [W] and exciting current [pu of 250 MVA], at the winding's nominal voltage."""
    head = f"4,1,0,'1 ',{codes},{magnetisation},2,'T',1,1,1"
    data = written(with_transformer(head, "0,0.0576,250", f"1.0,{nominal},0", "1.0,0"))
    (shunt,) = data.shunts
    assert (shunt.bus, shunt.g_mw, shunt.b_mvar) == (
        "bus_4",
        pytest.approx(wanted[0]),
        pytest.approx(wanted[1]),
    )


def test_three_windings_are_a_star(written):
    """Z12 = 0.10, Z23 = 0.14, Z31 = 0.16 on 50 MVA: 0.06, 0.04 and 0.10 to the star point, twice that on 100 MVA."""
    found = records(33)
    found["TRANSFORMER"] += [
        "4,8,6,'A ',1,2,1,0,0,2,'T',1,1,1",
        "0,0.10,50,0,0.14,50,0,0.16,50,1,0",
        "1.02,0,0",
        "1.0,0,0",
        "1.0,0,-30",
    ]
    data = written(raw(33, found))
    at = {x.from_bus: x for x in data.lines if x.to_bus == "bus_4_8_6_A_star"}
    assert [at[f"bus_{n}"].X for n in (4, 8, 6)] == pytest.approx([0.12, 0.08, 0.20])
    assert at["bus_4"].tap == 1.02
    assert at["bus_6"].shift == pytest.approx(-np.pi / 6)
    found["TRANSFORMER"][-5] = found["TRANSFORMER"][-5].replace("'T',1,", "'T',3,")
    flow = solved(written(raw(33, found)))
    assert flow.residual < 1e-9


def test_a_star_with_a_negative_reactance_is_a_transformer_of_three_windings(written):
    """Z12 = 0.10, Z23 = 0.04, Z31 = 0.16 on 100 MVA: 0.11, -0.01 and 0.05."""
    found = records(33)
    found["TRANSFORMER"] += [
        "4,8,6,'A ',1,1,1,0,0,2,'T',1,1,1",
        "0,0.10,50,0,0.04,50,0,0.16,50,1,0",
        "1.02,0,0",
        "1.0,0,0",
        "1.0,0,0",
    ]
    data = written(raw(33, found))
    (transformer,) = data.transformers
    assert "bus_4_8_6_A_star" not in data.buses
    by_bus = dict(zip(transformer.buses, transformer.X, strict=True))
    assert by_bus == {
        "bus_4": pytest.approx(0.11),
        "bus_8": pytest.approx(-0.01),
        "bus_6": pytest.approx(0.05),
    }


# -- elements that change form ---------------------------------------------------------------------


def test_loads_shunts_and_machines(written):
    found = records(33)
    found["LOAD"] += ["4,'2 ',1,1,1,10,4,20,8,5,-3,1,1,0", "4,'3 ',0,1,1,500,0"]
    found["FIXED SHUNT"] += ["5,'1 ',1,2.0,30.0", "5,'2 ',0,0,900"]
    found["SWITCHED SHUNT"] += [
        "6,1,0,1,1.05,0.95,0,100,'',40.0,4,10.0",
        "6,0,0,1,1,1,0,100,'',-5.0",
    ]
    found["GENERATOR"] += ["2,'2 ',20,0,9,-9,1.025,0,50", "3,'9 ',20,0,9,-9,1.025,0,50,0,1,0,0,1,0"]
    found["BUS"][3] = found["BUS"][3].replace(",1.0,0.0", ",1.1,0.0")
    data = written(raw(33, found))
    load = next(x for x in data.loads if x.bus == "bus_4")
    assert (load.p_mw, load.q_mvar) == (pytest.approx(10 + 20 * 1.1), pytest.approx(4 + 8 * 1.1))
    shunts = {s.bus: (s.g_mw, s.b_mvar) for s in data.shunts}
    assert shunts == {
        "bus_4": (5, pytest.approx(-3)),
        "bus_5": (pytest.approx(2), pytest.approx(30)),
        "bus_6": (0, pytest.approx(35)),
    }
    assert (data.generation["bus_2"].p_mw, data.generation["bus_2"].rating_mva) == (183, 242)
    assert (data.generation["bus_2"].q_min_mvar, data.generation["bus_2"].q_max_mvar) == (-309, 309)
    lines = raw(33, found).splitlines()
    listed = {
        text: place for place, text in ((p.place.rpartition(" ")[2], p.text) for p in data.changes)
    }
    (current,) = (n for text, n in listed.items() if text.startswith("load of constant current"))
    assert lines[int(current) - 1].startswith("4,'2 '")
    (held,) = (n for text, n in listed.items() if text.startswith("switched shunt: held"))
    assert lines[int(held) - 1].startswith("6,1,0")


def test_devices_may_be_left_out_and_an_unknown_section_must_be(written):
    found = records(33)
    found["TWO-TERMINAL DC"] += [
        "'DC 1',1,5,100,500",
        "5,2,15",
        "8,2,15",
        "'DC 2',1,5,100,500",
        "5,2,15",
        "8,2,15",
    ]
    found["FACTS DEVICE"] += ["'F',5,0,1"]
    text = raw(33, found)
    first = text.splitlines().index("'DC 1',1,5,100,500") + 1
    data = written(text, leave_out=["two-terminal dc", "facts device"])
    assert data.changes[0].place.rpartition("grid.raw, ")[2] == f"lines {first}, {first + 3}"
    assert data.changes[0].text == "two-terminal dc: left out, as leave_out says"
    with pytest.raises(InputError, match="leave_out: 'dc' is unknown; choose from two-terminal dc"):
        written(text, leave_out=["dc"])
    unknown = raw(33).replace(
        "END OF GNE DATA, BEGIN", "END OF GNE DATA, BEGIN WAVE TRAP DATA\n5,1\n0 / BEGIN"
    )
    with pytest.raises(
        InputError, match=r"no such elements: wave trap .*leave_out = \['wave trap'\]"
    ):
        written(unknown)
    assert written(unknown, leave_out=["wave trap"]).buses == written(raw(33)).buses


@pytest.mark.slow
def test_a_case_says_what_was_changed_and_has_modes(tmp_path, gfor):
    """Sauer and Pai's two electromechanical modes lie near 1.3 and 2 Hz with their inertias; ours are the defaults."""
    found = records(35)
    found["SWITCHED SHUNT"] += ["6,'1 ',1,0,1,1.05,0.95,0,0,100,'',10.0"]
    (tmp_path / "grid.raw").write_text(raw(35, found))
    (tmp_path / "case.toml").write_text(
        'name = "wscc"\n[components.grid]\nmodel = "grid"\n[network]\nraw = "grid.raw"\nstray_B = 0.05\n'
        '[power_flow]\ngrid = "grid"\n[units]\nalpha = 0.0\ngenerator = "synchronous_generator_st1"\n'
        'converter = "gfor"\n'
    )
    code, out, error = gfor("modes", tmp_path / "case.toml", "--json")
    assert code == 0, error
    assert "switched shunt: held at BINIT" in error
    said = [
        text for text in json.loads(out)["scenarios"][0]["warnings"] if "grid.raw, line" in text
    ]
    assert len(said) == 1
    assert "switched shunt: held at BINIT" in said[0]


# -- files that cannot be used ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "0,100.0,33",
            "0,100.0,22",
            r"grid.raw, line 1: the revision REV is 22; 23 to 36 are read: export",
        ),
        (
            "0,100.0,33",
            "2,100.0,33",
            r"line 1: IC is 2; it is 0 for a whole case, or 1 for changes",
        ),
        ("0,100.0,33", "0,0,33", r"line 1: the system base SBASE is 0 MVA; it must exceed 0"),
        ("0.01,0.085", "0.01,x", r"line \d+: X is 'x'; it must be a number"),
        (
            "2,'BUS 2     ',18.0,2",
            "1,'BUS 2     ',18.0,2",
            r"line 5: the bus 1 stands in line 4 as well",
        ),
        ("1,1,1,0,0,2", "1,4,1,0,0,2", r"line \d+: CZ is 4; known are 1 to 3"),
        (
            "BEGIN BRANCH DATA",
            "BEGIN RELAY DATA",
            r"grid.raw: the network has no such elements: relay \(line",
        ),
    ],
)
def test_a_file_that_cannot_be_used(old, new, words, written):
    text = raw()
    assert old in text
    with pytest.raises(InputError, match=words):
        written(text.replace(old, new, 1))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "it is empty; export the case from PSS/E as RAW"),
        (b"\x00\x01saved", r"it is no text, perhaps a saved case \(.sav\)"),
        (b'{"network": {}}', "network.bus has no rows; export the case"),
        (
            b"0,100,33,0,0,60\n\n\n1,'A',16,3\n",
            "grid.raw: it ends within its bus data; export the case once more",
        ),
        (b"hello\nworld\n", "line 1: the first record has no revision"),
        (b"0,100,36,0,0,60\na\nb\n1,2\n0\n2\n", "line 5: the line does not say which data begin"),
    ],
)
def test_a_file_of_another_kind(content, words, tmp_path):
    (tmp_path / "grid.raw").write_bytes(content)
    with pytest.raises(InputError, match=words):
        read_raw(tmp_path / "grid.raw")
    with pytest.raises(InputError, match="there is no such file"):
        read_raw(tmp_path / "none.raw")


@pytest.mark.parametrize(
    ("winding", "held"),
    [
        ("1.05,0,-30,100", False),
        ("1.05,0,-30,100,100,100,0", False),
        ("1.05,0,-30,100,100,100,1", True),
    ],
)
def test_only_a_transformer_that_is_controlled_is_held(winding, held, written):
    """A record that ends before COD has none."""
    data = written(
        with_transformer("4,1,0,'1 ',1,1,1,0,0,2,'T',1,1,1", "0.002,0.0576,100", winding, "1.0,0")
    )
    assert any("tap changer" in str(change) for change in data.changes) is held
