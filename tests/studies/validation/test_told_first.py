"""What is told first of an error: the cause by its plainest name, the recording, the model, and the rating in use."""

import re
from dataclasses import replace
from html import unescape
from io import StringIO

import numpy as np
import pytest
from rich.console import Console

from orchestrator.core.errors import ComponentError
from orchestrator.studies.validation.asked_first import AskedFirst
from orchestrator.studies.validation.causes import CauseKind, Explanation, without_worse_ways
from orchestrator.studies.validation.limits import (
    Criterion,
    LimitVerdict,
    OpenCause,
    read_limits,
)
from orchestrator.studies.validation.over_limit import OverLimit
from orchestrator.studies.validation.page import _causes_said, _not_judged
from orchestrator.studies.validation.questions import Question, QuestionKind
from orchestrator.studies.validation.tables import explanation_table
from orchestrator.studies.validation.view import parts
from orchestrator.studies.validation.words import (
    explanation_cells,
    explanation_sentence,
    open_sentence,
    rating_words,
    sentence,
)
from tests.studies.validation.made_device import (
    RATING,
    TIMES,
    answer,
    behind,
    course,
    model,
    recorded,
    validated,
)

RIGHT = answer(course() - 1)
LIMITED = RIGHT * np.minimum(1, 0.52 / np.abs(RIGHT))
TOLD = {"S_n": RATING}
OVER = {"over": OverLimit(begin=1.0, length=0.3, largest=1.5)}


def screen(found):
    """What the first screen shows, without its line breaks."""
    console = Console(file=StringIO(), width=400)
    for one in parts(found):
        console.print(one)
    return console.file.getvalue()


def late(signals, seconds=0.03, power=RIGHT):
    """A power of which P, Q or both come later."""

    def shifted(values, name):
        return np.interp(TIMES - seconds, TIMES, values) if name in signals else values

    return shifted(power.real, "p") + 1j * shifted(power.imag, "q")


@pytest.mark.parametrize(
    ("signals", "noise_q", "wrong", "name"),
    [
        ("p", 1e-4, {}, "P"),
        ("p", 4e-4, {}, "P"),
        ("q", 1e-4, {}, "Q"),
        ("pq", 1e-4, {}, "P and Q"),
        ("p", 1e-4, {"K": 1.5}, None),
    ],
)
def test_a_delay_that_leaves_noise_alone_is_the_cause_and_one_beside_more_is_not(
    signals, noise_q, wrong, name
):
    found = validated(
        model(**TOLD, **wrong), recorded(late(signals), noise_q=noise_q), explain=True
    )
    best = found.result.explanations[0]
    assert (best.cause is CauseKind.CLOCK) == (name is not None)
    if name:
        assert (best.name, best.value) == (f"delay of {name}", pytest.approx(0.03, abs=1e-3))
        said = explanation_sentence(found.result.explanations)
        assert said.startswith(f"The likeliest cause is {name} coming 30 ms later")


@pytest.mark.parametrize(
    ("plant", "reading"),
    [
        (-RIGHT.real + 1j * RIGHT.imag, "P counts into the plant"),
        (RIGHT.conj(), "Q counts into the plant"),
        (answer(course() - 1, K=3.0), None),
    ],
)
def test_a_wrong_sign_is_told_before_causes_which_are_likely_only_without_it(plant, reading):
    found = validated(model(**TOLD), recorded(plant), explain=True)
    said = f"The likeliest explanation is a yes to what is asked of rec1: {reading}? Read so, "
    for shown in (screen(found), _causes_said(found.result)):
        before, asked, after = shown.partition(said)
        assert bool(asked) == (reading is not None)
        assert ("The likeliest cause is K = 3" in before) == (reading is None)
        assert ("If the answer is no, no cause by itself" in after) == (reading is not None)
    told = found.as_json()
    assert all(one["behind_question"] == bool(reading) for one in told["explanations"])
    asked = told["asked_first"]
    if reading is None:
        assert asked is None
        return
    assert asked["questions"][0]["figures"]["reading"] == reading
    assert asked["rms_left_pu"] < 0.01 * asked["rms_now_pu"]


@pytest.mark.parametrize(("left", "first"), [(1.2, False), (1.4, True)])
def test_a_question_goes_before_a_cause_that_leaves_clearly_more(left, first):
    cause = Explanation(CauseKind.VALUE, "pod_p.K", "pu", 200.0, 90.0, 0.1, left * 0.01, noise=1e-4)
    asked = Question(QuestionKind.READ_OTHERWISE)
    assert AskedFirst([("rec1", asked)], 1.0, 0.1, 1e-4).goes_before([cause]) == first
    beside = replace(cause, behind_question=first)
    assert ("yes" in explanation_cells(beside)) != first
    assert beside.as_json()["explains"] != first


@pytest.mark.parametrize(("more", "explains"), [({}, True), (OVER, False)])
def test_no_value_is_named_that_stands_in_for_a_limit_which_the_model_lacks(more, explains):
    found = validated(model(more=more, **TOLD), recorded(LIMITED), explain=True)
    causes = found.result.explanations
    assert causes[0].share > 0.9
    assert causes[0].explains == explains
    said = explanation_sentence(causes)
    assert said.startswith("The likeliest cause" if explains else "No cause is named")
    assert ("the model lacks a limit" in str(explanation_table(causes).rows)) != explains


@pytest.mark.parametrize(("more", "asked"), [({}, True), (OVER, False)])
def test_no_lag_is_asked_about_beside_a_limit_that_the_model_lacks(more, asked):
    lagged = behind(RIGHT.real, 0.1) + 1j * RIGHT.imag
    (comparison,) = validated(model(more=more, **TOLD), recorded(lagged)).result.comparisons
    assert (QuestionKind.LAGGED in {one.kind for one in comparison.questions}) == asked


@pytest.mark.parametrize(
    ("of_file", "told", "plant", "asks"),
    [
        (1500.0, {}, 450.0, True),
        (1500.0, {"S_n": 1500.0}, 450.0, False),
        (450.0, TOLD, 450.0, False),
        (1500.0, {}, 1200.0, False),
    ],
)
def test_a_rating_that_only_the_file_gives_is_said_and_asked_about(of_file, told, plant, asks):
    """A rating that is off by a fourth may be a wrong reactance as well."""
    device = model(rating=of_file, **told)
    found = validated(device, recorded(rating=plant))
    typed = [one.partition("give --set S_n=")[2] for one in found.questions]
    assert [*filter(None, typed)] == ["450"] * asks
    own = "" if told else ", the start value of its file's S_n"
    assert rating_words(device) == f"{of_file:g} MVA{own}"
    assert f"[pu of {of_file:g} MVA{own}]" in screen(found)


@pytest.mark.parametrize(("gain", "is_noise"), [(2.0, True), (4.0, False)])
def test_noise_is_told_before_any_value_is_tried(gain, is_noise):
    """Of this noise the right model's error is less than the scatter before the event."""
    told = []
    plant = recorded(answer(course() - 1, K=gain), noise=0.01, seed=2)
    found = validated(model(**TOLD), plant, report=told.append, explain=True)
    said = explanation_sentence(found.result.explanations)
    assert said.startswith("There is nothing to explain") == is_noise
    assert any("trying" in one for one in told) != is_noise


@pytest.mark.parametrize(
    ("recordings", "devices", "named"),
    [
        (("may", "june"), ("a", "a"), "damping, delay of may, damping of june ("),
        (("may", "may"), ("a", "b"), "damping, delay of may, a, damping of may, b ("),
        (("may", "may"), ("a", "a"), "damping, delay ("),
    ],
)
def test_open_limits_name_their_recording_and_model_where_there_are_several(
    recordings, devices, named
):
    one = Criterion("", "damping", "%", 1.0, 3.0, 0.0, LimitVerdict.OPEN, "", OpenCause.NO_FIGURE)
    first, second = (
        replace(one, recording=recording, device=device)
        for recording, device in zip(recordings, devices, strict=True)
    )
    said = open_sentence([first, replace(first, name="delay"), second], [])
    assert f"stay open: {named}" in said


@pytest.mark.parametrize(
    ("refuses", "tried", "told"),
    [("enabled", "enabled = false", True), ("P_0", "P counts into the plant", False)],
)
def test_a_reading_that_the_device_refuses_is_in_json_alone_and_a_value_is_told(
    refuses, tried, told
):
    error = ComponentError("made", "fmi2DoStep", "fmi2Error", "too large", 0.1)
    device = model(more={"refuses": refuses, "error": error}, K=3.0, **TOLD)
    found = validated(device, recorded(), explain=True)
    assert tried in [one["tried"] for one in found.as_json()["refused"]]
    for shown in (screen(found), _not_judged(found.result)):
        assert (f"{tried} (" in shown) == told


@pytest.mark.parametrize("places", [["rec1"], ["rec1, made", "rec1, other"]])
def test_the_tables_of_the_first_screen_show_each_model_of_a_plant(places):
    other = replace(model(K=3.0, **TOLD), name="other") if len(places) > 1 else None
    shown = screen(validated(model(**TOLD), recorded(), beside=other)).partition("Events")[2]
    events = shown.partition("simulated less measured")[0].splitlines()
    head, rows = events[2], [line for line in events if line.startswith("│ rec1")]
    assert ("Model " in head.partition("Model rings")[0]) == (other is not None)
    for row, place in zip(rows, places, strict=True):
        assert all(word in row for word in place.split(", "))
    titles = [line for line in shown.splitlines() if "simulated less measured" in line]
    assert [line.partition(":")[0].strip() for line in titles] == places


@pytest.mark.parametrize(("left", "first"), [(1.08, "pod_p.enabled"), (1.12, "pod_p.K")])
def test_a_switch_goes_before_a_number_that_leaves_up_to_a_tenth_less(left, first):
    number = Explanation(CauseKind.VALUE, "pod_p.K", "pu", 200.0, 0.2, 0.03, 7e-4, noise=5e-5)
    switch = replace(
        number,
        cause=CauseKind.POSITION,
        name="pod_p.enabled",
        now=True,
        value=False,
        left=left * 7e-4,
    )
    assert without_worse_ways([number, switch])[0].name == first


@pytest.mark.parametrize("reactance", [0.4, 0.39])
def test_a_switch_that_is_off_in_the_plant_is_named_as_such_with_what_is_beside_it(reactance):
    """Beside it a gain of nearly nothing leaves a little less, as it takes some of the other part."""
    plant = answer(course() - 1, enabled=False, X=reactance)
    best, *_ = validated(model(**TOLD), recorded(plant), explain=True).result.explanations
    both = {best.name: best.value, **best.beside}
    expected = {"enabled": False} | (
        {} if reactance == 0.4 else {"X": pytest.approx(reactance, rel=1e-2)}
    )
    assert both == expected


@pytest.mark.parametrize(
    ("limit", "shade", "word"),
    [(1.0, "good", "MET"), (1e-3, "bad", "NOT MET"), (None, "soft", "made: the largest error")],
)
def test_the_page_begins_with_the_first_line_of_the_terminal(
    limit, shade, word, tmp_path, monkeypatch
):
    monkeypatch.setattr("orchestrator.studies.validation.page.sha256_of", str)  # there is no file
    file = tmp_path / "limits.toml"
    file.write_text(f'source = "a test"\n[windows.after.p]\nmean_abs_error = {limit}\n')
    limits = None if limit is None else read_limits(file)
    found = validated(model(K=2.2, **TOLD), recorded(), limits=limits)
    head = re.search(r'<p class="verdict"><b class="(\w+)">(.*?)</b>', found.html())
    said = unescape(head[2]).translate({0xA0: " ", 0x2212: "-"}).rstrip(".")
    assert head[1] == shade
    assert said.startswith(word)
    assert said in " ".join(screen(found).split())


@pytest.mark.parametrize("told", [{}, {"S_n": 3 * RATING}])
def test_a_rating_three_times_too_large_is_told_beside_a_power_of_one_phase(told):
    """Given, or that of the model's file: both are like a power of one phase."""
    found = validated(model(rating=3 * RATING, **told), recorded())
    (one,) = [
        each
        for each in found.result.comparisons[0].questions
        if each.kind is QuestionKind.READ_OTHERWISE
    ]
    said = sentence(one)
    assert said.startswith("P and Q are of one phase?")
    assert said.endswith("a rating of 450 MVA (S_n) in place of 1350 MVA would tell the same")


@pytest.mark.parametrize("names", [["made"], ["made", "other"]])
def test_the_page_has_a_table_of_errors_for_each_model_of_a_plant(names, monkeypatch):
    monkeypatch.setattr("orchestrator.studies.validation.page.sha256_of", str)  # there is no file
    other = replace(model(K=3.0, **TOLD), name="other") if len(names) > 1 else None
    page = validated(model(**TOLD), recorded(), beside=other).html()
    of = [f" of {name}" if other else "" for name in names]
    assert re.findall("<caption>(Errors.*?)</caption>", page) == [
        f"Errors{each} [pu of the rating]" for each in of
    ]
