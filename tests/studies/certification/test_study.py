"""The damping test as a whole: our converter passes, detuned ones fail where their exact eigenvalues say so."""

import json
import shutil
import time
import zipfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
import xarray as xr

from fmus.toolchain.catalogue import build_model
from fmus.toolchain.exporter import cached
from fmus.toolchain.native_fmu import NativeFmu
from fmus.toolchain.python_fmu import PythonFmu
from orchestrator.cases.case import load_case
from orchestrator.core.errors import CaseError, InputError
from orchestrator.face.cli import main
from orchestrator.linear.spectra.mode_tracking import ModeSet
from orchestrator.linear.spectra.modes import damping_ratio
from orchestrator.studies.certification import point as point_module
from orchestrator.studies.certification import study as study_module
from orchestrator.studies.certification.case_file import write_case
from orchestrator.studies.certification.codes.certificate import certify_code
from orchestrator.studies.certification.codes.known import code_for
from orchestrator.studies.certification.figures import fit_errors_of, linearised_of
from orchestrator.studies.certification.files import figures_of, save
from orchestrator.studies.certification.judgement import judge, watched
from orchestrator.studies.certification.point import FREQUENCY, POWER, PointResult
from orchestrator.studies.certification.request import (
    REACTANCES,
    CertificationRequest,
    refuse_what_follows_at_once,
)
from orchestrator.studies.certification.study import certify
from orchestrator.studies.points.processes import Processes
from tests.studies.certification.fabricated import figures, rings
from tests.studies.certification.sign_turned import turned
from tests.support import vendor
from tests.support.exact import exact_continuous
from tests.support.interruption import interrupted_after
from tests.support.scenarios import prepare_one


def exact_eigenvalues(model, path, values, X_L):
    """Of the continuous equations, interconnected without any FMU; ``model`` stands for the converter."""
    prepared = prepare_one(path, "with", {**values, "grid.X_L": X_L})
    grid = prepared.system.components["grid"].description.model_name

    def build(name):
        if name == "gfor":
            return model
        return _grid_of(path) if name == grid else build_model(name)

    with mock.patch("tests.support.exact.build_model", build):
        A, _ = exact_continuous(prepared)
    return np.linalg.eigvals(A)


def _grid_of(path):
    from fmus.grid.network import Network, Port  # noqa: PLC0415
    from orchestrator.cases.networks.data import network_data  # noqa: PLC0415

    case = load_case(path)
    data = network_data(case.table.network, case.path.parent)
    ports = tuple(Port(n, t.bus) for n, t in case.table.components.items() if t.bus)
    return build_model(
        "grid",
        network=Network(
            "norm631_grid", data.buses, data.lines, data.loads, ports, data.shunts, data.stray_B
        ),
    )


def is_bad(eigenvalues):
    """By the norm's rule, where the base has all its modes above 5 %."""
    hz = eigenvalues.imag / (2 * np.pi)
    judged = eigenvalues[(hz >= 0.1) & (hz <= 1.5)]
    return eigenvalues.real.max() > 1e-3 or any(damping_ratio(x) < 0.05 for x in judged.tolist())


@pytest.fixture(scope="module")
def executor():
    processes = Processes(2)
    yield processes
    processes.close()


# -- rules -----------------------------------------------------------------------------------------


def test_the_reactances_are_the_norms():
    assert REACTANCES == (0.01, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6)


def test_a_pod_p_is_judged_by_the_frequency_and_everything_else_by_the_power():
    assert [watched(pod) for pod in ("none", "p", "q", "pq")] == [
        POWER,
        FREQUENCY,
        POWER,
        FREQUENCY,
    ]


TIMES = np.arange(0, 61, 0.005)


def point(scenario, ratio, growth=-0.1, rings=None):
    """A system of one mode at 0.5 Hz that rings in SG1's power."""
    rings = ratio if rings is None else rings
    shape = np.eye(1, 2, dtype=complex)
    omega, after = 2 * np.pi * 0.5, np.clip(TIMES - 1, 0, None)
    value = omega * complex(-ratio, np.sqrt(1 - ratio**2))
    signal = 0.9 + 0.01 * (1 - np.exp(-rings * omega * after) * np.cos(omega * after))
    modes = ModeSet(np.array([value]), shape, shape, ("sg1.machine.omega", "sg1.machine.delta"))
    return PointResult(
        0.1,
        scenario,
        modes,
        ["sg1"],
        growth,
        residual=1e-13,
        power=1350.0,
        times=TIMES,
        signals={POWER: signal},
    )


@pytest.mark.parametrize(
    ("having", "lacking", "fault"),
    [
        (point("with", 0.06), point("without", 0.2), None),
        (point("with", 0.04), point("without", 0.2), "takes a mode from 20.00 % to 4.00 %"),
        (point("with", 0.06, rings=0.03), point("without", 0.2), "response of sg1.p: ΔP5M5/ΔP1M1"),
        (point("with", 0.06, growth=0.3), point("without", 0.2), "unstable"),
    ],
)
def test_each_criterion_can_fail_a_point(having, lacking, fault):
    verdict = judge(having, lacking, "none", 1.0)
    assert verdict.accepted == (fault is None)
    assert fault is None or any(fault in text for text in verdict.faults)


def test_a_failure_of_the_study_is_no_pass():
    failed = PointResult(
        0.1, "with", failure="component 'converter' at t = 3 s: fmi2DoStep returned fmi2Error: boom"
    )
    verdict = judge(failed, point("without", 0.2), "none", 1.0)
    assert not verdict.accepted
    assert "boom" in verdict.faults[0]


# -- input -----------------------------------------------------------------------------------------


def test_an_fmu_of_60_hz_is_told_its_codes(tmp_path, fmu_path):
    with pytest.raises(
        InputError, match="rated at 60 Hz, and NTS 631 is a code of 50 Hz; of 60 Hz are --code miso"
    ):
        certify(CertificationRequest(fmu_path("gfor"), None, {"f_n": 60.0}), None, tmp_path)


@pytest.mark.parametrize(
    "tested",
    [
        lambda request, folder: certify(request, None, folder),
        lambda request, folder: certify_code(request, code_for("miso", {}), None, folder),
    ],
)
def test_a_phasor_model_is_not_failed_for_a_network_where_it_cannot_stand(
    tmp_path, fmu_path, tested
):
    with pytest.raises(InputError, match=r"it is a phasor model .* give the converter's EMT model"):
        tested(CertificationRequest(fmu_path("gfor_phasor")), tmp_path)


@pytest.mark.parametrize("code", ["nts631", "tr331"])
def test_a_phasor_model_under_other_names_is_refused(code, tmp_path, gfor):
    """Its current is a function of the voltage, which no name of a variable tells."""
    fmu = vendor.device(tmp_path, ALGEBRAIC=1)
    out = tmp_path / "out"
    words = ("--binding", vendor.binding(tmp_path), "--code", code, "--no-check", "--out", out)
    ended, _, said = gfor("certify", fmu, *words)
    assert ended == 2
    assert said.count("error: ") == 1
    assert "it is a phasor model (its current answers a change of the voltage before any" in said
    assert "give the converter's EMT model" in said


@pytest.mark.parametrize(
    ("defines", "follows"), [({"ALGEBRAIC": 1}, True), ({"SHUNT": 0.05}, False), ({}, False)]
)
def test_a_current_that_is_a_state_follows_no_voltage_at_once(defines, follows, tmp_path):
    """Beside a resistor at its terminals as well, whose current does."""
    request = CertificationRequest(vendor.device(tmp_path, **defines), vendor.binding(tmp_path))
    with pytest.raises(InputError, match="phasor model") if follows else nullcontext():
        refuse_what_follows_at_once(request)


def test_what_cannot_be_used_is_said_at_once(tmp_path, fmu_path, capsys):
    with pytest.raises(InputError, match="there is no such file"):
        write_case(CertificationRequest(tmp_path / "missing.fmu"), {}, tmp_path)
    with pytest.raises(CaseError, match="has no variable"):
        certify(
            CertificationRequest(fmu_path("gfor"), values={"pod_x.enabled": True}),
            Processes(1),
            tmp_path,
        )
    with pytest.raises(SystemExit):
        main(["certify", str(fmu_path("gfor")), "--reactances", "0.1,0.1"])
    assert "are no reactances" in capsys.readouterr().err
    assert main(["certify", str(tmp_path / "missing.fmu"), "--out", str(tmp_path / "x")]) == 2
    assert "there is no such file" in capsys.readouterr().err


# -- keeping ---------------------------------------------------------------------------------------


def test_an_interrupted_test_continues_and_gives_the_same(tmp_path, fmu_path, gfor, monkeypatch):
    arguments = (
        "certify",
        fmu_path("gfor"),
        "--no-check",
        "--reactances",
        "0.1,0.3",
        "--workers",
        1,
        "--out",
    )
    monkeypatch.setattr(study_module, "compute_point", rings)
    assert gfor(*arguments, tmp_path / "whole")[0] == 3
    out = tmp_path / "out"
    monkeypatch.setattr(study_module, "compute_point", interrupted_after(3, rings))
    code, text, error = gfor(*arguments, out)
    assert (code, text) == (130, "")
    assert error.splitlines() == [
        f"interrupted: 3 of 4 points are in {out}; the same command continues from there"
    ]
    monkeypatch.setattr(study_module, "compute_point", rings)
    code, text, _ = gfor(*arguments, out)
    assert code == 3
    assert "3 of 4 points were there already" in text
    assert figures(out) == figures(tmp_path / "whole")
    xr.testing.assert_identical(
        *(xr.load_dataset(folder / "responses.nc") for folder in (out, tmp_path / "whole"))
    )


def test_what_was_changed_is_computed_anew(tmp_path, fmu_path, gfor, monkeypatch):
    """The system without the converter is not touched by the converter's settings."""
    monkeypatch.setattr(study_module, "compute_point", rings)
    fmu = Path(shutil.copy(fmu_path("gfor"), tmp_path))
    arguments = (
        "certify",
        fmu,
        "--no-check",
        "--reactances",
        "0.1",
        "--workers",
        1,
        "--out",
        tmp_path / "out",
    )
    for changes, kept in (
        ((), 0),
        ((), 2),
        (("--set", "pod_q.enabled=true"), 1),
        (("--set", "sg1.machine.H=4"), 0),
    ):
        text = gfor(*arguments, *changes)[1]
        assert (f"{kept} of 2 points were there already" in text) == bool(kept)
    with zipfile.ZipFile(fmu, "a") as archive:  # and its guid stays
        archive.writestr("resources/tables.csv", "1,2")
    assert "1 of 2 points were there already" in gfor(*arguments)[1]


def test_a_point_that_failed_is_tried_again(tmp_path, fmu_path, gfor, monkeypatch):
    arguments = (
        "certify",
        fmu_path("gfor"),
        "--no-check",
        "--reactances",
        "0.1",
        "--workers",
        1,
        "--out",
        tmp_path,
    )

    def fails(task):
        return (
            rings(task)
            if task.scenario == "without"
            else PointResult(task.X_L, task.scenario, failure="no licence")
        )

    monkeypatch.setattr(study_module, "compute_point", fails)
    code, text, _ = gfor(*arguments)
    assert code == 1
    assert "the study failed with the converter: no licence" in text
    monkeypatch.setattr(study_module, "compute_point", rings)
    code, text, _ = gfor(*arguments)
    assert code == 3
    assert "1 of 2 points were there already" in text


def test_threads_of_one_worker_compute_one_point_at_a_time(tmp_path, fmu_path, monkeypatch):
    """As those of a Dask worker; FMUs and the limit on BLAS threads are the whole process's."""
    inside, most = [], []

    def compute(task, case):
        inside.append(task)
        time.sleep(0.1)
        most.append(len(inside))
        inside.remove(task)
        return PointResult(task.X_L, task.scenario, failure="not computed")

    class Threads:
        def run(self, function, tasks):
            with ThreadPoolExecutor(2) as pool:
                yield from enumerate(pool.map(function, tasks))

    monkeypatch.setattr(point_module, "_result", compute)
    result = certify(CertificationRequest(fmu_path("gfor"), reactances=(0.1,)), Threads(), tmp_path)
    assert [point.failure for point in result.results.values()] == ["not computed"] * 2
    assert most == [1, 1]


# -- the study -------------------------------------------------------------------------------------


@pytest.mark.slow
def test_our_converter_passes_and_the_report_can_be_checked_by_hand(tmp_path, fmu_path, capsys):
    arguments = [
        "--no-check",
        "--set",
        "pod_p.enabled=true",
        "--reactances",
        "0.3",
        "--workers",
        "2",
    ]
    assert main(["certify", str(fmu_path("gfor")), *arguments, "--out", str(tmp_path)]) == 3
    assert "is accepted where it was judged" in capsys.readouterr().out
    kept = figures(tmp_path)
    assert main(["certify", str(fmu_path("gfor")), *arguments, "--out", str(tmp_path)]) == 3
    assert "2 of 2 points were there already" in capsys.readouterr().out
    assert figures(tmp_path) == kept
    content = json.loads((tmp_path / "certificate.json").read_text(encoding="utf-8"))
    (verdict,) = content["points"]
    assert verdict["accepted"]
    assert set(content["linearised"].values()) == {"perturbed"}
    assert content["pod"] == "p"
    assert content["signal"] == FREQUENCY
    values = {"converter.pod_p.enabled": True}
    exact = exact_eigenvalues(build_model("gfor"), tmp_path / "case.toml", values, 0.3)
    for mode in verdict["modes"]:
        if mode["damping_percent"] < 60:
            assert np.abs(exact - complex(mode["real"], mode["imag"])).min() < 3e-3
    base = verdict["time_without"]["modal"]["modes"][0]
    assert base["damping_percent"] > 5
    page = (tmp_path / "certificate.html").read_text(encoding="utf-8")
    for text in (
        "Damping test of",
        "Eigenvalue criterion",
        "the frequency at bus 2",
        "Left out: the",
        "Guid",
        "1 of 13",
    ):
        assert text in page
    for swing in verdict["time"]["swings"]["swings"]:
        (t0, p0), (t, m), (t1, p1) = swing["P"], swing["M"], swing["P_next"]
        assert swing["depth"] == pytest.approx(p0 + (t - t0) / (t1 - t0) * (p1 - p0) - m, rel=1e-9)
        assert f"{m:.6f}" in page


@pytest.mark.slow
@pytest.mark.parametrize(
    ("controller", "sign_turned", "gain", "reactances"),
    [
        ("pod_q", False, 2000.0, (0.1, 0.3)),
        ("pod_p", True, 2000.0, (0.01,)),
        ("pod_q", True, 200.0, (0.1,)),
    ],
)
def test_a_detuned_pod_fails_where_its_eigenvalues_say(
    tmp_path, executor, controller, sign_turned, gain, reactances
):
    """A tenfold gain, a turned sign, or both; a turned POD-Q of the usual gain is told by what it changes."""
    model = turned(controller) if sign_turned else build_model("gfor")
    values = {f"{controller}.enabled": True, f"{controller}.K": gain}
    request = CertificationRequest(cached(NativeFmu(model)), values=values, reactances=reactances)
    result = certify(request, executor, tmp_path)
    own = {f"converter.{name}": value for name, value in values.items()}
    wanted = {X: is_bad(exact_eigenvalues(model, result.case, own, X)) for X in reactances}
    for verdict in result.verdicts:
        against = any(
            "does not damp the electromechanical mode" in fault for fault in verdict.faults
        )
        assert verdict.accepted != (wanted[verdict.X_L] or against), verdict.faults
        assert against or gain > 1000
    assert any(wanted.values()) == (gain > 1000)
    sentence = figures_of(result)["sentence"]
    for X_L, bad in wanted.items():
        assert not bad or f"{X_L:g}" in sentence
    save(result, tmp_path)
    page = (tmp_path / "certificate.html").read_text(encoding="utf-8")
    assert ('<span class="bad">not accepted</span>' in page) == (result.verdict == "fails")


@pytest.mark.nightly
@pytest.mark.slow
def test_a_converter_that_hides_its_states_gets_the_same_verdict(tmp_path, executor, fmu_path):
    results = [
        certify(
            CertificationRequest(
                cached(PythonFmu(build_model("gfor"))), reactances=(0.2,), black_box=black_box
            ),
            executor,
            tmp_path,
        )
        for black_box in (False, True)
    ]
    assert [linearised_of(result)["converter"] for result in results] == ["perturbed", "identified"]
    assert figures_of(results[1])["linearised"] == linearised_of(results[1])
    assert 0 < fit_errors_of(results[1])["converter"] < 1e-3
    save(results[1], tmp_path)
    assert "converter (fitting error" in (tmp_path / "certificate.html").read_text(encoding="utf-8")
    shown, hidden = (result.verdicts[0] for result in results)
    assert shown.accepted
    assert hidden.accepted
    for mode in shown.modes:
        if mode.damping_percent < 60:
            same = min(hidden.modes, key=lambda m: abs(m.eigenvalue - mode.eigenvalue))
            assert same.frequency_hz == pytest.approx(mode.frequency_hz, abs=0.01)
            assert same.damping_percent == pytest.approx(mode.damping_percent, abs=0.3)
