"""A converter passes where all that the norm asks was done and met; what is less is called so."""

import json
from dataclasses import replace
from html import escape

import numpy as np
import pytest

from orchestrator.devices.acceptance.checks.base import failed, passed
from orchestrator.devices.acceptance.runner import AcceptanceReport
from orchestrator.linear.spectra.mode_tracking import ModeSet
from orchestrator.simulation.watch.finding import Finding
from orchestrator.studies.certification import study as study_module
from orchestrator.studies.certification.point import FREQUENCY, POWER, PointResult
from orchestrator.studies.certification.request import REACTANCES
from tests.studies.certification.fabricated import EVERY, TIMES, figures, rings
from tests.studies.certification.test_issued import forged


@pytest.fixture
def certified(tmp_path, fmu_path, gfor, monkeypatch):
    """Run `gfor certify` on points that some function makes; exit code, output and figures."""

    def run(*arguments, points=rings):
        monkeypatch.setattr(study_module, "compute_point", points)
        words = [] if "--check-them" in arguments else ["--no-check"]
        rest = [a for a in arguments if a != "--check-them"]
        code, text, error = gfor(
            "certify", fmu_path("gfor"), *words, "--workers", 1, "--out", tmp_path, *rest
        )
        assert code not in (2, 130), error
        return (
            code,
            text,
            figures(tmp_path),
            (tmp_path / "certificate.html").read_text(encoding="utf-8"),
        )

    return run


def said(values):
    return ",".join(f"{X:g}" for X in values)


def only(X_L, **changes):
    """Points that are good except at one reactance, where the one with the converter is changed."""

    def compute(task):
        found = rings(task)
        return replace(found, **changes) if task.X_L == X_L and task.scenario == "with" else found

    return compute


def test_all_thirteen_pass_and_a_failed_acceptance_test_is_loud(certified, monkeypatch):
    """It leaves the damping verdict, in other words and with another exit code."""
    code, text, content, page = certified()
    assert code == 0
    assert "passes the damping test at all 13 line reactances" in " ".join(text.split())
    assert (content["verdict"], content["passed"], content["judged"]) == (
        "passes",
        True,
        "13 of 13",
    )
    assert "Damping test of &#x27;gfor&#x27;: passed</h1>" in page

    def check(fmu, binding, *_):
        return AcceptanceReport(
            fmu, binding, [passed("archive", "fine"), failed("runs", "crash", "it died")]
        )

    monkeypatch.setattr("orchestrator.devices.acceptance.runner.check_fmu", check)
    code, _, content, page = certified("--check-them")
    assert code == 4
    assert content["verdict"] == "passes"
    assert "Acceptance tests failed: crash" in content["sentence"]
    assert "passed, acceptance tests failed</h1>" in page
    assert page.index("ACCEPTANCE TESTS FAILED: crash") < page.index("passes the damping test")
    assert json.dumps(content["acceptance"]).count("it died") == 1


@pytest.mark.parametrize(
    ("reactances", "judged"),
    [(REACTANCES[:2], "2 of 13"), ((*REACTANCES[:12], 0.59), "12 of 13"), ((0.7,), "0 of 13")],
)
def test_less_than_thirteen_are_incomplete(certified, reactances, judged):
    """Others do not replace one that is missing."""
    code, text, content, page = certified("--reactances", said(reactances))
    assert code == 3
    assert f"incomplete: {judged}" in " ".join(text.split())
    assert "passes" not in content["sentence"]
    assert (content["verdict"], content["passed"], content["judged"]) == (
        "incomplete",
        False,
        judged,
    )
    assert f"incomplete ({judged})</h1>" in page
    assert ("beyond the norm" in page.partition("<h2>How the code was read")[0]) == (
        reactances[-1] not in REACTANCES
    )


UNSTABLE = {"growth": 104.6}
OVER = {
    "kind": "misfit",
    "component": "converter",
    "message": "6.41 pu of its rating over a cycle",
    "time": 12.0,
    "declared": 1.2,
    "mean": 6.41,
}


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        (UNSTABLE, "unstable"),
        (
            {"stability": {"stable": False, "sentence": "UNSTABLE: a mode grows at 900 Hz"}},
            "grows at 900 Hz",
        ),
        ({"growth": float("nan")}, "not a number"),
        ({"power": 0.0}, "0 MW at the start and not 1350 MW"),
        ({"power": float("nan")}, "nan MW"),
        ({"modes": None}, "no mode"),
        (
            {
                "modes": ModeSet(
                    np.empty(0, complex), np.empty((0, 2)), np.empty((0, 2)), ("a", "b")
                ),
                "components": [],
            },
            "no mode",
        ),
        ({"signals": {}}, "no response"),
        ({"findings": [OVER]}, "6.41 pu of its rating"),
    ],
)
def test_a_point_whose_judged_modes_are_fine_fails_for_what_else_is_wrong(
    certified, changes, fault
):
    code, _, content, page = certified("--reactances", "0.1,0.3", points=only(0.3, **changes))
    assert code == 1
    assert content["verdict"] == "fails"
    assert fault in content["sentence"]
    assert "incomplete as well: 2 of 13" in content["sentence"]
    assert "failed (2 of 13)</h1>" in page


def test_a_response_that_the_watch_did_not_judge_is_not_passed(certified):
    said = "growth and lasting oscillations are not judged between t = 1 s and t = 20 s: noise can explain the motion"
    finding = {"kind": "not_judged", "message": said, "time": 1.0}
    code, _, content, page = certified(
        "--reactances", "0.1,0.3", points=only(0.3, findings=[finding])
    )
    assert code == 3
    assert (content["verdict"], content["passed"], content["judged"]) == (
        "incomplete",
        False,
        "1 of 13",
    )
    judged = {point["X_L"]: point["judged"] for point in content["points"]}
    assert judged == {0.1: True, 0.3: False}
    assert said in page


def test_failing_beyond_the_norms_reactances_is_failing(certified):
    code, _, content, _ = certified("--reactances", "0.1,0.7", points=only(0.7, **UNSTABLE))
    assert code == 1
    assert "fails the damping test at X_L = 0.7 pu: " in content["sentence"]


@pytest.mark.parametrize(("word", "code"), [("fails", 1), ("passes", 5)])
def test_the_sentence_of_earlier_versions_holds(certified, gfor, tmp_path, word, code):
    """It listed all reactances; another word in it is seen."""
    *_, page = certified("--reactances", "0.1,0.3", points=only(0.3, **UNSTABLE))
    content = json.loads((tmp_path / "certificate.json").read_text(encoding="utf-8"))
    now = content["sentence"]
    before = now.replace("X_L = 0.3 pu: ", "X_L = 0.3 pu. At 0.3 pu: ").replace("fails", word)
    shown = page.replace("\N{NO-BREAK SPACE}", " ").replace(escape(now), escape(before))
    (tmp_path / "certificate.html").write_text(shown, encoding="utf-8")
    forged(tmp_path, content | {"sentence": before})
    found, text, _ = gfor("verify", tmp_path, "--json", "--files-only")
    assert before != now
    assert found == code, json.loads(text)["faults"]


@pytest.mark.parametrize(("rates", "worst"), [((0.0, 104.6, 12.0), 0.3), ((0.0, 12.0, 104.6), 0.5)])
def test_the_headline_has_the_worst_reactance_and_how_many_there_are(certified, rates, worst):
    """The sentence once listed all of them, and the faults of the first."""
    growing = dict(zip((0.1, 0.3, 0.5), rates, strict=True))

    def compute(task):
        found = rings(task)
        return replace(found, growth=growing[task.X_L]) if task.scenario == "with" else found

    code, text, content, page = certified("--reactances", "0.1,0.3,0.5", points=compute)
    assert code == 1
    said = f"fails the damping test at 2 of 3 line reactances, worst at X_L = {worst} pu: "
    assert said in " ".join(text.split())
    assert said in content["sentence"]
    assert said in page.replace("\N{NO-BREAK SPACE}", " ")


@pytest.mark.parametrize("place", [0, 125, 499])
@pytest.mark.parametrize("name", [POWER, "converter.q"])
def test_one_value_that_is_no_number_fails(certified, name, place):
    def compute(task):
        found = rings(task)
        values = found.signals[POWER].copy()
        values[place] = np.nan
        found.signals[name], found.units[name] = values, "pu"
        return found if task.scenario == "with" else rings(task)

    code, _, content, _ = certified("--reactances", "0.1", points=compute)
    assert code == 1
    assert f"{name} is not finite from t = {place * EVERY:g} s on" in content["sentence"]


@pytest.mark.parametrize(
    ("arguments", "moves", "fault"),
    [
        (("--pod", "p"), False, "POD-P is said to be active, and converter.delta_p_pod stays at 0"),
        (("--pod", "none"), True, "POD-P is said to be off, and converter.delta_p_pod moves"),
        (("--pod", "p"), True, None),
        (("--pod", "none"), False, None),
    ],
)
def test_a_damping_controller_is_what_it_is_said_to_be(certified, arguments, moves, fault):
    def compute(task):
        found = rings(task)
        if task.scenario == "with":
            found.signals["converter.delta_p_pod"] = found.times * moves
            found.units["converter.delta_p_pod"] = "pu"
        return found

    code, _, content, _ = certified("--reactances", "0.1", *arguments, points=compute)
    assert code == (3 if fault is None else 1)
    assert fault is None or fault in content["sentence"]


def moved(signal):
    """The output of POD-P with the converter."""

    def compute(task):
        found = rings(task)
        if task.scenario == "with":
            found.signals["converter.delta_p_pod"] = signal(found.times)
            found.units["converter.delta_p_pod"] = "pu"
        return found

    return compute


@pytest.mark.parametrize(("size", "fault"), [(3.7e-11, True), (0.9e-6, True), (1.1e-6, False)])
def test_a_damping_controller_that_hardly_moves_does_nothing(certified, size, fault):
    points = moved(lambda t: size * np.sin(t) ** 2)
    code, _, content, _ = certified("--reactances", "0.1", "--pod", "p", points=points)
    assert code == (1 if fault else 3)
    assert fault == ("less than 1e-06 pu: it does nothing" in content["sentence"])
    assert fault or certified("--reactances", "0.1", "--pod", "none", points=points)[0] == 1


AFTER = np.maximum(TIMES - 1, 0)
EARLY = 0.1 * np.exp(-0.5 * AFTER) * np.sin(2 * np.pi * 0.6 * AFTER)
SLIPS = 50 + EARLY + 13 * np.sin(2 * np.pi * 0.5 * AFTER) * (AFTER > 9)
LIMIT_CYCLE = 1 + EARLY + 0.125 * np.sin(2 * np.pi * 0.4 * AFTER) * (AFTER > 11)


@pytest.mark.parametrize(
    ("name", "signal", "fault"),
    [
        (FREQUENCY, SLIPS, "Hz, first more than 2.5 Hz from its start at t = 10.0"),
        (FREQUENCY, 50 + EARLY * 25, None),
        (FREQUENCY, 50 + EARLY * 50, "Hz from its start"),
        (POWER, LIMIT_CYCLE, "sg1.p still swings by 0.2"),
        (POWER, 1 + EARLY + 0.2 * np.maximum(TIMES - 12, 0), None),
    ],
)
def test_a_response_that_slips_or_swings_for_ever_fails_whatever_its_first_swings_are(
    certified, name, signal, fault
):
    """A straight drift is no swing."""

    def compute(task):
        found = rings(task)
        if task.scenario == "with":
            found.signals[name] = signal
        return found

    # the norm's own criteria watch the other signal
    watched_too = ("--pod", "p") if name == POWER else ()
    code, _, content, page = certified("--reactances", "0.1", *watched_too, points=compute)
    assert code == (3 if fault is None else 1), content["sentence"]
    assert fault is None or fault in content["sentence"]
    assert "in the last third of the" in page


@pytest.mark.parametrize(
    ("kind", "fails"),
    [
        ("loss_of_synchronism", True),
        ("sustained_oscillation", True),
        ("growing_oscillation", True),
        ("run_away", True),
        ("active_limit", False),
        ("undisturbed_motion", False),
    ],
)
def test_what_the_watch_saw_of_an_unstable_run_fails_the_point(certified, kind, fails):
    finding = Finding(kind, 3.0, "converter", "omega", "the converter does it").as_json()
    code, _, content, _ = certified("--reactances", "0.1,0.3", points=only(0.3, findings=[finding]))
    assert code == (1 if fails else 3)
    assert ("X_L = 0.3 pu: the converter does it." in content["sentence"]) == fails
    assert content["points"][1]["findings"] == {"without": [], "with": [finding]}


def test_findings_are_stored_and_a_point_that_was_not_watched_is_computed_anew():
    finding = Finding(
        "sustained_oscillation", 3.0, "converter", "omega", "it swings", None, {"f": 1.0}
    ).as_json()
    header, arrays = PointResult(0.1, "with", findings=[finding]).stored()
    assert PointResult.restored(dict(header), dict(arrays)).findings == [finding]
    del header["findings"]
    assert PointResult.restored(header, arrays) is None


def test_the_terminal_shows_which_mode_it_was_without_the_converter(certified):
    _, text, _, _ = certified("--reactances", "0.1")
    assert "0.637 Hz, 12.40 %" in text


def test_the_help_names_the_exit_codes(gfor):
    _, text, _ = gfor("certify", "--help")
    text = " ".join(text.split())
    for code in (
        "0 the converter passes",
        "1 it fails",
        "3 the test is incomplete",
        "4 it passes, and",
        "130 interr",
    ):
        assert code in text


def test_where_the_base_system_fails_nothing_is_judged(certified):
    def compute(task):
        lost = task.X_L == 0.3 and task.scenario == "without"
        return PointResult(task.X_L, task.scenario, failure="no licence") if lost else rings(task)

    code, _, content, page = certified("--reactances", "0.1,0.3", points=compute)
    assert code == 3
    assert content["judged"] == "1 of 13"
    assert "at 0.3 pu, the study failed without the converter: no licence" in content["sentence"]
    assert "not judged" in page


@pytest.mark.parametrize(
    "setting", ["sg1.governor.enabled=true", "sg1.machine.H=4", "S_n=1490 MVA", "P_0=0.89"]
)
def test_a_study_that_was_changed_is_not_the_norms(certified, setting):
    code, _, content, _ = certified("--set", setting, "--reactances", "0.1")
    assert code == 3
    assert (
        f"the study is not the norm's, it was changed by {content['departures'][0]}"
        in content["sentence"]
    )
    assert setting.partition("=")[0] in content["departures"][0]
    assert not content["passed"]


@pytest.mark.parametrize("setting", ["connected=false", "S_n=1 MVA"])
def test_a_converter_that_feeds_in_nothing_is_no_study(tmp_path, fmu_path, gfor, setting):
    """Without its power the lines of the norm's system cannot carry what is asked of them."""
    arguments = ("--set", setting, "--reactances", "0.1", "--out", tmp_path)
    code, _, error = gfor("certify", fmu_path("gfor"), *arguments)
    assert code == 2
    assert "power flow: no solution found" in error


def test_the_reactance_is_not_to_be_set(tmp_path, fmu_path, gfor):
    code, _, error = gfor("certify", fmu_path("gfor"), "--set", "grid.X_L=0.1", "--out", tmp_path)
    assert code == 2
    assert "choose its values with --reactances" in error


def test_a_setting_that_does_not_fit_is_told_by_its_option(tmp_path, fmu_path, gfor):
    code, _, error = gfor("certify", fmu_path("gfor"), "--set", "pod_p.K=-200", "--out", tmp_path)
    assert code == 2
    assert "--set pod_p.K=-200: pod_p.K = -200 pu; it must be at least 0 pu" in error
