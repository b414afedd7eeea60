"""A vendor's DLL in the studies: each takes a device, and refuses a controller alone in words that help."""

import csv
import json

import pytest

from orchestrator.cases.case import load_case
from orchestrator.face.cli import main
from orchestrator.studies.certification import kinds
from orchestrator.studies.modes.modes import compute_modes
from tests.support.vendor_dlls import droop_device
from tests.vendor_dll.test_device import swing

pytestmark = pytest.mark.usefixtures("undrawn")

CASE = """
name = "one"
[solver]
step_size = "100 us"
stop_time = "1 s"
groups = [["ibr"], ["bus"]]
[components.ibr]
dll = "droop.toml"
parameters = { P_0 = 0.7, Q_0 = 0.1, v_0 = 1.0, S_n = "100 MVA", controller.mp = 0.009 }
[components.bus]
model = "infinite_bus"
parameters = { P_0 = 0.7, Q_0 = 0.1, v_0 = 1.0 }
[[connections]]
from = "bus.v_re"
to = "ibr.v_re"
[[connections]]
from = "bus.v_im"
to = "ibr.v_im"
[[connections]]
from = "ibr.i_re"
to = "bus.i_re"
[[connections]]
from = "ibr.i_im"
to = "bus.i_im"
[scenarios.base]
title = "Base"
"""

NETWORK = """
name = "net"
[solver]
step_size = "100 us"
stop_time = "1 s"
groups = [["ibr", "gen"], ["grid"]]
[power_flow]
grid = "grid"
slack = "north"
[components.grid]
model = "grid"
[network]
buses = ["north", "south"]
[network.lines]
one = { from = "north", to = "south", X = 0.05, R = 0.002, B = 0.2 }
two = { from = "north", to = "south", X = 0.05, R = 0.002, B = 0.2 }
[network.loads]
city = { bus = "south", p = "400 MW", q = "80 Mvar" }
[components.gen]
model = "synchronous_generator"
exciter = "sexs"
governor = "tgov1"
bus = "north"
parameters = { S_n = "600 MVA", v_0 = 1.02 }
[components.ibr]
dll = "droop.toml"
bus = "south"
parameters = { S_n = "200 MVA", P_0 = 0.7, v_0 = 1.0 }
[scenarios.plain]
title = "Plain"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The droop, its device's file, and two cases."""
    place = tmp_path_factory.mktemp("studies")
    droop_device(place)
    (place / "one.toml").write_text(CASE, encoding="utf-8")
    (place / "net.toml").write_text(NETWORK, encoding="utf-8")
    return place


def modes_with(folder, **values):
    """The swing [rad/s] with other values of the controller."""
    case = load_case(str(folder / "one.toml"))
    (prepared,) = case.prepare(
        (), {f"ibr.controller.{name}": value for name, value in values.items()}
    )
    return swing([m.eigenvalue for m in compute_modes(prepared, (0.1, 100.0)).modes])


def said(capsys):
    printed = capsys.readouterr()
    return " ".join((printed.out + printed.err).split())


@pytest.mark.parametrize(
    "command", [["fmu", "admittance"], ["certify"], ["certify", "--code", "aemo"]], ids=" ".join
)
def test_a_controller_alone_is_refused_with_the_remedy(folder, capsys, command):
    assert main([*command, str(folder / "droop.so")]) == 2
    printed = said(capsys)
    assert "it has no v_re, v_im, i_re, i_im: a controller alone stands at no bus" in printed
    assert "device's file" in printed
    assert "cache" not in printed


def test_a_binding_is_drafted_of_a_device_and_a_controller_is_warned_about(folder, capsys):
    draft = folder / "draft.toml"
    assert main(["fmu", "bind", str(folder / "droop.toml"), "--out", str(draft)]) == 0
    assert "REQUIRED:" not in draft.read_text(encoding="utf-8")
    assert "stands at no bus" not in said(capsys)
    assert main(["fmu", "bind", str(folder / "droop.so"), "--out", str(folder / "other.toml")]) == 0
    assert "droop.so: a controller alone stands at no bus" in said(capsys)


@pytest.mark.parametrize("file", ["droop.so", "droop.toml"])
def test_the_acceptance_tests_run_it(folder, capsys, file):
    wanted = ["archive", "loads", "state", "settable_states", "power_balance"]
    assert (
        main(["fmu", "check", str(folder / file), "--json", *(f"--only={name}" for name in wanted)])
        == 0
    )
    verdicts = {c["check"]: c["verdict"] for c in json.loads(capsys.readouterr().out)["checks"]}
    alone = {"power_balance": "not applicable"} if file == "droop.so" else {}
    assert verdicts == dict.fromkeys(wanted, "pass") | alone


def test_its_measured_admittance_gives_its_modes(folder, capsys):
    """Through its port alone, though its phase quantities ripple within a period."""
    options = ["--from-hz", "0.5", "--to-hz", "200", "--json", "--out", str(folder / "box")]
    assert (
        main(["modes", "--black-box", str(folder / "one.toml"), "--component", "ibr", *options])
        == 0
    )
    (found,) = json.loads(capsys.readouterr().out)
    (measured,), (perturbed,) = found["modes"], found["white_box_modes"]
    assert abs(measured["frequency_hz"] - perturbed["frequency_hz"]) < 0.005
    assert abs(measured["damping_percent"] - perturbed["damping_percent"]) < 0.5


def test_a_sampled_component_beside_the_box_is_named(folder, capsys):
    assert (
        main(
            [
                "modes",
                "--black-box",
                str(folder / "one.toml"),
                "--component",
                "bus",
                "--out",
                str(folder / "no"),
            ]
        )
        == 1
    )
    assert "ibr is sampled beside the communication step, or works on phase quantities" in said(
        capsys
    )


def test_other_codes_take_the_device_as_an_fmu(folder, monkeypatch):
    seen = []

    def watch(request, *rest, **more):
        seen.append(request.fmu)
        raise KeyboardInterrupt

    monkeypatch.setattr(kinds, "certify_code", watch)
    main(
        [
            "certify",
            str(folder / "droop.toml"),
            "--code",
            "aemo",
            "--no-check",
            "--out",
            str(folder / "aemo"),
        ]
    )
    assert [path.suffix for path in seen] == [".fmu"]


def test_a_screening_has_the_modes_of_each_point(folder, capsys):
    points = folder / "points.csv"
    points.write_text("name,ibr.P_0\nfull,0.7\nlow,0.3\n", encoding="utf-8")
    options = ["--points", str(points), "--workers", "1", "--out", str(folder / "screen"), "--json"]
    assert main(["screen", str(folder / "net.toml"), "--damping", "60", *options]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["stable"], found["counts"]) == (True, {"computed": 2})
    assert main(["screen", str(folder / "net.toml"), "--damping", "60", *options[:-1]]) == 0
    assert "of the map over 200 communication steps (0.02 s), after which sampled" in said(capsys)


def test_a_sensitivity_is_the_difference_of_modes_over_the_period(folder, capsys):
    """By the power filter's time, which leaves the point where it is, and by the rated voltage, which moves it."""
    names = ["ibr.controller.tau", "ibr.controller.V"]
    options = [f"--parameter={name}" for name in names]
    assert (
        main(
            [
                "sensitivities",
                str(folder / "one.toml"),
                *options,
                "--json",
                "--out",
                str(folder / "sens"),
            ]
        )
        == 0
    )
    rows = json.loads(capsys.readouterr().out)[0]["sensitivities"]
    found = {row["parameter"]: row for row in rows}
    change = 5e-4
    higher, lower = modes_with(folder, tau=0.05 + change), modes_with(folder, tau=0.05 - change)
    expected = (higher - lower) / (2 * change)
    assert found[names[0]]["real_per_unit"] == pytest.approx(expected.real, rel=0.01)
    assert found[names[0]]["imag_per_unit"] == pytest.approx(expected.imag, rel=0.01)
    assert [found[name]["operating_point"] for name in names] == ["stays", "moves"]


def test_a_sweep_has_the_modes_of_each_value(folder):
    out = folder / "sweep"
    values = "ibr.controller.tau=0.05:0.051:2"
    assert (
        main(
            [
                "sweep",
                str(folder / "one.toml"),
                "--vary",
                values,
                "--workers",
                "1",
                "--out",
                str(out),
            ]
        )
        == 0
    )
    with (out / "sweep.csv").open(encoding="utf-8") as file:
        rows = {float(row["ibr.controller.tau [s]"]): row for row in csv.DictReader(file)}
    expected = modes_with(folder, tau=0.051)
    assert float(rows[0.051]["imag [rad/s]"]) == pytest.approx(expected.imag, rel=1e-6)
    assert float(rows[0.05]["imag [rad/s]"]) != pytest.approx(expected.imag, rel=1e-4)


def test_info_says_what_the_states_of_a_sampled_controller_are(folder, capsys):
    assert main(["fmu", "info", str(folder / "droop.toml")]) == 0
    text = "3 in the arrays that it declares, 4 outputs held until its next sample, 5 of the circuit around it"
    assert f"states of a sampled controller: {text}" in said(capsys)
    assert main(["fmu", "info", str(folder / "none.so")]) == 2
    assert "give the vendor's .so or .dll file" in said(capsys)
