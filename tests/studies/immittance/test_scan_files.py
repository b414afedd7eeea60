"""Scans in the forms of Z-tool and IMTB: read, written, and refused with what is wrong."""

import math

import numpy as np
import pytest

from orchestrator.core.errors import InputError
from orchestrator.studies.immittance import scan_files
from orchestrator.studies.immittance.scan import (
    PortPoint,
    Scan,
    check_sign,
    in_own_form,
    other_q_axis,
)
from orchestrator.studies.immittance.scan_files import read_scan, write_ztool
from tests.studies.immittance.plants import Line, constant_power, random_plant

F = np.geomspace(1, 500, 120)
NO_CROSS = (
    "were dq and qd left at 0, or has one the wrong sign? They show no reactance where dd and qq do"
)


def write_imtb(scan, path, name="Zdut"):
    """The impedances of a scan of one port in siemens, in dq, as IMTB writes them."""
    elements = ("11", "12", "21", "22")
    columns = [
        f"{name}_dq_{e}_{part}"
        for e in elements
        for part in ("re", "im", "abs", "dB", "pha_rad", "pha_deg")
    ]
    lines = [",".join(["f", *columns])]
    for f, matrix in zip(
        scan.frequencies.tolist(), scan.impedance.reshape(-1, 4).tolist(), strict=True
    ):
        cells = [f]
        for z in matrix:
            phase = math.atan2(z.imag, z.real)
            cells += [
                z.real,
                z.imag,
                abs(z),
                20 * math.log10(abs(z) or 1e-300),
                phase,
                math.degrees(phase),
            ]
        lines.append(",".join(map(repr, cells)))
    path.write_text("\n".join(lines) + "\n")


def a_scan(ports=("PCC-1",), **more):
    Y = constant_power().admittance(F)
    values = np.kron(np.ones((len(ports), len(ports))), Y) if len(ports) > 1 else Y
    return Scan("made", F, values, ports, **more)


def test_a_scan_comes_back_from_a_file_of_z_tool_with_its_operating_point(tmp_path):
    point = PortPoint(206.9, 99.3, 6.6, 0.549)
    write_ztool(a_scan(points={"PCC-1": point}), tmp_path / "case#Y_AC#PCC-1#.txt")
    back = read_scan(tmp_path / "case#Y_AC#PCC-1#.txt", 50.0)
    assert back.values == pytest.approx(a_scan().values, rel=1e-15)
    assert back.frequencies == pytest.approx(F, rel=1e-15)
    assert back.points["PCC-1"] == point
    assert back.questions == (f"case#Y_AC#PCC-1#.txt: {NO_CROSS}",)  # as its plant is diagonal


def test_a_circuit_tells_frequencies_in_rad_s_and_elements_that_say_nothing(tmp_path):
    Y = np.linalg.inv(Line(0.05, 0.002).impedance(F))
    alone, one_sign = Y * np.eye(2), Y * np.array([[1, 1], [-1, 1]])
    for values, asked in (
        (Y, ()),
        (alone, (f"a.txt: {NO_CROSS}",)),
        (one_sign, (f"a.txt: {NO_CROSS}",)),
    ):
        write_ztool(Scan("line", F, values, ("P",)), tmp_path / "a.txt")
        assert read_scan(tmp_path / "a.txt", 50.0).questions == asked
    write_ztool(Scan("line", 2 * np.pi * F, Y, ("P",)), tmp_path / "a.txt")
    with pytest.raises(
        InputError,
        match=r"turns 6.3 times as fast as at the rated 50 Hz: are its frequencies in rad/s",
    ):
        read_scan(tmp_path / "a.txt", 50.0)


def test_a_scan_comes_back_from_a_file_of_imtb_as_another_writes_it(tmp_path):
    line = Scan("line", F, np.linalg.inv(Line(0.05, 0.002).impedance(F)), ("P",))
    scan_files.write_imtb(line, tmp_path / "a.csv")
    write_imtb(line, tmp_path / "b.csv")
    ours, other = (read_scan(tmp_path / name, 50.0) for name in ("a.csv", "b.csv"))
    assert ours.values == pytest.approx(line.values, rel=1e-12)
    assert (ours.values == other.values).all()
    for wrong in (line.scaled(1.0, "pu"), a_scan(ports=("A", "B"))):
        with pytest.raises(InputError, match="IMTB's form is of one port in ohms"):
            scan_files.write_imtb(wrong, tmp_path / "c.csv")


def test_several_ports_keep_their_order(tmp_path):
    write_ztool(a_scan(("A-1", "B-2")), tmp_path / "x#Y_AC#A-1#B-2#.txt")
    assert (
        (tmp_path / "x#Y_AC#A-1#B-2#.txt").read_text().startswith("f\tA-1_d\tA-1_q\tB-2_d\tB-2_q\n")
    )
    back = read_scan(tmp_path / "x#Y_AC#A-1#B-2#.txt", 50.0)
    assert back.ports == ("A-1", "B-2")
    assert back.values == pytest.approx(a_scan(("A-1", "B-2")).values, rel=1e-15)


def test_the_q_axis_of_z_tool_lags_and_that_of_imtb_leads(tmp_path):
    line = Scan("line", F, np.linalg.inv(Line(0.05, 0.002).impedance(F)), ("P",))
    write_ztool(line, tmp_path / "a.txt")
    cells = (tmp_path / "a.txt").read_text().splitlines()[1].split("\t")
    Z = np.linalg.inv(np.array([complex(c.strip().strip("()")) for c in cells[1:]]).reshape(2, 2))
    assert Z[0, 1].real > 0 > Z[1, 0].real
    write_imtb(line, tmp_path / "b.csv")
    for name in ("a.txt", "b.csv"):
        assert read_scan(tmp_path / name, 50.0).values == pytest.approx(line.values, rel=1e-12)


def test_a_file_with_the_other_q_axis_is_refused(tmp_path):
    line = Scan("line", F, other_q_axis(np.linalg.inv(Line(0.05, 0.002).impedance(F))), ("P",))
    write_ztool(line, tmp_path / "a.txt")
    with pytest.raises(InputError, match="q axis leads the d axis, where this form has it lagging"):
        read_scan(tmp_path / "a.txt", 50.0)


def test_the_axes_are_known_behind_a_filter_that_resonates(tmp_path):
    """The capacitor of an LC filter turns the sign of the reactance around its resonance."""
    f = np.geomspace(1, 1000, 300)
    z = {}
    for sign in (1, -1):
        s = 2j * np.pi * (f + sign * 50)
        inner = 1 / (s * 4.8e-4 + 1 / (0.02 + s * 4.8e-4))
        z[sign] = s * 4.8e-4 + inner
    along, cross = (z[1] + z[-1]) / 2, (z[1] - z[-1]) / 2j
    Z = np.stack([np.stack([along, -cross], -1), np.stack([cross, along], -1)], -2)
    right = Scan("filter", f, np.linalg.inv(Z), ("P",))
    write_ztool(right, tmp_path / "right.txt")
    write_ztool(Scan("filter", f, other_q_axis(right.values), ("P",)), tmp_path / "wrong.txt")
    assert read_scan(tmp_path / "right.txt", 50.0).values == pytest.approx(right.values, rel=1e-9)
    with pytest.raises(InputError, match="q axis leads the d axis"):
        read_scan(tmp_path / "wrong.txt", 50.0)


def test_rows_of_direct_current_and_mirrored_ones_are_left_out(tmp_path):
    write_ztool(a_scan(), tmp_path / "a.txt")
    head, first, *others = (tmp_path / "a.txt").read_text().splitlines()
    values = first.partition("\t")[2]
    more = [f"(-1+0j)\t{values}", f"(0+0j)\t{values}", first, *others]
    (tmp_path / "b.txt").write_text("\n".join([head, *more]) + "\n")
    one, other = (read_scan(tmp_path / name, 50.0) for name in ("a.txt", "b.txt"))
    assert (one.frequencies == other.frequencies).all()
    assert (one.values == other.values).all()


def test_the_axes_are_known_of_a_device_that_ends_in_a_capacitor(tmp_path):
    f, J = np.geomspace(1, 1500, 300), np.array([[0, -1], [1, 0]])
    capacitor = 0.5 * (1j * f[:, None, None] / 50 * np.eye(2) + J)
    Y = constant_power(T=0.004).admittance(f) + 0.4 * np.eye(2) + capacitor
    write_ztool(Scan("filter", f, Y, ("P",)), tmp_path / "right.txt")
    right = read_scan(tmp_path / "right.txt", 50.0)
    assert right.values == pytest.approx(Y, rel=1e-9)
    assert not right.questions
    write_ztool(Scan("filter", f, other_q_axis(Y), ("P",)), tmp_path / "wrong.txt")
    with pytest.raises(InputError, match="q axis leads the d axis"):
        read_scan(tmp_path / "wrong.txt", 50.0)
    write_ztool(Scan("filter", 2 * np.pi * f, Y, ("P",)), tmp_path / "radians.txt")
    with pytest.raises(InputError, match="are its frequencies in rad/s"):
        read_scan(tmp_path / "radians.txt", 50.0)


def test_the_axes_are_known_of_a_device_whose_capacitor_is_damped(tmp_path):
    """From 280 Hz on its admittance is flat: neither it nor the impedance rises as a coil's."""
    f, eye, J = np.geomspace(1, 1500, 300), np.eye(2), np.array([[0, -1], [1, 0]])
    capacitor = 0.557 * (1j * f[:, None, None] / 50 * eye + J)
    lag = 1 + 2j * np.pi * f[:, None, None] * 0.005
    Y = np.array([[1.092, 0.506], [0.506, -1.092]]) / lag + 0.18 * eye
    Y = Y + np.linalg.inv(0.322 * eye + np.linalg.inv(capacitor))
    write_ztool(Scan("filter", f, Y, ("P",)), tmp_path / "right.txt")
    assert not read_scan(tmp_path / "right.txt", 50.0).questions
    write_ztool(Scan("filter", f, other_q_axis(Y), ("P",)), tmp_path / "wrong.txt")
    with pytest.raises(InputError, match="q axis leads the d axis"):
        read_scan(tmp_path / "wrong.txt", 50.0)


def test_fast_control_in_its_own_frame_is_not_taken_for_another_axis():
    rng, f = np.random.default_rng(5), np.geomspace(1, 1500, 200)
    for _ in range(40):
        values = random_plant(rng).admittance(f)
        assert (in_own_form("a", f, values, 50.0, q_leads=True)[0] == values).all()


def test_alpha_beta_impedances_are_those_of_the_sequences(tmp_path):
    """Z₊₊ at f + 50 Hz and Z₋₋ at f − 50 Hz, from the definitions of both sequences."""
    f = np.linspace(1, 300, 90)
    Z = np.linalg.inv(constant_power().admittance(f)) + Line(0.05, 0.002).impedance(f)
    plus = (Z[:, 0, 0] + Z[:, 1, 1] + 1j * (Z[:, 1, 0] - Z[:, 0, 1])) / 2
    minus = (Z[:, 0, 0] + Z[:, 1, 1] - 1j * (Z[:, 1, 0] - Z[:, 0, 1])) / 2
    to_minus = (Z[:, 0, 0] - Z[:, 1, 1] + 1j * (Z[:, 0, 1] + Z[:, 1, 0])) / 2
    to_plus = (Z[:, 0, 0] - Z[:, 1, 1] - 1j * (Z[:, 0, 1] + Z[:, 1, 0])) / 2
    head = ",".join(
        ["f", *(f"Zdut_ab_{e}_{p}" for e in ("11", "12", "21", "22") for p in ("re", "im"))]
    )
    rows = [
        ",".join(map(repr, [x + 50, *np.array([[a.real, a.imag] for a in m]).ravel().tolist()]))
        for x, m in zip(
            f.tolist(), np.stack([plus, to_minus, to_plus, minus], 1).tolist(), strict=True
        )
    ]
    (tmp_path / "IM_Zab_MIMO_x.csv").write_text("\n".join([head, *rows]) + "\n")
    assert np.linalg.inv(read_scan(tmp_path / "IM_Zab_MIMO_x.csv", 50.0).values) == pytest.approx(
        Z, rel=1e-9
    )


def spoiled(tmp_path, change):
    write_ztool(a_scan(), tmp_path / "good.txt")
    lines = (tmp_path / "good.txt").read_text().splitlines()
    (tmp_path / "bad.txt").write_text("\n".join(change(lines)) + "\n")
    return tmp_path / "bad.txt"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda s: [*s[:50], s[50][:80]], "line 51: there are 2 numbers"),
        (lambda s: [*s[:50], s[48], *s[50:]], "do not rise"),
        (lambda s: [*s[:50], s[49], *s[50:]], "do not rise"),
        (lambda s: [*s[:9], s[9].replace("e-0", "x-0"), *s[10:]], "line 10: complex"),
        (
            lambda s: [*s[:9], s[9].replace(s[9].split("\t")[1], " (nan+0j)"), *s[10:]],
            "not a finite number",
        ),
        (lambda s: [s[0].replace("PCC-1_q", "PCC-1_dc"), *s[1:]], "PCC-1_dc are DC"),
        (lambda s: [s[0].replace("PCC-1_q", "PCC-2_q"), *s[1:]], "d and q of one port"),
        (lambda s: ["frequency;a;b", *s[1:]], "of no known form of scans"),
        (lambda s: s[:5], "there are 4 frequencies"),
    ],
)
def test_what_is_wrong_in_a_file_is_one_error(tmp_path, change, said):
    with pytest.raises(InputError, match=said):
        read_scan(spoiled(tmp_path, change), 50.0)


def test_rows_that_may_be_missing_are_asked_about(tmp_path):
    scan = read_scan(spoiled(tmp_path, lambda s: [*s[:60], *s[66:]]), 50.0)
    assert "are rows missing from" in scan.questions[0]


def test_a_generators_sign_is_told_by_the_resistance():
    check_sign(a_scan(), "--generator device")
    with pytest.raises(InputError, match="generator sign"):
        check_sign(a_scan().turned_sign(), "--generator device")


@pytest.mark.parametrize(
    ("stated", "said"), [("0.5", "plant_angles.txt has 0.5 rad"), ("30", "at most 2π")]
)
def test_two_angles_of_one_bus_and_degrees_are_refused(tmp_path, stated, said):
    """The scan's power flow says 0.2 rad."""
    point = PortPoint(kilovolt=230.0, megawatt=1.0, megavar=0.0, angle=0.2)
    write_ztool(a_scan(points={"PCC-1": point}), tmp_path / "plant.txt")
    beside = tmp_path / "plant_angles.txt"
    beside.write_text(beside.read_text().replace("0.20000000000000", stated))
    with pytest.raises(InputError, match=said):
        read_scan(tmp_path / "plant.txt", 50.0)
