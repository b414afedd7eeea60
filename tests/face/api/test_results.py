"""The Python face gives what the command line prints, as tables, datasets, pictures and HTML."""

import copy
import json
import pickle
from html import escape

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes

import orchestrator as face
from orchestrator.core.errors import AnalysisError, CaseError, InputError, ResultsError
from orchestrator.face.api.progress import shown_progress
from orchestrator.face.api.scenario import RunEndedWarning, UnusualDataWarning
from orchestrator.linear.spectra.modes import Mode
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.run_state import NOT_KEPT

mpl.use("Agg")


def test_a_mode_and_a_wrong_case_say_what_they_are_in_a_cell():
    assert repr(Mode(-0.5 + 6.28j, (("sg1.omega", 0.6), ("sg2.omega", 0.4)), {})) == (
        "<Mode 0.999 Hz, 7.94 %: sg1.omega 0.60, sg2.omega 0.40>"
    )
    with pytest.raises(InputError, match=r"a case is opened by load\('two_area'\)"):
        face.Case("two_area")


@pytest.fixture(scope="module")
def two_area():
    return face.load("two_area")


@pytest.fixture(scope="module")
def modes(two_area):
    return two_area.scenario("gfor", {"grid.X_L": 0.3}).modes()


@pytest.fixture(scope="module")
def run():
    return face.load("infinite_bus").scenario("dip").run(stop=1.2, linear=True)


@pytest.fixture(autouse=True)
def _no_figures_left():
    yield
    import matplotlib.pyplot as plt  # noqa: PLC0415 - after the backend is chosen

    plt.close("all")


# -- the same figures as on the command line -------------------------------------------------------


def test_modes_are_those_of_the_command(gfor, modes):
    code, out, _ = gfor(
        "modes", "two_area", "--scenario", "gfor", "--set", "grid.X_L=0.3", "--json"
    )
    assert code == 0
    assert json.loads(out) == json.loads(json.dumps(modes.as_json()))
    printed = json.loads(out)["scenarios"][0]["modes"]
    table = modes.table()
    assert len(table) == len(printed) == len(modes) > 0
    for figure in ("real", "imag", "frequency_hz", "damping_percent"):
        assert table[figure].tolist() == [mode[figure] for mode in printed]


def test_a_run_is_that_of_the_command(gfor, tmp_path, run):
    options = ("--scenario", "dip", "--stop", 1.2, "--linear", "--json", "--out", tmp_path)
    code, out, _ = gfor("run", "infinite_bus", *options)
    assert code == 0
    (printed,), summary = json.loads(out), json.loads(json.dumps(run.summary()))
    for one in (printed, summary):
        assert one.pop("steps_per_second")
        assert one.pop("share_in_fmus")
        assert one.pop("real_time_factor")
        assert one.pop("threads") == 1
    assert printed == summary
    same = face.compare(run, tmp_path / "dip", ["grid.v", "gfor.p"]).table()
    assert same["largest_difference"].tolist() == [0, 0]


def test_a_linear_model_is_that_of_the_command(gfor, tmp_path, two_area):
    names = ("--input", "gfor.droop.delta_P_ref", "--output", "sg1.omega")
    code, _, _ = gfor(
        "export", "linear", "two_area", "--scenario", "gfor", *names, "--out", tmp_path
    )
    assert code == 0
    model = two_area.scenario("gfor").linearize(["gfor.droop.delta_P_ref"], ["sg1.omega"])
    for name in "ABCD":
        lines = (tmp_path / "gfor" / f"{name}.csv").read_text(encoding="utf-8").splitlines()
        written = np.array([[float(cell) for cell in line.split(",")[1:]] for line in lines[1:]])
        assert np.array_equal(written, model.table(name).to_numpy())
        assert lines[0].split(",")[1:] == model.table(name).columns.tolist()
    assert model.stability.stable
    assert set(model.operating_point.states) >= {"sg1.machine.omega"}


def test_a_sweep_is_that_of_the_command(gfor, tmp_path, two_area):
    options = (
        "--scenario",
        "gfor",
        "--vary",
        "grid.X_L=0.1,0.2",
        "--workers",
        1,
        "--json",
        "--out",
        tmp_path,
    )
    code, out, _ = gfor("sweep", "two_area", *options)
    assert code == 0
    sweep = two_area.sweep({"grid.X_L": np.array([0.1, 0.2])}, ["gfor"], folder=tmp_path)
    assert sweep.result.computed == 0  # all points are there
    printed, own = json.loads(out), json.loads(json.dumps(sweep.as_json()))
    assert printed.pop("points") != own.pop("points")
    assert printed == own
    assert sweep.dataset.sizes["grid.X_L"] == 2
    as_text = two_area.sweep(["grid.X_L=0.1:0.2:2"], ["gfor"], folder=tmp_path)
    assert as_text.table().equals(sweep.table())
    written = sweep.save(tmp_path / "saved")
    there = {path.name for path in tmp_path.iterdir() if path.is_file()}
    assert {path.name for path in written} == there - {"manifest.json"}
    with pytest.raises(InputError, match="results cannot be written there"):
        sweep.save(written[1])
    assert written[1].read_bytes() == (tmp_path / "sweep.csv").read_bytes()
    assert sweep.failures().empty
    assert isinstance(sweep.plot(), Axes)
    assert "stable at all points" in sweep._repr_html_().partition("</b>")[0]
    assert f"<b>{repr(sweep)[1:].partition(':')[0]}" in sweep._repr_html_()


def test_a_comparison_and_its_modes_are_those_of_the_commands(gfor, tmp_path, run):
    code, _, _ = gfor("run", "infinite_bus", "--scenario", "dip", "--stop", 1.2, "--out", tmp_path)
    assert code == 0
    folder = tmp_path / "dip"
    code, out, _ = gfor(
        "signal", "compare", folder, folder, "--signal", "gfor.omega", "--start", 0.2, "--json"
    )
    compared = face.compare(folder, folder, ["gfor.omega"], start=0.2)
    assert (code, json.loads(out)) == (0, json.loads(json.dumps(compared.as_json())))
    code, out, err = gfor("signal", "identify", folder, "gfor.omega", "--start", 0.2, "--json")
    modes = face.identify(run, "gfor.omega", start=0.2)
    assert (code, json.loads(out)) == (0, modes.as_json())
    assert err.splitlines() == modes.remarks
    assert len(modes) == len(modes.table()) > 0
    assert all(mode in modes.as_json() for mode in compared.as_json()[0]["modes"])
    assert (modes.start, modes.stop) == (0.2, pytest.approx(1.2))
    assert "show nothing above" in modes._repr_html_()


@pytest.mark.slow
def test_a_design_is_that_of_the_command(gfor, tmp_path, two_area):
    file = tmp_path / "pod_p.toml"
    code, out, _ = gfor(
        "design", "two_area", "--controller", "pod_p", "--no-margins", "--json", "--out", file
    )
    assert code == 0
    design = two_area.design("pod_p", margins=False)
    printed = json.loads(out)
    assert printed.pop("parameter_file") == str(file)
    made = printed.pop("made")
    assert made["command"].startswith("gfor design two_area --controller pod_p")
    assert made["code"]
    assert printed == json.loads(json.dumps(design.as_json()))
    saved = design.save(tmp_path / "saved.toml")
    beside = json.loads(saved.with_suffix(".json").read_text(encoding="utf-8"))
    with pytest.raises(ResultsError, match="cannot be written"):
        design.save(file / "below_a_file.toml")
    assert beside.pop("made")["date"]
    assert beside == json.loads(json.dumps(design.as_json(saved)))
    by_file = two_area.scenario("gfor", parameters=[saved])
    assert by_file.values == two_area.scenario("gfor", design.parameters).values
    assert "requirement met" in design._repr_html_()
    assert (
        "the sensitivity asks for K = 18.45 pu, and the bounds allow no less than 200 pu "
        "(both on the base S_n of the converter): gain_bounds 0" in design.verdict
    )
    assert design.verdict in design._repr_html_().partition("</b>")[0]
    assert design.table().loc["with it", "damping_percent"] > 20


@pytest.mark.parametrize(
    "again", [lambda result: pickle.loads(pickle.dumps(result)), copy.deepcopy]
)
def test_results_can_be_pickled_and_copied(modes, run, again):
    same = again(modes)
    assert same.table().equals(modes.table())
    assert same.stability == modes.stability
    old, new = modes.result.model, again(same).result.model
    assert np.array_equal(new.A, old.A)
    assert np.array_equal(new.apply(np.ones(len(new.names))), old.apply(np.ones(len(old.names))))
    back = again(run)
    assert back.dataset.equals(run.dataset)
    assert back.modes.table().equals(run.modes.table())
    assert back.linear.equals(run.linear)


def test_another_stop_keeps_step_parameter_files_and_values(tmp_path):
    file = tmp_path / "values.toml"
    file.write_text('[set]\n"gfor.P_0" = 0.45\n', encoding="utf-8")
    scenario = face.load("infinite_bus").scenario(
        "dip", {"gfor.v_0": 1.01}, step="50 us", parameters=file
    )
    ready = scenario.run(stop=0.02).result.modes.prepared
    assert (ready.stop_time, ready.step_size) == (0.02, 5e-5)
    assert (ready.values["gfor.P_0"], ready.values["gfor.v_0"]) == (0.45, 1.01)


def test_a_design_is_made_with_the_step_files_and_values_that_are_given(
    two_area, tmp_path, monkeypatch
):
    file = tmp_path / "values.toml"
    file.write_text('[set]\n"grid.X_L" = 0.15\n', encoding="utf-8")

    class PreparedError(Exception):
        pass

    def prepared(case, request, *_):
        raise PreparedError(
            request.step_size, [one.values for one in request.files], dict(request.overrides)
        )

    monkeypatch.setattr("orchestrator.studies.coordinated_design.one_point.design_pod", prepared)
    with pytest.raises(PreparedError) as seen:
        two_area.design("pod_p", values={"gfor.P_0": 0.4}, step="50 us", parameters=file)
    assert seen.value.args == (5e-5, [{"grid.X_L": 0.15}], {"gfor.P_0": 0.4})


# -- values and mistakes ---------------------------------------------------------------------------


def test_values_may_be_numpys_and_have_units():
    case = face.load("infinite_bus")
    values = {"gfor.S_n": "1.5 GVA", "gfor.pod_p.K": np.float32(2), "gfor.pod_p.enabled": np.True_}
    found = case.scenario("dip", values, step="100 us").values
    assert found["gfor.S_n"] == 1500
    assert found["gfor.pod_p.K"] == 2
    assert found["gfor.pod_p.enabled"] is True


@pytest.mark.parametrize(
    ("mistake", "says"),
    [
        (lambda: face.load("two_aera"), "built-in: brazil7, four_vsc, "),
        (
            lambda: face.load("infinite_bus").scenario(),
            "2 scenarios; choose one of: dip, load_step",
        ),
        (
            lambda: face.load("infinite_bus").scenario("dip", step=-1),
            "step = -1; it must be a time above 0",
        ),
        (lambda: face.load("infinite_bus").scenario("dip", step="1 m"), "step: '1 m' is in m"),
        (lambda: face.load("infinite_bus").scenario("dip").modes((2, 1)), "the lower one first"),
        (
            lambda: face.load("infinite_bus").scenario("dip").modes(critical=0.2),
            "it is in percent between 1 and 90, such as 20: write 20",
        ),
        (lambda: face.load("infinite_bus").scenario("dip").modes((0, 2), 20), "begin above 0 Hz"),
        (lambda: face.load("infinite_bus").sweep({"grid.X": []}), "grid.X: a sweep needs values"),
        (
            lambda: face.load("infinite_bus").sweep({"grid.X": [0.1]}, workers=0),
            "workers = 0; it must be",
        ),
        (lambda: face.certify("vendor.fmu", pod="z"), "pod = 'z'; give one of none, p, q, pq"),
        (lambda: face.load("two_area_rms").site(below=0.1), "below = 0.1; it is in percent"),
        (
            lambda: face.load("infinite_bus").sweep(
                {"grid.X": [0.1]}, workers=2, scheduler="tcp://host:1"
            ),
            "workers and scheduler exclude each other",
        ),
        (
            lambda: face.check("a.fmu", component="gfor"),
            "component = 'gfor' names a component of a case; give case",
        ),
        (
            lambda: face.check("a.fmu", scenario="dip"),
            "scenario = 'dip' names a scenario of a case; give case",
        ),
        (lambda: face.check("a.fmu", time_limit=0), "time_limit = 0; it must be a time above 0"),
        (lambda: face.check("a.fmu", memory_limit=-1), "memory_limit = -1; it must be above 0 MB"),
        (lambda: face.identify("a", "grid.v"), "there is no trajectory.nc"),
        (lambda: face.info("a.fmu"), "a.fmu"),
        (lambda: face.load("infinite_bus").sweep("grid.X"), "not of the form component.parameter"),
        (lambda: face.load("two_area").design("pod_x"), "there are: pod_p, pod_q"),
        (lambda: face.load("two_area").design("pod_p", dampning=0.2), "dampning"),
        (
            lambda: face.load("two_area").design("pod_p", damping=20, damping_increment=10),
            "give one of them",
        ),
        (
            lambda: face.load("two_area").design("pod_p", damping=0.2),
            "write 20 for a damping ratio of 0.2",
        ),
        (lambda: face.build("gforr"), "there is no model 'gforr'; there are: "),
        (lambda: face.build("gfor", fmi="3.0"), "native"),
        (lambda: face.compare("a", "b"), "there is no trajectory.nc"),
    ],
)
def test_a_mistake_is_said_in_words(mistake, says):
    with pytest.raises(InputError) as caught:
        mistake()
    assert says in str(caught.value)


def test_the_mistakes_of_a_case_come_together():
    with pytest.raises(CaseError) as caught:
        face.load("infinite_bus").scenario("dip", {"gfor.nothing": 1, "grid.X": "3 MW"})
    assert len(caught.value.problems) == 2
    assert isinstance(caught.value, face.CosimError)


def test_data_that_are_most_unusual_are_questioned_where_the_caller_stands():
    case = face.load("infinite_bus")
    for prepare in (
        lambda: case.scenario("dip", {"gfor.pod_p.K": 5e4}),
        lambda: case.choose([], {"gfor.pod_p.K": 5e4}),
        lambda: case.sweep({"gfor.P_0": [0.5]}, ["dip"], {"gfor.pod_p.K": 5e4}),
    ):
        with pytest.warns(UnusualDataWarning, match=r"gfor.pod_p.K") as caught:
            prepare()
        assert sum("pod_p.K = 50000 pu is outside" in str(one.message) for one in caught) == 1
        assert len(caught) <= 2  # the POD is off besides
        assert {one.filename for one in caught} == {__file__}


def test_a_run_that_ends_early_warns_and_keeps_what_it_has(monkeypatch):
    whole = Master.run

    def broken(self, stop_time, events=(), observers=(), keeper=NOT_KEPT):
        whole(self, 0.5, events, observers, keeper)
        raise AnalysisError("made to fail")

    scenario = face.load("infinite_bus").scenario("load_step")
    monkeypatch.setattr(Master, "run", broken)
    with pytest.warns(RunEndedWarning, match="scenario 'load_step': made to fail"):
        run = scenario.run(stop=1.0)
    assert run.dataset["time"].values[-1] == 0.5
    assert "made to fail" in repr(run)
    assert "ended early: made to fail" in run._repr_html_()


# -- pictures and notebooks ------------------------------------------------------------------------


def test_plots_take_and_return_axes(modes, run, two_area):
    axes = modes.plot()
    assert isinstance(axes, Axes)
    assert two_area.scenario("pod_p").modes().plot(axes) is axes
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert len(labels) == len(set(labels)) == 2
    named = [points for points in axes.collections if not points.get_label().startswith("_")]
    colours = {tuple(points.get_edgecolor()[0]) for points in named}
    assert len(colours) == 2
    first = run.plot()
    assert isinstance(first, Axes)
    axes = run.plot("grid.v")
    assert axes.get_ylabel() == "grid.v [pu]"
    assert len(axes.lines) == 2  # the linear model's response beside the simulated one
    assert np.array_equal(axes.lines[0].get_ydata(), run.dataset["grid.v"])
    assert run.plot("grid.v", ax=axes) is axes
    with pytest.raises(InputError, match=r"'grid\.w' was not recorded"):
        run.plot("grid.w")


def test_results_show_themselves(modes, run, two_area):
    scenario = two_area.scenario("gfor")
    for shown in (two_area, scenario, modes, run):
        html = shown._repr_html_()
        assert html.startswith("<p")
        assert "two_area" in html or "infinite_bus" in html
        assert repr(shown).startswith("<")
    html = modes._repr_html_()
    assert "stable: the largest real part" in html
    least = min(modes, key=lambda mode: mode.damping_percent)
    figures = f"{least.frequency_hz:.3f} Hz, {least.damping_percent:.2f} %"
    assert f"<b>stable, least damped {figures}</b>" in html[: html.index("Modes of")]
    assert "electromechanical" in modes._repr_html_()
    linear = scenario.linearize()
    assert f"<th>{linear.outputs[0]}</th>" in linear._repr_html_()  # D by name, not all of A
    for shown, verdict in ((linear, linear.stability.sentence()), (run, run.verdict)):
        top, _, below = shown._repr_html_().partition("</b>")
        assert top.endswith(f"<b>{escape(verdict)}")
        assert f"<b>{repr(shown)[1:4]}" in below  # the title comes behind it


def test_what_is_shown_cannot_be_read_as_html(two_area):
    from orchestrator.output.report.notebook import page  # noqa: PLC0415 - inner part

    assert "<script>" not in page("<script>", ["<script>"])


def test_participation_is_that_of_the_modes(modes):
    factors = modes.participation()
    for number, mode in enumerate(modes, start=1):
        assert factors[number].to_dict() == dict(mode.participation)
    shape = modes.dataset["shape"].sel(mode=1)
    assert {str(k): v for k, v in zip(shape.state.values, shape.values, strict=True) if v} == modes[
        0
    ].shape
    assert modes.dataset["damping"].values.tolist() == modes.table()["damping_percent"].tolist()


def test_progress_is_reported():
    with shown_progress("points", shown=False) as report:
        report(1, 2)
    with shown_progress("points", shown=True) as report:
        report(1, 2)
    scenario = face.load("infinite_bus").scenario("dip")
    with_bar, without = scenario.run(stop=0.2, progress=True), scenario.run(stop=0.2)
    assert with_bar.dataset.equals(without.dataset)


# -- one FMU ---------------------------------------------------------------------------------------


def test_an_fmu_is_set_stepped_and_read(fmu_path):
    with face.open_fmu(fmu_path("infinite_bus"), {"f_n": "60 Hz"}, stop=1.0) as fmu:
        assert fmu.get("f_n") == 60
        assert set(fmu.values()) == {"v_re", "v_im", "v", "p", "q"}
        fmu.set({"load.scale": "1.5", "i_re": np.float64(1)})
        fmu.step(1e-3)
        assert fmu.time == 1e-3
        assert fmu.table().loc["v", "unit"] == "pu"
        for mistake in (
            lambda: fmu.get("w"),
            lambda: fmu.set({"w": 1}),
            lambda: fmu.set({"f_n": "3 MW"}),
        ):
            with pytest.raises(InputError, match="infinite_bus"):
                mistake()
        with pytest.raises(InputError, match="a time above 0"):
            fmu.step(0)
        assert "infinite_bus" in fmu._repr_html_()


def test_an_fmu_that_was_closed_says_so(fmu_path):
    fmu = face.open_fmu(fmu_path("infinite_bus"))
    fmu.close()
    fmu.close()
    for call in (
        lambda: fmu.step(1e-4),
        lambda: fmu.get("v"),
        fmu.values,
        lambda: fmu.set({"dip.depth": 0.2}),
    ):
        with pytest.raises(InputError, match="infinite_bus: this FMU was closed; open it again"):
            call()
    with pytest.raises(InputError, match="closed"), fmu:
        pass


def test_an_fmu_is_checked_as_a_case_uses_it(fmu_path, gfor, tmp_path):
    fmu, options = (
        fmu_path("infinite_bus"),
        {"case": "infinite_bus", "component": "grid", "scenario": "load_step"},
    )
    report = face.check(
        fmu, only=["runs"], time_limit="20 s", memory_limit=2000, step="200 us", **options
    )
    assert report.trusted
    assert not report.faults
    assert report.as_json()["trusted"]
    assert "no check failed" in report._repr_html_()
    assert "component 'grid' in scenario 'load_step'" in report.as_json()["used_as"]
    assert "steps of 0.0002 s" in report.table().loc["runs", "evidence"]
    words = [word for name, value in options.items() for word in (f"--{name}", value)]
    code, out, _ = gfor("fmu", "check", fmu, *words, "--only", "runs", "--step", 2e-4, "--json")
    assert code == 0
    assert json.loads(out)["used_as"] == report.as_json()["used_as"]
    assert (
        report.save_junit(tmp_path / "junit.xml").read_text(encoding="utf-8").count("<testcase")
        == 2
    )


def test_an_fmu_shows_what_it_declares(fmu_path, gfor):
    found = face.info(fmu_path("infinite_bus"))
    code, out, _ = gfor("fmu", "info", fmu_path("infinite_bus"))
    assert code == 0
    assert all(name in out for name in found.table().index if not name.startswith("der("))
    assert found.linear_model is None
    assert found.description.model_name in found._repr_html_()


def test_an_fmu_is_opened_with_the_values_it_is_given(tmp_path):
    fmu = face.build("infinite_bus", tmp_path)
    for values in ({}, {"v_0": 1.05}, None):
        with face.open_fmu(fmu, values) as opened:
            assert opened.get("v") == pytest.approx(1.05 if values else 1.0)
