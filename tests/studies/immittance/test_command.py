"""``gfor fmu nyquist`` as it is typed, on files that the project makes."""

import json
import re

import numpy as np
import pytest

import orchestrator as gfor
from orchestrator.core.errors import InputError
from orchestrator.face.cli import main
from orchestrator.studies.immittance.scan import PortPoint, Scan
from orchestrator.studies.immittance.scan_files import write_ztool
from tests.studies.immittance.plants import OMEGA, Line, constant_power, is_stable

pytestmark = pytest.mark.usefixtures("undrawn")

F = np.unique(np.concatenate([np.geomspace(0.5, 1000, 250), np.linspace(40, 60, 60)]))
PLANT = constant_power(g=1.2, h=0.6, T=0.003, G=0.2)
STRONG, WEAK = Line(0.05, 0.8 / OMEGA), Line(0.05, 1.2 / OMEGA)


def files(folder, line=STRONG, device=None, **points):
    """A device and a network in siemens on 100 MVA and 100 kV, whose base is 0.01 S."""
    network = 0.01 * np.linalg.inv(line.impedance(F, capacitor=False))
    Y = 0.01 * PLANT.admittance(F) if device is None else device
    for name, values in (("plant", Y), ("network", network)):
        point = {"PCC-1": points[name]} if name in points else {}
        write_ztool(Scan(name, F, values, ("PCC-1",), points=point), folder / f"{name}.txt")
    return [str(folder / "plant.txt"), str(folder / "network.txt")]


def test_the_form_that_must_work(tmp_path, capsys):
    given = files(tmp_path)
    command = ["fmu", "nyquist", *given, "--frequency", "50 Hz", "--compensation", "32 %", "--json"]
    assert main([*command, "--out", str(tmp_path / "out")]) == 0
    answer = json.loads(capsys.readouterr().out)
    line = Line(STRONG.R, STRONG.L, 0.32)
    assert answer["verdict"] == ("stable" if is_stable(PLANT, line) else "unstable")
    assert all(set(c) == {"real", "frequency_hz"} for c in answer["crossings"])
    assert {"gain", "phase_deg", "delay_s", "disk"} <= set(answer["margins"])
    written = {p.name for p in (tmp_path / "out").iterdir()}
    assert {"nyquist.json", "eigenloci.png", "matrices.png", "gfor#Y_AC#device-1#.txt"} <= written


def test_an_unstable_plant_is_said_on_the_first_line_and_by_the_exit_code(tmp_path, capsys):
    given = files(tmp_path, WEAK)
    assert main(["fmu", "nyquist", *given, "--fail-unstable", "--out", str(tmp_path / "out")]) == 3
    assert capsys.readouterr().out.startswith("unstable: −1 is encircled")


def test_a_setting_of_another_form_is_told_at_its_option(tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        main(
            [
                "fmu",
                "nyquist",
                "two_area",
                "--component",
                "gfor",
                "--set",
                "nonsense",
                "--out",
                str(tmp_path),
            ]
        )
    assert ended.value.code == 2
    assert "'nonsense' is not of the form variable=value" in " ".join(
        capsys.readouterr().err.split()
    )


def test_python_gives_what_the_command_prints(tmp_path):
    given = files(tmp_path)
    found = gfor.nyquist(*given, compensation=10)
    assert found.verdict in {"unstable", "stable"}
    assert found.as_json()["compensation_percent"] == 10


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--compensation", "0.32"], "'0.32' is read in percent; write 32"),
        (["--frequency", "50 kV"], "is in kV, but Hz is needed"),
        (["--per-unit", "network"], "give the rated voltage at the cut"),
    ],
)
def test_options_that_cannot_be_meant(tmp_path, capsys, more, said):
    try:
        code = main(["fmu", "nyquist", *files(tmp_path), *more, "--out", str(tmp_path / "out")])
    except SystemExit as end:
        code = end.code
    assert code == 2
    assert said in " ".join(capsys.readouterr().err.split())


def test_a_device_alone_asks_for_its_network(tmp_path, capsys):
    assert main(["fmu", "nyquist", files(tmp_path)[0]]) == 2
    assert "give its network as well" in capsys.readouterr().err


def test_per_unit_where_siemens_are_due(tmp_path):
    given = files(tmp_path, device=PLANT.admittance(F) * 5)
    with pytest.raises(InputError, match="is one of them in per unit"):
        gfor.nyquist(*given)


def test_at_a_short_circuit_ratio(tmp_path, capsys):
    """The limit is that of the line whose impedance grows; per unit for siemens, and no rating, are asked for."""
    device, _ = files(tmp_path)
    found = gfor.nyquist(device, scr=1.5, rating="100 MVA", voltage="100 kV").as_json()["strength"]
    R, X = (1 / found["scr_limit"] / (1 + k * k) ** 0.5 for k in (10, 0.1))
    for k, stable in ((0.99, True), (1.01, False)):
        assert is_stable(PLANT, Line(k * R, k * X / OMEGA)) == stable
    with pytest.raises(InputError, match="a scan states no rating"):
        gfor.nyquist(device, scr=1.5, voltage="100 kV")
    (given, _) = files(tmp_path, device=PLANT.admittance(F) * 5)
    with pytest.raises(InputError, match="is one of them in per unit"):
        gfor.nyquist(given, scr=1.5, rating="100 MVA", voltage="100 kV")
    assert main(["fmu", "nyquist", device, "--distance", "0.2"]) == 2
    assert "belong to --retune" in capsys.readouterr().err


def test_a_page_has_a_slider_of_the_ratio(tmp_path, capsys):
    """Its verdicts are those of the line, its distances those that are judged."""
    device, network = files(tmp_path)
    page, out = tmp_path / "page.html", ["--out", str(tmp_path / "out")]
    at_source = ["--scr", "1.5", "--rating", "100 MVA", "--voltage", "100 kV", "--html", str(page)]
    assert main(["fmu", "nyquist", device, *at_source, *out]) == 0
    (text,) = re.findall(r'id="held">(.*?)</script>', page.read_text("utf-8"))
    held = json.loads(text)
    assert len(held["judged"]) == 25
    verdicts = {one["verdict"] for one in held["judged"]}
    assert {"stable", "unstable"} <= verdicts
    for one in held["judged"]:
        R, X = (1 / one["ratio"] / (1 + k * k) ** 0.5 for k in (10, 0.1))
        right = "stable" if is_stable(PLANT, Line(R, X / OMEGA)) else "unstable"
        assert one["verdict"] in (right, "not known")
    assert held["off"] < 2e-3
    capsys.readouterr()
    assert main(["fmu", "nyquist", device, network, "--html", str(page), *out]) == 2
    assert "give --scr" in capsys.readouterr().err


def test_generator_sign(tmp_path):
    given = files(tmp_path, device=-0.01 * PLANT.admittance(F))
    with pytest.raises(InputError, match="Then give --generator device"):
        gfor.nyquist(*given)


def test_a_rated_voltage_that_is_not_that_of_the_scan(tmp_path):
    given = files(tmp_path, plant=PortPoint(100.0, 50.0, 5.0, 0.1))
    with pytest.raises(
        InputError, match=r"plant.txt was scanned at 100 kV, and --voltage is 132 kV"
    ):
        gfor.nyquist(given[0], scr=1.5, rating="100 MVA", voltage="132 kV")
    assert gfor.nyquist(given[0], scr=1.5, rating="100 MVA").verdict == "stable"


def test_scans_at_two_operating_points(tmp_path):
    given = files(
        tmp_path, plant=PortPoint(100.0, 50.0, 5.0, 0.1), network=PortPoint(100.0, 80.0, 5.0, 0.1)
    )
    with pytest.raises(
        InputError, match=r"another operating point than network.txt: active power \[MW\] 50 and 80"
    ):
        gfor.nyquist(*given)


def test_the_file_of_a_device_around_a_dll_is_a_device(tmp_path, capsys):
    """Not a case, though both are TOML; what is wrong with it is said of the device."""
    (tmp_path / "plant.toml").write_text('dll = "plant.so"\nfilter = "LC"\n')
    assert (
        main(["fmu", "nyquist", str(tmp_path / "plant.toml"), "--out", str(tmp_path / "out")]) == 2
    )
    assert "plant.toml: give its network as well" in " ".join(capsys.readouterr().err.split())
    assert (
        main(
            [
                "fmu",
                "nyquist",
                str(tmp_path / "plant.toml"),
                "--scr",
                "2",
                "--out",
                str(tmp_path / "out"),
            ]
        )
        == 2
    )
    assert "plant.so: cannot be read" in " ".join(capsys.readouterr().err.split())


def test_a_scan_at_more_than_its_rating_is_asked_about(tmp_path, capsys):
    for megawatts, asked in ((200.0, True), (80.0, False)):
        plant, _ = files(
            tmp_path, plant=PortPoint(kilovolt=100.0, megawatt=megawatts, megavar=0.0, angle=0.0)
        )
        assert (
            main(
                [
                    "fmu",
                    "nyquist",
                    plant,
                    "--scr",
                    "3",
                    "--rating",
                    "100 MVA",
                    "--out",
                    str(tmp_path / "out"),
                ]
            )
            == 0
        )
        assert (
            "rated at 100 MVA; do both hold?" in " ".join(capsys.readouterr().err.split())
        ) == asked
