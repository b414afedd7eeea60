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
    const own = getComputedStyle(one), behind = [];
    for (let at = one; at; at = at.parentElement) behind.push(getComputedStyle(at).backgroundColor);
    const ink = one.namespaceURI.endsWith('svg') ? own.fill : own.color;
    found.push([one.tagName, ink, behind.find(x => !x.endsWith(', 0)')) ?? 'rgb(255, 255, 255)']);
  }
  return found;
}"""


def luminance(colour):
    """Relative luminance of ``rgb(r, g, b)``, by WCAG 2.1."""
    parts = np.array([int(x) for x in re.findall(r"\d+", colour)[:3]]) / 255
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(one, other):
    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
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


@pytest.mark.slow
@pytest.mark.parametrize("window", ["light", "dark", "paper"])
def test_every_text_stands_out(texts, window):
    faint = [one for one in texts[window] if contrast(*one[1:]) < LEAST_CONTRAST]
    assert faint == []
    assert len(texts[window]) > 15


@pytest.mark.slow
def test_the_page_is_dark_its_pictures_are_light_and_paper_is_white(texts):
    behind = {
        window: {name: luminance(colour) for name, _, colour in texts[window]} for window in texts
    }
    assert behind["dark"]["TD"] < 0.05
    assert behind["dark"]["text"] > 0.7
    assert behind["paper"]["TD"] == behind["light"]["TD"] == 1.0
