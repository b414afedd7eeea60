"""The pictures of the page on `gfor explore`: `python -m tests.face.explore.pictures` takes them anew, in Chromium."""

import io
import threading
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

from orchestrator.face.explore.server import Explorer
from tests.face.explore.test_page import add, computed, opened
from tests.support.chromium import CHROMIUM, OPTIONS

PLACE = Path(__file__).parents[3] / ".docs" / "how-to" / "pictures"


def taken(view, name):
    view.wait_for_function("() => !atWork.size")
    view.evaluate("() => { seen.timing.text = ''; tick(); }")  # how busy this machine was
    picture = Image.open(io.BytesIO(view.screenshot())).convert("RGB").quantize(96)
    picture.save(PLACE / f"{name}.png", optimize=True)


def main():
    PLACE.mkdir(exist_ok=True)
    beginning = {"case": "two_area", "scenario": "pod_p", "values": {}, "range": [0.1, 2.0]}
    explorer = Explorer("two_area", beginning)
    threading.Thread(target=explorer.serve, daemon=True).start()
    with sync_playwright() as tools:
        browser = tools.chromium.launch(executable_path=CHROMIUM, args=OPTIONS)
        with opened(browser, explorer.address) as view:
            view.locator("#map .mark").first.click(force=True)
            view.locator("#pin").click()
            control = add(view, "gfor.pod_p.K")
            for count, gain in ((2, 160), (3, 120), (4, 90)):
                control.locator('input[type="text"]').fill(str(gain))
                control.locator('input[type="text"]').press("Enter")
                computed(view, count)
            add(view, "grid.X_L")
            view.locator("#search").fill("")
            view.mouse.move(10, 880)
            taken(view, "explore-modes")
            view.locator("#tab-network").click()
            view.locator('.thing[data-thing="line L"] .hit').click(force=True)
            view.mouse.move(10, 880)
            taken(view, "explore-network")
            view.locator("#tab-response").click()
            view.locator("#signals").fill("sg1.omega - sg2.omega, gfor.p")
            view.locator("#signals").press("Tab")
            view.locator("#linear").click()
            view.locator("#plots .curve.linear").first.wait_for(state="attached")
            view.mouse.move(10, 880)
            taken(view, "explore-response")
        browser.close()
    explorer.close()


if __name__ == "__main__":
    main()
