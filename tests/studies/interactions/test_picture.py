"""The picture of a study's page: a square for each pair, and names that stay apart."""

from types import SimpleNamespace

from orchestrator.output.report.html.elements import Figures, document
from orchestrator.studies.interactions.view import _heat_picture
from tests.support.chromium import needs_chromium, running_browser

GAP = 4.0  # between two names, at least [px]


@needs_chromium
def test_long_names_do_not_touch_each_other_or_the_squares(tmp_path):
    system = SimpleNamespace(stable=True, least_damping=7.8, critical=object())
    names = [f"MANUFACTURER_{k}" for k in range(4)]
    picture = _heat_picture("pairs", names, [[system] * len(names)] * len(names))
    page = tmp_path / "page.html"
    shown = Figures().add(picture, "")[0]
    assert all(f">{name}<" in shown for name in names)  # none is cut
    page.write_text(document("a", "b", "", [("Pairs", shown)]), encoding="utf-8")
    with running_browser() as browser:
        view = browser.new_page(viewport={"width": 1280, "height": 800})
        view.goto(page.as_uri())
        boxes = view.evaluate(
            "[...document.querySelectorAll('svg text[font-size]')].map(x => x.getBoundingClientRect().toJSON())"
        )
        (left, *_) = view.evaluate(
            "[...document.querySelectorAll('svg rect')].map(x => x.getBoundingClientRect().left)"
        )
    above, beside = boxes[: len(names)], boxes[len(names) :]
    for k, one in enumerate(above):
        for other in above[k + 1 :]:
            aside, below = other["left"] - one["right"], abs(other["top"] - one["top"])
            assert aside >= GAP or below >= one["height"]
    assert all(one["right"] + GAP <= left for one in beside)
    assert all(one["left"] >= 0 for one in beside)
