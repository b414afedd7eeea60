"""What `fmu check` says of a device and its binding, `modes`, `run` and `certify` say of both in the same words."""

import json
import re
from functools import partial
from pathlib import Path

import pytest

from orchestrator.core.errors import ComponentError
from orchestrator.devices.acceptance.checks.base import REMEDIES
from orchestrator.devices.acceptance.runner import check_fmu
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.devices.fmi.instance import open_component
from orchestrator.face.cli import main
from orchestrator.studies.black_box import coupled_modes
from orchestrator.studies.black_box.frequency_response import Excitation
from tests.support import vendor

pytestmark = pytest.mark.usefixtures("undrawn")

in_process = pytest.mark.usefixtures("in_process")
"""The device is in a process of its own where a mark is missing: with the right binding, and with a wrong sign."""


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    return vendor.device(tmp_path_factory.mktemp("vendor"))


@pytest.fixture
def typed(fmu, tmp_path, capfd, monkeypatch):
    """A command in a folder with the device, a binding of it and a case."""
    (tmp_path / "vendor.fmu").write_bytes(fmu.read_bytes())
    monkeypatch.chdir(tmp_path)

    def run(*words, **bound):
        f_n, depth = bound.get("f_n", 50.0), bound.pop("depth", 0.2)
        vendor.binding(tmp_path, **bound)
        vendor.case(tmp_path, f_n, depth=depth)
        code = main([*map(str, words)])
        out, err = capfd.readouterr()
        return code, out, re.sub(r"\s+", " ", err)

    return run


def checked(typed, *only, **bound):
    words = [word for name in only for word in ("--only", name)]
    _, out, _ = typed("check", "vendor.fmu", "--binding", "vendor.toml", *words, "--json", **bound)
    return {check["check"]: check for check in json.loads(out)["checks"]}


WRONG = {"f_n": 60.0}


@pytest.mark.slow
def test_another_frequency_is_found_alike_and_nothing_slips(typed):
    found = checked(typed, "rated_frequency", **WRONG)["rated_frequency"]
    assert found["fault"] == "wrong rated frequency"
    assert "made for 50 Hz where 60 Hz is bound" in found["evidence"]
    sentence = f"gfor: {found['fault']}: {found['evidence']}; {found['remedy']}"
    _, out, said = typed("run", "case.toml", "--out", "r", "--json", **WRONG)
    (summary,) = json.loads(out)
    kinds = {finding["kind"]: finding for finding in summary["findings"]}
    assert sentence in said
    assert "loss_of_synchronism" not in kinds
    assert kinds["misfit"]["message"] == sentence
    _, out, said = typed("modes", "case.toml", "--black-box", "--json", **WRONG)
    assert sentence in json.loads(out)["scenarios"][0]["warnings"]
    assert "wrong rated frequency" in typed("modes", "case.toml", "--black-box", **WRONG)[1]


@pytest.mark.parametrize(
    ("bound", "check", "fault"),
    [
        ({"direction": "into the converter"}, "power_balance", "wrong sign"),
        # `check` asks with dips, which take long
        ({"i_max": 0.4}, None, "above its current limit"),
    ],
)
def test_sign_and_limit_are_found_alike(typed, bound, check, fault, request):
    if check:
        assert checked(typed, check, **bound)[check]["fault"] == fault
    else:
        request.getfixturevalue("in_process")
    said = typed("run", "case.toml", "--out", "r", **bound)[2]
    assert f"gfor: {fault}: " in said
    assert REMEDIES[fault] in said


@in_process
@pytest.mark.parametrize(("i_max", "above"), [(0.65, True), (1.5, False)])
def test_a_run_finds_a_limit_that_a_dip_exceeds(typed, i_max, above):
    """It gives 0.6 pu at rest, and its limit is at 1.5 pu."""
    _, out, _ = typed(
        "run",
        "case.toml",
        "--scenario",
        "dip",
        "--stop",
        "1.2",
        "--out",
        "r",
        "--json",
        i_max=i_max,
    )
    found = [f for f in json.loads(out)[0]["findings"] if f["kind"] == "misfit"]
    assert len(found) == above
    for finding in found:
        assert "gfor: above its current limit: " in finding["message"]
        assert f"{i_max:g} pu is declared" in finding["message"]
        assert 1 <= finding["time"] < 1.02
        assert 0.7 < finding["mean"] < 0.9


@in_process
@pytest.mark.parametrize("bound", [{"v_n": 230.0}, {"rating": 4.0}])
def test_another_rating_than_delivered_is_told(typed, fmu, bound, tmp_path):
    told = checked(typed, "binding", **bound)["binding"]
    assert told["verdict"] == "remark"
    said = typed("run", "case.toml", "--out", "r", **bound)[2]
    assert told["evidence"] in said
    component = open_component("gfor", bound_fmu(fmu, vendor.binding(tmp_path, **bound)))
    try:
        with pytest.raises(ComponentError, match="likely cause: the binding has"):
            component.check(3, "fmi2DoStep", 0.1)
    finally:
        component.close()


@in_process
@pytest.mark.parametrize(
    ("bound", "said"),
    [
        ({"v_n": 22.0}, "V_n"),
        ({"v_n": 18.0}, "V_n"),
        ({"rating": 1400.0}, "S_n = 1400 MVA, and the FMU's S_n is 1500 MVA"),
    ],
)
def test_a_rating_a_little_off_is_named_and_is_the_likely_cause(typed, fmu, bound, said, tmp_path):
    """10 per cent beside what the FMU has by itself: a limit of the declared size is then exceeded, or not reached."""
    told = checked(typed, "binding", **bound)["binding"]
    assert told["verdict"] == "remark"
    assert said in told["evidence"]
    if "v_n" in bound:
        assert f"({bound['v_n']:g} kV, and 20 kV by itself)" in told["evidence"]
    found = typed("run", "case.toml", "--out", "r", **bound, i_max=0.4)[2]
    assert "above its current limit" in found
    assert (
        f"likely cause: the binding has {told['evidence'].removeprefix('the binding has ')}"
        in found
    )


@in_process
@pytest.mark.parametrize(("i_max", "found"), [(1.05, True), (1.5, False)])
def test_a_limit_that_is_exceeded_in_a_dip_alone_is_found_in_a_run(typed, i_max, found):
    _, out, _ = typed("run", "case.toml", "--out", "r", "--json", i_max=i_max, depth=0.7)
    told = [f for f in json.loads(out)[0]["findings"] if f["kind"] == "misfit"]
    assert bool(told) is found
    for finding in told:
        assert finding["time"] > 0.5
        assert 1.2 < finding["mean"] < 1.6
        assert "above its current limit" in finding["message"]
        assert "; 1.05 pu is declared; " in finding["message"]


@in_process
@pytest.mark.slow
def test_a_device_that_does_not_fit_its_binding_is_not_called_stable(typed, monkeypatch):
    # one second of excitation instead of twenty: what is judged here lies in the device's steady state
    monkeypatch.setattr(coupled_modes, "Excitation", partial(Excitation, lowest_hz=1.0))
    modes = ("modes", "case.toml", "--black-box")
    code, shown, _ = typed(*modes, "--fail-unstable", "--out", "m", i_max=0.4)
    first = shown.split("└")[0]
    assert "not known" in first
    assert "above its current limit" in first
    assert code == 1
    stability = json.loads(Path("m/modes.json").read_text(encoding="utf-8"))["scenarios"][0][
        "stability"
    ]
    assert stability["stable"] is None
    assert stability["reason"] == "gfor does not fit its binding: above its current limit"
    assert "stable" in typed(*modes)[1].split("└")[0]


@in_process
@pytest.mark.slow
def test_check_names_the_rating_beside_the_limit_that_is_exceeded(typed):
    found = checked(typed, "limits", v_n=22.0, i_max=1.5)["limits"]
    assert found["fault"] == "above its current limit"
    assert "likely cause: the binding has another V_n" in found["evidence"]
    assert "(22 kV, and 20 kV by itself)" in found["evidence"]
    assert found["whose"] == "the binding"
    assert "likely cause" not in checked(typed, "limits", i_max=1.5)["limits"]["evidence"]


@pytest.mark.slow
def test_another_frequency_is_one_accusation(typed):
    found = checked(typed, "rated_frequency", "power_balance", "signs", **WRONG)
    assert [name for name, check in found.items() if check["fault"]] == ["rated_frequency"]
    assert "because it failed in 'rated_frequency'" in found["signs"]["evidence"]


def test_a_right_binding_is_not_accused(typed, fmu, tmp_path):
    code, out, said = typed("run", "case.toml", "--out", "r", "--json")
    assert code == 0
    assert not [f for f in json.loads(out)[0]["findings"] if f["kind"] == "misfit"]
    assert "the binding has" not in said
    assert checked(typed, "binding", "rated_frequency")["binding"]["verdict"] == "pass"
    component = open_component("gfor", bound_fmu(fmu, vendor.binding(tmp_path)))
    try:
        with pytest.raises(ComponentError) as caught:
            component.check(3, "fmi2DoStep", 0.1)
        assert "the binding has" not in str(caught.value)
    finally:
        component.close()


@in_process
@pytest.mark.parametrize(
    ("begins", "f_n", "lag"),
    [
        *((0.0, 50.0, 0.03), (0.0, 60.0, 0.03), (1.0, 60.0, 0.03), (1.0, 60.0, 0.5)),
        *(pytest.param(b, 50.0, 0.03, marks=pytest.mark.slow) for b in (0.9, 50.0)),
    ],
)
def test_a_meter_that_settles_is_judged_where_it_has(typed, begins, f_n, lag, tmp_path):
    """It is honest however it begins, 0 or its frequency in place of 1; one for another frequency is found anyway, be
    it that it begins at 1."""
    shown = vendor.device(tmp_path, METER_BEGINS=begins, FAULT_OMEGA_LAGS=lag)
    (tmp_path / "vendor.fmu").write_bytes(shown.read_bytes())
    found = checked(typed, "rated_frequency", f_n=f_n)["rated_frequency"]
    _, out, _ = typed("run", "case.toml", "--stop", "0.3", "--out", "r", "--json", f_n=f_n)
    kinds = {finding["kind"]: finding["message"] for finding in json.loads(out)[0]["findings"]}
    assert "loss_of_synchronism" not in kinds
    if f_n == 50:
        assert found["verdict"] == "pass"
        assert "misfit" not in kinds
    else:
        assert found["fault"] == "wrong rated frequency"
        assert found["evidence"] in kinds["misfit"]


def test_units_that_a_binding_converts_are_not_accused(tmp_path):
    """The device calls its ports v_re and i_re as ours does, in kV and kA."""
    path = vendor.device(tmp_path)
    bound = check_fmu(path, vendor.binding(tmp_path), only=("units",), run_for=0.3)
    assert bound.faults == []
    assert check_fmu(path, None, only=("units",), run_for=0.3).faults == ["wrong units"]
