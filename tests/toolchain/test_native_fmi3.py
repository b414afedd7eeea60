"""Native FMUs of FMI 3.0: the same answers, derivatives both ways, terminals, and a status for every bad call."""

import ctypes
import math
import shutil
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi3 import FMU3Slave, fmi3LogMessageCallback
from lxml import etree

from fmus.toolchain.catalogue import build_model
from fmus.toolchain.exporter import export
from fmus.toolchain.native_fmu import NativeFmu
from orchestrator.devices.fmi.validation import fmpys_problems
from tests.support.host import DISCARD, ERROR, GENERATOR, OK, H, drive
from tests.support.jacobians import jacobians

MODELS = ["gfor", GENERATOR, "two_area_grid"]
SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi3"


class Host3:
    """One instance of FMI 3.0 through FMPy, with everything it logged."""

    def __init__(self, directory, instance="one", token=None):
        self.md = md = fmpy.read_model_description(str(directory), validate=False)
        self.vr = {v.name: v.valueReference for v in md.modelVariables}
        self.floats = [
            v.name
            for v in md.modelVariables
            if v.type == "Float64" and v.causality != "independent"
        ]
        self.log = []
        self._logger = fmi3LogMessageCallback(lambda *a: self.log.append((a[1], a[-1].decode())))
        self.fmu = FMU3Slave(
            guid=token or md.guid,
            unzipDirectory=str(directory),
            modelIdentifier=md.coSimulation.modelIdentifier,
            instanceName=instance,
        )
        self.fmu.instantiate(loggingOn=True, logMessage=self._logger)

    def initialise(self):
        self.fmu.enterInitializationMode(startTime=0.0)
        self.fmu.exitInitializationMode()
        return self

    def status(self, function, *arguments):
        try:
            function(*arguments)
        except fmpy.fmi1.FMICallException as error:
            return error.status
        return OK

    def get(self, *names):
        return self.fmu.getFloat64([self.vr[n] for n in names])

    def set(self, **values):
        self.fmu.setFloat64([self.vr[n.replace("__", ".")] for n in values], list(values.values()))

    def run(self, steps):
        inputs = [v.valueReference for v in self.md.modelVariables if v.causality == "input"]
        rows = []
        for k in range(steps):
            self.fmu.setFloat64(inputs, [drive(k, j) for j in range(len(inputs))])
            self.fmu.doStep(k * H, H)
            rows.append(np.array(self.get(*self.floats)).tobytes())
        return rows

    def role(self, causality):
        return [v.valueReference for v in self.md.modelVariables if v.causality == causality]

    @property
    def states(self):
        return [
            v.derivative.valueReference for v in self.md.modelVariables if v.derivative is not None
        ]

    @property
    def rates(self):
        return [v.valueReference for v in self.md.modelVariables if v.derivative is not None]


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmi3")
    return {
        name: export(NativeFmu(build_model(name), "3.0"), folder, ("linux64",)) for name in MODELS
    }


@pytest.fixture(scope="module")
def folders(files):
    extracted = {name: fmpy.extract(str(path)) for name, path in files.items()}
    yield extracted
    for folder in extracted.values():
        shutil.rmtree(folder)


@pytest.fixture
def host3(folders):
    hosts = []

    def create(name="gfor", **more):
        hosts.append(Host3(folders[name], **more))
        return hosts[-1]

    yield create
    for h in hosts:
        h.fmu.freeInstance()


@pytest.mark.parametrize("name", MODELS)
def test_the_file_is_clean_under_validator_and_schema(name, files):
    assert fmpys_problems(files[name]) == []
    md = fmpy.read_model_description(str(files[name]), validate=True)
    assert md.fmiVersion == "3.0"
    with zipfile.ZipFile(files[name]) as archive:
        capabilities = etree.fromstring(archive.read("modelDescription.xml")).find("CoSimulation")
    assert capabilities.get("providesDirectionalDerivatives") == "true"
    assert capabilities.get("providesAdjointDerivatives") == "true"


@pytest.mark.parametrize("name", ["gfor", GENERATOR])
def test_the_terminal_of_a_device_follows_its_schema_and_names_real_variables(name, files):
    with zipfile.ZipFile(files[name]) as archive:
        text = archive.read("terminalsAndIcons/terminalsAndIcons.xml")
    root = etree.fromstring(text)
    etree.XMLSchema(etree.parse(str(SCHEMA / "fmi3TerminalsAndIcons.xsd"))).assertValid(root)
    names = {v.name for v in fmpy.read_model_description(str(files[name])).modelVariables}
    members = [m.get("variableName") for m in root.iter("TerminalMemberVariable")]
    assert set(members) <= names
    assert [t.get("name") for t in root.iter("Terminal")] == ["bus"]
    assert len(members) == 4


def test_fmpy_simulates_it(files):
    result = fmpy.simulate_fmu(
        str(files["gfor"]), stop_time=0.01, step_size=H, start_values={"P_0": 0.6}
    )
    assert result["p"][0] == pytest.approx(0.6, abs=1e-12)
    assert np.ptp(result["p"]) < 1e-9


@pytest.mark.parametrize("name", MODELS)
def test_both_versions_of_fmi_give_the_same_bits(name, host3, open_host):
    two, three = open_host(name, native=True).initialise(), host3(name).initialise()
    assert three.floats == two.reals
    assert three.run(100) == two.run(100)
    assert three.log == []


def test_parameters_of_all_types(host3):
    h = host3()
    h.fmu.setInt32([h.vr["pod_p.N_S"]], [1])
    h.fmu.setBoolean([h.vr["pod_p.enabled"]], [True])
    assert h.fmu.getInt32([h.vr["pod_p.N_S"]]) == [1]
    assert h.fmu.getBoolean([h.vr["pod_p.enabled"]]) == [True]
    h.set(P_0=0.5)
    h.initialise()
    assert h.get("p") == pytest.approx([0.5], abs=1e-12)
    h.fmu.doStep(0.0, H)
    assert h.get("time") == [H]


def matrix(call, rows, columns):
    """A Jacobian, one seed at a time."""
    return np.array([call(rows, columns, seed) for seed in np.eye(len(columns))]).T


def directional(h):
    def call(unknowns, knowns, seed):
        return h.fmu.getDirectionalDerivative(unknowns, knowns, list(seed), len(unknowns))

    return call


def adjoint(h):
    def call(knowns, unknowns, seed):
        return h.fmu.getAdjointDerivative(unknowns, knowns, list(seed), len(knowns))

    return call


@pytest.mark.parametrize("name", MODELS)
def test_the_adjoint_is_the_transpose(name, host3):
    h = host3(name).initialise()
    h.run(20)
    knowns, unknowns = h.role("input") + h.states, h.role("output") + h.rates
    J = matrix(directional(h), unknowns, knowns)
    assert np.abs(J).max() > 1
    np.testing.assert_allclose(
        matrix(adjoint(h), knowns, unknowns), J.T, rtol=1e-12, atol=1e-12 * np.abs(J).max()
    )


def test_the_adjoint_is_the_transpose_in_initialisation_too(host3):
    h = host3()
    h.fmu.enterInitializationMode(startTime=0.0)
    calculated = [
        v.valueReference for v in h.md.modelVariables if v.causality == "calculatedParameter"
    ]
    parameters = [
        v.valueReference
        for v in h.md.modelVariables
        if v.causality == "parameter" and v.type == "Float64"
    ]
    knowns, unknowns = parameters + h.role("input"), h.role("output") + h.states + calculated
    J = matrix(directional(h), unknowns, knowns)
    assert np.abs(J[:, : len(parameters)]).max() > 0.1
    np.testing.assert_allclose(
        matrix(adjoint(h), knowns, unknowns), J.T, rtol=1e-12, atol=1e-12 * np.abs(J).max()
    )


def test_derivatives_equal_the_exact_jacobians(host3):
    h, model = host3().initialise(), build_model("gfor")
    h.run(20)
    z = [
        h.fmu.getFloat64([v.valueReference])[0] if v.type == "Float64" else None
        for v in h.md.modelVariables
    ]
    np_, nc, nu, nx = (
        len(g) for g in (model.parameters, model.calculated, model.inputs, model.states)
    )
    p = [p.start if value is None else value for p, value in zip(model.parameters, z, strict=False)]
    c, u, x = z[np_ : np_ + nc], z[np_ + nc : np_ + nc + nu], z[np_ + nc + nu : np_ + nc + nu + nx]
    A, B, C, D = (np.array(block) for block in jacobians(model)(x, u, p, c))
    J = matrix(directional(h), h.rates + h.role("output"), h.states + h.role("input"))
    np.testing.assert_allclose(J, np.block([[A, B], [C, D]]), rtol=1e-10, atol=1e-9)


def test_a_saved_state_continues_in_another_instance(host3):
    h, twin = host3().initialise(), host3(instance="twin").initialise()
    h.run(30)
    state = h.fmu.getFMUState()
    data = h.fmu.serializeFMUState(state)
    future = h.run(20)
    twin.fmu.setFMUState(twin.fmu.deserializeFMUState(data))
    assert twin.run(20) == future
    h.fmu.setFMUState(state)
    assert h.run(20) == future
    h.fmu.freeFMUState(state)


BAD = {
    "a wrong reference": (
        lambda h: h.fmu.getFloat64([9999]),
        ERROR,
        "no variable with value reference 9999",
    ),
    "NaN at an input": (lambda h: h.set(v_re=math.nan), DISCARD, "v_re = "),
    "out of range": (
        lambda h: h.set(pod_p__K=-1.0),
        DISCARD,
        "pod_p.K = -1; it must be at least 0",
    ),
    "set an output": (lambda h: h.set(p=1.0), ERROR, "p is computed"),
    "a step of zero": (lambda h: h.fmu.doStep(0.0, 0.0), ERROR, "it must exceed 0"),
    "event mode": (
        lambda h: h.fmu.enterEventMode(),
        ERROR,
        "fmi3EnterEventMode is not for this FMU",
    ),
    "another type": (lambda h: h.fmu.getInt32([h.vr["p"]]), ERROR, "p is no Integer variable"),
    "no such type": (lambda h: h.fmu.getInt64([0]), ERROR, "no Int64 variables"),
    "initialise twice": (
        lambda h: h.fmu.exitInitializationMode(),
        ERROR,
        "not allowed after initialisation",
    ),
    "sizes differ": (
        lambda h: h.fmu.fmi3GetFloat64(
            h.fmu.component, (ctypes.c_uint * 2)(0, 1), 2, (ctypes.c_double * 1)(), 1
        ),
        ERROR,
        "2 value references with 1 values",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_call_gets_the_standards_status_and_words(name, host3):
    call, status, words = BAD[name]
    h = host3(instance="misused").initialise()
    assert h.status(call, h) == status
    assert words in h.log[-1][1]
    assert h.log[-1][0] == status
    assert h.log[-1][1].startswith("misused: ")
    if status == ERROR:
        assert h.status(h.fmu.doStep, 0.0, H) == ERROR
        h.fmu.reset()
        h.initialise()
    assert h.status(h.fmu.doStep, 0.0, H) == OK


def test_a_wrong_token_gives_no_instance(folders):
    with pytest.raises(Exception, match=r"[Ii]nstantiate"):
        Host3(folders["gfor"], token="{other}")
