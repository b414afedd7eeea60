"""Converters on RTE's rows: ours as it is and as it is not, and three that are unfit."""

import json
import math

import pytest

from orchestrator.core.errors import ComponentError
from orchestrator.studies.black_box.frequency_response import Excitation
from orchestrator.studies.certification.codes import bench_point, perturbation_plot
from orchestrator.studies.certification.codes.certificate import certify_code
from orchestrator.studies.certification.codes.ercot import ERCOT
from orchestrator.studies.certification.codes.frequency.limits import asked_stiffness
from orchestrator.studies.certification.codes.known import code_for
from orchestrator.studies.certification.codes.perturbation_plot import measure_stiffness
from orchestrator.studies.certification.files import save
from orchestrator.studies.certification.request import CertificationRequest
from orchestrator.studies.certification.verification import read_certificate, verify_files
from orchestrator.studies.points.executor import Serial
from tests.studies.certification.codes.reactance_source import write_source
from tests.studies.certification.codes.wrong_droop import write_wrong

pytestmark = pytest.mark.slow

TRUE = {"X_eff": 0.15, "D": 20.0, "H": 1.0}
"""Of our converter: the reactance of its transformer, 1/R_f, and τ_P/(2·R_f)."""


@pytest.fixture
def converter(fmu_path):
    """Compiled, which gives what the one with Python in it gives in half the time; in this process, as ours are."""
    return fmu_path("gfor", native=True)


@pytest.fixture(name="gfor_command")
def _gfor_command(request):
    """The command of the same name as the module that is imported here."""
    return request.getfixturevalue("gfor")


def certified(fmu, folder, rows, values=None, declared=TRUE):
    request = CertificationRequest(fmu, None, values or {})
    return certify_code(request, code_for("rte", declared), Serial(), folder, rows)


def failed(fmu, folder, row, values=None, declared=TRUE):
    (verdict,) = certified(fmu, folder, (row,), values, declared).verdicts
    return [finding.criterion for finding in verdict.failed]


def test_ours_meets_what_its_parameters_declare_and_the_certificate_verifies(converter, tmp_path):
    found = certified(
        converter, tmp_path, ("igfm1_scr10_pm50", "igfm2_scr2_p0", "igfm3_scr10_p50_scr2")
    )
    assert all(verdict.accepted for verdict in found.verdicts)
    assert found.verdict == "incomplete"
    save(found, tmp_path)
    folder, content = read_certificate(tmp_path)
    assert content["declared"] == TRUE
    (fault,) = verify_files(folder, content).faults  # all else agrees
    assert fault.startswith("rows of the code's table that the record has not: ")
    content["declared"]["H"] = 4.0
    (tmp_path / "certificate.json").write_text(json.dumps(content), encoding="utf-8")
    assert "come to other findings" in " ".join(verify_files(*read_certificate(tmp_path)).faults)


@pytest.fixture(scope="module")
def row_folder(tmp_path_factory):
    """Where a row of ours is kept that is judged by several declarations."""
    return tmp_path_factory.mktemp("row")


@pytest.mark.parametrize("wrong", [{"H": 4.0}, {"D": 80.0}, {"X_eff": 0.6}])
def test_a_wrong_declaration_is_seen(converter, row_folder, wrong):
    assert "power after the jump ahead" in failed(
        converter, row_folder, "igfm1_scr10_pm50", declared=TRUE | wrong
    )


def test_a_converter_without_damping_swings_out_of_its_envelope(converter, tmp_path):
    """A lag of 5 s in the droop's measurement: H = 50 s with the same D."""
    values = {"droop.tau_P": 5.0}
    assert failed(converter, tmp_path, "igfm1_scr10_pm50", values) == [
        "power after the jump ahead",
        "power after the jump back",
    ]


@pytest.mark.parametrize(
    "row", ["igfm1_scr10_p50", "igfm2_scr10_p0", "igfm3_scr10_p50_scr2", "igfm4_scr10_p0_2"]
)
def test_a_grid_following_converter_fails_every_kind_of_row(fmu_path, tmp_path, row):
    follower = fmu_path("gfl", native=True)
    assert any(name != "stable" for name in failed(follower, tmp_path, row))


def test_a_voltage_droop_of_the_wrong_sign_is_seen(converter, tmp_path):
    """No row of MISO sees it. With the droop X_eff is X_t + R_V in the end, with the wrong sign X_t − R_V: the current
    comes to 0.15·(0.217 + 0.5)/(0.083 + 0.5) = 0.184 pu, beyond 0.17 pu.
    """
    with_droop = TRUE | {"X_eff": 0.15 + 0.067}
    assert not failed(converter, tmp_path, "igfm2_scr2_p0", declared=with_droop)
    wrong = failed(write_wrong("R_V", tmp_path), tmp_path, "igfm2_scr2_p0", declared=with_droop)
    assert wrong == ["current after the rise", "current after the fall"]


def test_a_frequency_droop_of_the_wrong_sign_is_seen(tmp_path):
    assert "power after the jump ahead" in failed(
        write_wrong("R_f", tmp_path), tmp_path, "igfm1_scr10_p0"
    )


def test_a_hang_of_a_busy_machine_is_no_verdict_and_is_not_kept(converter, tmp_path, monkeypatch):
    def hanging(prepared):
        raise ComponentError(
            "converter", "fmi2DoStep", "hang: no answer within 30 s; its process was ended", "", 1.0
        )

    with monkeypatch.context() as patched:
        patched.setattr(bench_point, "running", hanging)
        request = CertificationRequest(converter)
        found = certify_code(request, ERCOT, Serial(), tmp_path, ("phase_jumps",))
    assert found.verdict == "incomplete"
    assert "hang" in found.verdicts[0].unknown
    again = certify_code(request, ERCOT, Serial(), tmp_path, ("phase_jumps",))
    assert again.stored == 0
    assert again.verdicts[0].accepted


def test_the_command_asks_for_what_is_to_be_declared(converter, gfor_command):
    code, _, said = gfor_command(
        "certify", converter, "--code", "rte", "--declare", "D=20", "--declare", "H=1"
    )
    assert code == 2
    assert "missing: X_eff" in " ".join(said.split())
    for name, words in (
        ("gb", "--code gb knows no such value"),
        ("nts631", "takes no declared value"),
    ):
        code, _, said = gfor_command("certify", converter, "--code", name, "--declare", "D=20")
        assert code == 2
        assert words in " ".join(said.split())


@pytest.mark.parametrize(("X", "stiff"), [(0.3, True), (0.8, False)])
def test_the_stiffness_that_a_jump_asks_for_agrees_with_the_jump(tmp_path, monkeypatch, X, stiff):
    """A source behind a reactance: 1/X to 1/X/(1 − (f/f_n)²) against 1/(10°/0.2 pu − |Z|²/X_g) = 1.87 pu/rad."""
    monkeypatch.setattr(
        perturbation_plot, "EXCITATION", Excitation(lowest_hz=5.0, highest_hz=40.0, lines=8)
    )
    request = CertificationRequest(write_source(tmp_path), None, {"X": X})
    asked = asked_stiffness(measure_stiffness(request, 60.0, lambda text: None), 60.0)
    assert asked.value == pytest.approx(1 / (math.radians(10) / 0.2 - 1 / 9 / 0.3288), rel=1e-3)
    assert asked.band == pytest.approx((60 / (2 * math.pi), 24.43), rel=1e-3)
    assert 0.98 / X < asked.found < 1.02 / X / (1 - (24.43 / 60) ** 2)
    assert asked.met is stiff
    (verdict,) = certify_code(request, ERCOT, Serial(), tmp_path, ("phase_jumps",)).verdicts
    opposed = [
        finding.accepted for finding in verdict.findings if finding.criterion.startswith("opposes")
    ]
    assert opposed == [stiff, stiff]


def test_gb_gives_figures_and_no_verdict(converter, tmp_path, gfor_command, monkeypatch):
    """Slow changes of the frequency see the droop, P/ω = −1/(R_f/(1 + τ_P·s) + s·X_t/ω_b). Quick ones of the voltage
    see the transformer, Q/V = 1/X_t/(1 − (f/f_n)²), but for the voltage loop of 50 ms.
    """
    quick = Excitation(lowest_hz=0.5, highest_hz=20.0, lines=8)
    monkeypatch.setattr(perturbation_plot, "EXCITATION", quick)
    out = tmp_path / "gb"
    code, printed, _ = gfor_command("certify", converter, "--code", "gb", "--out", out, "--json")
    assert code == 0
    figures = json.loads(printed)
    assert figures["verdict"] is None
    assert "no verdict" in figures["sentence"]
    s = 2j * math.pi * 0.5
    droop = -1 / (0.05 / (1 + 0.1 * s) + s * 0.15 / (2 * math.pi * 50))
    assert abs(complex(figures["slow"]["real"], figures["slow"]["imag"]) - droop) < 0.05 * abs(
        droop
    )
    assert figures["phase_jump"]["met"]
    assert "no code says so" in figures["phase_jump"]["sentence"]
    stiff = figures["least"]["Q/V [pu/pu]"]
    assert stiff["value"] == pytest.approx(1 / 0.15 / (1 - (stiff["at_hz"] / 50) ** 2), rel=0.05)
    assert {path.name for path in out.glob("frequency.*")} == {
        "frequency.csv",
        "frequency.json",
        "frequency.png",
    }
