"""What a user may type in Python: one clear error of our own, or what was meant; never another answer in silence."""

import inspect

import matplotlib as mpl
import numpy as np
import pytest

import orchestrator as gfor
from orchestrator.core.errors import InputError
from orchestrator.studies.pod_design.view import ControllerDesign

mpl.use("agg")


@pytest.fixture(scope="module")
def case():
    return gfor.load("two_area")


@pytest.fixture(scope="module")
def run():
    return gfor.load("infinite_bus").scenario("dip").run(stop=1.1)


@pytest.mark.parametrize(
    "values", [{"grid": {"X_L": 0.3}}, {"grid.X_L": np.float64(0.3)}, {"grid.X_L": "0.3"}]
)
def test_a_value_is_taken_however_it_is_written(case, values):
    assert case.scenario("pod_p", values).values["grid.X_L"] == 0.3


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"grid": 0.3}, "'grid' is not of the form component.variable"),
        ({"X_L": 0.3}, "'X_L' is not of the form component.variable"),
        ({".X_L": 0.3}, "'.X_L' is not of the form"),
        ({3: 0.3}, "3 is not a name"),
        ({"grid": {3: 0.3}}, "3 is not a name"),
        (["grid.X_L=0.3"], "give values by name"),
        ("grid.X_L=0.3", "give values by name"),
    ],
)
def test_values_that_say_nothing_are_refused(case, values, words):
    with pytest.raises(InputError, match=words):
        case.scenario("pod_p", values)
    with pytest.raises(InputError, match=words):
        case.sweep({"grid.X_L": [0.1, 0.2]}, ["gfor"], values)
    with pytest.raises(InputError, match=words):
        case.design("pod_p", values=values)


@pytest.mark.parametrize(
    ("vary", "words"),
    [
        ({"grid": [0.1, 0.2]}, "'grid' is not of the form component.variable"),
        ({"grid": {"X_L": [0.1]}}, "'grid' is not of the form component.variable"),
        ({"grid.X_L": 0.1}, "a sweep needs a list of values"),
        ({"grid.X_L": "0.1:0.5:9"}, "a sweep needs a list of values"),
        ({"grid.X_L": []}, "a sweep needs values"),
        ({4: [0.1]}, "4 is not a name"),
        ({}, "give what is varied"),
        ([], "give what is varied"),
        (None, "give what is varied"),
        (3, "give what is varied"),
    ],
)
def test_a_sweep_of_nothing_is_refused(case, vary, words):
    with pytest.raises(InputError, match=words):
        case.sweep(vary, ["gfor"])


def test_one_name_is_as_good_as_a_list_of_one(case, tmp_path):
    assert [scenario.name for scenario in case.choose("pod_p")] == ["pod_p"]
    report = gfor.check(gfor.build("infinite_bus", tmp_path), only="runs")
    assert report.table().index.tolist() == ["archive", "runs"]
    scenario = gfor.load("infinite_bus").scenario("load_step")
    model = scenario.linearize("gfor.droop.delta_P_ref", "gfor.omega")
    assert model.inputs == ("gfor.droop.delta_P_ref",)
    with pytest.raises(InputError, match=r"x\.toml: the parameter file cannot be read"):
        case.scenario("pod_p", parameters="x.toml")
    for wrong in (3, [3], None):
        with pytest.raises(InputError, match="give a name, or a list of names"):
            case.choose(wrong)


@pytest.mark.parametrize(
    "frequencies", [2, None, "0.1", (0.1,), (2, 0.1), ("x", "y"), (0.1, float("nan")), (-1, 2)]
)
def test_frequencies_are_two_numbers_in_order(case, frequencies):
    with pytest.raises(InputError, match="frequencies"):
        case.scenario("pod_p").modes(frequencies)


@pytest.mark.parametrize("given", ["5 %", "0.05", 0.05, 0, True, float("nan"), [5], 120])
def test_a_damping_is_in_percent(case, given):
    """A ratio is no old wish with another answer: it is refused."""
    for argument, study in (("critical", case.scenario("pod_p").modes), ("damping", case.screen)):
        with pytest.raises(InputError, match=rf"{argument} = .*in percent"):
            study(**{argument: given})


@pytest.mark.parametrize("given", ["5 %", "0.05", 0.05, 0.999, 95, 0, True, float("nan"), [5]])
@pytest.mark.parametrize("name", ["damping", "least_damping"])
def test_a_damping_of_a_design_is_in_percent(case, name, given, tmp_path):
    with pytest.raises(InputError, match=f"{name} = .*it is in percent between 1 and 90"):
        case.design("pod_p", **{name: given})
    with pytest.raises(InputError, match=f"{name} = .*it is in percent between 1 and 90"):
        case.design_over_points(tmp_path / "points.csv", **{name: given})


@pytest.mark.parametrize(
    ("wanted", "words"),
    [
        ({"gain_bounds": 5}, r"gain_bounds = 5; give the lowest and the highest gain in pu"),
        ({"gain_bounds": ("0", "9")}, "in pu, such as"),
        ({"gain_bounds": (200, 0)}, "0 ≤ lowest ≤ highest"),
        ({"gain_bounds": (-5, 10)}, "0 ≤ lowest ≤ highest"),
        ({"gain_bounds": (0, float("nan"))}, "0 ≤ lowest ≤ highest"),
        ({"delta_gain": "1"}, "delta_gain = '1'; give a gain above 0 in pu, such as"),
        ({"delta_gain": None}, "delta_gain = None; give a gain"),
        ({"delta_gain": -1.0}, "delta_gain = -1.0; give a gain"),
        ({"stages": True}, "stages = True; give a whole number from 0 to 10"),
        ({"stages": "2"}, "stages = '2'; give a whole number"),
        ({"least_damping": None}, "least_damping = None; it is in percent"),
        ({"component": ["gfor"]}, r"component = \['gfor'\]; give one name"),
        ({"scenario": ["gfor"]}, r"scenario = \['gfor'\]; it is for one scenario"),
        ({"refine": "no"}, "refine = 'no'; give True or False"),
    ],
)
def test_what_is_asked_of_a_design_is_of_its_kind(case, wanted, words):
    with pytest.raises(InputError, match=words):
        case.design("pod_p", **wanted)


@pytest.mark.parametrize(
    ("path", "words"),
    [("design.json", "name it design.toml"), (None, "give the path"), (3, "give the path")],
)
def test_a_design_is_not_saved_over_its_own_json(tmp_path, monkeypatch, path, words):
    monkeypatch.chdir(tmp_path)
    # the path is refused before anything of the design is looked at
    design = ControllerDesign(None)
    with pytest.raises(InputError, match=words):
        design.save(path, "a command")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("nothing", [None, 3, ""])
def test_a_file_is_named_by_its_path(nothing):
    for function in (gfor.load, gfor.open_fmu, gfor.info, gfor.check):
        with pytest.raises(InputError, match=r"give (a built-in case|the path)"):
            function(nothing)


def test_what_is_compared_must_be_runs(run):
    for other in (None, run.modes, 3):
        with pytest.raises(InputError, match="give a run, its dataset, a DataFrame"):
            gfor.compare(run, other)
    with pytest.raises(InputError, match="give a run, its dataset, a DataFrame"):
        gfor.identify(None, "gfor.omega")


@pytest.mark.parametrize("start", ["500 ms", "0.5 s", np.float64(0.5), 0.5])
def test_a_start_is_a_time_however_it_is_written(run, start):
    assert (
        gfor.compare(run, run, "gfor.omega", start).signals
        == gfor.compare(run, run, "gfor.omega", 0.5).signals
    )
    assert gfor.identify(run, "gfor.omega", start).start == pytest.approx(0.5)


@pytest.mark.parametrize("start", [float("nan"), -1, True, "soon", "1 kV", 1.1, 99, [1.0]])
def test_a_start_that_leaves_nothing_is_refused(run, start):
    with pytest.raises(InputError, match="start"):
        gfor.compare(run, run, "gfor.omega", start)
    with pytest.raises(InputError, match="start"):
        gfor.identify(run, "gfor.omega", start)


def test_a_run_too_short_for_its_rings_says_so(run):
    found = gfor.compare(run, run, "gfor.omega")
    assert found.signals[0].modes == (None, None)
    assert [text.partition(":")[0] for text in found.remarks] == [
        f"{x} (dip) ends at t = 1.1 s" for x in "ab"
    ]
    assert "give an earlier start" in found._repr_html_()


def test_a_record_of_nothing_is_refused(run):
    with pytest.raises(InputError, match="nothing was recorded over the time"):
        gfor.identify(run.dataset.isel(time=slice(0)), "gfor.omega")


def test_a_misspelt_signal_names_the_one_that_was_meant(run):
    with pytest.raises(InputError, match=r"did you mean gfor\.omega"):
        run.signal("gfor.omga")
    with pytest.raises(InputError, match=r"the difference 'a\.b - c\.d' of two"):
        run.plot("gfor.omega + gfor.p")
    with pytest.raises(InputError, match="give one signal"):
        run.plot(["gfor.omega", "gfor.p"])
    with pytest.raises(InputError, match=r"ax = 3; give Matplotlib Axes"):
        run.plot("gfor.omega", 3)


def test_modes_are_a_sequence():
    modes = gfor.load("infinite_bus").scenario("dip").modes((0.1, 100.0))
    assert modes[0] is next(iter(modes))
    with pytest.raises(InputError, match="give Matplotlib Axes"):
        modes.plot(3)


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    return gfor.build("infinite_bus", tmp_path_factory.mktemp("fmu"))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda case: case.scenario(""), "name = ''; give the name of one scenario: base"),
        (lambda case: case.scenario(["gfor"]), "give the name of one scenario"),
        (lambda _: gfor.load("a" * 5000), "case = 'aaaa.* is no path that a file can have"),
        (lambda case: case.scenario("gfor", {"grid.X_L": 10**400}), "a whole number beyond 1e308"),
        (lambda case: case.scenario("gfor", step=10**400), "a whole number beyond 1e308"),
        (
            lambda case: case.sweep({"grid.X_L": [0.1]}, workers="2"),
            "workers = '2'; it must be a whole number",
        ),
        (
            lambda case: case.sweep({"grid.X_L": [0.1]}, workers=True),
            "workers = True; it must be a whole number",
        ),
        (
            lambda case: case.sweep({"grid.X_L": [0.1]}, folder="/proc/x"),
            "folder = '/proc/x': points cannot be kept",
        ),
        (
            lambda case: case.sweep({"grid.X_L": [0.1]}, folder=__file__),
            "points cannot be kept there",
        ),
        (
            lambda case: case.scenario("gfor", {"grid": {"X_L": 0.1}, "grid.X_L": 0.2}),
            "'grid.X_L' is given twice",
        ),
        (
            lambda case: case.scenario("gfor").run(observers=[3]),
            r"observers = \[3\]; give a list of observers",
        ),
        (
            lambda case: case.scenario("gfor").run(observers=None),
            "observers = None; give a list of observers",
        ),
        (
            lambda case: case.scenario("gfor").run(recording="rec"),
            "recording = 'rec'; give a RecordingFolder",
        ),
        (
            lambda case: case.scenario("gfor").run(federates="gfor"),
            r"federates = 'gfor'; give Federates",
        ),
        (lambda _: gfor.read_linear_model(None), "fmu = None; give the path of a file"),
        (
            lambda case: case.scenario("gfor", {"grid.X_L": np.array([0.1, 0.2])}),
            r"grid.X_L is given several values",
        ),
        (
            lambda _: gfor.certify(__file__, "miso", declared=1.1),
            r"declared = 1.1; give values by name",
        ),
        (
            lambda _: gfor.certify(__file__, reactances="0.1"),
            "reactances = '0.1'; give line reactances in pu",
        ),
        (
            lambda _: gfor.certify(__file__, reactances=0.1),
            "reactances = 0.1; give line reactances in pu",
        ),
        (
            lambda _: gfor.certify(__file__, reactances=[None]),
            "reactances = None; give line reactances in pu",
        ),
        (
            lambda _: gfor.build("synchronous_generator", parts="genrou"),
            "parts = 'genrou'; give models by part",
        ),
        (
            lambda case: case.interactions("gfor", devices="a.fmu"),
            "devices = 'a.fmu'; give files by name",
        ),
        (
            lambda case: case.interactions("gfor", bindings="a.toml"),
            "bindings = 'a.toml'; give files by name",
        ),
        (
            lambda _: gfor.admittance(__file__, frequencies=(0, 10)),
            r"\(0, 10\); the lowest must be above 0",
        ),
        (lambda _: gfor.nyquist(3), "device = 3; give the path of a file"),
        (lambda case: gfor.nyquist(case, frequency="x"), "frequency: 'x' is not a number"),
        (lambda case: gfor.nyquist(case, compensation=None), "compensation = None; give a share"),
        (lambda case: gfor.nyquist(case, rating="5 kV"), "rating: '5 kV' is in kV"),
        (
            lambda case: gfor.nyquist(case, voltage=np.array([1, 2])),
            "voltage = .*; give a voltage in kV",
        ),
        (lambda case: case.modes(), r"it belongs to a scenario: case.scenario\(…\).modes"),
        (lambda case: case.run(), r"it belongs to a scenario: case.scenario\(…\).run"),
    ],
)
def test_an_argument_of_another_kind_is_named(case, call, words):
    with pytest.raises(InputError, match=words):
        call(case)


@pytest.mark.parametrize("nothing", [None, ["grid.v"], 3])
def test_a_signal_is_one_name(run, nothing):
    with pytest.raises(InputError, match=r"signal = .*; give one signal"):
        run.signal(nothing)
    with pytest.raises(InputError, match=r"folder = .*; give the path of a folder"):
        run.save(None)


@pytest.mark.parametrize("current", [-1, 110, np.nan, "1.1 MW", True, None])
def test_a_current_and_a_rating_are_in_their_range(current):
    # refused before its power flow is asked for, which it lacks
    scenario = gfor.load("infinite_bus").scenario("dip")
    with pytest.raises(
        InputError,
        match=r"converter_current.* a converter's current in pu|converter_current: '1.1 MW'",
    ):
        scenario.strengths(current)
    with pytest.raises(InputError, match=r"rating.* a rating above 0 in MVA|rating: 'x'"):
        scenario.strengths(1.1, rating={110: 0, -1: -1, None: "x"}.get(current, np.nan))


def test_a_mode_is_found_by_its_name():
    modes = gfor.load("two_area").scenario("gfor").modes()
    assert modes["electromechanical"] == modes.named["electromechanical"]
    with pytest.raises(InputError, match="has no mode named 'inter'"):
        modes["inter"]


def test_nyquist_takes_a_case(case):
    assert gfor.nyquist(case, components=["gfor"], scenario="gfor").verdict == "stable"


def test_a_step_response_is_of_all_inputs_at_equal_distances():
    model = (
        gfor.load("infinite_bus")
        .scenario("load_step")
        .linearize(["gfor.droop.delta_P_ref"], ["gfor.omega"])
    )
    times = np.arange(0.0, 0.1, 0.01)
    assert np.array_equal(
        model.step_response(0.01, times), model.step_response([0.01], list(times))
    )
    with pytest.raises(InputError, match=r"give one number for each input: gfor.droop.delta_P_ref"):
        model.step_response([0.01, 0.0], times)
    for wrong in ([0.0, 0.01, 0.03], [], [-1.0, 0.0]):
        with pytest.raises(InputError, match="equal distances"):
            model.step_response(0.01, wrong)


def test_what_was_recorded_cannot_be_written_over(run):
    """Modes are identified in it."""
    name = next(iter(run.dataset.data_vars))
    before = run.dataset[name].values.copy()
    with pytest.raises(ValueError, match="read-only"):
        run.dataset[name].values[:] = 0
    with pytest.raises(ValueError, match="read-only"):
        run.dataset[name] *= 0
    run.dataset[name] = 2 * run.dataset[name]
    assert (run.dataset[name].values == before).all()
    own = run.dataset.copy(deep=True)
    own[name][:] = 0


@pytest.mark.parametrize("signal", [None, ["gfor.omega"], ""])
def test_modes_are_identified_in_one_signal(run, signal):
    with pytest.raises(InputError, match=r"signal = .*; give one signal, 'a\.b' or the difference"):
        gfor.identify(run, signal)


def test_one_number_in_an_array_is_a_number(case):
    assert len(case.scenario("pod_p").modes(critical=np.array([30]))) > 0


def test_a_linear_model_has_the_inputs_that_are_given_and_else_those_of_the_events():
    scenario = gfor.load("infinite_bus").scenario("load_step")
    model = scenario.linearize(["gfor.droop.delta_Q_ref"], ["gfor.p"])
    assert (model.inputs, model.outputs) == (("gfor.droop.delta_Q_ref",), ("gfor.p",))
    changed = {
        f"{c}.{v}"
        for event in scenario.prepared.events
        for c, values in event.changes().items()
        for v in values
    }
    assert set(scenario.linearize().inputs) == changed
    assert "gfor.droop.delta_Q_ref" not in changed


def test_a_matrix_is_named_by_a_letter():
    model = gfor.load("infinite_bus").scenario("load_step").linearize()
    with pytest.raises(InputError, match=r"there is no matrix \['A'\]"):
        model.table(["A"])


@pytest.mark.parametrize(
    ("wanted", "words"),
    [
        ({"model": ["gfor"]}, "give the name of a model of the catalogue"),
        ({"model": None}, "give the name of a model of the catalogue"),
        ({"folder": None}, "folder = None; give the path of a folder"),
        ({"folder": __file__}, "an FMU cannot be written there: File exists"),
        ({"folder": "/proc/x"}, "an FMU cannot be written there"),
        (
            {"platforms": ["amiga"]},
            "there is no platform 'amiga'; choose from darwin64, linux64, wasm32-wasip2, win64",
        ),
        ({"platforms": ["amiga"], "native": True}, "there is no platform 'amiga'"),
        ({"platforms": 3}, "platforms = 3; give a name"),
        ({"extra": {"../../x": b""}}, r"'\.\./\.\./x' is not a path in the FMU's folder extra/"),
        (
            {"extra": {"extra/../modelDescription.xml": b""}},
            "is not a path in the FMU's folder extra/",
        ),
        ({"extra": {"modelDescription.xml": b""}}, "is not a path in the FMU's folder extra/"),
        ({"extra": {"extra/x": "text"}}, "is of type str; give bytes"),
        ({"extra": ["x"]}, "give bytes by path"),
    ],
)
def test_a_build_that_cannot_be_is_refused(tmp_path, wanted, words):
    with pytest.raises(InputError, match=words):
        gfor.build(**{"model": "infinite_bus", "folder": tmp_path} | wanted)
    assert list(tmp_path.iterdir()) == []


def test_one_platform_is_as_good_as_a_list_of_one(tmp_path):
    assert gfor.build(
        "infinite_bus", tmp_path, platforms="linux64", extra={"extra/a/b.txt": b"1"}
    ).exists()


@pytest.mark.parametrize(
    ("wanted", "words"),
    [
        (
            {"memory_limit": 4},
            "memory_limit = 4 is 4 MB, too little to load any FMU; give at least 32 MB",
        ),
        ({"memory_limit": True}, "memory_limit = True; give an amount of memory in MB"),
        ({"memory_limit": "4 s"}, "'4 s' is in s, but MB is needed"),
        ({"memory_limit": "1 kB"}, "is 0.001 MB, too little"),
        ({"component": ["grid"], "case": "infinite_bus"}, r"component = \['grid'\]; give one name"),
        (
            {"component": "nope", "case": "infinite_bus"},
            "there is no component 'nope'; there are: gfor, grid",
        ),
        ({"case": 3}, "case = 3; give the path"),
        ({"binding": 3}, "binding = 3; give the path of a file"),
    ],
)
def test_a_check_names_what_it_cannot_use(fmu, wanted, words):
    with pytest.raises(InputError, match=words):
        gfor.check(fmu, **wanted)


def test_a_memory_limit_has_a_unit(fmu):
    assert gfor.check(fmu, only="runs", memory_limit="2 GB").trusted
    assert gfor.check(fmu, only="runs", memory_limit=32).trusted


def test_an_fmu_takes_times_with_a_unit_and_refuses_others(fmu):
    with gfor.open_fmu(fmu, stop="1 s") as opened:
        opened.step("1 ms")
        assert opened.time == 1e-3
        assert opened.values("v") == {"v": opened.get("v")}
        for step in ("1 MW", None, -1, True, 10**400):
            with pytest.raises(InputError):
                opened.step(step)
        for name in (["v"], None, 3):
            with pytest.raises(InputError, match="there is no variable"):
                opened.get(name)
        with pytest.raises(InputError, match="names = 3; give a name"):
            opened.values(3)
    for wanted in ({"stop": -1}, {"stop": "x"}, {"binding": 3}):
        with pytest.raises(InputError):
            gfor.open_fmu(fmu, **wanted)


@pytest.mark.parametrize("study", [gfor.certify, gfor.verify])
def test_python_starts_no_processes_unless_it_is_asked(study):
    """A script without a main guard would start itself again in each."""
    assert inspect.signature(study).parameters["workers"].default == 1
