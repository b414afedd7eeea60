"""Event mode, early returns and clocks of FMI 3.0, against what can be computed by hand."""

import zipfile
from functools import cache
from math import floor, sqrt
from pathlib import Path

import numpy as np
import pytest

from fmus.toolchain.compiler import compile_library
from orchestrator.core.errors import (
    ComponentError,
    EndedError,
    FmuFileError,
    InputError,
    UnsupportedFmuError,
)
from orchestrator.devices.acceptance.runner import check_fmu
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.instance import open_component

XML = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="events3" instantiationToken="events3">
  <CoSimulation modelIdentifier="events3" hasEventMode="true" canGetAndSetFMUState="true" canSerializeFMUState="true"
                canHandleVariableCommunicationStepSize="true" canReturnEarlyAfterIntermediateUpdate="true"/>
  <DefaultExperiment startTime="0" stopTime="2" stepSize="0.01"/>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent"/>
    <Float64 name="x" valueReference="1" causality="output"/>
    <Float64 name="v" valueReference="2" causality="output"/>
    <Float64 name="e" valueReference="3" causality="parameter" variability="fixed" start="0.7"/>
    <Boolean name="rest" valueReference="4" causality="local"/>
    <Clock name="sample" valueReference="10" causality="input" intervalVariability="constant"
           intervalDecimal="0.3" shiftDecimal="0.1"/>
    <Float64 name="count" valueReference="11" causality="output" variability="discrete" clocks="10"/>
    <Float64 name="sampled" valueReference="12" causality="output" variability="discrete" clocks="10"/>
    <Float64 name="u" valueReference="13" causality="input" variability="discrete" start="0" clocks="10"/>
    <Clock name="late" valueReference="20" causality="input" intervalVariability="countdown"/>
    <Boolean name="gate" valueReference="21" causality="input" start="false"/>
    <Float64 name="fired" valueReference="22" causality="output" variability="discrete"/>
    <Float64 name="delay" valueReference="23" causality="parameter" variability="fixed" start="0.25"/>
    <Float64 name="changes" valueReference="24" causality="output" variability="discrete"/>
    <Clock name="growing" valueReference="30" causality="input" intervalVariability="changing"/>
    <Float64 name="grown" valueReference="31" causality="output" variability="discrete"/>
    <Float64 name="end" valueReference="40" causality="parameter" variability="fixed" start="0"/>
    <Clock name="out" valueReference="50" causality="output" intervalVariability="triggered"/>
    <Float64 name="half" valueReference="51" causality="output" variability="discrete" clocks="50"/>
    <Clock name="periods" valueReference="60" causality="input" intervalVariability="tunable"/>
    <Float64 name="period" valueReference="61" causality="parameter" variability="tunable" start="0.2"/>
    <Float64 name="beats" valueReference="62" causality="output" variability="discrete"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="1" dependencies=""/><Output valueReference="2" dependencies=""/>
    <Output valueReference="11" dependencies=""/><Output valueReference="12" dependencies="13"/>
    <Output valueReference="22" dependencies=""/><Output valueReference="24" dependencies=""/>
    <Output valueReference="31" dependencies=""/><Output valueReference="51" dependencies=""/>
    <Output valueReference="50" dependencies="10"/><Output valueReference="62" dependencies=""/>
    <InitialUnknown valueReference="1" dependencies=""/><InitialUnknown valueReference="2" dependencies=""/>
    <InitialUnknown valueReference="22" dependencies=""/><InitialUnknown valueReference="24" dependencies=""/>
    <InitialUnknown valueReference="31" dependencies=""/><InitialUnknown valueReference="50" dependencies=""/>
    <InitialUnknown valueReference="62" dependencies=""/>
  </ModelStructure>
</fmiModelDescription>
"""
OUTPUTS = ("x", "v", "count", "sampled", "fired", "changes", "grown", "half", "beats")
STEPS = (0.01, 0.07, 0.1, 0.3, 0.00625)
"""Some fit the clocks' intervals, some do not."""


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    folder = tmp_path_factory.mktemp("events3")

    @cache
    def write(fault="", old="", new=""):
        source = (Path(__file__).parent / "events3.c").read_text(encoding="utf-8")
        library = compile_library(f"#define {fault}\n{source}" if fault else source, "linux64")
        path = folder / f"events{len(list(folder.iterdir()))}.fmu"
        with zipfile.ZipFile(path, "w") as archive:
            assert old in XML
            archive.writestr("modelDescription.xml", XML.replace(old, new) if old else XML)
            archive.writestr("binaries/x86_64-linux/events3.so", library.read_bytes())
        return path

    return write


def begun(description, *, isolated=False, **parameters):
    component = open_component("c", description, isolated=isolated)
    component.set(parameters)
    component.setup(0.0, None)
    component.enter_initialization_mode()
    component.exit_initialization_mode()
    return component


def ball(t, e=0.7, g=9.81):
    """Height and speed of a ball that falls from 1 m."""
    begin, v = sqrt(2 / g), e * sqrt(2 * g)
    if t < begin:
        return 1 - g * t * t / 2, -g * t
    while v >= 0.1 and t >= begin + 2 * v / g:
        begin, v = begin + 2 * v / g, e * v
    if v < 0.1:
        return 0.0, 0.0
    return v * (t - begin) - g * (t - begin) ** 2 / 2, v - g * (t - begin)


def ticks(t, interval, shift):
    return floor((t - shift) / interval + 1e-9) + 1 if t > shift - 1e-9 else 0


@pytest.mark.parametrize("isolated", [False, True])
@pytest.mark.parametrize("h", STEPS)
def test_events_inside_of_steps_are_exact(fmu, h, isolated):
    """A ball that bounces, and four clocks: any communication step gives what is computed by hand."""
    with begun(read_description(fmu()), isolated=isolated) as c:
        for k in range(round(1.5 / h)):
            c.set({"u": float(k)})
            c.step(k * h, h)
            t, found = (k + 1) * h, c.get(OUTPUTS)
            assert (found["x"], found["v"]) == pytest.approx(ball(t), abs=1e-9)
            count = ticks(t, 0.3, 0.1)
            assert (found["count"], found["half"]) == (count, count // 2)
            if count:  # the input of the step in which the clock ticked, its end included
                last = 0.1 + 0.3 * (count - 1)
                assert found["sampled"] == max(0, int(np.ceil(last / h - 1e-9)) - 1)
            assert found["grown"] == floor((sqrt(1 + 80 * t) - 1) / 2 + 1e-9)  # at 0.1·n(n+1)/2
            assert found["beats"] == ticks(t, 0.2, 0.05)


@pytest.mark.parametrize("h", STEPS)
def test_a_discrete_input_that_changes_is_an_event(fmu, h):
    with begun(read_description(fmu())) as c:
        on = round(0.6 / h)
        for k in range(round(1.5 / h)):
            c.set({"gate": k >= on})
            c.step(k * h, h)
            found = c.get(OUTPUTS)
            assert found["changes"] == (k >= on)
            t = (k + 1) * h
            fires = on * h + 0.25
            assert found["fired"] == pytest.approx(fires if t > fires - 1e-9 else -1.0, abs=1e-9)


def test_an_input_that_was_set_before_the_start_is_no_event(fmu):
    with begun(read_description(fmu()), gate=True) as c:
        c.set({"gate": True})
        c.step(0.0, 0.01)
        assert c.get(["changes"]) == {"changes": 0.0}


def test_the_interval_of_a_tunable_clock_follows_its_parameter(fmu):
    """From the moment of the change on."""
    with begun(read_description(fmu())) as c:
        for k in range(100):
            if k == 50:
                c.set({"period": 0.03})  # at t = 0.5 s, after ticks at 0.05, 0.25 and 0.45 s
            c.step(0.01 * k, 0.01)
        assert c.get(["beats"])["beats"] == 3 + floor(0.5 / 0.03 + 1e-9)


@pytest.mark.parametrize("through_bytes", [False, True])
def test_a_saved_state_holds_what_the_clocks_have_counted(fmu, through_bytes):
    with begun(read_description(fmu())) as c:

        def run(begin, end):
            rows = []
            for k in range(begin, end):
                c.set({"u": float(k * k), "gate": k > 62})
                c.step(0.01 * k, 0.01)
                rows.append(c.get(OUTPUTS))
            return rows

        run(0, 55)
        kept = c.save_state()
        first = run(55, 150)
        for _ in range(2):
            if through_bytes:
                copy = c.deserialize_state(c.serialize_state(kept))
                c.restore_state(copy)
                c.free_state(copy)
            else:
                c.restore_state(kept)
            assert run(55, 150) == first
        c.free_state(kept)


def test_a_reset_begins_anew(fmu):
    with begun(read_description(fmu())) as c:

        def run():
            rows = []
            for k in range(80):
                c.set({"u": float(k), "gate": k > 30})
                c.step(0.01 * k, 0.01)
                rows.append(c.get(OUTPUTS))
            return rows

        first = run()
        c.reset()
        c.setup(0.0, None)
        c.enter_initialization_mode()
        c.exit_initialization_mode()
        assert run() == first


@pytest.mark.parametrize("isolated", [False, True])
def test_an_end_of_its_own_is_told_with_its_time(fmu, isolated):
    with begun(read_description(fmu()), isolated=isolated, end=0.555) as c:
        for k in range(55):
            c.step(0.01 * k, 0.01)
        with pytest.raises(
            EndedError, match=r"it ended its simulation at t = 0\.555 s by itself"
        ) as e:
            c.step(0.55, 0.01)
        assert e.value.ended_at == pytest.approx(0.555)
        with pytest.raises(EndedError):
            c.step(0.56, 0.01)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("FAULT_ENDLESS", r"the events at t = 0\.25 s do not come to an end"),
        ("FAULT_STANDS_STILL", r"again and again at t = 0\.2"),
    ],
)
def test_what_never_gets_on_is_an_error_and_no_hang(fmu, fault, words):
    with begun(read_description(fmu(fault))) as c:
        for k in range(21):
            c.step(0.01 * k, 0.01)
        with pytest.raises(ComponentError, match=words):
            c.step(0.21, 0.05)


def test_a_clock_of_somebody_else_is_not_supported_here(fmu):
    path = fmu(old='intervalVariability="countdown"', new='intervalVariability="triggered"')
    with pytest.raises(
        UnsupportedFmuError, match="its clock 'late' is triggered by another FMU's clock"
    ):
        open_component("c", read_description(path), isolated=False)
    with pytest.raises(InputError, match="its clock 'late' is triggered by another FMU's clock"):
        open_component("c", read_description(path), isolated=True)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('intervalDecimal="0.3"', "", "clock 'sample' is constant and declares no interval"),
        ('intervalDecimal="0.3"', 'intervalDecimal="-1"', "clock 'sample' has an interval of -1"),
        (
            'intervalVariability="changing"',
            'intervalVariability="often"',
            "clock 'growing' has intervalVariability 'often'",
        ),
    ],
)
def test_a_clock_that_fmi_does_not_know(fmu, old, new, words):
    with pytest.raises(FmuFileError, match=words):
        read_description(fmu(old=old, new=new))


def test_a_fraction_is_exact(fmu):
    path = fmu(
        old='intervalDecimal="0.3"', new='resolution="30" intervalCounter="10" shiftCounter="3"'
    )
    (sample, *_) = read_description(path).clocks
    assert (sample.interval, sample.shift) == (10 / 30, 3 / 30)


def test_clocks_have_no_start_values(fmu):
    assert check_fmu(fmu(), only=("declared_starts",)).results[-1].verdict == "pass"
    bare = fmu(old='start="0" clocks="10"', new='clocks="10"')
    assert check_fmu(bare, only=("declared_starts",)).faults == ["bad start values"]


def test_gfor_check_says_once_that_a_clock_is_not_supported(fmu, gfor):
    path = fmu(old='intervalVariability="countdown"', new='intervalVariability="triggered"')
    code, text, _ = gfor("fmu", "check", path)
    assert code == 2
    assert text.count("its clock 'late' is triggered by another FMU's clock") == 1
    assert "not supported here: triggered clocks" in text


@pytest.mark.slow
def test_gfor_check_accuses_only_the_faulty_one(fmu):
    good = check_fmu(fmu(), run_for=0.3)
    assert good.trusted, good.failures
    assert (
        "hidden state"
        in check_fmu(fmu("FAULT_HIDDEN"), run_for=0.3, only=("loads", "state")).faults
    )
