"""`Scenario.explore`: the page in a notebook, with the scenario's own values."""

import inspect
import json
import re
from urllib.error import URLError
from urllib.request import Request, urlopen

import pytest

import orchestrator as gfor

PLAIN = {"BusStrength", "Mode", "Stability"}
"""Parts of results, which one line shows."""


@pytest.fixture(scope="module")
def scenario():
    return gfor.load("two_area").scenario("pod_p", {"grid.X_L": 0.3, "gfor*.pod_p.K": 150.0})


@pytest.fixture(scope="module")
def page(scenario):
    with scenario.explore() as page:
        yield page


def test_a_notebook_shows_the_page_that_the_server_gives(page):
    (source,) = re.findall('<iframe src="(.*?)"', page._repr_html_())
    assert source == page.address
    with urlopen(source) as answer:
        assert b"gfor explore" in answer.read()
        # nothing forbids the frame
        assert "X-Frame-Options" not in answer.headers
        assert "frame-ancestors" not in answer.headers["Content-Security-Policy"]


def test_the_page_begins_with_the_values_of_the_scenario(page, scenario):
    with urlopen(f"{page.address}beginning") as answer:
        beginning = json.load(answer)
    assert beginning["scenario"] == "pod_p"
    assert beginning["values"] == {"grid.X_L": 0.3, "gfor.pod_p.K": 150.0}
    question = {"ask": "modes", "page": "1", "number": 1, **beginning}
    asked = Request(f"{page.address}ask", json.dumps(question).encode(), method="POST")
    with urlopen(asked) as answer:
        (found,) = json.load(answer)["answer"]["modes"]["scenarios"]
    shown = {mode["name"]: mode["damping_percent"] for mode in found["modes"]}
    own = scenario.modes()["electromechanical"]
    assert shown["electromechanical"] == pytest.approx(own.damping_percent, abs=1e-9)


def test_a_closed_page_says_so():
    page = gfor.load("infinite_bus").scenario("dip").explore()
    address = page.address
    page.close()
    page.close()
    with pytest.raises(URLError):
        urlopen(address)
    assert "iframe" not in page._repr_html_()
    assert "closed" in repr(page)


def test_every_result_shows_itself_in_a_notebook():
    known = {name: getattr(gfor, name) for name in dir(gfor)}
    results = {
        name: of
        for name, of in known.items()
        if inspect.isclass(of) and not issubclass(of, Exception)
    }
    assert {name for name, of in results.items() if not hasattr(of, "_repr_html_")} == PLAIN


def test_the_choice_of_a_step_begins_with_what_is_allowed():
    choice = gfor.load("two_area").scenario("base").steps(steps=[1e-4, 2e-4])
    html = choice._repr_html_()
    assert html.index("steps within the error") < html.index("<table")
    assert html.count("gauss-seidel") >= 2
