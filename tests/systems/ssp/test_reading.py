"""SSPs of other tools: what they mean, and what is said of those that cannot be used."""

import io
import json
import zipfile

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import CosimError
from orchestrator.face.cli import main
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.ssp.archive import SspArchive
from orchestrator.systems.ssp.names import NAMESPACES
from tests.support.scenarios import prepare_one
from tests.systems.ssp.packages import (
    OSP_STEP,
    bindings,
    component,
    connector,
    experiment,
    system,
    unit,
    values,
    wire,
    write,
)

H = 1e-3


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    """Unpacked archives go to a folder of the test; built FMUs stay where they are."""
    monkeypatch.setattr(
        "orchestrator.cases.case.cache_directory", lambda kind: tmp_path / "unpacked" / kind
    )


def prepared(path, **options):
    scenario = prepare_one(path, **options)
    return scenario


def response(scenario):
    """Recorded times and values by name."""
    recorder = Recorder(scenario.record, 1)
    with Master(
        scenario.system, scenario.schedule, scenario.step_size, scenario.stop_time
    ) as master:
        master.run(scenario.stop_time, scenario.events, [recorder])
    return recorder.times, dict(zip(recorder.names, recorder.values.T, strict=True))


def oscillator(steps):
    """Two integrators in a ring, stepped side by side: what both outputs are after every step."""
    a, b = [1.0], [0.0]
    for _ in range(steps):
        a, b = [*a, a[-1] + H * 30 * b[-1]], [*b, b[-1] - H * 20 * a[-1]]
    return np.array(a), np.array(b)


RING = (wire("a.y", "b.u"), wire("b.y", "a.u"))
IN_RING = (
    component("a", "integrator", bindings(values(gain=30.0, x_0=1.0))),
    component("b", "integrator", bindings(values(gain=-20.0))),
)


def test_a_flat_system_steps_side_by_side(tmp_path):
    path = write(tmp_path / "ring.ssp", system("top", IN_RING, RING))
    scenario = prepared(path)
    assert (scenario.step_size, scenario.stop_time, scenario.schedule.name) == (H, 0.1, "jacobi")
    times, found = response(scenario)
    a, b = oscillator(100)
    assert times == pytest.approx(H * np.arange(101))
    assert found["a.y"] == pytest.approx(a, abs=1e-12)
    assert found["b.y"] == pytest.approx(b, abs=1e-12)


def test_nested_systems_are_laid_flat(tmp_path):
    """One integrator sits two systems deep; kinds and not the ends' names tell where the signals go."""
    inner = system(
        "inner",
        [component("x", "integrator")],
        [wire("into", "x.u"), wire("out", "x.y")],
        [("into", "input"), ("out", "output")],
    )
    middle = system(
        "middle",
        [inner],
        [wire("inner.into", "into"), wire("inner.out", "out")],
        [("into", "input"), ("out", "output")],
        bindings(values(inner__x__gain=30.0, inner__x__x_0=5.0)),
    )
    top = system(
        "top",
        [middle, IN_RING[1]],
        [wire("b.y", "middle.into"), wire("b.u", "middle.out")],
        # the outer system's value goes before the inner one's
        bound=bindings(values(middle__inner__x__x_0=1.0)),
    )
    _, found = response(prepared(write(tmp_path / "nested.ssp", top)))
    a, b = oscillator(100)
    assert found["middle_inner_x.y"] == pytest.approx(a, abs=1e-12)
    assert found["b.y"] == pytest.approx(b, abs=1e-12)


def test_a_system_s_parameter_reaches_the_components_that_are_connected_to_it(tmp_path):
    parts = [
        '<ssd:Component name="one" source="resources/gain.fmu"><ssd:Connectors>'
        f"{connector('K', 'parameter')}{connector('y', 'output')}</ssd:Connectors></ssd:Component>",
        component("two", "gain"),
    ]
    top = system(
        "top",
        parts,
        [wire("factor", "one.K"), wire("level", "two.u")],
        [("factor", "parameter"), ("level", "input")],
        bindings(values(factor=7.0, level=2.5, nothing_of_that_name=1.0)),
    )
    scenario = prepared(write(tmp_path / "top.ssp", top, models=["gain"]))
    components = scenario.system.components
    assert components["one"].parameters == {"K": 7.0}
    assert components["one"].inputs == {"u": 0.0}  # what nothing feeds stays at its start
    assert components["two"].inputs == {"u": 2.5}
    assert response(scenario)[1]["two.y"] == pytest.approx(2.5)


def test_values_from_files_and_mappings(tmp_path):
    binding = (
        '<ssd:ParameterBinding source="resources/a%20set.ssv"><ssd:ParameterMapping>'
        '<ssm:ParameterMapping version="1.0"><ssm:MappingEntry source="start" target="x_0"/>'
        '<ssm:MappingEntry source="rate" target="gain"/></ssm:ParameterMapping>'
        "</ssd:ParameterMapping></ssd:ParameterBinding>"
    )
    ssv = (
        f'<ssv:ParameterSet xmlns:ssv="{NAMESPACES["ssv"]}" version="1.0" name="s">'
        '<ssv:Parameters><ssv:Parameter name="start"><ssv:Real value="4"/></ssv:Parameter>'
        '<ssv:Parameter name="rate"><ssv:Integer value="3"/></ssv:Parameter></ssv:Parameters></ssv:ParameterSet>'
    )
    # a later binding of the same component goes first; prefix + name = gain
    later = values("ga", **{"in": 5.0})
    top = system("top", [component("a", "integrator", bindings(binding, later))])
    path = write(tmp_path / "files.ssp", top, **{"a set__ssv": ssv})
    assert prepared(path).system.components["a"].parameters == {"x_0": 4.0, "gain": 5.0}


def test_units_are_converted_where_they_differ(tmp_path):
    """The units that the file names are known by their names."""
    powers = [
        component("kilo", "power_source", bindings(values(P=(1500.0, "kW"), on=True))),
        component("same", "power_source", bindings(values(P=(0.1, "MW"), on=False))),
    ]
    components = prepared(
        write(tmp_path / "p.ssp", system("top", powers), models=["power_source"])
    ).system.components
    assert components["kilo"].parameters == {"P": 1.5, "on": True}
    assert components["same"].parameters == {"P": 0.1, "on": False}


@pytest.mark.parametrize(
    ("value", "units", "around", "expected"),
    [
        # the FMU has the gain in 1/s; a name that nobody else knows
        ((3.0, "Takt"), unit("Takt", s="-1", factor="0.5"), "", 1.5),
        # the definition counts, and not the name
        ((3.0, "kHz"), unit("kHz", s="-1", factor="10"), "", 30.0),
        ((3.0, "1/s"), unit("1/s", s="-1", factor="7"), "", 21.0),
        # the set stands in the description, whose units define it
        ((3.0, "Takt"), "", unit("Takt", s="-1", factor="2"), 6.0),
        ((3.0, "Takt"), unit("Takt", s="-1"), unit("Takt", s="-1", factor="2"), 3.0),
        # both say the same
        ((3.0, "1/ms"), unit("1/ms", s="-1", factor="1000"), "", 3000.0),
        ((3.0, "1/s"), unit("1/s", s="-1"), "", 3.0),
    ],
)
def test_the_definition_of_a_unit_counts(tmp_path, value, units, around, expected):
    top = system("top", [component("a", "integrator", bindings(values(units=units, gain=value)))])
    after = f"<ssd:Units>{around}</ssd:Units>" * bool(around) + experiment("0.1", OSP_STEP)
    scenario = prepared(write(tmp_path / "u.ssp", top, after))
    assert scenario.system.components["a"].parameters["gain"] == pytest.approx(expected, rel=1e-12)
    unlike = [str(question) for question in scenario.questions if "usually means" in str(question)]
    assert bool(unlike) == (expected in (30.0, 21.0)), unlike


@pytest.mark.parametrize(
    ("value", "definition", "words"),
    [
        ((3.0, "Takt"), unit("Takt", m="1"), "'Takt' is defined as 1 m, and '1/s'.* is 1 s.-1"),
        ((3.0, "Takt"), unit("Takt", rad="1", s="-1"), "defined as 1 rad·s.-1"),
        ((3.0, "Takt"), unit("Takt", s="-1", offset="x"), "holds what is no number"),
    ],
)
def test_a_definition_of_another_quantity_is_refused(tmp_path, value, definition, words):
    bound = bindings(values(units=definition, gain=value))
    top = system("top", [component("a", "integrator", bound)])
    with pytest.raises(CosimError, match=f"value of a.gain: .*{words}"):
        load_case(write(tmp_path / "u.ssp", top, valid=False))


OPEN = b'causality="input" variability="continuous">\n      <Real unit="1" start="0.0" />'


@pytest.mark.parametrize(
    ("declared", "expected"),
    [
        (b'<Integer start="3" />', {"u": 3}),
        (b'<Boolean start="true" />', {"u": True}),
        (b'<Enumeration declaredType="E" min="1" max="2" start="2" />', {"u": 2}),
        (b'<String start="auto" />', {}),
    ],
)
def test_open_inputs_of_every_type_keep_their_start_values(tmp_path, declared, expected):
    plain = write(tmp_path / "gain.ssp", system("top", [component("a", "gain")]), models=["gain"])
    other = b'causality="input" variability="discrete">\n      ' + declared
    path = with_other_fmus(plain, tmp_path / "open.ssp", OPEN, other)
    if b"Enumeration" in declared:
        types = (
            b'<TypeDefinitions><SimpleType name="E"><Enumeration><Item name="a" value="1"/>'
            b'<Item name="b" value="2"/></Enumeration></SimpleType></TypeDefinitions>\n  <LogCategories>'
        )
        path = with_other_fmus(path, tmp_path / "enumeration.ssp", b"<LogCategories>", types)
    inputs = prepared(path).system.components["a"].inputs
    assert inputs == expected
    assert [type(value) for value in inputs.values()] in ([float], [bool], [])


MILLI = (
    b'name="y" valueReference="4" description="Output" causality="output" variability="continuous" '
)


def in_other_units(tmp_path, attributes):
    """Two gains of 2 and 3 in a row, whose output is in ms and whose input is a number."""
    parts = [
        component("a", "gain", bindings(values(K=2.0, u=5.0))),
        component("b", "gain", bindings(values(K=3.0))),
    ]
    wires = [wire("a.y", "b.u", attributes=attributes)]
    plain = write(tmp_path / "same.ssp", system("top", parts, wires), models=["gain"])
    old = MILLI + b'initial="calculated">\n      <Real unit="1" />'
    new = MILLI + b'initial="calculated">\n      <Real unit="s" />'
    return with_other_fmus(plain, tmp_path / "units.ssp", old, new)


def test_a_connection_that_suppresses_the_conversion_takes_the_value_as_it_is(tmp_path):
    scenario = prepared(in_other_units(tmp_path, 'suppressUnitConversion="true"'))
    assert response(scenario)[1]["b.y"][-1] == pytest.approx(30.0)


def test_a_connection_of_two_units_is_one_problem(tmp_path):
    with pytest.raises(CosimError) as caught:
        prepared(in_other_units(tmp_path, ""))
    assert "1 problem\n" in str(caught.value)
    assert "connection a.y - b.u: s and 1 are no units of one quantity" in str(caught.value)


@pytest.mark.parametrize(
    ("annotations", "options", "expected"),
    [
        (OSP_STEP, {}, 1e-3),
        (OSP_STEP, {"step_size": 5e-4}, 5e-4),
        ("", {}, 1e-4),  # what the FMUs suggest
        (
            '<ssc:Annotation type="org.openmodelica"><oms:FixedStepMaster xmlns:oms="urn:oms" stepSize="0.01"/>'
            "</ssc:Annotation>",
            {},
            1e-2,
        ),
    ],
)
def test_where_the_communication_step_comes_from(tmp_path, annotations, options, expected):
    path = write(tmp_path / "s.ssp", system("top", IN_RING, RING), experiment("0.1", annotations))
    assert prepared(path, **options).step_size == expected


def test_names_that_a_case_cannot_have_are_made_plain(tmp_path):
    parts = [component("my integrator.1", "integrator"), component("my_integrator_1", "integrator")]
    top = system(
        "top",
        parts,
        [
            '<ssd:Connection startElement="my integrator.1" startConnector="y" '
            'endElement="my_integrator_1" endConnector="u"/>'
        ],
    )
    scenario = prepared(write(tmp_path / "names.ssp", top))
    assert list(scenario.system.components) == ["my_integrator_1", "my_integrator_1_2"]
    assert [str(c.source) for c in scenario.system.connections] == ["my_integrator_1.y"]


# -- commands --------------------------------------------------------------------------------------


def test_modes_and_linear_model_of_a_foreign_system(tmp_path, capsys):
    path = write(tmp_path / "ring.ssp", system("top", IN_RING, RING))
    path_at_rest = write(
        tmp_path / "rest.ssp",
        system(
            "top", (component("a", "integrator", bindings(values(gain=30.0))), IN_RING[1]), RING
        ),
    )
    assert main(["modes", str(path_at_rest), "--range", "0:10", "--json"]) == 0
    (mode,) = json.loads(capsys.readouterr().out)["scenarios"][0]["modes"]
    # μ² − 2μ + 1 + 600·H² = 0
    assert complex(mode["real"], mode["imag"]) == pytest.approx(
        np.log(1 + 1j * np.sqrt(600) * H) / H, rel=1e-8
    )
    assert (
        main(
            [
                "export",
                "linear",
                str(path),
                "--output",
                "a.y",
                "--input",
                "a.gain",
                "--out",
                str(tmp_path / "linear"),
            ]
        )
        == 0
    )
    assert (tmp_path / "linear" / "foreign" / "A.csv").exists()


def with_other_fmus(path, target, old, new):
    """The archive with another text in its FMUs' model descriptions."""

    def changed(content):
        out = io.BytesIO()
        with zipfile.ZipFile(io.BytesIO(content)) as fmu, zipfile.ZipFile(out, "w") as other:
            for name in fmu.namelist():
                text = fmu.read(name)
                if name == "modelDescription.xml":
                    assert old in text
                    text = text.replace(old, new)
                other.writestr(name, text)
        return out.getvalue()

    with zipfile.ZipFile(path) as archive, zipfile.ZipFile(target, "w") as other:
        for name in archive.namelist():
            content = archive.read(name)
            other.writestr(name, changed(content) if name.endswith(".fmu") else content)
    return target


@pytest.mark.usefixtures("in_process", "undrawn")
def test_what_cannot_be_linearised_is_simulated_all_the_same(tmp_path, capsys):
    plain = write(tmp_path / "ring.ssp", system("top", IN_RING, RING))
    path = with_other_fmus(plain, tmp_path / "closed.ssp", b'settable="true"', b'settable="false"')
    out = tmp_path / "results"
    assert main(["run", str(path), "--out", str(out)]) == 0
    captured = capsys.readouterr()
    assert "no steady state was looked for" in captured.err
    assert "does not let a master set its continuous states" in captured.err
    rows = np.genfromtxt(out / "foreign" / "trajectory.csv", delimiter=",", skip_header=1)
    a, _ = oscillator(100)
    assert rows[:, 1] == pytest.approx(a[::5], abs=1e-9)
    assert (
        json.loads((out / "summary.json").read_text(encoding="utf-8"))["scenarios"][0]["residual"]
        is None
    )
    assert main(["report", str(out)]) == 0
    assert main(["modes", str(path)]) == 1
    assert "does not let a master set its continuous states" in capsys.readouterr().err


def test_outputs_that_are_no_real_numbers_are_not_recorded(tmp_path):
    plain = write(tmp_path / "gain.ssp", system("top", [component("a", "gain")]), models=["gain"])
    real = b'causality="output" variability="continuous" initial="calculated">\n      <Real unit="1" />'
    whole = b'causality="output" variability="discrete" initial="calculated">\n      <Integer />'
    scenario = prepared(with_other_fmus(plain, tmp_path / "whole.ssp", real, whole))
    assert scenario.system.components["a"].description.variables["y"].type == "Integer"
    assert scenario.record == ()
    assert prepared(plain).record == ("a.y",)


# -- what is refused -------------------------------------------------------------------------------

MAPPED = (
    '<ssc:BooleanMappingTransformation><ssc:MapEntry source="true" target="false"/>'
    "</ssc:BooleanMappingTransformation>"
)
TRANSFORMED = wire("a.y", "b.u", MAPPED)
DICTIONARY = '<ssd:SignalDictionaries><ssd:SignalDictionary name="bus"/></ssd:SignalDictionaries>'
SCALED = (
    '<ssd:ParameterMapping><ssm:ParameterMapping version="1.0"><ssm:MappingEntry source="gain" target="gain">'
    '<ssc:LinearTransformation factor="2"/></ssm:MappingEntry></ssm:ParameterMapping></ssd:ParameterMapping>'
)


@pytest.mark.parametrize(
    ("top", "words"),
    [
        (
            system("top", IN_RING, [TRANSFORMED]),
            ["connection a.y - b.u", "BooleanMappingTransformation"],
        ),
        (system("top", IN_RING, after=DICTIONARY), ["element bus", "signal dictionary"]),
        (
            system("top", [*IN_RING, '<ssd:SignalDictionaryReference name="r" dictionary="bus"/>']),
            ["element r", "signal dictionary"],
        ),
        (
            system(
                "top", [component("a", "integrator", attributes='implementation="ModelExchange"')]
            ),
            ["element a"],
        ),
        (
            system(
                "top", [component("a", "integrator", attributes='type="application/x-ssp-package"')]
            ),
            ["element a", "application/x-ssp-package", "only FMUs"],
        ),
        (
            system("top", [component("a", "integrator", source="../a.fmu")]),
            ["element a", "outside the archive"],
        ),
        (
            system("top", [component("a", "integrator", source="/a.fmu")]),
            ["element a", "outside the archive"],
        ),
        (
            system("top", [component("a", "integrator", source="C:/a.fmu")]),
            ["element a", "outside the archive"],
        ),
        (
            system("top", [component("a", "integrator", source="resources/%2e%2e/%2e%2e/a.fmu")]),
            ["element a", "outside the archive"],
        ),
        (
            system("top", [component("a", "integrator", source="https://example.org/a.fmu")]),
            ["element a", "https://example.org/a.fmu", "outside the archive"],
        ),
        (
            system("top", [component("a", "integrator", source="resources/none.fmu")]),
            ["no 'resources/none.fmu'"],
        ),
        (system("top", IN_RING, [wire("a.z", "b.u")]), ["there is no connector a.z"]),
        (system("top", IN_RING, [wire("a.y", "b.y")]), ["output and output"]),
        (system("top", IN_RING, [*RING, wire("a.y", "a.u")]), ["a.u is already fed by b.y"]),
        (system("top", [IN_RING[0], IN_RING[0]]), ["element a", "twice"]),
        (
            system("top", [component("a", "integrator", bindings(values("", SCALED, gain=1.0)))]),
            ["parameter binding of a", "LinearTransformation"],
        ),
        (
            system(
                "top",
                [component("a", "integrator", bindings('<ssd:ParameterBinding source="x.ssv"/>'))],
            ),
            ["parameter binding of a", "no 'x.ssv'"],
        ),
        (
            system(
                "top",
                [component("a", "integrator", bindings('<ssd:ParameterBinding type="text/csv"/>'))],
            ),
            ["parameter binding of a", "application/x-ssp-parameter-set"],
        ),
    ],
)
def test_what_is_not_supported_is_named(tmp_path, capsys, top, words):
    path = write(tmp_path / "refused.ssp", top)
    assert main(["run", str(path), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "1 problem\n" in said
    assert all(word in said for word in words), said
    assert not (tmp_path / "a.fmu").exists()


@pytest.mark.parametrize(
    ("inside", "word"),
    [
        ({"gain": (1.0, "kg")}, "'1.0 kg' is in kg, but 1/s is needed"),
        ({"gain": "fast"}, "'fast' is not a number"),
        ({"x": 1.0}, "x is of causality local; only parameters and inputs can be set"),
    ],
)
def test_values_that_do_not_fit(tmp_path, inside, word):
    top = system("top", [component("a", "integrator", bindings(values(**inside)))])
    with pytest.raises(CosimError) as caught:
        prepared(write(tmp_path / "values.ssp", top))
    assert word in str(caught.value)
    assert "components.a" in str(caught.value)


def test_all_that_is_wrong_is_told_at_once(tmp_path):
    top = system(
        "top",
        [*IN_RING, component("c", "integrator", source="../c.fmu")],
        [TRANSFORMED],
        after=DICTIONARY,
    )
    with pytest.raises(CosimError, match="3 problems"):
        load_case(write(tmp_path / "three.ssp", top))


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"version": "2.0", "valid": False}, "version 2.0; SSP 1.0 can be read"),
        ({"after": experiment("0.1", OSP_STEP, 'startTime="5"')}, "the start time is 5 s"),
        (
            {"after": experiment("soon", OSP_STEP), "valid": False},
            "stopTime is 'soon', which is no number",
        ),
    ],
)
def test_descriptions_that_cannot_be_read(tmp_path, options, word):
    with pytest.raises(CosimError, match=word):
        load_case(write(tmp_path / "d.ssp", system("top", IN_RING, RING), **options))


def test_files_that_are_no_ssp(tmp_path):
    text, empty, broken = (tmp_path / f"{name}.ssp" for name in ("text", "empty", "broken"))
    text.write_text("no zip")
    zipfile.ZipFile(empty, "w").close()
    with zipfile.ZipFile(broken, "w") as archive:
        archive.writestr("SystemStructure.ssd", "<open>")
    for path, word in (
        (text, "not a zip"),
        (empty, "no SystemStructure.ssd"),
        (broken, "is not XML"),
    ):
        with pytest.raises(
            CosimError,
            match="(?i)" + word.replace("not a zip", "a zip archive and this file is not"),
        ):
            load_case(path)
    with pytest.raises(CosimError, match="there is no such file"):
        SspArchive(tmp_path / "none.ssp")


@pytest.mark.parametrize(
    ("member", "content", "word"),
    [
        ("../outside.txt", "x", "out of the archive's own folder"),
        ("resources/zeros.bin", bytes(200 * 1024**2), "more than 100 times as much"),
        (
            "SystemStructure.ssd",
            '<!DOCTYPE a [<!ENTITY b "b">]><a>&b;</a>',
            "defines a document type",
        ),
    ],
)
def test_files_that_would_do_harm(tmp_path, member, content, word):
    with zipfile.ZipFile(tmp_path / "h.ssp", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(member, content)
        if member != "SystemStructure.ssd":
            archive.writestr("SystemStructure.ssd", "<SystemStructureDescription/>")
    with pytest.raises(CosimError, match=word) as caught:
        load_case(tmp_path / "h.ssp")
    assert caught.value.exit_code == 2
