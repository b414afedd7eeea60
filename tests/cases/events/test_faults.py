"""Faults and imperfections in case files: what they come to, what is refused with its line, who must know of them."""

import numpy as np
import pytest

from fmus.toolchain.cache import cache_directory, keep
from orchestrator.cases.case import BUILT_IN, load_case
from orchestrator.core.errors import AnalysisError, CaseError
from orchestrator.devices.fmi.instance import is_ours
from orchestrator.face.cli import main
from orchestrator.simulation.interop.rules import MASTERS
from orchestrator.simulation.watch.settings import Settings
from orchestrator.studies.modes.linear import linear_response
from orchestrator.studies.modes.modes import compute_modes, running
from orchestrator.studies.runs.like import run_like
from orchestrator.studies.runs.run import run_scenario
from orchestrator.systems.coupling.events import (
    NotANumber,
    Silence,
    UnitSwitching,
    WireFault,
    WireRecovery,
)
from orchestrator.systems.coupling.imperfections import Bias, Delay, DropOut, Noise, Quantisation

TEXT = (BUILT_IN / "two_area" / "case.toml").read_text(encoding="utf-8")
OWN_EVENT = TEXT[TEXT.index("[[events]]") : TEXT.index("[scenarios.base]")]
V_RE = "grid.bus_2.v_re -> gfor.v_re"


def case_with(tmp_path, more, events=""):
    """The two-area case without its own event, with some tables and events."""
    path = tmp_path / "case.toml"
    path.write_text(TEXT.replace(OWN_EVENT, f"{events}\n{more}\n"), encoding="utf-8")
    return load_case(path)


def event(kind, rest="", time="1 s", connection=V_RE):
    wire = f'connection = "{connection}"\n' if connection else ""
    return f'[[events]]\ntype = "{kind}"\ntime = "{time}"\n{wire}{rest}\n'


def prepare(case, scenario="gfor", overrides=None, **options):
    (prepared,) = case.prepare([scenario], overrides, **options)
    return prepared


def problems(case, **options):
    with pytest.raises(CaseError) as caught:
        prepare(case, **options)
    return str(caught.value)


# -- what tables come to ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "rest", "expected"),
    [
        ("bias", 'value = "0.02 pu"', Bias(0.02)),
        ("noise", 'deviation = 0.01\nseed = 3\nbandwidth = "50 Hz"', Noise(0.01, 3, 50.0)),
        ("freeze", "", DropOut()),
        ("drop_out", "", DropOut()),
        ("drop_out", 'substitute = "zero"', DropOut(0.0)),
        ("drop_out", "substitute = 0.5", DropOut(0.5)),
        ("delay", 'delay = "20 ms"', Delay(0.02)),
        ("quantisation", "step = 1e-3", Quantisation(1e-3)),
    ],
)
def test_an_event_and_a_table_come_to_the_same_imperfection(tmp_path, kind, rest, expected):
    begun, ended = prepare(case_with(tmp_path, "", event(kind, f'{rest}\nend = "2 s"'))).events
    assert isinstance(begun, WireFault)
    assert isinstance(ended, WireRecovery)
    assert (begun.time, begun.imperfection, ended.time, ended.imperfection) == (
        1.0,
        expected,
        2.0,
        expected,
    )
    assert str(begun.connection) == V_RE
    table = f'[imperfections.one]\ntype = "{kind}"\nconnection = "{V_RE}"\n{rest}'
    (plan,) = prepare(case_with(tmp_path, table)).system.wires.values()
    assert plan.permanent == {type(expected): expected}


def test_a_pattern_means_all_connections_that_fit(tmp_path):
    table = '[imperfections.late]\ntype = "delay"\nconnection = "grid.*.v_* -> *.v_*"\ndelay = 1e-3'
    prepared = prepare(case_with(tmp_path, table))
    assert len(prepared.system.wires) == 6
    assert prepared.values["imperfections.late.delay"] == 1e-3


def test_a_scenario_and_the_command_line_set_the_numbers(tmp_path):
    table = f'[imperfections.late]\ntype = "delay"\nconnection = "{V_RE}"\ndelay = 0'
    case = case_with(tmp_path, table)
    assert not prepare(case).system.wires
    (plan,) = prepare(case, overrides={"imperfections.late.delay": "3 ms"}).system.wires.values()
    assert plan.delay == 3e-3
    assert "no imperfection 'lat'; did you mean late?" in problems(
        case, overrides={"imperfections.lat.delay": 1.0}
    )
    assert "imperfections.late.dela" in problems(case, overrides={"imperfections.late.dela": 1.0})


def test_a_scenario_that_removes_the_component_has_no_fault_of_it(tmp_path):
    table = f'[imperfections.late]\ntype = "delay"\nconnection = "{V_RE}"\ndelay = 1e-3'
    prepared = prepare(case_with(tmp_path, table, event("bias", "value = 0.1")), "base")
    assert not prepared.events
    assert not prepared.system.wires


def test_the_trip_of_a_converter_opens_its_breaker_and_its_current_ends(tmp_path):
    case = case_with(tmp_path, "", event("component_trip", 'component = "gfor"', "0.1 s", ""))
    prepared = prepare(case, stop_time=0.2)
    assert prepared.events == (
        UnitSwitching(0.1, "grid", "gfor", connected=False, has_breaker=True),
    )
    with running(prepared) as master:
        master.run(0.2, prepared.events)
        current = master.components["gfor"].get(["i_re", "i_im"])
    assert np.allclose(list(current.values()), 0.0, atol=1e-9)


def test_faults_of_components(tmp_path):
    nan = prepare(case_with(tmp_path, "", event("nan_output", 'component = "sg1"', "1 s", "")))
    assert nan.events == (NotANumber(1.0, "sg1"),)
    isolated = '[components.gfor]\nisolated = true\nmodel = "gfor"'
    text = TEXT.replace(OWN_EVENT, event("time_out", 'component = "gfor"', "1 s", ""))
    path = tmp_path / "isolated.toml"
    path.write_text(text.replace('[components.gfor]\nmodel = "gfor"', isolated), encoding="utf-8")
    assert prepare(load_case(path)).events == (Silence(1.0, "gfor"),)


def test_a_model_of_ours_is_ours_before_it_is_built(monkeypatch, tmp_path):
    """So that a time-out is refused at it with an empty cache as well."""
    monkeypatch.setenv("GFOR_COSIM_CACHE", str(tmp_path))
    assert is_ours(cache_directory("fmus") / "to come" / "gfor.fmu")
    stranger = cache_directory("fmus") / "gfor.fmu"
    stranger.parent.mkdir(parents=True, exist_ok=True)
    stranger.write_bytes(b"of somebody else")
    assert not is_ours(stranger)


def test_a_stranger_is_ours_once_the_same_is_built(monkeypatch, tmp_path):
    """What was found of a file counts as long as nothing is built, and the file stays as it was."""
    monkeypatch.setenv("GFOR_COSIM_CACHE", str(tmp_path))
    copy, built = tmp_path / "copy.fmu", cache_directory("fmus") / "key" / "gfor.fmu"
    copy.write_bytes(b"an FMU")
    assert not is_ours(copy)
    built.parent.mkdir(parents=True)
    keep(built, b"an FMU")
    assert is_ours(copy)
    copy.write_bytes(b"another")
    assert not is_ours(copy)


# -- what is refused, with its line and the remedy -------------------------------------------------


@pytest.mark.parametrize(
    ("events", "words"),
    [
        (
            event("bias", "value = 0.1", connection="grid.bus_2.v -> gfor.v_re"),
            "there is no connection",
        ),
        (
            event("bias", "value = 0.1", connection="gfor.v_re"),
            "component.output -> component.input",
        ),
        (event("bias", 'value = "1 kV"'), "value"),
        (event("bias", "value = inf"), "it must be a finite number"),
        (event("noise", "deviation = -1\nseed = 1"), "deviation = -1 pu; it must be at least 0"),
        (
            event("noise", "deviation = 1\nseed = 1\nbandwidth = 5000"),
            "bandwidth = 5000 Hz; it must be below 5000 Hz",
        ),
        (event("noise", "deviation = 1\nseed = -1"), "seed"),
        (event("delay", "delay = 0.12345e-3"), "no multiple of the communication step of 0.0001 s"),
        (event("delay", "delay = -1"), "delay"),
        (event("bias", "value = 0.1", "1.00005 s"), "not a communication point"),
        (event("bias", "value = 0.1\nend = 1.00005"), "not a communication point"),
        (event("bias", "value = 0.1\nend = 1.0"), "end = 1 s is not after time = 1 s"),
        (event("bias", "value = 0.1", "25 s"), "never happens, as the run stops at 20 s"),
        (event("bias", "value = 0.1", "20 s"), "never happens, as the run stops at 20 s"),
        (
            event("bias", "value = 0.1") * 2,
            "the bias of grid.bus_2.v_re -> gfor.v_re is set at 1 s by line",
        ),
        (
            event("freeze") + event("drop_out", "substitute = 0"),
            "the loss of grid.bus_2.v_re -> gfor.v_re is set at",
        ),
        (
            event("delay", "delay = 1e-3\nend = 3") + event("delay", "delay = 2e-3", "2 s"),
            "lasts from 1 s to 3 s",
        ),
        (
            event("delay", "delay = 1e-3") + event("delay", "delay = 2e-3", "2 s"),
            "lasts from 1 s to the run's end",
        ),
        (
            event("time_out", 'component = "gfor"', connection=""),
            "'isolated = true' to try a time-out",
        ),
        (event("nan_output", 'component = "gfo"', connection=""), "there is no component 'gfo'"),
        (
            event("load_change", 'load = "load_2"\nscale = 1.1', connection="") * 2,
            "grid.load_2.scale is set at 1 s by",
        ),
        (
            event("load_change", 'load = "load_2"\nscale = 1.1', "30 s", ""),
            "never happens, as the run stops at 20 s",
        ),
    ],
)
def test_what_cannot_be_is_refused_with_its_line(tmp_path, events, words):
    said = problems(case_with(tmp_path, "", events))
    assert words in said
    assert "line " in said


def test_faults_that_follow_one_another_need_no_gap(tmp_path):
    events = event("delay", "delay = 1e-3\nend = 2") + event(
        "delay", "delay = 2e-3\nend = 3", "2 s"
    )
    times = [(type(e), e.time) for e in prepare(case_with(tmp_path, "", events)).events]
    assert times == [(WireFault, 1.0), (WireFault, 2.0), (WireRecovery, 3.0)]


def test_an_event_after_a_stop_that_was_chosen_for_the_run_is_said(tmp_path):
    case = case_with(tmp_path, "", event("bias", "value = 0.1"))
    prepared = prepare(case, stop_time=0.5)
    assert not prepared.events
    assert any(
        "never happens, as the run stops at 0.5 s (--stop)" in str(q) for q in prepared.questions
    )


# -- who must know of them -------------------------------------------------------------------------

LATE = f'[imperfections.late]\ntype = "delay"\nconnection = "{V_RE}"\ndelay = "2 ms"'
FAULT = event("bias", "value = 0.01", "0.1 s")


@pytest.mark.parametrize(("more", "events", "words"), [(LATE, "", "delay"), ("", FAULT, "fault")])
def test_an_ssp_is_refused_rather_than_written_without_them(tmp_path, capsys, more, events, words):
    case = case_with(tmp_path, more, events)
    assert (
        main(
            [
                "export",
                "ssp",
                str(case.path),
                "--scenario",
                "gfor",
                "--out",
                str(tmp_path / "x.ssp"),
            ]
        )
        == 2
    )
    assert words in capsys.readouterr().err
    assert not (tmp_path / "x.ssp").exists()


@pytest.mark.parametrize(("more", "events"), [(LATE, ""), ("", FAULT)])
def test_other_masters_refuse_by_name(tmp_path, more, events):
    prepared = prepare(case_with(tmp_path, more, events), stop_time=0.2)
    with pytest.raises(Exception, match=r"knows no imperfections.*grid.bus_2.v_re -> gfor.v_re"):
        run_like(prepared, next(iter(MASTERS.values())))


def test_a_linear_response_refuses_a_fault(tmp_path):
    prepared = prepare(case_with(tmp_path, "", FAULT), stop_time=0.2)
    with running(prepared) as master, pytest.raises(Exception, match="cannot follow a fault"):
        linear_response(master, prepared)


def test_modes_and_run_say_that_a_fault_comes_later_and_record_it(tmp_path):
    prepared = prepare(case_with(tmp_path, "", FAULT), stop_time=0.2)
    result = run_scenario(prepared)
    assert any("has faults later (bias 0.01)" in w for w in result.modes.warnings)
    assert "bias 0.01" in result.dataset.attrs["events"]
    v = result.dataset["gfor.p"].values
    at = result.dataset["time"].values
    assert np.ptp(v[at <= 0.1]) < 1e-9
    assert np.ptp(v[at > 0.1]) > 1e-3


def test_a_delay_of_the_terminal_voltage_moves_the_modes(tmp_path):
    """It is in the step map: the modes with it are others than without."""
    plain, late = (prepare(case_with(tmp_path, more)) for more in ("", LATE))
    first = run_scenario(prepare(case_with(tmp_path, ""), stop_time=0.01)).modes.electromechanical
    second = run_scenario(prepare(case_with(tmp_path, LATE), stop_time=0.01)).modes
    assert plain.system.wires == {}
    assert late.system.wires
    assert abs(second.electromechanical.eigenvalue - first.eigenvalue) > 1e-4
    assert any("(delayed" in name for name in second.model.names)


def test_noise_is_no_growth_of_an_undisturbed_system(tmp_path):
    noise = f'[imperfections.n]\ntype = "noise"\nconnection = "{V_RE}"\ndeviation = 0.02\nseed = 1'
    prepared = prepare(case_with(tmp_path, noise), stop_time=0.3)
    result = run_scenario(prepared)
    assert not any(f.kind in ("growth", "undisturbed_motion") for f in result.findings)
    assert any("without noise" in w for w in result.modes.warnings)
    assert Settings(prepared.system, prepared.events, np.zeros(1)).effective_times() == [0.0]


def test_a_sweep_varies_a_delay_in_whole_steps(tmp_path, capsys):
    case = case_with(tmp_path, LATE)
    out = tmp_path / "sweep"
    vary = "imperfections.late.delay=0:2 ms:3"
    arguments = [
        "sweep",
        str(case.path),
        "--scenario",
        "gfor",
        "--vary",
        vary,
        "--out",
        str(out),
        "--workers",
        "1",
    ]
    assert main(arguments) == 0
    rows = next(out.rglob("sweep.csv")).read_text(encoding="utf-8").splitlines()
    assert "imperfections.late.delay" in rows[0]
    assert {
        row.split(",")[rows[0].split(",").index("imperfections.late.delay [s]")] for row in rows[1:]
    } >= {"0.0"}
    assert main([*arguments[:5], "imperfections.lat.delay=0:1:3"]) == 2
    assert "no imperfection 'lat'" in capsys.readouterr().err


# -- many ------------------------------------------------------------------------------------------


MANY = 10_000


def test_many_events_are_read_without_looking_through_all_of_them_for_each(tmp_path):
    """With a search through the file, or through all problems, for each of them this takes many minutes."""
    events = "".join(
        event(
            "load_change",
            f'load = "load_2"\nscale = {1 + 1e-6 * (k % 7):.7f}',
            f"{(k + 1) * 1e-4:.4f}",
            "",
        )
        for k in range(MANY)
    )
    assert len(prepare(case_with(tmp_path, "", events), stop_time=3.0).events) == MANY
    off = events.replace('00"', '005 s"').replace('5"', '55 s"')
    said = problems(case_with(tmp_path, "", off), stop_time=3.0)
    assert len(said.splitlines()) == 202
    assert "more problems" in said.splitlines()[-1]


# -- what modes can say of them --------------------------------------------------------------------


def test_a_later_trip_is_named_by_the_modes(tmp_path):
    case = case_with(tmp_path, "", event("component_trip", 'component = "gfor"', "5 s", ""))
    said = "component 'gfor' trips at t = 5 s: the modes are those before it"
    assert said in compute_modes(prepare(case)).warnings
    # it has no converter
    assert not any("trips" in text for text in compute_modes(prepare(case, "base")).warnings)


def test_a_permanent_loss_without_a_steady_state_is_named_first(tmp_path):
    table = '[imperfections.lost]\ntype = "drop_out"\nconnection = "grid.*.v_* -> gfor.v_*"\nsubstitute = "zero"'
    with pytest.raises(AnalysisError) as caught:
        compute_modes(prepare(case_with(tmp_path, table)))
    assert str(caught.value).startswith(
        f"no steady state found with {V_RE}: lost, replaced by 0; grid."
    )
    assert "as an event" in str(caught.value)
    assert "start values" not in str(caught.value)


@pytest.mark.parametrize("events", [False, True])
def test_a_delay_as_long_as_the_run_is_refused(tmp_path, events):
    rest = 'delay = "20 s"'
    table = "" if events else f'[imperfections.late]\ntype = "delay"\nconnection = "{V_RE}"\n{rest}'
    case = case_with(tmp_path, table, event("delay", rest) if events else "")
    text = problems(case)
    assert (
        "delay = 20 s, but the run ends at 20 s: nothing that is sent in it arrives; give a shorter delay"
        in text
    )


def test_a_delay_beyond_a_shorter_stop_is_asked_about(tmp_path):
    table = f'[imperfections.late]\ntype = "delay"\nconnection = "{V_RE}"\ndelay = 2'
    (question,) = prepare(case_with(tmp_path, table), stop_time=1.5).questions
    assert "the run ends at 1.5 s" in str(question)


@pytest.mark.filterwarnings("error")
def test_modes_beyond_what_a_long_delay_allows_are_named(tmp_path):
    table = f'[imperfections.late]\ntype = "delay"\nconnection = "{V_RE}"\ndelay = 15'
    result = compute_modes(prepare(case_with(tmp_path, table)))
    # 24 / (2π·15)
    assert any(
        "up to 0.255 Hz; what it shows from there to 2 Hz" in text for text in result.warnings
    )
    # it grows without an oscillation, where the delay is right
    assert result.stability.stable is False
