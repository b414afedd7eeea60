"""What a connection of an SSP does with its value: conversions of units and of types."""

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

from fmus.toolchain.compiler import compile_library, host_platform
from orchestrator.core.errors import CosimError
from orchestrator.devices.fmi.description import read_description
from orchestrator.face.cli import main
from orchestrator.systems.coupling.master import Master
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
from tests.systems.ssp.test_reading import (
    MILLI,
    RING,
    H,
    cache,  # noqa: F401 - a fixture that every test here takes as well
    prepared,
    response,
    with_other_fmus,
)

pytestmark = pytest.mark.usefixtures("in_process")

OUTPUT = MILLI + b'initial="calculated">\n      <Real unit="1" />'
INPUT = b'causality="input" variability="continuous">\n      <Real unit="1" start="0.0" />'
UNITS = b"<UnitDefinitions>"
DEFINED = (
    UNITS + b'<Unit name="kW"><BaseUnit kg="1" m="2" s="-3" factor="1000"/></Unit>'
    b'<Unit name="W"><BaseUnit kg="1" m="2" s="-3"/></Unit>'
    b'<Unit name="Grad"><BaseUnit K="1" factor="0.5" offset="200"/></Unit>'
    b'<Unit name="K"><BaseUnit K="1"/></Unit>'
)


def gains(tmp_path, given, needed, attributes="", ports=("", ""), around="", inside=""):
    """5 · 2 in the unit ``given`` into a gain of 3 whose input is in ``needed``; ``ports``: units of the connectors."""
    parts = [
        f'<ssd:Component name="{name}" source="resources/gain.fmu"><ssd:Connectors>'
        f"{connector('u', 'input', port)}{connector('y', 'output', port)}</ssd:Connectors>{bound}</ssd:Component>"
        for name, port, bound in (
            ("a", ports[0], bindings(values(K=2.0, u=5.0))),
            ("b", ports[1], bindings(values(K=3.0))),
        )
    ]
    top = system("top", parts, [wire("a.y", "b.u", inside, attributes)])
    after = f"<ssd:Units>{around}</ssd:Units>" * bool(around) + experiment("0.01", OSP_STEP)
    path = write(tmp_path / "gains.ssp", top, after, models=["gain"])
    changes = (
        (UNITS, DEFINED),
        (OUTPUT, OUTPUT.replace(b'unit="1"', f'unit="{given}"'.encode())),
        (INPUT, INPUT.replace(b'unit="1"', f'unit="{needed}"'.encode())),
    )
    for k, change in enumerate(changes):
        path = with_other_fmus(path, tmp_path / f"gains_{k}.ssp", *change)
    return path


@pytest.mark.parametrize(
    ("units", "attributes", "arrives"),
    [
        (("kW", "W"), "", 10e3),
        (("W", "kW"), "", 10e-3),
        (("kW", "kW"), "", 10.0),
        (("Grad", "K"), "", 205.0),
        (("K", "Grad"), "", -380.0),
        (("kW", "W"), 'suppressUnitConversion="true"', 10.0),
        (("kW", "K"), 'suppressUnitConversion="1"', 10.0),
    ],
)
def test_a_connection_converts_between_units_of_one_quantity(tmp_path, units, attributes, arrives):
    found = response(prepared(gains(tmp_path, *units, attributes)))[1]
    assert found["a.y"] == pytest.approx(10.0, rel=1e-14)
    assert found["b.y"] == pytest.approx(3 * arrives, rel=1e-12)


@pytest.mark.parametrize(
    ("ports", "attributes", "arrives"),
    [
        # a sends W as 10e3 W, and b reads them in kW
        (("W", "W"), "", 10.0),
        (("W", ""), "", 10.0),
        # the number of W is taken for kW
        (("W", "kW"), 'suppressUnitConversion="true"', 10e3),
        (("W", ""), 'suppressUnitConversion="true"', 10e3),
        # a unit that the description alone defines: 7 W
        (("Woche", "Woche"), "", 10.0),
        (("Woche", "W"), 'suppressUnitConversion="true"', 10.0 / 7),
    ],
)
def test_a_connector_has_the_value_in_the_unit_that_it_states(tmp_path, ports, attributes, arrives):
    own = unit("Woche", kg="1", m="2", s="-3", factor="7") + unit("W", kg="1", m="2", s="-3")
    path = gains(
        tmp_path,
        "kW",
        "kW",
        attributes,
        ports,
        own + unit("kW", kg="1", m="2", s="-3", factor="1000"),
    )
    assert response(prepared(path))[1]["b.y"] == pytest.approx(3 * arrives, rel=1e-12)


@pytest.mark.parametrize(
    ("units", "words"),
    [
        (("kW", "K"), "kW and K are no units of one quantity"),
        (("kW", "Zoll"), "the unit 'Zoll' is not known, and no file defines it"),
    ],
)
def test_units_of_two_quantities_are_one_problem(tmp_path, capsys, units, words):
    assert main(["run", str(gains(tmp_path, *units)), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "1 problem\n" in said
    assert f"connection a.y - b.u: {words}; correct the unit of one end" in said


def test_a_converted_system_comes_back_from_its_own_export(tmp_path):
    path, out = gains(tmp_path, "kW", "W"), tmp_path / "again.ssp"
    assert main(["export", "ssp", str(path), "--out", str(out)]) == 0
    assert response(prepared(out))[1]["b.y"] == pytest.approx(30e3, rel=1e-12)


LINEAR = '<ssc:LinearTransformation factor="-2" offset="7"/>'


@pytest.mark.parametrize(
    ("units", "attributes", "inside", "arrives"),
    [
        (("kW", "kW"), "", LINEAR, -2 * 10 + 7),
        # the unit comes first, so that the offset is in the one that is needed
        (("kW", "W"), "", LINEAR, -2 * 10e3 + 7),
        (("kW", "W"), 'suppressUnitConversion="true"', LINEAR, -2 * 10 + 7),
        (("Grad", "K"), "", '<ssc:LinearTransformation offset="0.5"/>', 205.5),
        (("kW", "kW"), "", "<ssc:LinearTransformation/>", 10.0),
    ],
)
def test_a_connections_own_transformation_comes_behind_the_conversion(
    tmp_path, units, attributes, inside, arrives
):
    path = gains(tmp_path, *units, attributes, inside=inside)
    assert response(prepared(path))[1]["b.y"][-1] == pytest.approx(3 * arrives, rel=1e-12)


@pytest.mark.parametrize(
    ("inside", "said"),
    [
        ('<ssc:LinearTransformation factor="INF"/>', "must be finite"),
        (
            '<ssc:IntegerMappingTransformation><ssc:MapEntry source="1" target="2"/>'
            "</ssc:IntegerMappingTransformation>",
            "IntegerMappingTransformation, which is not supported",
        ),
    ],
)
def test_a_transformation_that_cannot_be_is_one_problem(tmp_path, inside, said):
    with pytest.raises(CosimError) as caught:
        prepared(gains(tmp_path, "kW", "kW", inside=inside))
    assert "1 problem\n" in str(caught.value)
    assert said in str(caught.value)


def test_a_transformation_of_a_whole_number_is_refused(tmp_path, whole):
    path = wholes(tmp_path / "t.ssp", whole, [("m", "n")], inside=LINEAR)
    with pytest.raises(CosimError) as caught:
        prepared(path)
    assert "LinearTransformation, which is of Real values, and a.m is Integer" in str(caught.value)


def test_modes_see_a_conversion(tmp_path, capsys):
    """Two integrators in a ring, whose outputs are in a unit of 1000: each connection multiplies by that."""

    def mode(unit_of_outputs):
        parts = [
            component("a", "integrator", bindings(values(gain=0.03))),
            component("b", "integrator", bindings(values(gain=-0.02))),
        ]
        path = write(tmp_path / f"{unit_of_outputs}.ssp", system("top", parts, RING))
        own = UNITS + b'<Unit name="k"><BaseUnit factor="1000"/></Unit>'
        old = b'causality="output" variability="continuous" initial="calculated">\n      <Real unit="1" />'
        new = old.replace(b'"1" />', f'"{unit_of_outputs}" />'.encode())
        path = with_other_fmus(path, tmp_path / f"{unit_of_outputs}_.ssp", UNITS, own)
        path = with_other_fmus(path, tmp_path / f"{unit_of_outputs}__.ssp", old, new)
        assert main(["modes", str(path), "--range", "0:10", "--json"]) == 0
        (found,) = json.loads(capsys.readouterr().out)["scenarios"][0]["modes"]
        return complex(found["real"], found["imag"])

    expected = np.log(1 + 1j * np.sqrt(600) * H) / H
    assert mode("k") == pytest.approx(expected, rel=1e-6)


# -- types ------------------------------------------------------------------------------------------

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="whole" guid="whole">
  <CoSimulation modelIdentifier="whole"/>
  <TypeDefinitions><SimpleType name="E"><Enumeration><Item name="a" value="1"/><Item name="b" value="2"/>
    <Item name="c" value="3"/></Enumeration></SimpleType></TypeDefinitions>
  <ModelVariables>
{variables}
  </ModelVariables>
  <ModelStructure><Outputs>{outputs}</Outputs></ModelStructure>
</fmiModelDescription>
"""
# name → causality, type, reference and start value
VARIABLES = {
    "u": ("input", "Real", 0, "0"),
    "y": ("output", "Real", 1, None),
    "n": ("input", "Integer", 0, "0"),
    "m": ("output", "Integer", 1, None),
    "choice": ("input", "Enumeration", 2, "1"),
    "chosen": ("output", "Enumeration", 3, None),
    "on": ("input", "Boolean", 0, "false"),
    "is_on": ("output", "Boolean", 1, None),
    "text": ("input", "String", 0, "x"),
    "words": ("output", "String", 1, None),
}


def described():
    """The model description of whole.c."""
    rows, outputs = [], []
    for index, (name, (causality, form, reference, start)) in enumerate(VARIABLES.items(), 1):
        declared = ' declaredType="E"' if form == "Enumeration" else ""
        begins = "" if start is None else f' start="{start}"'
        kind = "continuous" if form == "Real" else "discrete"
        rows.append(
            f'<ScalarVariable name="{name}" valueReference="{reference}" causality="{causality}" variability="{kind}">'
            f"<{form}{declared}{begins}/></ScalarVariable>"
        )
        outputs += [f'<Unknown index="{index}"/>'] if causality == "output" else []
    return DESCRIPTION.format(variables="".join(rows), outputs="".join(outputs))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The FMU of whole.c."""
    folder = tmp_path_factory.mktemp("whole")
    source = (Path(__file__).parent / "whole.c").read_text(encoding="utf-8")
    library = compile_library(source, host_platform())
    path = folder / "whole.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", described())
        archive.write(library, f"binaries/{host_platform()}/whole{library.suffix}")
    assert read_description(path).variables["on"].type == "Boolean"
    return path


def wholes(path, fmu, wires, inside="", **given):
    """Two of them, a and b; ``inside``: of each connection; ``given``: values of a."""
    ports = "".join(
        f'<ssd:Connector name="{name}" kind="{kind}"><ssc:{form.replace("Enumeration", "Integer")}/></ssd:Connector>'
        for name, (kind, form, *_) in VARIABLES.items()
    )
    parts = [
        f'<ssd:Component name="{name}" source="resources/whole.fmu"><ssd:Connectors>{ports}</ssd:Connectors>{bound}'
        "</ssd:Component>"
        for name, bound in (("a", bindings(values(**given)) if given else ""), ("b", ""))
    ]
    top = system("top", parts, [wire(f"a.{source}", f"b.{sink}", inside) for source, sink in wires])
    return write(path, top, models=[], **{"whole__fmu": fmu.read_bytes()})


@pytest.mark.parametrize("on", [False, True])
def test_whole_numbers_and_switches_are_carried(tmp_path, whole, on):
    wires = [("m", "n"), ("m", "u"), ("is_on", "on"), ("chosen", "choice")]
    path = wholes(tmp_path / "w.ssp", whole, wires, n=-4, on=on, choice=3)
    scenario = prepared(path)
    _, found = response(scenario)
    # b.y = 2u + n + 100 where it is on
    assert found["b.y"] == pytest.approx(2 * -3 - 3 + (0 if on else 100))
    assert (found["a.m"][-1], found["a.chosen"][-1], found["a.is_on"][-1]) == (-3, 3, not on)
    with Master(scenario.system, scenario.schedule, scenario.step_size, 0.1) as master:
        assert master.components["b"].values(["n", "choice", "on", "u"]) == {
            "n": -3,
            "choice": 3,
            "on": not on,
            "u": -3,
        }


def test_such_a_system_comes_back_from_its_own_export(tmp_path, whole):
    wires = [("m", "n"), ("is_on", "on"), ("chosen", "choice")]
    path = wholes(tmp_path / "e.ssp", whole, wires, n=6, choice=2)
    # the values of an Enumeration cannot be written
    path = with_other_fmus(path, tmp_path / "w.ssp", b'Enumeration declaredType="E"', b"Integer")
    out = tmp_path / "again.ssp"
    assert main(["export", "ssp", str(path), "--out", str(out)]) == 0
    first, again = response(prepared(path))[1], response(prepared(out))[1]
    assert again["b.y"] == pytest.approx(7 + 100)
    assert {name: list(column) for name, column in again.items()} == {
        name: list(column) for name, column in first.items()
    }


@pytest.mark.parametrize(
    ("source", "sink", "kinds"),
    [
        ("y", "n", ("Real", "Integer")),
        ("m", "on", ("Integer", "Boolean")),
        ("is_on", "u", ("Boolean", "Real")),
        ("chosen", "n", ("Enumeration", "Integer")),
        ("words", "text", ("String", "String")),
    ],
)
def test_types_that_a_connection_does_not_carry_are_one_problem(
    tmp_path, whole, source, sink, kinds
):
    with pytest.raises(CosimError) as caught:
        prepared(wholes(tmp_path / "w.ssp", whole, [(source, sink)]))
    said = str(caught.value)
    assert "1 problem\n" in said
    assert f"a.{source} is {kinds[0]} and b.{sink} is {kinds[1]}; a connection carries Real" in said
