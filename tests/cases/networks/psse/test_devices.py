"""DC lines, FACTS devices, induction machines and GNE of a PSS/E file: loads with the powers of the solved state."""

import math

import numpy as np
import pytest
from scipy.optimize import fsolve

from orchestrator.cases.form.schema import NetworkTable
from orchestrator.cases.networks.data import network_data
from orchestrator.cases.networks.record_use import UseOfRecord
from orchestrator.core.errors import InputError
from tests.cases.networks.psse import BUSES, LINES, LOADS, MACHINES, TRANSFORMERS, raw, records
from tests.cases.networks.psse.older_texts import with_shunts_in_buses
from tests.cases.networks.psse.rawx_texts import network, rawx, table

DC = [
    "'TIE 1',1,8.0,60.0,250.0,0.0,0.0,0.1,'I',0.0,20,1.0",
    "5,1,20,12,0.0,12.0,230.0,0.92,1.0,1.5,0.51,0.00625,0,{node}0,0,'1',0.0",
    "8,1,22,17,0.0,12.0,230.0,0.92,1.0,1.5,0.51,0.00625,0,{node}0,0,'1',0.0",
]
VSC = [
    "'V 1',1,0.7,1,1.0",
    "5,2,2,-50.0,0.95,100.0,0.1,50.0,400,1200,0.1,100,-110,0,{node}100.0",
    "8,1,1,150.0,1.02,90.0,0.15,40.0,350,1200,0.15,150,-140,0,{node}100.0",
]
STATCON = ["'F 1',8,0,1,0,0,1.03,60.0,9999,0.9,1.1,1,0,0.05,100,1,0,0,0,0{node}"]
UPFC = ["'F 2',4,10,1,40.0,10.0,1.02,200.0,9999,0.9,1.1,1,0,0.05,100,1,0,0,0,0{node}"]
MOTOR = ["6,'1 ',1,1,0,1,1,1,1,2,20.0,230.0,2,15.0,1,1,1,1,1,0.02,0.1,3.0,0.03,0.12,999,999,0"]
KINDS = {
    "TWO-TERMINAL DC": DC,
    "VSC DC LINE": VSC,
    "FACTS DEVICE": STATCON,
    "INDUCTION MACHINE": MOTOR,
}


def lines_of(section, revision):
    node = {"FACTS DEVICE": ",0"}.get(section, "0,") if revision > 34 else ""
    return [line.replace("{node}", node) for line in KINDS[section]]


@pytest.fixture
def read(tmp_path):
    """Text of a RAW file, or lines of data by section → its network."""

    def from_content(content, revision=33, **keys):
        if not isinstance(content, str):
            found = records(revision)
            for section, lines in content.items():
                found[section] = [*found[section], *lines]
            content = raw(revision, found)
        (tmp_path / "grid.raw").write_text(content)
        return network_data(NetworkTable(raw="grid.raw", **keys), tmp_path)

    return from_content


def fed(data):
    """P + jQ that the devices feed, by the load's name [MW, Mvar]."""
    return {x.name: -complex(x.p_mw, x.q_mvar) for x in data.loads if x.name[:5] != "load_"}


def texts(data):
    return " ".join(problem.text for problem in data.changes)


# an independent solution: all equations of the network and of the devices at once, in rectangular voltages


def solved(devices, held=()):
    """Voltages of the WSCC system with devices, by bus, and what holds of voltages feed [Mvar].

    ``devices``: voltages and held reactive powers → P + jQ that is fed by bus [MW, Mvar]; ``held``: bus and pu."""
    numbers = sorted(BUSES)
    place = {number: k for k, number in enumerate(numbers)}
    matrix = np.zeros((9, 9), dtype=complex)
    branches = [*LINES, *((i, j, 0.0, x, 0.0) for i, j, x in TRANSFORMERS)]
    for i, j, r, x, b in branches:
        y = 1 / complex(r, x)
        for m, n, value in ((i, i, y + 0.5j * b), (j, j, y + 0.5j * b), (i, j, -y), (j, i, -y)):
            matrix[place[m], place[n]] += value

    def left(unknown):
        v = unknown[:9] + 1j * unknown[9:18]
        q = dict(zip((bus for bus, _ in held), unknown[20:], strict=True))
        power = np.array([-complex(*LOADS.get(n, (0, 0))) for n in numbers])
        for bus, value in devices(dict(zip(numbers, v, strict=True)), q).items():
            power[place[bus]] += value
        power[[1, 2]] += [complex(MACHINES[n][0], unknown[16 + n]) for n in (2, 3)]
        missing = v * (matrix @ v).conj() - power / 100
        free = [k for k in range(9) if numbers[k] != 1]
        machines = [abs(v[place[n]]) - MACHINES[n][1] for n in (2, 3)]
        holds = [abs(v[place[n]]) - pu for n, pu in held]
        reference = [v[0].real - MACHINES[1][1], v[0].imag]
        return [*missing[free].real, *missing[free].imag, *reference, *machines, *holds]

    start = [*[1.0] * 9, *[0.0] * 9, *[0.0] * (2 + len(held))]
    found, _, good, message = fsolve(left, start, full_output=True, xtol=1e-13)
    assert good == 1, message
    voltages = dict(zip(numbers, found[:9] + 1j * found[9:18], strict=True))
    return voltages, found[20:]


def bridge(kilovolts, current, v, ohm=12.0, base=230.0, ratio=0.92):
    """Q that a bridge draws: the first harmonic of its current, integrated over its waveform [Mvar]."""
    E = v * base * ratio
    cosine = (kilovolts + 3 / math.pi * ohm * current) / (3 * math.sqrt(2) / math.pi * E)
    angle = math.acos(cosine)
    end = math.acos(cosine - math.sqrt(2) * ohm * current / E)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    at = angle + (end - angle) * (nodes + 1) / 2
    rising = (end - angle) / 2 * weights * (math.cos(angle) - np.cos(at)) / (cosine - math.cos(end))
    falling = (end - angle) / 2 * weights - rising
    third = 2 * math.pi / 3
    flat = (np.exp(-1j * end) - np.exp(-1j * (angle + third))) / 1j
    wave = rising @ np.exp(-1j * at) + flat + falling @ np.exp(-1j * (at + third))
    harmonic = 2 / math.pi * current * wave
    return (1.5 * math.sqrt(2 / 3) * E * np.exp(-1j * math.pi / 3) * harmonic.conj()).imag


def test_a_dc_line_is_solved_with_the_network(read):
    """60 MW at the rectifier and 250 kV at the inverter: the current by hand, Q by the waveform of the bridge."""
    current = (math.sqrt(250**2 + 4 * 8 * 60) - 250) / 16
    rectifier = 250 + 8 * current
    assert rectifier * current == pytest.approx(60)

    def devices(v, _):
        return {
            5: complex(-60, -bridge(rectifier, current, abs(v[5]))),
            8: complex(250 * current, -bridge(250, current, abs(v[8]))),
        }

    voltages, _ = solved(devices)
    wanted = devices(voltages, {})
    found = fed(read({"TWO-TERMINAL DC": lines_of("TWO-TERMINAL DC", 33)}))
    assert found["dc_TIE_1_5"] == pytest.approx(wanted[5], abs=1e-4)
    assert found["dc_TIE_1_8"] == pytest.approx(wanted[8], abs=1e-4)
    assert wanted[8].imag < -15  # no small thing


def test_a_vsc_line_feeds_by_its_losses_and_holds_its_voltage(read):
    """50 MW drawn at a power factor of 0.95; the other end feeds them less both converters' losses and the line's."""
    current = 0.0
    for _ in range(50):  # from the power's converter to the other
        current = (50 - max(0.05, 0.1 + 0.1 * current)) / (150 + 0.7 * current)
    p = 150 * current - max(0.04, 0.09 + 0.15 * current)
    drawn = complex(-50, -50 * math.tan(math.acos(0.95)))
    _, (q,) = solved(lambda _, q: {5: drawn, 8: complex(p, q[8])}, [(8, 1.02)])
    found = fed(read({"VSC DC LINE": lines_of("VSC DC LINE", 33)}))
    assert found["vsc_V_1_5"] == pytest.approx(drawn, abs=1e-6)
    assert found["vsc_V_1_8"] == pytest.approx(complex(p, q), abs=1e-4)
    assert 48 < p < 50


def test_a_converter_at_its_limit_feeds_the_limit_and_says_so(read):
    lines = [line.replace("150,-140", "2.5,-140") for line in lines_of("VSC DC LINE", 33)]
    data = read({"VSC DC LINE": lines})
    assert fed(data)["vsc_V_1_8"].imag == pytest.approx(2.5)
    assert "cannot hold within its limits" in texts(data)
    assert "cannot hold" not in texts(read({"VSC DC LINE": lines_of("VSC DC LINE", 33)}))


def test_a_statcon_holds_its_voltage_within_its_rating(read):
    _, (q,) = solved(lambda _, q: {8: 1j * q[8]}, [(8, 1.03)])
    assert fed(read({"FACTS DEVICE": lines_of("FACTS DEVICE", 33)})) == {
        "facts_F_1_8": pytest.approx(1j * q, abs=1e-5)
    }
    weak = [STATCON[0].replace("60.0", "10.0").replace("{node}", "")]
    voltages, _ = solved(lambda v, _: {8: 10j * abs(v[8])})
    data = read({"FACTS DEVICE": weak})
    assert fed(data)["facts_F_1_8"] == pytest.approx(10j * abs(voltages[8]), abs=1e-5)
    assert abs(voltages[8]) < 1.03
    assert "cannot hold within its limits" in texts(data)


def test_a_series_part_delivers_its_power_and_the_shunt_part_brings_it(read):
    more = {"BUS": ["10,'FAR',230,1,1,1,1,1,0"], "BRANCH": ["10,5,'1 ',0.01,0.085,0"]}
    found = fed(read({**more, "FACTS DEVICE": [UPFC[0].replace("{node}", "")]}))
    assert found["facts_F_2_10"] == 40 + 10j
    assert found["facts_F_2_4"].real == -40


def test_the_shunt_part_at_its_limit_draws_the_series_parts_power_within_its_rating(read):
    """As in the solutions of PSS/E's example (SAVNW with a UPFC at bus 153): SHMX limits the apparent power."""
    rating, series = 1.0, 40 + 10j
    record = UPFC[0].replace("{node}", "").replace("4,10,1", "8,5,1").replace("200.0", "1.0")
    found = fed(read({"FACTS DEVICE": [record.replace("1.02", "1.08")]}))

    def powers(v, _):
        into = v[8] * series / v[5]
        shunt = math.sqrt((rating * abs(v[8])) ** 2 - (into.real - series.real) ** 2)
        return {5: series, 8: complex(-series.real, shunt - into.imag)}

    voltages, _ = solved(powers)
    assert found["facts_F_2_8"] == pytest.approx(powers(voltages, None)[8], abs=1e-4)
    inserted = (voltages[8] * series / voltages[5]).real - series.real
    assert abs(inserted) > 0.1 * rating


def test_a_bypassed_series_part_is_a_branch_and_an_impedance_too(read):
    far = {"BUS": ["10,'FAR',230,1,1,1,1,1,0"]}
    bypassed = UPFC[0].replace("{node}", "").replace("4,10,1", "4,10,2")
    data = read({**far, "FACTS DEVICE": [bypassed]})
    assert [x.X for x in data.lines if x.to_bus == "bus_10"] == pytest.approx([1.1e-5])
    series = bypassed.replace("4,10,2", "4,10,3").replace("1,0,0,0,0", "1,0.01,0.2,0,0")
    (line,) = (x for x in read({**far, "FACTS DEVICE": [series]}).lines if x.to_bus == "bus_10")
    assert (line.R, line.X) == (0.01, 0.2)


@pytest.mark.parametrize("mode", range(4, 9))
def test_a_series_voltage_and_linked_devices_feed_what_the_solution_lacks(read, mode):
    """MODE 4 to 8: what the device does is not in its record; the file's solution tells what it fed at both ends."""
    fed_there = {8: 12 - 7j, 5: -12 + 3j}
    voltages, _ = solved(lambda _v, _q: fed_there)
    found = records(33)
    found["BUS"] = in_solution(found["BUS"], voltages)
    record = UPFC[0].replace("{node}", "").replace("4,10,1", f"8,5,{mode}")
    found["FACTS DEVICE"] = [record]
    data = read(raw(33, found))
    wanted = {f"facts_F_2_{bus}": pytest.approx(s, abs=1e-4) for bus, s in fed_there.items()}
    assert fed(data) == wanted
    assert data.misfit == ""


def test_a_series_voltage_without_a_solution_is_refused_with_a_remedy_that_works(read):
    far = {"BUS": ["10,'FAR',230,1,1,1,1,1,0"], "BRANCH": ["10,5,'1 ',0.01,0.085,0"]}
    voltage = {**far, "FACTS DEVICE": [UPFC[0].replace("{node}", "").replace("4,10,1", "4,10,4")]}
    with pytest.raises(
        InputError, match=r"file is not solved; write leave_out = \['facts device'\]"
    ):
        read(voltage)
    assert not fed(read(voltage, leave_out=["facts device"]))


@pytest.mark.parametrize("far", [10, 0])
def test_a_mode_that_is_none_is_named(far, read):
    buses = {"BUS": ["10,'FAR',230,1,1,1,1,1,0"], "BRANCH": ["10,5,'1 ',0.01,0.085,0"]}
    record = UPFC[0].replace("{node}", "").replace("4,10,1", f"4,{far},9")
    with pytest.raises(InputError, match="MODE is 9: no mode of PSS/E"):
        read({**buses, "FACTS DEVICE": [record]})


def test_an_induction_machine_draws_what_its_circuit_does(read):
    """Electrical power of 15 MW at the solved voltage: a slip, and with it Q."""
    data = read({"INDUCTION MACHINE": MOTOR})
    (drawn,) = (-value for value in fed(data).values())
    voltages, _ = solved(lambda _v, _q: {6: -drawn})
    v = abs(voltages[6])

    def at(slip):
        rotor = complex(0.03 / slip, 0.12)
        return 20 * (v**2 / (complex(0.02, 0.1) + rotor * 3j / (rotor + 3j))).conjugate()

    slip = fsolve(lambda s: at(s[0]).real - 15, [0.02])[0]
    assert 0.01 < slip < 0.05
    assert drawn == pytest.approx(at(slip), abs=1e-4)


def test_an_induction_generator_feeds_and_draws_reactive_power(read):
    lines = [MOTOR[0].replace("15.0", "-15.0")]
    (value,) = fed(read({"INDUCTION MACHINE": lines})).values()
    assert value.real == pytest.approx(15)
    assert value.imag < -5


def test_a_machine_that_cannot_give_its_power_is_refused(read):
    lines = [MOTOR[0].replace("15.0", "150.0")]
    with pytest.raises(InputError, match=r"cannot give PSET = 150 MW .*leave_out = \['induction"):
        read({"INDUCTION MACHINE": lines})
    assert not fed(read({"INDUCTION MACHINE": lines}, leave_out=["induction machine"]))


def test_a_standard_design_is_asked_about(read):
    data = read({"INDUCTION MACHINE": ["6,'1 ',1,1,2,1,1,1,1,1,10.0,230.0,1,10.0,1,1,1,1,1"]})
    assert fed(data)["induction_1_6"] == pytest.approx(complex(-10.58, -5.82), abs=0.01)
    assert "names a standard design, whose circuit the file does not hold" in texts(data)


@pytest.mark.parametrize("section", KINDS)
@pytest.mark.parametrize("revision", [33, 34, 35])
def test_every_revision_has_the_same_devices(section, revision, read):
    usual = fed(read({section: lines_of(section, 33)}))
    data = read({section: lines_of(section, revision)}, revision)
    assert usual
    assert fed(data) == {name: pytest.approx(value, abs=1e-6) for name, value in usual.items()}
    (use,) = (x for x in data.records if x.kind == section.lower())
    assert use.use is UseOfRecord.HELD
    assert " MW and " in use.why
    assert "without dynamics, at the solved powers" in texts(data)


@pytest.mark.parametrize("revision", [29, 30])
def test_old_revisions_have_the_same_devices(revision, read):
    """They have no titles: DC lines are the seventh section, FACTS devices the sixteenth."""
    head = with_shunts_in_buses(revision).rstrip("\n").removesuffix("\n0" * 11)
    sections = [[]] * 11
    sections[1] = lines_of("TWO-TERMINAL DC", 33)
    sections[10] = lines_of("FACTS DEVICE", 33)
    text = "\n".join([head, *(line for lines in sections for line in [*lines, "0"]), ""])
    usual = fed(read(head + "\n0" * 11 + "\n"))
    found = fed(read(text))
    assert not usual
    assert list(found) == ["dc_TIE_1_5", "dc_TIE_1_8", "facts_F_1_8"]
    assert found["dc_TIE_1_5"].real == pytest.approx(-60)


@pytest.mark.parametrize("section", KINDS)
def test_what_is_out_of_service_feeds_nothing(section, read):
    lines = lines_of(section, 33)
    column = {"FACTS DEVICE": 3, "INDUCTION MACHINE": 2}.get(section, 1)
    fields = lines[0].split(",")
    fields[column] = "0"
    data = read({section: [",".join(fields), *lines[1:]]})
    assert not fed(data)
    (use,) = (x for x in data.records if x.kind == section.lower())
    assert (use.use, use.why) == (UseOfRecord.NOT_USED, "out of service: its status is 0")


@pytest.mark.parametrize("section", KINDS)
def test_a_device_at_a_bus_that_is_not_there_is_not_used_and_told(section, read):
    lines = lines_of(section, 33)
    at = {"FACTS DEVICE": 1}.get(section, 0)
    row = -1 if len(lines) > 1 else 0
    fields = lines[row].split(",")
    fields[at] = "77"
    lines[row] = ",".join(fields)
    data = read({section: lines})
    assert not fed(data)
    assert "not used: bus 77 is not in the file" in texts(data)


def test_the_case_says_how_devices_follow_the_voltage(read):
    section = {"TWO-TERMINAL DC": lines_of("TWO-TERMINAL DC", 33)}
    usual = read(section)
    assert "write which, such as device_model" in texts(usual)
    assert {x.active.p for x in usual.loads if x.name.startswith("dc_")} == {1.0}
    chosen = read(section, device_model={"active": "current", "reactive": "impedance"})
    assert "device_model" not in texts(chosen)
    assert {(x.active.i, x.reactive.z) for x in chosen.loads if x.name.startswith("dc_")} == {
        (1.0, 1.0)
    }


def test_lines_that_cannot_be_are_refused_with_their_line(read):
    lines = lines_of("TWO-TERMINAL DC", 33)
    lines[0] = lines[0].replace("60.0,250.0", "6000.0,-2.0")
    with pytest.raises(InputError, match="VSCHD is -2 kV; it must exceed 0"):
        read({"TWO-TERMINAL DC": lines})
    lines[0] = (
        lines[0].replace("8.0,6000.0,-2.0", "2000.0,-60.0,25.0").replace(",0.0,0.1", ",99.0,0.1")
    )
    with pytest.raises(InputError, match=r"'TIE 1' cannot carry SETVL = -60 .*leave_out"):
        read({"TWO-TERMINAL DC": lines})
    lines = lines_of("VSC DC LINE", 33)
    lines[2] = lines[2].replace("1.02", "102")
    with pytest.raises(InputError, match="ACSET is 102 pu with MODE = 1"):
        read({"VSC DC LINE": lines})


def test_two_converters_that_set_a_power_are_asked_about(read):
    lines = lines_of("VSC DC LINE", 33)
    lines[2] = lines[2].replace("8,1,1,150.0", "8,2,1,45.0")
    data = read({"VSC DC LINE": lines})
    assert fed(data)["vsc_V_1_8"].real == 45
    assert "(TYPE is 2 and 2), where PSS/E wants one with TYPE = 1" in texts(data)


def test_a_part_that_only_a_dc_line_joins_is_left_out_and_told(read):
    """Bus 10 with its machine has a frequency of its own; what the line feeds here stays."""
    other = {
        "BUS": ["10,'FAR',230,3,1,1,1,1,0"],
        "GENERATOR": ["10,'1 ',30,0,90,-90,1.0,0,100,0,0.2,0,0,1,1,100,100,0,1,1"],
        "TWO-TERMINAL DC": [
            line.replace("8,1,22", "10,1,22") for line in lines_of("TWO-TERMINAL DC", 33)
        ],
    }
    data = read(other)
    assert "bus_10" not in data.buses
    assert {m.bus for m in data.machines} == {1, 2, 3}
    assert data.idle_machines == {(10, "1")}  # of whose dynamics nothing is asked
    assert list(fed(data)) == ["dc_TIE_1_5"]
    assert "only DC lines lead to bus_10: a part with a frequency of its own" in texts(data)
    assert data.slack == "bus_1"


def in_solution(lines, values):
    """The buses of a file with the angles and magnitudes of a solution."""
    found = []
    for line in lines:
        fields = line.split(",")
        v = values[int(fields[0])]
        fields[7:9] = f"{abs(v):.9f}", f"{math.degrees(np.angle(v)):.8f}"
        found.append(",".join(fields))
    return found


GNE = ["'G 1','OWN',1,8,0,3,1,0,1,1,8", "1.0,2.0,3.0", "5"]


def test_a_gne_feeds_what_the_solution_lacks(read):
    """Its model is the user's, and not in the file; the file's solution tells what it fed."""
    voltages, _ = solved(lambda _v, _q: {8: 12 - 7j})
    found = records(33)
    found["BUS"] = in_solution(found["BUS"], voltages)
    found["GNE"] = GNE
    data = read(raw(33, found))
    assert fed(data) == {"gne_G_1_8": pytest.approx(12 - 7j, abs=1e-4)}
    assert data.misfit == ""
    found["GNE"] = [GNE[0].replace("3,1,0,1,1,8", "3,1,0,0,1,8"), *GNE[1:]]
    assert not fed(read(raw(33, found)))


def test_a_gne_without_a_solution_is_refused_with_a_remedy_that_works(read):
    with pytest.raises(InputError, match=r"the GNE device 'G 1' feeds at bus 8: .* not solved"):
        read({"GNE": GNE})
    assert not fed(read({"GNE": GNE}, leave_out=["gne"]))
    with pytest.raises(InputError, match=r"no record of a GNE.*leave_out = \['gne'\]"):
        read({"GNE": ["something"]})


def test_a_solved_file_with_devices_fits_its_data(read):
    """The file's voltages are those that the devices give: nothing is asked, and a slip is."""
    q_line = lines_of("TWO-TERMINAL DC", 33)
    first = fed(read({"TWO-TERMINAL DC": q_line}))
    powers = {5: first["dc_TIE_1_5"], 8: first["dc_TIE_1_8"]}
    voltages, _ = solved(lambda _v, _q: powers)
    found = records(33)
    found["BUS"] = in_solution(found["BUS"], voltages)
    found["TWO-TERMINAL DC"] = q_line
    assert read(raw(33, found)).misfit == ""
    found["TWO-TERMINAL DC"] = [q_line[0].replace("60.0,250", "70.0,250"), *q_line[1:]]
    assert "bus_5" in read(raw(33, found)).misfit


MULTI = [
    "'M 1',3,3,2,1,8,250.0,0",
    "5,2,20,8,0,10.0,230.0,0.5,1.0,1.1,0.9,0.01,40.0,1,0.1,1",
    "6,2,20,8,0,10.0,230.0,0.5,1.0,1.1,0.9,0.01,30.0,1,0.1,1",
    "8,2,20,17,0,10.0,230.0,0.5,1.0,1.1,0.9,0.01,250.0,1,0.1,1",
    "1,5,1,1,'A',0,0.0,1",
    "2,6,1,1,'B',0,0.0,1",
    "3,8,1,1,'C',0,0.0,1",
    "1,3,'1',{met}20.0,0.0",
    "2,3,'1',{met}10.0,0.0",
]


@pytest.mark.parametrize("metered", ["", "1,"])
def test_terminals_of_a_dc_network_share_its_losses(metered, read):
    """Two rectifiers feed one inverter of 250 kV, over 20 and 10 ohms; links have a metered end since revision 31."""
    data = read({"MULTI-TERMINAL DC": [line.replace("{met}", metered) for line in MULTI]})
    found = fed(data)
    currents = [(math.sqrt(250**2 + 4 * r * p) - 250) / (2 * r) for p, r in ((40, 20), (30, 10))]
    powers = [found[f"dc_M_1_{bus}"].real for bus in (5, 6, 8)]
    assert powers == pytest.approx([-40, -30, 250 * sum(currents)], abs=1e-6)
    assert all(value.imag < -5 for value in found.values())
    lost = [line.replace("{met}", metered) for line in MULTI[:-1]]
    with pytest.raises(InputError, match=r"which do not fit the lines that follow.*leave_out"):
        read({"MULTI-TERMINAL DC": lost})


@pytest.mark.parametrize("bridges", ["n", "nbrdg"])  # PSS/E 35 writes the latter
def test_rawx_has_the_same_multi_terminal_network_and_gne(bridges, tmp_path, read):
    usual = fed(read({"MULTI-TERMINAL DC": [line.replace("{met}", "1,") for line in MULTI]}))
    rows = [[x.strip("'") for x in line.replace("{met}", "1,").split(",")] for line in MULTI]
    whole = network()
    whole["ntermdc"] = table("name nconv ndcbs ndcln mdc vconv vcmod vconvn", rows[:1])
    names = f"name ib {bridges} angmx angmn rc xc ebas tr tap tpmx tpmn tstp setvl dcpf marg cnvcod"
    whole["ntermdcconv"] = table(names, [["M 1", *row] for row in rows[1:4]])
    names = "name idc ib area zone dcname idc2 rgrnd owner"
    whole["ntermdcbus"] = table(names, [["M 1", *row] for row in rows[4:7]])
    whole["ntermdclink"] = table(
        "name idc jdc dcckt met rdc ldc", [["M 1", *row] for row in rows[7:]]
    )
    names = "name model nterm bus1 bus2 nreal nintg nchar stat owner nmet real1 intg1"
    whole["gne"] = table(names, [["G", "OWN", 1, 8, 0, 1, 1, 0, 0, 1, 8, 1.0, 5]])
    (tmp_path / "nine.rawx").write_text(rawx(whole))
    data = network_data(NetworkTable(raw="nine.rawx"), tmp_path)
    assert fed(data) == {name: pytest.approx(value, abs=1e-6) for name, value in usual.items()}
    told = {x.kind: x.why for x in data.records if x.kind == "gne"}
    assert told == {"gne": "out of service: its status is 0"}


def test_two_devices_of_one_name_are_both_used_and_asked_about(read):
    other = STATCON[0].replace("{node}", "").replace("'F 1',8", "'F 1',5")
    data = read({"FACTS DEVICE": [*lines_of("FACTS DEVICE", 33), other]})
    assert set(fed(data)) == {"facts_F_1_8", "facts_F_1_5"}
    assert "a second facts device of the name 'F 1'" in texts(data)
    motors = [MOTOR[0], MOTOR[0].replace("6,'1 '", "5,'1 '")]
    assert "a second" not in texts(read({"INDUCTION MACHINE": motors}))


def test_a_name_of_any_letters_becomes_one_of_ours(read):
    lines = [line.replace("'F 1'", "'Süd/3 #'") for line in lines_of("FACTS DEVICE", 33)]
    assert list(fed(read({"FACTS DEVICE": lines}))) == ["facts_S_d_3_8"]


def test_a_rating_leaves_room_for_reactive_power(read):
    """SMAX of 60 MVA beside 49 MW; beyond it nothing is left, which is said."""
    weak = [line.replace("1.02,90", "1.2,90") for line in lines_of("VSC DC LINE", 33)]
    small = [line.replace("40.0,350,1200", "40.0,60,1200") for line in weak]
    value = fed(read({"VSC DC LINE": small}))["vsc_V_1_8"]
    assert abs(value) == pytest.approx(60.0)
    assert value.imag > 30
    tiny = [line.replace("40.0,350,1200", "40.0,45,1200") for line in weak]
    data = read({"VSC DC LINE": tiny})
    assert fed(data)["vsc_V_1_8"].imag == pytest.approx(0.0, abs=1e-9)
    assert "takes the whole rating (SMAX, IMAX)" in texts(data)


def test_both_ends_at_buses_that_are_one_are_two_loads(read):
    """A line without impedance joins them; the DC line's losses are what both feed together."""
    current = (math.sqrt(250**2 + 4 * 8 * 60) - 250) / 16
    join = ["5,8,'1 ',0,1e-6,0,0,0,0,0,0,0,0,1,1,0,1,1"]
    found = fed(read({"TWO-TERMINAL DC": lines_of("TWO-TERMINAL DC", 33), "BRANCH": join}))
    assert list(found) == ["dc_TIE_1_5", "dc_TIE_1_5_2"]
    assert sum(found.values()).real == pytest.approx(-8 * current**2)


def test_a_dc_line_from_a_bus_to_itself_is_refused_and_the_remedy_works(read):
    lines = [line.replace("8,1,22", "5,1,22") for line in lines_of("TWO-TERMINAL DC", 33)]
    number = raw(33, records(33) | {"TWO-TERMINAL DC": lines}).splitlines().index(lines[0]) + 1
    words = rf"line {number}: the DC line 'TIE 1' has its rectifier and its inverter at one bus, 5:"
    with pytest.raises(InputError, match=words) as refused:
        read({"TWO-TERMINAL DC": lines})
    assert "leave_out = ['two-terminal dc']" in str(refused.value).replace('"', "'")
    assert not fed(read({"TWO-TERMINAL DC": lines}, leave_out=("two-terminal dc",)))
