"""One measure for the headline and the confirmation, machines' terminals, and the rating that was typed."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import block_diag

from orchestrator.cases.case import load_case
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.studies.pod_design.closed_loop import PodSetting
from orchestrator.studies.pod_design.lead_lag import NO_COMPENSATION
from orchestrator.studies.siting import study
from orchestrator.studies.siting.candidates import question_about, unit_terminals
from orchestrator.studies.siting.confirmation import Confirmation, SearchEnd, tuned_setting
from orchestrator.studies.siting.least_damping import LeastDamping
from orchestrator.studies.siting.study import SiteRequest, find_sites
from orchestrator.studies.siting.view import (
    Siting,
    answer,
    as_json,
    ranking_table,
    remarks,
    sureness,
)
from tests.studies.screening.five_machines import RATINGS, five_machines
from tests.support.scenarios import prepare_one


@pytest.fixture(scope="module")
def five(tmp_path_factory):
    return five_machines(tmp_path_factory.mktemp("five"))


STABLE = "the system is stable with it"


def eigenvalue(damping):
    """Of the mode at 9.2 rad/s with a damping [%]."""
    return 9.2 * complex(-damping / 100, (1 - (damping / 100) ** 2) ** 0.5)


OTHER = 11.0 * complex(-0.075, (1 - 0.075**2) ** 0.5)
"""The mode beside it [rad/s], of 7.5 %."""


def swinging(w, damping_ratio):
    """An eigenvalue of the size w [rad/s]."""
    return w * complex(-damping_ratio, (1 - damping_ratio**2) ** 0.5)


def least_damped(damping):
    return OTHER if damping > 7.5 else eigenvalue(damping)


def planted(monkeypatch, case, **found):
    """The result with confirmations that are given: by bus the damping with the device, and with its POD [%]."""

    def confirmed(prepared, bus, *_, **__):
        alone, tuned, stable = found[bus]
        if tuned is None:
            return Confirmation(bus, failure="no steady state")
        return Confirmation(
            bus,
            1j,
            1j,
            eigenvalue(alone),
            tuned=eigenvalue(tuned),
            least=least_damped(tuned),
            stable=stable,
        )

    monkeypatch.setattr(study, "confirmed", confirmed)
    return find_sites(case, SiteRequest("pod_p", confirm=len(found), buses=tuple(found)))


def test_the_headline_ranks_as_the_confirmation_does(five, monkeypatch):
    """Small support says 11, 12, 15; with the device 15 has most, then 12. A place that breaks the system, or has no
    figure, is never the best."""
    found = planted(
        monkeypatch,
        five,
        bus_11=(4.61, 8.13, True),
        bus_12=(4.0, 9.30, True),
        bus_15=(4.5, 9.64, True),
        bus_13=(5.0, 30.0, False),
        bus_14=(5.0, None, None),
    )
    assert found.ranking == ("bus_15", "bus_12", "bus_11", "bus_13", "bus_14")
    assert [text.partition(":")[0] for text in sureness(found)] == list(found.ranking)
    said = answer(found)
    seen = found.intact.modes[0].mode
    at, before = f"{seen.frequency_hz:.3f} Hz", f"{seen.damping_percent:.2f} %"
    assert said.startswith("bus_15 is the best place for POD-P of those asked for: ")
    first, further = Siting(found).answer_lines
    worse = f"another mode: 1.746 Hz, 7.50 %, LESS than the least before, {before}"
    assert first.endswith(
        f"for: {before} → 9.64 % for {at}, but least damped then is {worse}; {STABLE}"
    )
    assert further.startswith(f"The least damped mode without the device is {at}. With the device ")
    assert "least damped then" not in further
    assert "next best places it has 9.30 % (bus_12), 8.13 % (bus_11)" in said
    assert said.rpartition("the best are ")[2].startswith("bus_11 +")
    assert [bus["bus"] for bus in as_json(found)["buses"]] == list(found.ranking)
    assert as_json(found)["ranked_by"] == "damping with the device, by coupled FMUs"


@pytest.mark.parametrize(
    ("stable", "said"),
    [
        (True, "the system is stable with it"),
        (False, "the system is UNSTABLE with it"),
        (None, "whether the system is stable with it is not known"),
    ],
)
def test_the_headline_says_whether_the_system_is_stable_with_the_device(
    five, monkeypatch, stable, said
):
    """Of a system that grows without the device, too: what breaks a stable one is never the first."""
    found = planted(monkeypatch, five, bus_11=(4.61, 8.13, True), bus_12=(4.0, 9.30, True))
    first, second = (replace(one, stable=stable) for one in found.confirmations)
    found = replace(found, confirmations=(first, second))
    assert Siting(found).answer_lines[0].endswith(f"; {said}")
    assert f"confirmed; {said}" in Siting(found).page_text() or first in found.breaking


def test_a_swing_outside_of_the_range_with_less_damping_is_in_the_headline(five, monkeypatch):
    found = planted(monkeypatch, five, bus_11=(4.61, 8.13, True), bus_12=(4.0, 9.30, True))
    first, second = found.confirmations
    for damping, said in ((5.27, True), (12.0, False)):
        beside = 13.0 * complex(-damping / 100, (1 - (damping / 100) ** 2) ** 0.5)
        shown = replace(found, confirmations=(replace(first, beside=beside), second))
        text = ", and a swing outside of --range has less: 5.27 % at 2.066 Hz"
        assert Siting(shown).answer_lines[0].endswith(text) is said
        outside = as_json(shown)["confirmed"][0]["least_damped_outside_of_range"]
        assert outside["damping_percent"] == pytest.approx(damping)
    assert as_json(found)["confirmed"][0]["least_damped_outside_of_range"] is None


@pytest.mark.slow
def test_a_swing_outside_of_the_range_is_followed_to_the_system_with_the_device():
    """The one of 2.03 Hz and 5.2 % of wscc9, beside 26 % that the POD brings to that of 1.3 Hz."""
    found = find_sites(load_case("wscc9"), SiteRequest("pod_p", confirm=2))
    assert ", and a swing outside of --range has less: 5.2" in Siting(found).answer_lines[0]
    one = found.confirmations[0]
    assert one.stable
    assert one.damping > 20
    assert one.beside.imag / (2 * np.pi) == pytest.approx(2.035, abs=0.01)
    assert "it stays the least damped of the range" in " ".join(sureness(found))


def test_what_the_device_brings_without_its_pod_stands_in_a_column(five, monkeypatch):
    found = planted(monkeypatch, five, bus_11=(4.61, 8.13, True), bus_12=(4.0, 9.30, True))
    table = ranking_table(found)
    headings = table.headings
    alone = next(k for k, text in enumerate(headings) if "with the device alone [%]" in text)
    assert headings[alone + 2 : alone + 4] == ["least damped then [%]", "at [Hz]"]
    cells = {row[0]: row[alone : alone + 3] for row in table.rows}
    assert cells == {"bus_12": ["4.00", "9.30", "7.50"], "bus_11": ["4.61", "8.13", "7.50"]}
    (one,) = [x for x in as_json(found)["confirmed"] if x["bus"] == "bus_11"]
    assert one["damping_percent_of_device_alone"] == pytest.approx(4.61)


@pytest.mark.parametrize(
    ("other", "said", "costs"),
    [
        (None, "it stays the least damped", False),
        (14.0, "least damped then is another mode: 1.733 Hz, 14.00 %", False),
        (2.0, "least damped then is another mode: 1.750 Hz, 2.00 %, LESS than the least", True),
    ],
)
def test_the_least_damped_with_the_device_may_be_another_mode(
    five, monkeypatch, other, said, costs
):
    """The swing rises from 11.3 to 20 %. Another mode may be least damped then, even less than the swing was."""
    found = planted(monkeypatch, five, bus_11=(12.0, 20.0, True), bus_12=(12.0, 18.0, True))
    beside = 11.0 * complex(-(other or 0) / 100, (1 - ((other or 0) / 100) ** 2) ** 0.5)
    confirmations = tuple(
        replace(one, least=beside if other else one.reached) for one in found.confirmations
    )
    found = replace(found, confirmations=confirmations)
    assert said in sureness(found)[0]
    assert ("but least damped then is another mode: 1.750 Hz" in answer(found)) is costs
    (first, _) = as_json(found)["confirmed"]
    assert first["least_damped_is_another_mode"] is (other is not None)
    assert first["least_damping_percent"] == pytest.approx(other or 20.0)


def test_terminals_of_machines_are_left_out_unless_they_are_asked_for(five):
    found = find_sites(five, SiteRequest("pod_p", confirm=0))
    assert set(found.ranking) == {f"bus_{n}" for n in range(11, 17)}
    assert any("left out: the terminals of units, bus_1, bus_2" in text for text in remarks(found))
    every = find_sites(five, SiteRequest("pod_p", confirm=0, buses=("bus_*",)))
    assert set(every.ranking) == {f"bus_{n}" for n in (1, 2, 3, 4, 5, *range(11, 17))}
    assert not any("left out" in text for text in remarks(every))


def test_a_bus_with_lines_is_no_terminal_and_some_bus_is_left():
    """Bus 39 has a machine and two lines; at bus 31 stands the plant's own load. Of two buses neither is left out."""
    ieee39 = prepare_one("ieee39", "base")
    assert unit_terminals(ieee39) == [f"bus_{n}" for n in range(30, 39)]
    two = prepare_one("two_area_rms", "gfor")
    assert unit_terminals(two) == []


@pytest.mark.parametrize(
    ("rating", "asked"),
    [(0.25, True), (0.27, False), (250.0, False), (2500.0, False), (25e3, True)],
)
def test_a_rating_in_another_unit_is_questioned(five, rating, asked):
    """The largest machine has 260 MVA; from a thousandth of it to ten times it everything is possible."""
    (prepared,) = five.prepare()
    question = question_about(rating, prepared)
    assert (question is not None) is asked
    if question is not None:
        assert f"{rating:g} MVA beside sg5's {max(RATINGS.values()):g} MVA" in str(question)


def test_the_question_about_the_rating_is_on_the_screen_and_in_the_json(gfor, five):
    code, out, err = gfor("site", five.path, "--confirm", "0", "--rating", "0.25", "--json")
    assert code == 0
    assert "0.25 MVA beside sg5's 260 MVA; is it in MVA?" in err
    assert any("0.25 MVA" in text for text in json.loads(out)["questions"])
    assert Siting(find_sites(five, SiteRequest(confirm=0))).ranking[0] in json.loads(out)["answer"]


class Loop:
    """A swing of 1.4 Hz that gains 0.05 points of damping by 1 pu, beside a mode of 1.8 Hz with a damping by gain."""

    SWING, OTHER = 2.8 * np.pi, 3.6 * np.pi

    def __init__(self, other):
        self._other = other

    def dampings(self, setting):
        turn = np.angle(setting.filters.response(1j * self.SWING))
        return 0.03 + 5e-4 * setting.gain * np.cos(turn), self._other(setting.gain)

    def model(self, setting):
        pairs = zip((self.SWING, self.OTHER), self.dampings(setting), strict=True)
        blocks = [
            w * np.array([[-zeta, np.sqrt(1 - zeta**2)], [-np.sqrt(1 - zeta**2), -zeta]])
            for w, zeta in pairs
        ]
        return LinearModel.from_matrix(block_diag(*blocks), tuple("abcd"), None)

    def place(self, start, gain, filters):
        zeta, _ = self.dampings(PodSetting(gain, filters))
        return SimpleNamespace(eigenvalue=self.SWING * complex(-zeta, np.sqrt(1 - zeta**2)))


@pytest.mark.parametrize(
    ("other", "most", "gain", "ended"),
    [
        (lambda K: 0.30, 200.0, 200.0, SearchEnd(200.0)),
        (lambda K: 0.02, 200.0, 200.0, SearchEnd(200.0)),  # nothing moves it
        (lambda K: 0.02 - 2e-6 * K, 200.0, 200.0, SearchEnd(200.0)),  # by 0.04 points it falls
        (
            lambda K: 0.09 - 4e-4 * K,
            200.0,
            50.0,
            SearchEnd(200.0, 100.0, pytest.approx(swinging(3.6 * np.pi, 0.05))),
        ),
        (lambda K: -0.01 if K > 60 else 0.09, 200.0, 50.0, SearchEnd(200.0, 100.0)),
    ],
)
def test_gain_rises_until_damping_does_no_longer_or_its_bound_is_reached(other, most, gain, ended):
    setting, search = tuned_setting(
        Loop(other), None, complex(-1.0), complex(0.0, Loop.SWING), most
    )
    assert setting.gain == gain
    assert search == ended


def test_a_swing_of_the_study_beyond_2_hz_bounds_the_gain():
    """A mode of 2.2 Hz falls with the gain: it counts in a study to 3 Hz, and is what ends the search there."""

    class FastLoop(Loop):
        OTHER = 4.4 * np.pi

    loop = FastLoop(lambda K: 0.09 - 4e-4 * K)
    to_2_hz, to_3_hz = (
        tuned_setting(
            loop,
            None,
            complex(-1.0),
            complex(0.0, Loop.SWING),
            200.0,
            looks=LeastDamping(loop, frequency_range=(0.1, high)),
        )
        for high in (2.0, 3.0)
    )
    assert to_2_hz[0].gain == 200.0
    assert to_3_hz[0].gain == 50.0
    expected = pytest.approx(swinging(FastLoop.OTHER, 0.05))
    assert to_3_hz[1] == SearchEnd(200.0, 100.0, expected)


def test_a_best_place_whose_prediction_is_off_is_not_called_best_without_saying_so(
    five, monkeypatch
):
    """Whether it is the only place that coupled FMUs tried, or the best of several."""
    for others in ({}, {"bus_12": (4.0, 7.30, True)}):
        found = planted(monkeypatch, five, bus_11=(4.61, 8.13, True), **others)
        assert "NOT CONFIRMED" not in answer(found)
        first, *behind = found.confirmations
        off = replace(first, predicted=1.08 * first.coupled)
        (said, *_) = Siting(replace(found, confirmations=(off, *behind))).answer_lines
        assert "(NOT CONFIRMED: the prediction is off by 8 %)" in said


def test_a_device_that_takes_damping_is_told_beside_what_was_predicted_of_it(five, monkeypatch):
    """Support alone adds damping there, and the converter that gives it takes some: the row held both, unexplained."""
    found = planted(monkeypatch, five, bus_11=(4.61, 8.13, True), bus_12=(4.0, 7.30, True))
    assert "(support alone: the converter's voltage and delays" in answer(found)
    coupled = eigenvalue(8.0) - found.intact.modes[0].mode.eigenvalue
    plain = replace(found.confirmations[0], tuned=None, coupled=coupled, predicted=1.01 * coupled)
    before = found.intact.modes[0].mode.damping_percent

    def row(one):
        return sureness(replace(found, confirmations=(one,)))[0]

    less, more = (row(replace(plain, with_device=eigenvalue(x))) for x in (8.0, 14.0))
    expected = replace(plain, with_device=eigenvalue(8.0)).damping_predicted
    assert f"own response predicts {expected:.2f} %, the mode's shift is off by 1 %)" in less
    assert 0 < abs(expected - 8.0) < 0.1
    assert f"{before:.2f} % → 8.00 % with the device of 100 MVA, LESS than without it; " in less
    assert "LESS than without it" not in more
    tuned = row(replace(plain, setting=PodSetting(50.0, NO_COMPENSATION), tuned=eigenvalue(14.0)))
    assert "(the mode's shift by a small gain, as predicted, is off by 1 %)" in tuned


def test_what_ended_the_search_is_said(five, monkeypatch):
    found = planted(monkeypatch, five, bus_11=(4.61, 8.13, True))
    (one,) = found.confirmations
    tuned = replace(one, setting=PodSetting(100.0, NO_COMPENSATION))
    for search, words in (
        (SearchEnd(100.0), "(K 100 pu, the largest that --gain allows)"),
        (
            SearchEnd(200.0, 200.0, swinging(Loop.OTHER, 0.0711)),
            "(K 100 pu; with 200 the least damped mode, 1.795 Hz, has 7.11 %)",
        ),
        (SearchEnd(200.0, 200.0), "(K 100 pu; with 200 something grows)"),
    ):
        ended = replace(found, confirmations=(replace(tuned, search=search),))
        assert words in " ".join(sureness(ended))
