"""Pictures of responses with their limits, on the page of a certificate."""

import re

import numpy as np
import pytest

from orchestrator.output.report.colours import colour
from orchestrator.output.report.html.charts import legend
from orchestrator.output.report.html.elements import Figures
from orchestrator.studies.certification.codes.all_codes import CODES
from orchestrator.studies.certification.codes.bench_point import BenchResult
from orchestrator.studies.certification.codes.known import code_for
from orchestrator.studies.certification.codes.record import LIMIT, row_pictures
from orchestrator.studies.certification.codes.row_verdict import judge_row

pytestmark = pytest.mark.filterwarnings("error")

RTE = code_for("rte", {"X_eff": 0.15, "D": 20.0, "H": 1.0})


def drawn(code, name, power, until=99.0):
    """The pictures of a row on a response with that active power, a function of the time."""
    row = next(row for row in code.rows if row.name == name)
    times = np.arange(0, row.programme(50.0).stop + 5e-4, 1e-3)
    times = times[times <= until]
    signals = {"p": power(times), "q": np.full(times.shape, 0.1), "v": np.ones(times.shape)}
    signals |= {
        "v_re": signals["v"],
        "v_im": 0 * times,
        "duplicate.p": 0 * times,
        "source.p": -signals["p"],
    }
    result = BenchResult(name, times, signals)
    return row_pictures(judge_row(row, result, 50.0), result, 50.0, Figures())


def curves(page):
    """Label, x and y of every curve."""
    found = re.findall(r'data-label="([^"]*)" data-x="([^"]*)" data-y="([^"]*)"', page)
    return [
        (label, *(np.array(list(map(float, text.split()))) for text in values))
        for label, *values in found
    ]


def test_every_envelope_is_a_picture_in_which_the_response_leaves_it():
    """A constant power against a jump: outside of the drawn envelope, where the text says so."""
    page = drawn(RTE, "igfm1_scr10_p50", lambda t: np.full(t.shape, 0.5))
    assert page.count("<svg") == 2
    assert "igfm1_scr10_p50, power after the jump ahead: not accepted: " in page
    (_, x, response), (high, t, most), (low, low_t, least) = curves(page)[:3]
    assert (high, low) == (
        "power after the jump ahead: at most",
        "power after the jump ahead: at least",
    )
    assert (x[0], t[0]) == pytest.approx((0.75, 1.0), abs=2e-3)
    assert np.any(np.interp(t, x, response) > most + 0.05)
    assert np.all(least < np.interp(low_t, t, most))


def test_what_other_codes_ask_is_drawn_along_the_run():
    """AEMO's jumps: 0.2 pu against each, and back within 0.05 pu."""
    page = drawn(CODES["aemo"], "jump_10", lambda t: np.full(t.shape, 0.5))
    levels = [(label, tuple(y)) for label, _, y in curves(page) if label != "response"]
    first = "reached in the first swing after each jump"
    assert levels[0] == (f"{first}: at least", pytest.approx((0.7, 0.7)))
    assert levels[1] == (f"{first}: at most", pytest.approx((0.3, 0.3)))
    assert levels[4] == ("returns: at most", pytest.approx((0.55, 0.55)))
    assert page.count("<svg") == 1


@pytest.mark.parametrize("code", CODES.values(), ids=lambda code: code.key)
def test_every_row_has_a_picture(code):
    for row in code.rows:
        page = drawn(code, row.name, lambda t: np.full(t.shape, 0.5))
        assert page.count("<svg") == page.count("<figure") >= 1
        assert all(len(x) == len(y) > 1 for _, x, y in curves(page))


def test_the_power_after_a_dip_is_drawn_from_the_codes_time_on():
    """Fingrid: 3 s after the last step of its profile, at 2.5 s, until the end."""
    page = drawn(CODES["fingrid"], "dip", lambda t: np.full(t.shape, 0.5))
    (most,) = [
        (tuple(x), tuple(y))
        for label, x, y in curves(page)
        if label == "power after the dip: at most"
    ]
    assert most == (pytest.approx((5.5, 9.0), abs=2e-3), pytest.approx((0.55, 0.55)))


@pytest.mark.parametrize(
    ("power", "until"),
    [(lambda t: np.where(t > 3, np.nan, 0.5), 99.0), (lambda t: np.full(t.shape, 0.5), 3.0)],
)
def test_a_broken_or_a_short_response_is_drawn_as_far_as_it_goes(power, until):
    drawn(RTE, "igfm1_scr10_p50", power, 0.4)
    page = drawn(RTE, "igfm1_scr10_p50", power, until)
    assert any(label == "response" and len(x) > 100 for label, x, _ in curves(page))
    assert all(np.isfinite(y).all() for _, _, y in curves(page))
    assert (
        drawn(RTE, "igfm1_scr10_p50", lambda t: np.full(t.shape, np.nan)).count(
            "no value is a number"
        )
        == 2
    )


def test_the_legend_shows_a_limit_in_the_colour_in_which_it_is_drawn():
    page = drawn(RTE, "igfm1_scr10_p50", lambda t: np.full(t.shape, 0.5))
    both = legend([("response", colour(1)), ("limit", LIMIT)])
    assert both in page
    assert f'stroke="{colour(1)}"' in page
    assert f'stroke="{LIMIT}"' in page


@pytest.mark.parametrize(("until", "pictures"), [(0.0, 0), (1e-3, 1)])
def test_two_samples_are_a_picture_and_one_is_none(until, pictures):
    page = drawn(RTE, "igfm1_scr10_p50", lambda t: np.full(t.shape, 0.5), until)
    assert bool(page.count("<figure")) == bool(pictures)
