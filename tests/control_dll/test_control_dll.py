"""Our control as IEEE/CIGRE DLL: the FMU's own signals to the last bit, and errors in words."""

import sys
from pathlib import Path

import numpy as np
import pytest

from fmus.control_dll import export
from fmus.control_dll.export import (
    DLL_TARGETS,
    ControlDllError,
    control_part_of,
    with_values,
    write_dll,
)
from fmus.vendor_dll.fmu import dll_fmu, read_dll
from orchestrator.devices.acceptance.checks.base import Verdict
from orchestrator.devices.acceptance.controller_dll.conformity import check_dll
from orchestrator.devices.acceptance.controller_dll.questions import DLL_QUESTIONS
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from orchestrator.face.cli import main
from tests.control_dll.conftest import PODS
from tests.control_dll.hosts import HOST, STEP, ControlHost, driven, fmu_call
from tests.support.programs import compiled_program


@pytest.fixture(scope="module")
def host():
    """The host in C, compiled for this machine."""
    if not sys.platform.startswith("linux"):
        pytest.skip("the host is compiled for Linux")
    return compiled_program(HOST, DLL_TARGETS["linux64"][0])


def test_a_host_in_c_gets_the_signals_of_the_fmu_to_the_last_bit(
    part, written, drive, host, tmp_path
):
    given = [f"{name.replace('.', '_')}={value}" for name, value in PODS.items()]
    ours, said = driven(
        [host, "dll", written().libraries["linux64"], "IN", "OUT", *given], drive, tmp_path
    )
    call, model = fmu_call(part, PODS, tmp_path)
    theirs, _ = driven([host, *call], drive, tmp_path)
    assert len(ours) == len(drive)
    assert np.array_equal(ours, theirs)
    assert f"{len(model.states)} states every 2e-05 s" in said
    moved = np.ptp(ours[:, [3, 4, 5, 6, 7]], axis=0)  # p, q, omega and both PODs
    assert np.all(moved > [100, 100, 1e-5, 1e-4, 1e-4])


def test_a_parameter_given_by_name_is_the_fmus_parameter(part, written, drive, host, tmp_path):
    """A different value gives different signals: equality above is not that of two deaf programs."""
    library = written().libraries["linux64"]
    plain, _ = driven([host, "dll", library, "IN", "OUT"], drive, tmp_path)
    other, _ = driven(
        [host, "dll", library, "IN", "OUT", "droop_R_V=0.1", "pod_p_enabled=1"], drive, tmp_path
    )
    call, _ = fmu_call(part, {"droop.R_V": 0.1, "pod_p.enabled": 1}, tmp_path)
    theirs, _ = driven([host, *call], drive, tmp_path)
    assert not np.allclose(plain[:, :3], other[:, :3], rtol=1e-9)
    assert np.array_equal(other, theirs)


def test_our_importer_reads_it_and_runs_it(written, drive, tmp_path):
    dll = read_dll(written(**PODS).libraries["linux64"])
    assert (dll.interface.sample_time, dll.interface.mode, dll.interface.states) == (
        STEP,
        1,
        (5, 0, 22),
    )
    assert dll.trial.state == "arrays", dll.trial.why
    bare = ControlHost(written(**PODS).libraries["linux64"])
    bare.inputs[:] = drive[0]
    assert [bare.call(name) for name in ("FirstCall", "CheckParameters", "Initialize")] == [0, 0, 0]
    names = [signal.name for signal in dll.interface.inputs]
    with LoadedComponent("control", read_description(dll_fmu(dll, tmp_path))) as component:
        component.setup(0.0, None)
        component.enter_initialization_mode()
        component.set(dict(zip(names, drive[0], strict=True)))
        component.exit_initialization_mode()
        for k, row in enumerate(drive[:200]):
            component.set(dict(zip(names, row, strict=True)))
            component.step(k * STEP, STEP)
            expected = bare.sample(row)
            assert [component.values([n])[n] for n in ("v_a", "v_b", "v_c")] == list(expected[:3])


def test_all_of_its_state_is_in_the_hosts_arrays(written, drive):
    """Put back, they repeat every sample to the last bit; two instances do not know each other."""
    one, two = (started(written(**PODS), drive[0]) for _ in range(2))
    first = [one.sample(row) for row in drive[:100]]
    arrays = one.ints.copy(), one.doubles.copy()
    then = [one.sample(row) for row in drive[100:200]]
    assert np.array_equal([two.sample(row) for row in drive[:100]], first)
    one.ints[:], one.doubles[:] = arrays
    assert np.array_equal([one.sample(row) for row in drive[100:200]], then)


def started(written, inputs, **values):
    control = ControlHost(written.libraries["linux64"], **values)
    control.inputs[:] = inputs
    codes = [
        control.call(name) for name in ("PrintInfo", "FirstCall", "CheckParameters", "Initialize")
    ]
    assert codes == [0, 0, 0, 0], control.error
    return control


# -- mistakes of a host ----------------------------------------------------------------------------


def test_a_parameter_out_of_bounds_is_named(written):
    control = ControlHost(written().libraries["linux64"], droop_tau_P=0)
    assert control.call("CheckParameters") == 2
    assert control.error == "gfor_control: parameter droop_tau_P must be from 0.001 to 1e+30"


def test_a_rule_of_the_model_is_told(written):
    control = ControlHost(written().libraries["linux64"], P_0=1.3)
    assert control.call("Initialize") == 2
    assert "more active current than voltage_control.i_q_max" in control.error


def test_an_rms_program_is_refused(written):
    control = ControlHost(written().libraries["linux64"], mode=2)
    assert [control.call(name) for name in ("CheckParameters", "Initialize", "Iterate")] == [
        2,
        2,
        2,
    ]
    assert "it is for EMT programs" in control.error


def test_a_sample_before_the_start_is_refused(written):
    control = ControlHost(written().libraries["linux64"])
    assert (control.call("FirstCall"), control.call("Outputs")) == (0, 2)
    assert "before Model_Initialize" in control.error


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("P_0", 0.5, "a fixed parameter was changed"),
        ("pod_p_limit", -1, "parameter pod_p_limit must be from 0 to 1e+30"),
    ],
)
def test_a_parameter_that_may_not_change_so_is_refused_in_the_run(
    written, drive, name, value, words
):
    control = started(written(), drive[0])
    control.sample(drive[1])
    before = control.doubles.copy()
    control.set(name, value)
    assert control.call("Outputs") == 2
    assert words in control.error
    assert np.array_equal(control.doubles, before)


def test_a_tunable_parameter_acts_at_once(written, drive):
    control, same = (started(written(), drive[0]) for _ in range(2))
    control.set("droop_delta_U_ref", 0.05)
    ours, theirs = control.sample(drive[1]), same.sample(drive[1])
    assert np.abs(ours[:3] - theirs[:3]).max() > 1


def test_an_input_that_is_no_number_is_named(written, drive):
    control = started(written(), drive[0])
    control.inputs[4] = np.nan
    assert control.call("Outputs") == 2
    assert control.error == "gfor_control: input i_s_b is not a finite number"


def test_while_a_host_holds_it_at_its_start_the_voltage_turns_on(written):
    """A period later it is the same; a quarter of a period later it is turned by 90°."""
    control = ControlHost(written().libraries["linux64"])
    outputs = {}
    for time in (0.0, 0.005, 0.02):
        turn = np.exp(1j * (2 * np.pi * 50 * time - 2 * np.pi / 3 * np.arange(3)))
        control.inputs[:3] = (230 * np.sqrt(2 / 3) * turn).real
        control.inputs[3:] = np.tile(0.9 * 1500 / 230 * np.sqrt(2 / 3) * turn.real, 2)
        assert control.call("Initialize", time) == 0, control.error
        outputs[time] = control.outputs[:3].copy()
    _, b, c = outputs[0.0]
    assert outputs[0.02] == pytest.approx(outputs[0.0], rel=1e-9)
    assert outputs[0.005][0] == pytest.approx((c - b) / np.sqrt(3), rel=1e-9)


# -- mistakes of a user ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"droop.R_x": 1}, "there is no parameter 'droop.R_x'"),
        ({"droop.tau_P": 0}, "droop.tau_P = 0; it must be a number from 0.001 to any"),
        ({"pod_p.N_S": 1.5}, "pod_p.N_S = 1.5; it must be a whole number from 0 to 3"),
        ({"pod_p.enabled": 2}, "pod_p.enabled = 2; it must be a whole number from 0 to 1"),
        ({"P_0": 1.3}, "more active current than"),
    ],
)
def test_defaults_that_cannot_be_are_refused(part, values, words):
    with pytest.raises(ControlDllError, match=words):
        with_values(part, values, STEP)


def test_what_cannot_be_written_is_refused(part, tmp_path):
    with pytest.raises(ControlDllError, match="choose from: gfor"):
        control_part_of("gfl")
    with pytest.raises(ControlDllError, match=r"a sample time of 0\.001 s; it must be from"):
        write_dll(part, tmp_path, ("linux64",), 1e-3)
    with pytest.raises(ControlDllError, match="no platform 'win16'"):
        write_dll(part, tmp_path, ("win16",))
    assert not list(tmp_path.iterdir())


def test_the_command_writes_library_and_sheet(tmp_path, capsys):
    call = [
        "export",
        "dll",
        "gfor",
        "--platform",
        "linux64",
        "--dest",
        str(tmp_path),
        "--set",
        "S_n=500",
    ]
    assert main(call) == 0
    library, sheet = capsys.readouterr().out.split()
    assert read_dll(Path(library)).interface.sample_time == 2e-5
    text = Path(sheet).read_text(encoding="utf-8")
    assert "| power | 500 MVA | S_n |" in text
    assert (
        f"| L_c | converter-side inductor, bridge to capacitor | {0.15 * 230**2 / 500 / 0.1 / np.pi:.10g} mH"
        in text
    )
    assert main([*call, "--set", "S_n=abc"]) == 2
    assert "give NAME=VALUE with a number" in capsys.readouterr().err
    assert main(["export", "dll", "gfl", "--dest", str(tmp_path)]) == 2
    assert "'gfl' has no control part" in capsys.readouterr().err


def test_an_export_that_ends_half_way_leaves_nothing(part, tmp_path, monkeypatch):
    def full(*_):
        raise OSError("no space left")

    monkeypatch.setattr(export, "data_sheet", full)
    with pytest.raises(OSError, match="no space left"):
        write_dll(part, tmp_path / "dest", ("linux64",))
    assert not (tmp_path / "dest").exists()
    monkeypatch.undo()
    monkeypatch.setattr(export.Path, "replace", full)
    with pytest.raises(OSError, match="no space left"):
        write_dll(part, tmp_path / "dest", ("linux64",))
    assert not [path for path in (tmp_path / "dest").rglob("*") if path.is_file()]


def test_it_keeps_the_interface(written):
    results = check_dll(written().libraries["linux64"])
    assert [r.check for r in results] == list(DLL_QUESTIONS)
    assert not [(r.check, r.evidence) for r in results if r.verdict is Verdict.FAIL]
