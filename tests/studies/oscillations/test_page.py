"""The page on a source: every curve that is named is seen, and parts are parts of something."""

from dataclasses import replace

import numpy as np
import pytest

from orchestrator.studies.oscillations.detection import signals_of
from orchestrator.studies.oscillations.location import DEF, QV_PHASE, Opinion
from orchestrator.studies.oscillations.models import OWN_MODEL
from orchestrator.studies.oscillations.page import envelope_curves, source_page
from orchestrator.studies.oscillations.tables import parts_of
from orchestrator.studies.oscillations.verdict import evidence_of, locate
from tests.support.forced_records import record, sine, times_of

TIMES = times_of(40.0)


@pytest.fixture(scope="module")
def forced():
    """A record of two areas in which a governor is forced, and what is found in it."""
    measured = record("two_area", {"sg1.governor.delta_P_ref": sine(TIMES, 0.8, 0.02)}, times=TIMES)
    return measured, locate(measured)[0]


def test_each_curve_differs_from_the_others_and_all_names_stand_beside_them(forced):
    """Two of three curves once lay on each other: a machine's power is that of its transformer."""
    measured, one = forced
    curves = envelope_curves(measured, one.found)
    largest = max(curve.y.max() for curve in curves)
    for k, curve in enumerate(curves):
        for other in curves[:k]:
            assert np.abs(curve.y - other.y).max() > 1e-3 * largest
    powers = [name for name in one.found.amplitudes if name.endswith(".p")]
    named = [name for curve in curves for name in curve.label.split(" = ")]
    assert named
    assert len(named) == len(set(named))
    assert set(named) <= set(powers)


def test_an_amplitude_is_in_megawatts_for_any_base(forced):
    measured, one = forced
    (first, *_) = envelope_curves(measured, one.found)
    place = next(p for p in measured.places if f"{p.name}.p" == first.label.split(" = ")[0])
    settled = place.p[len(TIMES) // 2 :]
    assert np.median(first.y) == pytest.approx(
        100 / measured.base * np.sqrt(2) * settled.std(), rel=0.1
    )


@pytest.mark.parametrize(
    ("ranking", "words"),
    [
        ([("a", 0.97), ("b", 0.03), ("c", 0.001), ("d", -0.4)], "a 97 %, b 3 %"),
        # 100 % of nearly nothing: all others take 300 times as much
        ([("a", 1.0), ("b", -100.0), ("c", -200.0)], "these places take more than they give"),
        ([("a", -1.0)], "none"),
    ],
)
def test_parts_of_what_is_given(ranking, words):
    given = Opinion(QV_PHASE if len(ranking) == 3 else DEF, None, True, "", tuple(ranking))
    if ranking == [("a", -1.0)]:  # takes alone: nobody gives
        assert given.others_give is False
    assert parts_of(given) == words


def test_a_named_place_that_is_not_observed_is_told_beside_the_parts_of_those_that_are():
    """A load was named, and its row gave 76 % to a machine."""
    ranking = (("sg2", 0.76), ("sg1", 0.21))
    load = Opinion(OWN_MODEL, "grid.load_7", True, "", ranking)
    assert parts_of(load) == (
        "grid.load_7, which the record does not measure; of those that it does: sg2 76 %, sg1 21 %"
    )
    assert parts_of(Opinion(OWN_MODEL, "sg2", True, "", ranking)) == "sg2 76 %, sg1 21 %"


def test_too_short_a_record_says_from_when_on_it_can_be_judged(forced):
    """6.5 periods were told beside a figure with 13: those before its begin, and two after it, do not count."""
    measured, one = forced
    signals = signals_of(measured)
    middle = float(signals.times[len(TIMES) // 2])
    late = replace(one.found, begin=middle, first=len(TIMES) // 2, last=len(TIMES) * 3 // 4)
    (why,) = evidence_of(signals, late).reasons
    begin = middle + 2 / one.found.frequency
    assert why.startswith(f"it can be judged from {begin:.1f} s, two periods after it begins, to ")
    assert "s, when less than half of it is left: " in why
    assert "8 are needed" in why


def test_a_map_on_which_no_bus_is_red_promises_none(forced):
    measured, one = forced
    words = {}
    for name in ("sg1", "gfor"):  # the one feeds what the other takes
        alone = [place for place in measured.places if place.name == name]
        found = replace(one.found, amplitudes={f"{name}.p": one.found.amplitudes[f"{name}.p"]})
        words[name] = source_page(replace(measured, places=alone), [replace(one, found=found)])
    assert "the redder a bus, the more it feeds" in words["sg1"]
    assert "no bus that is measured feeds any" in words["gfor"]
