"""How a device at a bus moves a mode: predicted and by coupled FMUs, and what would be wrong in silence."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

import orchestrator as gfor_api
from orchestrator.cases.case import load_case
from orchestrator.linear.models.linearization import Blocks
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.studies.modes.modes import running
from orchestrator.studies.siting import placing, residues, study
from orchestrator.studies.siting.confirmation import Confirmation
from orchestrator.studies.siting.placing import ideal_support
from orchestrator.studies.siting.study import SiteRequest, find_sites
from orchestrator.studies.siting.view import Siting, answer, open_points, remarks, sureness
from tests.studies.screening.five_machines import five_machines


def sites(case, device, **asked):
    return find_sites(load_case(case), SiteRequest(device, scenario="gfor", **asked))


@pytest.mark.parametrize("device", ["pod_p", "pod_q"])
def test_predicted_and_coupled_shift_agree_at_every_bus(device):
    found = sites("two_area", device, rating=10.0)
    assert [one.bus for one in found.confirmations] == ["bus_2", "bus_3"]
    assert max(one.error for one in found.confirmations) < 0.01
    assert all(one.agrees and one.damping > 10.6 for one in found.confirmations)


def test_a_droop_helps_without_tuning():
    found = sites("two_area", "droop", rating=100.0)
    assert found.ranking == ("bus_2", "bus_3")
    assert max(one.error for one in found.confirmations) < 0.01


def test_phasor_and_emt_models_say_the_same():
    emt, phasor = (sites(case, "pod_p", confirm=0) for case in ("two_area", "two_area_rms"))
    for bus in ("bus_2", "bus_3"):
        changes = [
            one.shifts["device"]["intact"]["electromechanical"][bus].change for one in (emt, phasor)
        ]
        assert abs(changes[0] - changes[1]) < 0.02 * abs(changes[0])


def test_only_the_buses_asked_for_are_places():
    found = sites("two_area_rms", "pod_p", confirm=0, buses=("3",))
    assert found.ranking == ("bus_3",)
    assert answer(found).startswith("bus_3 as a place for POD-P: ")
    with pytest.raises(
        gfor_api.CosimError, match=r"buses bus3: there is no such bus; did you mean bus_3"
    ):
        sites("two_area_rms", "pod_p", confirm=0, buses=("2", "bus3"))


def test_a_question_is_asked_once(gfor, tmp_path):
    code, _, err = gfor("site", five_machines(tmp_path).path, "--device", "droop", "--confirm", "0")
    assert (code, err.count("the load model is open")) == (0, 1)


def test_a_wrong_sign_at_the_bus_is_caught(gfor, monkeypatch):
    """The ranking alone, by sizes, would not show it; the coupled FMUs do."""

    def reversed_currents(*given):
        ports = true_ports(*given)
        return replace(ports, into_states=-ports.into_states, into_wires=-ports.into_wires)

    true_ports = residues.BusPorts.of
    monkeypatch.setattr(residues.BusPorts, "of", reversed_currents)
    code, out, _ = gfor(
        "site", "two_area_rms", "--scenario", "gfor", "--confirm", "1", "--rating", "400"
    )
    assert code == 3
    assert "NOT CONFIRMED" in out
    assert "; its size is not the cause: --rating 230 is off by " in out


def test_a_device_too_large_for_its_bus_is_told_with_the_rating_that_is_confirmed(gfor):
    """It changes the mode by its mere presence, and a prediction starts from the mode without it."""
    words = ("site", "two_area_rms", "--scenario", "gfor", "--confirm", "1", "--rating")
    code, out, _ = gfor(*words, "3000")
    said = " ".join(out.split())
    assert code == 3
    power = re.search(r"as 3000 MVA is much for a bus of (\d+) MVA short-circuit power; ", said)
    assert power is not None
    rating, off = re.search(r"; --rating ([\d.]+) is confirmed, off by ([\d.]+) %", said).groups()
    assert float(rating) == pytest.approx(int(power[1]) / 20, rel=0.03)
    assert float(off) < 1
    code, out, _ = gfor(*words, rating)
    assert code == 0
    assert f"is off by {off} %" in " ".join(out.split())


def test_a_device_that_is_small_for_its_bus_is_tried_once(monkeypatch):
    tried = []

    def confirmed(prepared, bus, *_, **__):
        tried.append(prepared.system.components[f"site_{bus}"].number("S_n"))
        return Confirmation(bus, predicted=1.1j, coupled=1j)

    monkeypatch.setattr(study, "confirmed", confirmed)
    (small,) = sites("two_area_rms", "pod_p", confirm=1, rating=100.0).confirmations
    (large,) = sites("two_area_rms", "pod_p", confirm=1, rating=1000.0).confirmations
    assert small.smaller is None
    assert large.smaller is not None
    assert tried == [100.0, 1000.0, large.smaller.rating_mva]


def test_an_injection_is_what_a_device_feeds_at_the_same_bus():
    """The column of the bus's own current is that of the port of a device there."""
    (prepared,) = replace(load_case("two_area"), injections=True).prepare(["gfor"])
    with running(prepared) as master:
        find_operating_point(master)
        grid = Blocks(master, inputs=["grid.bus_2.i_re", "grid.bus_2.i_im"]).components["grid"]
    for part in ("i_re", "i_im"):
        port, bus = (grid.inputs.index(f"{name}.{part}") for name in ("gfor", "bus_2"))
        assert grid.B[:, bus] == pytest.approx(grid.B[:, port], abs=1e-9)
        assert grid.D[:, bus] == pytest.approx(grid.D[:, port], abs=1e-9)


@pytest.mark.parametrize("voltage", [1.0, 0.5 + 0.3j, -0.2 + 1.1j])
def test_a_unit_of_support_is_a_megawatt_whatever_the_bus(voltage):
    """Power, not current and not pu of the bus: else the order of buses would depend on their voltages."""
    eigenvalue = -0.3 + 5j
    turn = 0.01j * voltage  # the bus's angle is ahead by 0.01 rad
    hertz = 0.01 * eigenvalue / (2 * np.pi)
    for kind in ("P", "Q"):
        response = ideal_support(kind, voltage, eigenvalue)
        for part in (
            np.real,
            np.imag,
        ):  # of the complex amplitudes; a power is linear in the current
            current = part(response @ [turn.real, turn.imag])
            power = voltage * complex(current[0], -current[1])
            wanted = part(hertz) / 100 * (-1 if kind == "P" else 1j)
            assert power == pytest.approx(wanted, abs=1e-12), kind


def test_more_than_one_unit_scales_no_order(monkeypatch):
    found = sites("two_area_rms", "pod_p", confirm=0)
    monkeypatch.setattr(placing, "ideal_support", lambda *at: 7.0 * ideal_support(*at))
    other = sites("two_area_rms", "pod_p", confirm=0)
    assert other.ranking == found.ranking
    assert other.least("bus_2")[0] == pytest.approx(7 * found.least("bus_2")[0], rel=1e-3)


def test_a_mode_outside_of_the_range_is_named():
    found = sites("two_area_rms", "pod_p", confirm=0, frequencies=(0.1, 0.4))
    assert [seen.mode.frequency_hz < 0.4 for seen in found.intact.modes] == [True]
    (text,) = open_points(found)
    assert text.startswith("0.581 Hz, 10.6")
    assert f"not judged: {text}" in remarks(found)


def test_what_is_unstable_without_the_device_is_named_first():
    found = find_sites(
        load_case("kundur"), SiteRequest("pod_p", scenario="tgr", confirm=0, outages="line_5_6")
    )
    assert sureness(found)[0].startswith(
        "UNSTABLE without the device: line_5_6 (inter-area, 0.643 Hz, -3.61 %), intact ("
    )
    assert not any(
        "UNSTABLE" in text for text in sureness(sites("two_area_rms", "pod_p", confirm=0))
    )


def test_what_grows_beside_damped_modes_of_the_range_is_named():
    asked = SiteRequest("pod_p", scenario="manual", confirm=0)
    found = find_sites(load_case("kundur"), asked)
    assert sureness(found)[0].startswith(
        "UNSTABLE without the device: intact (every swing is damped, and the common speed drifts at "
        "+0.005153 1/s without a governor (sg1.machine.omega, "
    )
    assert "; least damped in the range: inter-area, 0.542 Hz, 3.27 %)" in sureness(found)[0]
    page = Siting(found).page_text()
    (red,) = re.findall(r'</p><p class="bad">(UNSTABLE without the device: .*?)</p>', page)
    assert page.count("UNSTABLE without") == 1  # in red, below the answer, and once
    assert "cause" not in red  # which `gfor modes` tells


def test_the_json_has_a_shift_for_each_bus_and_mode(gfor, tmp_path):
    code, out, _ = gfor(
        "site",
        "two_area_rms",
        "--scenario",
        "gfor",
        "--device",
        "pod_q",
        "--json",
        "--confirm",
        "1",
        "--out",
        str(tmp_path),
    )
    found = json.loads(out)
    assert code == 0
    assert [bus["bus"] for bus in found["buses"]] == ["bus_2", "bus_3"]
    shift = found["buses"][0]["shift"]["electromechanical"]
    assert shift["controllable"]
    assert shift["damping_points"] > 0
    assert "Mvar/Hz" in found["units"]["damping_points"]
    assert found["buses"][0]["q"]["electromechanical"] == shift
    by_100 = shift["damping_points_per_100_Mvar_per_Hz"]
    assert by_100 == 100 * shift["damping_points"]
    assert f"{by_100:+.3g}" in found["answer"]
    assert "damping_points_per_100_MW_per_Hz" in found["buses"][0]["p"]["electromechanical"]
    assert found["confirmed"][0]["agrees"] is True
    assert {"site.html", "buses.csv"} < {path.name for path in tmp_path.iterdir()}
    page = (tmp_path / "site.html").read_text(encoding="utf-8")
    top = page[page.index('<div class="findings">') : page.index("<section")]
    with_pod = f"{found['confirmed'][0]['damping_percent']:.2f}"
    assert '<b class="good">confirmed; the system is stable with it</b>' in top
    assert f"<td>{with_pod}</td>" in top


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["two_area_rms", "--device", "pod_x"],
            "give pod_p, pod_q, droop, regulator or the path of an .fmu",
        ),
        (["two_area_rms", "--device", "no.fmu", "--scenario", "gfor"], "there is no such file"),
        (["infinite_bus"], "[power_flow]"),
        (
            ["two_area_rms", "--scenario", "gfor", "--range", "1.5:1.9"],
            "no oscillation from 1.5 to 1.9 Hz",
        ),
        (
            ["two_area_rms", "--scenario", "gfor", "--outages", "line_9"],
            "no unit, line, DC line, load or shunt 'line_9'",
        ),
        (
            ["two_area_rms", "--scenario", "gfor", "--rating", "-5"],
            "--rating: '-5' must be a number above 0",
        ),
    ],
)
def test_what_cannot_be_done_is_said_in_one_sentence(gfor, words, said):
    code, _, err = gfor("site", *words)
    assert code == 2
    assert said in err
    assert "Traceback" not in err


def test_a_device_at_a_bus_of_a_model_with_a_network_of_its_own(tmp_path):
    """Any component at a bus of the two-area grid gets a port."""
    text = load_case("two_area").path.read_text()
    text += (
        '\n[components.battery]\nmodel = "gfor"\nbus = "bus_3"\n'
        'parameters = { S_n = "50 MVA", P_0 = 0.0, Q_0 = 0.0 }\n'
    )
    text = text.replace('groups = [["gfor", "sg1", "sg2"], ["grid"]]', "")
    (tmp_path / "case.toml").write_text(text)
    modes = gfor_api.load(tmp_path / "case.toml").scenario("gfor").modes()
    assert modes.result.stability.stable
    assert "battery.droop.theta" in modes.result.model.names
