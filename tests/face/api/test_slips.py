"""Slips of somebody who works in Python: one sentence that says what was meant, and no other answer in silence."""

import copy
import pickle
import re
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import orchestrator as gfor
from orchestrator.core.attributes import NoSuchAttributeError
from orchestrator.core.errors import InputError

TIMES = 0.01 * np.arange(1000)
RING = np.exp(-0.5 * TIMES) * np.sin(5.0 * TIMES)  # 0.7958 Hz, 9.95 %


@pytest.fixture(scope="module")
def case():
    return gfor.load("two_area_rms")


@pytest.fixture(scope="module")
def scenario(case):
    return case.scenario("pod_p")


@pytest.fixture(scope="module")
def modes(scenario):
    return scenario.modes()


@pytest.fixture(scope="module")
def run():
    return gfor.load("infinite_bus").scenario("dip").run(stop=1.1)


@pytest.fixture(scope="module")
def model():
    inputs, outputs = ["gfor.droop.delta_P_ref"], ["gfor.omega"]
    return gfor.load("infinite_bus").scenario("load_step").linearize(inputs, outputs)


def test_a_step_map_says_nothing_between_its_steps(model):
    """A time between two steps was rounded to one, and the response was stretched in silence."""
    step, change = model.step_size, np.array([0.1])
    x, rows = np.zeros(len(model.states)), []
    for _ in range(400):
        rows.append(model.C @ x + model.D @ change)
        x = model.A @ x + model.B @ change
    times = 2 * step * np.arange(200)
    np.testing.assert_allclose(model.step_response(change, times), rows[::2], atol=1e-12)
    with pytest.raises(InputError, match=r"lies between the steps of the step map.*multiples"):
        model.step_response(change, np.linspace(0, 1.0, 77))
    continuous = model.continuous()
    ends = continuous.step_response(change, np.linspace(0, 1.0, 77))[-1]
    np.testing.assert_allclose(ends, continuous.step_response(change, [1.0])[0], rtol=1e-9)


@pytest.mark.parametrize(
    ("change", "times"), [([np.nan], [0.0]), ([1.0], [0.0, np.inf]), ("x", [0])]
)
def test_a_step_response_takes_finite_numbers(model, change, times):
    with pytest.raises(InputError, match="give finite numbers"):
        model.step_response(change, times)


def test_a_row_count_is_no_time():
    """Without an index of times the frequency was a hundredth of the right one."""
    counted = pd.DataFrame({"x": RING})
    with pytest.raises(InputError, match="its index counts the rows, and is no time"):
        gfor.identify(counted, start=0)
    with pytest.raises(InputError, match="counts the rows"):
        gfor.compare(counted, counted)
    (mode, *_) = gfor.identify(counted.set_index(0.01 * counted.index), start=0).modes
    assert mode.eigenvalue == pytest.approx(-0.5 + 5.0j, abs=1e-6)


@pytest.mark.parametrize(("name", "unit"), [("time [ms]", 1e-3), ("t (us)", 1e-6), ("time", 1.0)])
def test_an_index_of_times_has_the_unit_of_its_name(name, unit):
    frame = pd.DataFrame({"x": RING}, index=pd.Index(TIMES / unit, name=name))
    (mode, *_) = gfor.identify(frame, start=0).modes
    assert mode.eigenvalue == pytest.approx(-0.5 + 5.0j, abs=1e-6)
    with pytest.raises(InputError, match=r"its index is named 'time \[km\]', and a time is in s"):
        gfor.identify(frame.rename_axis("time [km]"), start=0)


@pytest.mark.parametrize("read", [gfor.identify, gfor.source, lambda f: gfor.compare(f, f)])
def test_a_file_that_is_not_there_is_called_so(read, tmp_path):
    with pytest.raises(InputError, match=r"recorder\.csv: there is no such file"):
        read(str(tmp_path / "recorder.csv"))


def test_results_are_asked_for_a_file_as_a_mapping(tmp_path):
    (tmp_path / "modes.csv").write_text("a\n1\n")
    saved = gfor.open(tmp_path)
    assert "modes.csv" in saved
    assert "trajectory.nc" not in saved
    assert saved.get("trajectory.nc", "none") == "none"
    with pytest.raises(gfor.CosimError, match=r"it holds no 'trajectory\.nc'; it holds: modes"):
        _ = saved["trajectory.nc"]


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda c: c.scenario("pod_x"),
            "scenario: there is no scenario 'pod_x'; did you mean pod_q or pod_p or pod_pq? the case has: base",
        ),
        (lambda c: c.scenario("gfor", step=5), "step: a communication step of 5 s is too long"),
        (lambda c: c.scenario("gfor", fault="bus_9, 150 ms"), "fault 'bus_9, 150 ms': component"),
        (
            lambda c: c.scenario("gfor", force="sg9 0.8 Hz 2 %"),
            "force 'sg9 0.8 Hz 2 %': there is no",
        ),
    ],
)
def test_a_slip_in_a_call_does_not_blame_the_case_file(case, call, words):
    with pytest.raises(gfor.CosimError) as raised:
        call(case)
    assert str(raised.value).startswith(words)
    assert "case.toml" not in str(raised.value)
    assert len(raised.value._render_traceback_()) == 1
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda s, _: s.run(1.0, True),
            "run: too many positional arguments; it takes by place stop, and by",
        ),
        (lambda _, c: c.design(), "design: missing a required argument: 'controller'"),
        (lambda s, _: s.modes(report=True), "report = True; give what can be called"),
        (lambda s, _: s.sensitivities(report=3), "report = 3; give what can be called"),
        (lambda _, c: c.scenario("gfor", tolerance="small"), "tolerance = 'small': give a number"),
        (
            lambda _, c: c.scenario("gfor", parameters={"gfor.pod_p.K": 3}),
            "give values by name as values=",
        ),
        (
            lambda _, c: c.scenario("gfor", fault="bus_3, -150 ms"),
            "duration = .*it must be greater than 0",
        ),
        (
            lambda _, c: c.sweep(pd.DataFrame({"grid.X_L": [0.1]}), ["gfor"]),
            "a DataFrame is no grid",
        ),
        (
            lambda _, c: c.screen([1, 2]),
            "give the path of a file, or a DataFrame with a row for each",
        ),
        (lambda s, _: s.linearize(["gfor.droop.delta_P_ref"] * 2), "stands in the list twice"),
        (lambda s, _: s.linearize(["nix"]), r"no variable 'nix'; scenario\.parameters\(\)"),
        (
            lambda s, _: gfor.export(s, "ssp", "x.ssp", inputs=["a"]),
            "kind 'ssp' cannot be asked for 'inputs'",
        ),
        (lambda _s, _c: gfor.verify("x", "0.1"), r"anew = '0\.1'; give a list of line reactances"),
        (
            lambda _s, _c: gfor.certify("x", reactances=[]),
            r"reactances = \[\]; give line reactances",
        ),
        (
            lambda _s, _c: gfor.nyquist("two_area", components="gfr"),
            "component gfr: it is no device",
        ),
    ],
)
def test_a_wrong_argument_is_one_sentence(case, scenario, call, words):
    with pytest.raises(InputError, match=words):
        call(scenario, case)


@pytest.mark.parametrize(
    ("wanted", "words"),
    [
        ({"level": "abc"}, "level: 'abc' is not a number"),
        ({"level": float("nan")}, "level = nan; it must be a damping in percent"),
        ({"highest_hz": -1}, "highest_hz = -1; give a frequency above 0"),
        ({"signals": [3]}, r"signals = \[3\]; give a name"),
    ],
)
def test_ambient_modes_are_asked_for_by_numbers(run, wanted, words):
    with pytest.raises(InputError, match=words):
        gfor.ambient(**{"run": run, "signals": "gfor.omega"} | wanted)


def test_a_recording_has_a_rated_frequency_above_zero(run, tmp_path):
    with pytest.raises(InputError, match="frequency = -50; give a rated frequency above 0"):
        gfor.export(run, "comtrade", tmp_path / "run.cfg", frequency=-50)
    with pytest.raises(
        InputError, match="cannot be asked for 'signal', but for signals, form, frequency"
    ):
        gfor.export(run, "comtrade", tmp_path / "run.cfg", signal=["gfor.omega"])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("place", [1.0, True, None, (0, 1)])
def test_a_mode_is_at_a_whole_place(modes, place):
    with pytest.raises(InputError, match="give a place in the range, such as 0, or a mode's name"):
        _ = modes[place]
    with pytest.raises(InputError, match="give a place in the range"):
        modes.plot_shape(place)
    assert modes[np.int64(0)] is modes[0]


def test_values_may_be_a_series(case):
    chosen = pd.Series({"gfor.pod_p.K": 100.0, "grid.X_L": 0.3})
    values = case.scenario("pod_p", chosen).values
    assert (values["gfor.pod_p.K"], values["grid.X_L"]) == (100.0, 0.3)


def test_nothing_is_set_that_nobody_reads(case, scenario):
    """``scenario.step = 1e-3`` was taken, and the run went on with the old step."""
    with pytest.raises(NoSuchAttributeError, match=r"Scenario\.step cannot be set.*case\.scenario"):
        scenario.step = 1e-3
    with pytest.raises(NoSuchAttributeError, match=r"Case\.solver cannot be set.*with_"):
        case.solver = {}
    assert "step" not in vars(scenario)


def test_a_running_fmu_is_neither_copied_nor_given_away(tmp_path):
    with gfor.open_fmu(gfor.build("infinite_bus", tmp_path)) as fmu:
        for way in (copy.copy, copy.deepcopy, pickle.dumps):
            with pytest.raises(InputError, match="a running FMU has no copy"):
                way(fmu)
        with pytest.raises(NoSuchAttributeError, match=r"Fmu\.v_0 cannot be set.*set\(\{…\}\)"):
            fmu.v_0 = 1.0
        with pytest.raises(NoSuchAttributeError, match=r"Fmu\.time cannot be set"):
            fmu.time = 3.0
        with pytest.raises(InputError, match=r"v_0 is given several values; give one$"):
            fmu.set({"v_0": [1.0, 1.0]})
        assert fmu.get("v") == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("stable", r"it is \.stability\.stable"),
        ("damping_percent", r"it is modes\[0\]\.damping_percent"),
        ("tabel", r"did you mean \.table\?"),
    ],
)
def test_a_name_that_modes_lack_is_told(modes, name, words):
    with pytest.raises(AttributeError, match=words) as raised:
        getattr(modes, name)
    assert raised.value._render_traceback_() == [f"NoSuchAttributeError: {raised.value}"]
    assert not hasattr(modes, name)


def test_a_study_of_the_case_is_not_the_scenarios(scenario):
    with pytest.raises(AttributeError, match=r"asked of the case: case\.sweep\(…\)"):
        _ = scenario.sweep
    with pytest.raises(AttributeError, match=r"did you mean load\?$") as raised:
        _ = gfor.laod
    assert isinstance(raised.value, gfor.CosimError)


def test_results_are_not_compared_by_equality(modes, scenario):
    with pytest.raises(
        gfor.CosimError, match="== does not compare the figures of two Modes objects"
    ):
        _ = modes == scenario.modes()
    assert modes == modes  # noqa: PLR0124 - identity
    assert modes != 3
    assert modes in [3, modes]
    assert len({modes, modes}) == 1


def test_linear_models_are_compared_by_their_matrices(model):
    again = copy.deepcopy(model)
    assert model == again
    assert model != model.continuous()
    with pytest.raises(ValueError, match="read-only"):
        model.A[0, 0] = 1.0
    assert pickle.loads(pickle.dumps(model)) == model


def test_what_is_shown_is_short(case, scenario):
    steps = repr(scenario.steps(steps=["5 ms"], schedules="gauss-seidel"))
    assert re.fullmatch(r"<StepChoice of scenario pod_p of two_area_rms: .*>", steps)
    (limit,) = case.sweep(["grid.X_L=0.1:0.3"], ["gfor"], until="5 %").limits
    assert len(repr(limit)) < 200
    assert "'holds'" not in repr(limit)


def test_a_difference_without_blanks_is_told_how_it_is_written(run):
    with pytest.raises(
        InputError, match=r"write 'gfor\.p - gfor\.q', with blanks around the minus"
    ):
        run.signal("gfor.p-gfor.q")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("pod_p", r"it is case\.scenario\('pod_p'\)"),
        ("swep", r"did you mean \.sweep\?"),
        ("modes", r"it belongs to a scenario: case\.scenario\(…\)\.modes"),
    ],
)
def test_a_name_that_a_case_lacks_is_told(case, name, words):
    with pytest.raises(NoSuchAttributeError, match=words):
        getattr(case, name)


def test_a_screening_says_which_scenario_it_is_of(case):
    assert repr(case.screen()).startswith("<Screening of two_area_rms, base: UNSTABLE")


def test_a_wrong_value_that_is_long_is_named_by_its_type(case):
    frame = pd.DataFrame({"gfor.pod_p.K": [100.0]})
    with pytest.raises(
        InputError, match="values = something of type DataFrame; give values by name"
    ):
        case.scenario("pod_p", frame)
    with pytest.raises(InputError, match="stop = something of type ndarray; give a time above 0"):
        case.scenario("gfor").run(stop=np.zeros(100))


@pytest.mark.parametrize("kind", [gfor.Modes, gfor.Run])
def test_a_result_is_not_made_by_hand(kind):
    with pytest.raises(InputError, match=r"from load\(…\)\.scenario\(…\)"):
        kind("two_area")


def test_the_tab_key_offers_no_more_than_before(case, scenario, modes):
    """What errors are made of is not the user's."""
    for shown in (case, scenario, modes):
        assert not {"elsewhere", "own", "instead"} & {*dir(shown)}


def test_times_far_apart_without_a_unit_are_asked_about():
    """Samples that are seconds apart show no swing; written in ms, they are the recorder's 20 ms."""
    times = pd.Index(20.0 * np.arange(len(RING)))
    ring = pd.DataFrame({"x": RING}, index=times)
    with pytest.warns(
        gfor.UnusualDataWarning, match=r"20 apart, perhaps in ms.*'time \[ms\]'"
    ) as asked:
        gfor.identify(ring, start=0)
    assert Path(asked[0].filename) == Path(__file__)
    for name in ("time [ms]", "time [s]"):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            gfor.identify(ring.rename_axis(name), start=0)
