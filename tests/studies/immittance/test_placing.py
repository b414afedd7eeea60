"""Scans that stand in a case: what is found is what the case's own models say there."""

import cmath
import shutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import orchestrator as gfor
from orchestrator.cases.case import load_case
from orchestrator.core.errors import CaseError, InputError
from orchestrator.face.cli import main
from orchestrator.studies.black_box.frequency_response import FrequencyResponse
from orchestrator.studies.immittance import measured
from orchestrator.studies.immittance.cut import cut_of
from orchestrator.studies.immittance.placing import at_ports, in_one_frame
from orchestrator.studies.immittance.scan import PER_UNIT, PortPoint, Scan, block_rotation
from orchestrator.studies.immittance.scan_files import write_ztool
from tests.studies.immittance import plants

AROUND = np.sinh(np.linspace(-4.5, 4.5, 121))
MODEL = {"gfor": 'model = "gfor"', "sg2": 'model = "synchronous_generator_st1" '}


def scanned(cut, name, *, turned=0.0, power=1.0):
    """What a vendor sends: siemens at 230 kV, d along the voltage, at another angle of the bus than the case's."""
    (unit,) = (u for u in cut.units if name in u.devices)
    v, S = cut.voltages[name], 100 * power * cut.voltages[name] * cut.currents[name].conjugate()
    point = {name: PortPoint(230 * abs(v), S.real, S.imag, 0.7)}
    at, wide = (
        np.abs(unit.side.poles.imag) / (2 * np.pi),
        np.abs(unit.side.poles.real) / (2 * np.pi),
    )
    f = np.unique(
        np.round(
            np.concatenate([np.geomspace(0.05, 3000, 400), *(at + k * wide for k in AROUND)]), 6
        )
    )
    # dense where the device turns quickly, as a vendor's scan has to be
    F = f[(f >= 0.05) & (f <= 3000)]
    whole = Scan(name, F, unit.side.at(2j * np.pi * F), (name,), PER_UNIT, points=point)
    return whole.rotated([turned - cmath.phase(v)]).in_siemens(230)


@pytest.fixture(scope="module")
def two_area():
    return cut_of(gfor.load("two_area").scenario("gfor").prepared, None, ("gfor", "sg2"))


def placed(folder, cut, *names, **more):
    """The case with scans at some places."""
    text = load_case("two_area").path.read_text()
    for name in names:
        write_ztool(scanned(cut, name, **more), folder / f"{name}.txt")
        assert text.count(f"[components.{name}]\n{MODEL[name]}") == 1
        text = text.replace(MODEL[name], f'scan = "{name}.txt"\nvoltage = "230 kV" ', 1)
    (folder / "case.toml").write_text(text.replace("[analysis]", "[other]").partition("[other]")[0])
    return folder / "case.toml"


@pytest.mark.parametrize("names", [("gfor",), ("gfor", "sg2")])
def test_scans_in_a_case_have_the_verdict_and_margins_of_its_models(tmp_path, two_area, names):
    assert abs(cmath.phase(two_area.voltages["gfor"])) > 0.1
    found = gfor.nyquist(placed(tmp_path, two_area, *names), scenario="gfor").as_json()
    own = gfor.nyquist("two_area", components=names, scenario="gfor").as_json()
    assert (found["verdict"], found["questions"]) == (own["verdict"], []) == ("stable", [])
    assert (found["modes_stable"], found["difference_from_case"]) == (None, None)
    for margin in ("phase_deg", "distance", "disk"):
        assert found["margins"][margin]["value"] == pytest.approx(
            own["margins"][margin]["value"], rel=2e-3
        )


def test_an_fmu_in_the_place_of_a_scan_is_compared_with_it(tmp_path, two_area):
    case = placed(tmp_path, two_area, "gfor")
    found = gfor.nyquist(tmp_path / "gfor.txt", case, scenario="gfor", voltage=230)
    assert found.as_json()["difference_from_case"]["largest_relative"] < 1e-9
    write_ztool(scanned(two_area, "gfor", turned=0.3), tmp_path / "other.txt")
    for name in ("angles", "power_flow"):
        shutil.copy(tmp_path / f"gfor_{name}.txt", tmp_path / f"other_{name}.txt")
    turned = gfor.nyquist(tmp_path / "other.txt", case, scenario="gfor", voltage=230).as_json()
    assert turned["difference_from_case"]["largest_relative"] > 0.1


def test_an_unstable_device_is_seen_beside_a_far_larger_one():
    """Both at one bus: their sum shows no pole of the smaller one."""
    rng, f = np.random.default_rng(3), np.geomspace(0.1, 1000, 300)
    small, large = plants.random_plant(rng, unstable=True), plants.random_plant(rng)
    scans = {
        "x": Scan("x", f, 1e-4 * small.admittance(f), ("x",)),
        "y": Scan("y", f, large.admittance(f), ("y",)),
    }
    both = at_ports(scans, SimpleNamespace(ports=(("bus", ("x", "y")),)))
    assert both.unstable
    assert not replace(both, parts=()).unstable


def test_what_does_not_belong_there_is_refused(tmp_path, two_area):
    case = placed(tmp_path, two_area, "gfor", power=1.02)
    with pytest.raises(
        InputError, match="at another operating point than gfor in the case: active power"
    ):
        gfor.nyquist(case, scenario="gfor")
    case = placed(tmp_path, two_area, "gfor")
    with pytest.raises(
        InputError, match="the two sides are all scans and all else, and the cut is at gfor, sg1"
    ):
        gfor.nyquist(case, scenario="gfor", bus="bus_2")
    case.write_text(case.read_text().replace('voltage = "230 kV"', ""))
    with pytest.raises(InputError, match='of a scan in a case by voltage = "230 kV"'):
        gfor.nyquist(case, scenario="gfor")
    with pytest.raises(InputError, match="is a scan and has no parameters"):
        gfor.nyquist(case, scenario="gfor", voltage=230).retune()
    write_ztool(scanned(two_area, "gfor").turned_sign(), tmp_path / "gfor.txt")
    with pytest.raises(InputError, match="Then give --generator device"):
        gfor.nyquist(case, scenario="gfor", voltage=230)


def test_without_an_operating_point_it_is_asked_and_without_a_frame_it_is_not_known(
    tmp_path, two_area
):
    case = placed(tmp_path, two_area, "gfor")
    for name in ("angles", "power_flow"):
        (tmp_path / f"gfor_{name}.txt").unlink()
    found = gfor.nyquist(case, scenario="gfor").as_json()
    assert (
        "states no operating point; was it scanned where gfor is here, at 1350 MW"
        in found["questions"][0]
    )


@pytest.mark.parametrize(
    "command", [["modes"], ["run", "--stop", "1 s"], ["explore", "--save", "x.html"]]
)
def test_what_needs_states_refuses_a_scan_and_names_what_does_not(
    tmp_path, two_area, capsys, command
):
    case = placed(tmp_path, two_area, "gfor")
    assert main([command[0], str(case), *command[1:]]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert (
        "gfor is known by its scan alone, which has no states: it cannot be run and has no modes"
        in said
    )
    assert (
        f"`gfor fmu nyquist {case}` judges it, and for all else give the vendor's 'fmu' or 'dll'"
        in said
    )
    with pytest.raises(CaseError, match="known by its scan alone"):
        gfor.load(case).scenario("gfor")
    assert main(["scr", str(case), "--scenario", "gfor"]) == 0


def test_the_frame_of_a_measured_scan_is_that_of_its_voltage(monkeypatch):
    """A device that is not the same in all frames, measured at a voltage of 0.4 rad."""
    Y, turn = np.array([[2.0, 0.3], [-0.1, 0.5]]), block_rotation([0.4])
    monkeypatch.setattr(
        measured,
        "_without_hold",
        lambda model, at: -np.broadcast_to(turn @ Y @ turn.T, (len(at), 2, 2)),
    )
    monkeypatch.setattr(
        measured, "fit", lambda response: type("M", (), {"poles": np.zeros(0), "error": 0.0})
    )
    response = FrequencyResponse.__new__(FrequencyResponse)
    vars(response).update(
        frequencies=np.geomspace(1, 9, 9),
        bounds=np.zeros((9, 2, 2)),
        values=np.ones((9, 2, 2)),
        operating_point=(1.0, 0.0),
    )
    scan = measured.as_scan("x", response, cmath.rect(1.0, 0.4))
    assert scan.values == pytest.approx(np.broadcast_to(Y, scan.values.shape))
    assert scan.points["x"].angle == pytest.approx(0.4)


def test_two_files_are_turned_by_the_angles_that_they_state_or_by_the_one_given():
    f, Y = np.geomspace(1, 9, 9), np.broadcast_to([[2.0, 0.3], [-0.1, 0.5]], (9, 2, 2))

    def sides(**angles):
        return {
            side: Scan(side, f, Y, ("P",), points={"P": PortPoint(angle=angle)}).rotated(
                [-(angle or 0.0)]
            )
            for side, angle in angles.items()
        }

    stated, open_ = sides(device=0.4, network=-0.9), sides(device=0.4, network=None)
    assert in_one_frame(stated, None)
    assert all(scan.values == pytest.approx(Y) for scan in stated.values())
    assert not in_one_frame(open_, None)
    assert in_one_frame(open_, 0.4)
    assert open_["device"].values == pytest.approx(Y)
