"""The pages that a newcomer opens before an install: small, alone, and with the figures of today."""

import json
import math
import re
from pathlib import Path

import pytest

import orchestrator as gfor
from orchestrator.cases.case import BUILT_IN
from orchestrator.face.explore.files import whole_page
from orchestrator.output.report.html import elements
from orchestrator.studies.immittance import ratio_page
from tests.benchmarks import wasm
from tests.benchmarks.live_pages import pages_with_answers
from tests.pages.markdown import ROOT, links
from tests.support.chromium import running_browser

GUIDE = ROOT / ".docs" / "how-to" / "look-first.md"
PAGES = sorted((ROOT / ".docs" / "live").glob("*.html"))
LARGEST = 2_700_000
"""Bytes of a page: a tenth below the 3 MB that a slow line fetches in ten seconds."""
MOST_STOPS = 20
"""Stops of the Tab key from the top of a page within which its questions are."""


def saved(path):
    """What a page holds."""
    (content,) = re.findall(r'<script[^>]* id="saved"[^>]*>(.*?)</script>', path.read_text("utf-8"))
    return json.loads(content)


@pytest.fixture(scope="module")
def browser():
    """One for all tests of these pages: its start takes longer than most of them."""
    with running_browser() as found:
        yield found


@pytest.fixture
def window(browser):
    """Opens windows that know nothing of each other; they are closed after the test."""
    views = []

    def opened(**size):
        views.append(browser.new_page(**size))
        return views[-1]

    yield opened
    for view in views:
        view.close()


def test_the_guide_leads_to_every_page_and_says_how_it_was_made():
    led = {(GUIDE.parent / target).resolve() for _, target in links(GUIDE)}
    assert len(PAGES) >= 5
    text = GUIDE.read_text(encoding="utf-8")
    for path in PAGES:
        assert path in led
        assert re.search(rf"--(save|html|out) \.docs/live/{re.escape(path.name)}[\n`]", text)


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.stem)
def test_a_page_is_small_and_asks_nothing_of_the_network(path):
    text = path.read_text(encoding="utf-8")
    assert len(text.encode()) <= LARGEST
    assert not re.search(r"""(src|href)=["']?(https?:)?//""", text)
    assert not re.search(r"""@import|url\(["']?(https?:)?//""", text)
    assert not re.search(r"[\"' ]/(home|root|tmp|work)/", text), (
        "a folder of the machine that made it"
    )


def test_the_explorers_pages_are_those_that_todays_code_writes_around_what_they_hold():
    """Pages were once patched in their text, and told a verdict in other words than the live page."""
    held = pages_with_answers()
    assert len(held) >= 5
    old = [
        path.name
        for path, content in held.items()
        if whole_page(content) != path.read_text("utf-8")
    ]
    assert old == [], "python -m tests.benchmarks.live_pages --put"


@pytest.mark.parametrize(
    ("name", "texts"),
    [
        ("design", [elements.__file__]),
        ("source", [elements.__file__]),
        ("weak_grid", [elements.__file__, ratio_page.__file__]),
        ("converter_in_browser", [wasm.__file__]),
    ],
)
def test_styles_and_scripts_of_other_pages_are_todays(name, texts):
    page = (ROOT / ".docs" / "live" / f"{name}.html").read_text(encoding="utf-8")
    for module in map(Path, texts):
        beside = [
            path
            for path in module.parent.glob("*.*s*")
            if path.suffix in (".css", ".js") and path.stem in ("page", module.stem)
        ]
        assert beside
        assert [path.name for path in beside if path.read_text(encoding="utf-8") not in page] == []


@pytest.mark.parametrize("name", ["two_area"])
def test_the_figures_are_those_of_today(name):
    held = saved(ROOT / ".docs" / "live" / f"{name}.html")
    for one in (held["answers"][0], held["answers"][-1]):
        (found,) = one["answer"]["modes"]["scenarios"]
        modes = gfor.load(name).scenario(one["scenario"], one["values"]).modes()
        assert [mode["damping_percent"] for mode in found["modes"]] == pytest.approx(
            [mode.damping_percent for mode in modes], abs=1e-3
        )


def test_every_question_of_a_page_is_asked_by_tab_and_enter(window):
    view = window(viewport={"width": 1280, "height": 900})
    view.goto((ROOT / ".docs" / "live" / "two_area.html").as_uri())
    view.get_by_role("button", name="What is a mode?").wait_for()
    asked = set()
    for _ in range(MOST_STOPS):
        view.keyboard.press("Tab")
        question = view.evaluate("document.activeElement.textContent").strip()
        if question.endswith("?") and question not in asked:
            before = view.inner_text("body")
            view.keyboard.press("Enter")
            view.wait_for_function("seen => document.body.innerText !== seen", arg=before)
            asked.add(question)
    answer = view.inner_text("body")
    assert "What is a mode?" in asked
    assert len(asked) >= 3
    assert "A mode is one of the ways in which the system swings" in answer


def test_a_page_does_not_tell_where_the_built_in_cases_are_installed():
    warning = f"{BUILT_IN / 'kundur' / 'units.csv'}, line 4: sg3"
    page = whole_page({"answers": [{"warnings": [warning]}]})
    assert f'"{Path("kundur", "units.csv")}, line 4: sg3"' in page.replace("\\\\", "\\")
    assert str(BUILT_IN) not in page


def test_a_doubled_gain_is_a_question_and_words_have_the_pages_size_on_a_phone(window):
    path = ROOT / ".docs" / "live" / "two_area.html"
    held = {tuple(one["values"].items()): one["answer"] for one in saved(path)["answers"]}
    answer = held[("grid.X_L", 0.1), ("gfor.pod_p.K", 400.0)]["modes"]["scenarios"][0]
    least = min(mode["damping_percent"] for mode in answer["modes"])
    view = window(viewport={"width": 390, "height": 844})
    view.goto(path.as_uri())
    view.get_by_role("button", name="What if gfor.pod_p.K is doubled?").click()
    said = view.inner_text("#else-said")
    heights = view.evaluate(
        "[...document.querySelectorAll('#first-plot svg text')].map(x => x.getBoundingClientRect().height)"
    )
    assert "With gfor.pod_p.K = 400: stable, least damped " in said
    assert f"with {least:.2f} %" in said
    assert heights
    assert min(heights) > 9  # [px]; they were 5


def test_the_double_of_a_value_may_lie_between_two_that_were_computed(window):
    """Of a tie of 0.08 pu, 0.16 was not computed: the straight line there is told, with its error."""
    path = ROOT / ".docs" / "live" / "kundur.html"
    name, corners = "grid.X_tie_8_9_1", (0.1438, 0.1881)
    held = {tuple(one["values"].items()): one["answer"] for one in saved(path)["answers"]}
    answers = [held[((name, x),)]["modes"]["scenarios"][0]["modes"] for x in corners]
    growing = [next(complex(m["real"], m["imag"]) for m in one if m["real"] > 0) for one in answers]
    part = (0.16 - corners[0]) / (corners[1] - corners[0])
    between = (1 - part) * growing[0] + part * growing[1]
    damping = f"{-100 * between.real / abs(between):.2f}".replace("-", "−")
    view = window(viewport={"width": 1280, "height": 900})
    view.goto(path.as_uri())
    view.evaluate("name => { SAVED.own[name] = 0.08; }", name)
    view.get_by_role("button", name=f"What if {name} is doubled?").click()
    said = view.inner_text("#else-said")
    assert f"≈ least damped {between.imag / math.tau:.3f} Hz with {damping} %" in said
    assert "halfway off by less than 0.01 points. Computed nearby, with 0.1438: UNSTABLE" in said


def test_a_question_names_the_few_values_at_which_it_is_stable(window):
    """Twelve values were named at which Kundur's system is unstable, for one at which it is stable."""
    view = window(viewport={"width": 1280, "height": 900})
    view.goto((ROOT / ".docs" / "live" / "kundur.html").as_uri())
    said = {}
    for name in ("grid.load_7.scale", "grid.load_9.scale", "grid.X_tie_8_9_1"):
        view.get_by_role("button", name=f"Which {name} damps most?").click()
        said[name] = view.inner_text("#else-said").partition("%. ")[2].partition(" show it")[0]
    view.evaluate(
        "dragSaved('grid.load_9.scale', 0.9 * SAVED.grid['grid.load_9.scale'].find(x => x > 0.5))"
    )
    beside = view.inner_text("#outside")
    others = view.inner_text("#between")
    assert "holds pod_q; gfor explore kundur opens the others of the case: manual," in others
    assert said == {
        "grid.load_7.scale": "Unstable at all of them.",
        "grid.load_9.scale": "Stable at 0.342, 0.5, 0.5848, 0.7647 only.",
        "grid.X_tie_8_9_1": "Stable at 0.022 only.",
    }
    assert beside.startswith("Computed nearby, with grid.load_9.scale = 0.5: stable")


def test_two_lines_side_by_side_have_their_number_at_their_flow(window):
    """Of two ties of Kundur's the picture had room for one figure, which looked like that of both."""
    view = window(viewport={"width": 1280, "height": 900})
    view.goto((ROOT / ".docs" / "live" / "kundur.html").as_uri())
    view.locator("#names text").first.wait_for(state="attached")
    said = view.evaluate("names.labels.flatMap(one => one.words)")
    assert len([text for text in said if re.fullmatch(r"2 × \d+ MW", text)]) == 2
    odd = view.evaluate("flowLabel([{x: 0, y: 0, p: 150}, {x: 2, y: 0, p: 50.4}]).words")
    assert odd == ["2 lines: 200 MW"]


def test_a_saved_page_answers_what_most_ask_of_a_live_one(window):
    """A line out, a converter apart, and the gain for 10 % were asked of the live page alone."""
    path = ROOT / ".docs" / "live" / "kundur.html"
    held = {one["question"]: one for one in saved(path)["asked"]}
    view = window(viewport={"width": 1280, "height": 900})
    view.goto(path.as_uri())
    for question in ("What if line tie_7_8_1 is out?", "What does the converter do?"):
        view.get_by_role("button", name=question).click()
        (one,) = held[question]["answer"]["modes"]["scenarios"]
        (least,) = one["modes"]
        figures = f"{least['frequency_hz']:.3f} Hz with {least['damping_percent']:.2f} %"
        said = view.inner_text("#else-said").replace("−", "-")
        assert f"{held[question]['words']}: UNSTABLE, least damped {figures}. " in said
        assert "least damped 0.622 Hz with -1.01 %" in said
    view.evaluate("state.scenario = 'another'; paintQuestions();")
    assert "What does the converter do?" not in view.inner_text("#questions")


def test_a_saved_page_tells_between_which_values_a_gain_gives_the_wanted_damping(window):
    view = window(viewport={"width": 1280, "height": 900})
    view.goto((ROOT / ".docs" / "live" / "ieee39.html").as_uri())
    view.get_by_role("button", name="Which gain gfor38.pod_p.K gives 10 %?").click()
    said = view.inner_text("#else-said")
    value, damping = r"([\d.]+)", r"\(([\d.]+) %\)"
    found = re.search(
        f"comes to 10 % between {value} {damping} and {value} {damping}, which are", said
    )
    low, less, high, more = map(float, found.groups())
    assert low < high
    assert less < 10 <= more
    view.evaluate(
        "SAVED.grid['gfor38.pod_p.K'] = SAVED.grid['gfor38.pod_p.K'].filter(x => x < 52.4)"
    )
    view.evaluate("askGain('gfor38.pod_p.K')")
    said = view.inner_text("#else-said")
    assert said.startswith("None of the ")
    assert said.endswith(f" gives 10 %: the most has {low:g} ({less:.2f} %).")


MARKS = """
Array.from(document.querySelectorAll("#network circle.unit, #network path.load"), x => {
  const {left, top, right, bottom} = x.getBoundingClientRect();
  return [left, top, right, bottom];
})
"""
TEXTS = """
Array.from(document.querySelectorAll("#names text"), x => {
  const {left, top, right, bottom} = x.getBoundingClientRect();
  return [x.textContent, [left, top + 2, right, bottom - 2]];
})
"""
"""Words of the single-line diagram with their places, without what letters leave free above and below."""


def test_no_word_of_the_network_touches_a_mark(window):
    """ "825 MW" began in the circles of its transformer."""
    view = window(viewport={"width": 1280, "height": 900})
    view.goto((ROOT / ".docs" / "live" / "ieee39.html").as_uri())
    view.locator("#names text").first.wait_for(state="attached")
    texts, marks = view.evaluate(TEXTS), view.evaluate(MARKS)
    assert len(marks) > 40
    assert "825 MW" in [text for text, _ in texts]
    touching = [
        text
        for text, (x0, y0, x1, y1) in texts
        for (left, top, right, bottom) in marks
        if x0 < right and left < x1 and y0 < bottom and top < y1
    ]
    assert touching == []


def test_a_slider_tells_where_its_step_leaves_another_mode_least_damped(window):
    """Its points are those of the mode shown: where that one is damped more, another one may become the worst."""
    path = ROOT / ".docs" / "live" / "ieee39.html"
    held = saved(path)
    mover = next(x for x in held["movers"]["movers"] if x["parameter"] == "gfor38.pod_p.T_S1")
    end = mover["value"] + mover["step"]
    upper = min(x for x in held["grid"][mover["parameter"]] if x >= end)
    answer = next(x for x in held["answers"] if x["values"] == {mover["parameter"]: upper})[
        "answer"
    ]
    other = min(answer["modes"]["scenarios"][0]["modes"], key=lambda mode: mode["damping_percent"])[
        "frequency_hz"
    ]
    view = window(viewport={"width": 1280, "height": 900})
    view.goto(path.as_uri())
    view.locator("#movers .control").first.wait_for()
    said = {
        name: view.locator(f'.control[data-name="{name}"] .effect').inner_text()
        for name in ("gfor38.pod_p.T_S1", "gfor38.pod_p.T_S2")
    }
    chosen = view.inner_text("#movers > p")
    assert abs(other - held["movers"]["frequency_hz"]) > 0.1
    assert re.search(
        rf"; then another mode is damped least: ≈ \d+\.\d\d % at {other:.3f} Hz$",
        said["gfor38.pod_p.T_S1"],
    )
    assert "another" not in said["gfor38.pod_p.T_S2"]  # the mode shown is damped less
    assert "By ∂λ/∂p of the running FMUs: " in chosen
    assert chosen.endswith("40 of 192 values were looked at.")


def test_a_typed_value_that_was_not_computed_is_told_with_the_one_that_is_shown(window):
    """400 once became 447.2, and −5 the least of the grid, without a word."""
    view = window(viewport={"width": 1280, "height": 900})
    view.goto((ROOT / ".docs" / "live" / "two_area.html").as_uri())
    control = view.locator('.control[data-name="gfor.pod_p.K"]')
    said = {}
    for typed in ("31", "2000", "−5", "27"):
        control.get_by_role("textbox").fill(typed)
        control.get_by_role("textbox").press("Enter")
        view.wait_for_timeout(100)
        told = control.locator(".snapped")
        said[typed] = (
            told.inner_text() if told.count() else "",
            control.get_by_role("textbox").input_value(),
        )
    assert said == {
        "31": ("nearest computed: 27 (31 was asked)", "27"),
        "2000": ("nearest computed: 400 (2000 was asked)", "400"),
        "−5": ("nearest computed: 0 (−5 was asked)", "0"),
        "27": ("", "27"),
    }


@pytest.mark.parametrize(
    ("name", "keys"), [("design", ".legend i"), ("source", ".legend i"), ("two_area", "svg")]
)
def test_keys_of_a_legend_keep_their_colours_on_paper(window, name, keys):
    """Browsers leave out the backgrounds that they print, and with them a key's only colour."""
    view = window()
    view.emulate_media(media="print")
    view.goto((ROOT / ".docs" / "live" / f"{name}.html").as_uri())
    printed = view.evaluate(
        "keys => [...document.querySelectorAll(keys)].map(x => getComputedStyle(x).printColorAdjust)",
        keys,
    )
    assert {*printed} == {"exact"}


def test_no_page_is_wider_than_the_smallest_telephone(window):
    """A path in a heading, and the buttons beside the tabs, once were."""
    view = window(viewport={"width": 320, "height": 800})
    wide = {}
    for path in PAGES:
        view.goto(path.as_uri())
        view.wait_for_function("document.body.innerText.length > 300")
        wide[path.name] = view.evaluate("document.documentElement.scrollWidth")
    assert {name: width for name, width in wide.items() if width > 320} == {}


@pytest.mark.parametrize("name", ["two_area", "kundur"])
def test_a_telephone_shows_a_page_without_scrolling_sideways(window, name):
    """A scenario's long title once made the page wider than the screen, and a mode's name hid who takes part in it."""
    view = window(viewport={"width": 390, "height": 844})
    view.goto((ROOT / ".docs" / "live" / f"{name}.html").as_uri())
    view.get_by_role("button", name="What is a mode?").wait_for()
    view.locator("td.text").first.wait_for()
    hidden = view.evaluate(
        "[document.documentElement, ...document.querySelectorAll('.scroll')]"
        ".map(part => part.scrollWidth - part.clientWidth)"
    )
    signs = view.evaluate(
        "[...document.querySelectorAll('svg text')].map(text => text.textContent)"
    )
    assert max(hidden) == 0
    powers = [text for text in signs if re.fullmatch(r"[-−]?\d\.\d+e.*", text)]
    assert powers
    assert not [text for text in powers if "-" in text]
