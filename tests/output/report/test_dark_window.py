"""A report in a dark window: what is read stands out from what is behind it, in pictures too; paper stays white."""

import re
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from orchestrator.output.report.html.charts import ChartCurve, legend, line_chart
from orchestrator.output.report.html.elements import Figures, document, table
from tests.support.chromium import running_browser
from tests.support.once import computed_once

LEAST_CONTRAST = 4.5
"""Of text, by the Web Content Accessibility Guidelines 2.1, level AA."""

OF_TEXTS = """() => {
  const found = [], read = 'h1, h2, p, td, th, li, caption, figcaption, pre, svg text';
  for (const one of document.querySelectorAll(read)) {
    const own = getComputedStyle(one), behind = [], filters = [];
    for (let at = one; at; at = at.parentElement) {
      behind.push(getComputedStyle(at).backgroundColor);
      filters.push(getComputedStyle(at).filter);
    }
    const ink = one.namespaceURI.endsWith('svg') ? own.fill : own.color;
    const ground = behind.find(x => !x.endsWith(', 0)')) ?? 'rgb(255, 255, 255)';
    found.push([one.tagName, ink, ground, filters.find(x => x !== 'none') ?? '']);
  }
  return found;
}"""


HALF_TURN = np.array([[-0.574, 1.430, 0.144], [0.426, 0.430, 0.144], [0.426, 1.430, -0.856]])
"""What ``hue-rotate(180deg)`` does to red, green and blue, by the W3C's Filter Effects Module."""

IN_THE_DARK = "invert(1) hue-rotate(180deg)"


def shown(colour, through=""):
    """Red, green and blue of ``rgb(r, g, b)`` from 0 to 1, behind a filter of the page."""
    assert through in ("", IN_THE_DARK)
    parts = np.array([int(x) for x in re.findall(r"\d+", colour)[:3]]) / 255
    return np.clip(HALF_TURN @ (1 - parts), 0, 1) if through else parts


def luminance(parts):
    """Relative luminance of red, green and blue, by WCAG 2.1."""
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(ink, ground, through):
    """Of a text, which a filter changes, and of what is behind it, which none does."""
    light, dark = sorted((luminance(shown(ink, through)), luminance(shown(ground))), reverse=True)
    return (light + 0.05) / (dark + 0.05)


@pytest.fixture(scope="module")
def texts():
    return texts_in_windows()


@computed_once
def texts_in_windows():
    """Colours of every text, and of what is behind it: in a light window, in a dark one, and on paper."""
    x = np.array([0.0, 1.0])
    chart = legend([("a", "#4d4d4d")]) + line_chart(
        "c", "x", "y", [ChartCurve("a", "#4d4d4d", x, x)]
    )
    content = (
        f"{Figures().add(chart, 'A figure.')[0]}{table('A table', ['a'], [['1']])}<pre>typed</pre>"
        '<p class="warning">warned</p><p class="bad">UNSTABLE</p><p class="good">stable</p>'
    )
    findings = '<div class="findings"><ul><li>found</li></ul></div>'
    found = {}
    with TemporaryDirectory() as folder, running_browser() as browser:
        page = Path(folder) / "page.html"
        page.write_text(document("A page", "kind", findings, [("Part", content)]), encoding="utf-8")
        view = browser.new_page()
        view.goto(page.as_uri())
        for name, media in (
            ("light", {"color_scheme": "light"}),
            ("dark", {"color_scheme": "dark"}),
            ("paper", {"color_scheme": "dark", "media": "print"}),
        ):
            view.emulate_media(**media)
            found[name] = view.evaluate(OF_TEXTS)
    return found


LEAST_HEIGHT = 9.0
"""Of a word in a narrow window [px]."""

OF_WORDS = """() => {
  const boxes = [...document.querySelectorAll('svg text')].map(x => [x.textContent, x.getBoundingClientRect()]);
  const crosses = (a, b) => a.left < b.right && b.left < a.right && a.top + 3 < b.bottom && b.top + 3 < a.bottom;
  const after = (one, k, a) => boxes.slice(k + 1).filter(([, b]) => crosses(a, b)).map(([other]) => [one, other]);
  const heights = boxes.map(([, a]) => a.height), left = Math.min(...boxes.map(([, a]) => a.left));
  return [heights, boxes.flatMap(([one, a], k) => after(one, k, a)), left];
}"""


@pytest.fixture(scope="module")
def sizes():
    return sizes_in_a_narrow_window()


@computed_once
def sizes_in_a_narrow_window():
    """Heights of a chart's words [px], which of them cross, and the left end of the farthest one [px]."""
    x = np.array([0.0, 20.0])
    y = np.array([-3e-4, 1.2e-3])
    chart = line_chart("c", "Time [s]", "omega [pu]", [ChartCurve("a", "#4d4d4d", x, y)])
    with TemporaryDirectory() as folder, running_browser() as browser:
        page = Path(folder) / "page.html"
        page.write_text(document("A page", "kind", "", [("Part", chart)]), encoding="utf-8")
        view = browser.new_page(viewport={"width": 390, "height": 844})
        view.goto(page.as_uri())
        return view.evaluate(OF_WORDS)


@pytest.mark.slow
@pytest.mark.parametrize("window", ["light", "dark", "paper"])
def test_every_text_stands_out(texts, window):
    faint = [one for one in texts[window] if contrast(*one[1:]) < LEAST_CONTRAST]
    assert faint == []
    assert len(texts[window]) > 15


@pytest.mark.slow
def test_page_and_pictures_are_dark_in_a_dark_window_and_white_on_paper(texts):
    behind = {
        window: {name: luminance(shown(ground)) for name, _, ground, _ in texts[window]}
        for window in texts
    }
    filters = {window: {through for *_, through in texts[window]} for window in texts}
    assert behind["dark"]["TD"] < 0.05
    assert behind["dark"]["text"] < 0.05
    assert behind["paper"]["text"] == behind["paper"]["TD"] == behind["light"]["TD"] == 1.0
    assert filters == {"light": {""}, "dark": {"", IN_THE_DARK}, "paper": {""}}


@pytest.mark.slow
def test_words_of_a_chart_can_be_read_in_a_narrow_window_and_do_not_cross(sizes):
    """A picture of 720 px that is made smaller as a whole leaves them 5 px."""
    heights, crossing, least_left = sizes
    assert min(heights) > LEAST_HEIGHT
    assert crossing == []
    assert least_left >= 0
