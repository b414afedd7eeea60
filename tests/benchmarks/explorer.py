"""How long the page takes from an input to the painted map:
`python -m tests.benchmarks.explorer CASE SCENARIO PARAMETER [TIMES]`."""

import os
import statistics
import sys
import threading
import time
from pathlib import Path

from playwright.sync_api import sync_playwright

from orchestrator.face.explore.server import Explorer
from tests.face.explore.test_page import add, computed, opened
from tests.support.chromium import CHROMIUM, OPTIONS

DRAGS = 10_000


def worked(pid):
    """Processor time of a process so far [s]."""
    parts = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(parts[11]) + int(parts[12])) / os.sysconf("SC_CLK_TCK")


def resident(pid):
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def heap(view):
    return view.evaluate("() => { gc(); return performance.memory.usedJSHeapSize / 1e6; }")


def dragged(view, worker, times=DRAGS):
    """Megabytes of page and worker before and after so many drags of the first slider."""
    before = heap(view), resident(worker)
    view.evaluate(
        "async n => { for (let k = 0; k < n; k++) { estimateAt(state.controls[0], 1 + (k % 100)); "
        "if (k % 50 === 0) await new Promise(requestAnimationFrame); } }",
        times,
    )
    return before, (heap(view), resident(worker))


def main(case, scenario, parameter, times=11):
    explorer = Explorer(
        case, {"case": case, "scenario": scenario, "values": {}, "range": [0.1, 2.0]}
    )
    threading.Thread(target=explorer.serve, daemon=True).start()
    with sync_playwright() as tools:
        browser = tools.chromium.launch(
            executable_path=CHROMIUM, args=[*OPTIONS, "--js-flags=--expose-gc"]
        )
        begin = time.monotonic()
        with opened(browser, explorer.address) as view:
            print(f"opened after {time.monotonic() - begin:.1f} s")
            slider = add(view, parameter).locator('input[type="range"]')
            exact, estimate, busy = [], [], []
            worker = explorer.computing["modes"]._process.pid
            for count in range(2, int(times) + 2):
                slider.focus()
                view.evaluate("() => wantSlopes(state.controls[0])")
                while view.evaluate("() => !seen.slopes[slopeKey(state.controls[0])]"):
                    time.sleep(0.05)
                value = view.evaluate(
                    "() => state.values[state.controls[0]] ?? original(state.controls[0])"
                )
                for part in (0.99, 0.98, 0.97):
                    painted = view.evaluate("() => document.body.dataset.estimateCount ?? 0")
                    view.evaluate("x => estimateAt(state.controls[0], x)", part * value)
                    view.wait_for_selector(
                        f'body[data-estimate-count="{int(painted) + 1}"]', state="attached"
                    )
                    estimate.append(float(view.locator("body").get_attribute("data-estimate")))
                before = worked(worker)
                slider.press("ArrowLeft")
                computed(view, count)
                busy.append(1e3 * (worked(worker) - before))
                exact.append(float(view.locator("body").get_attribute("data-exact")))
            for name, found in (
                ("exact", exact),
                ("of them processor time", busy),
                ("estimate", estimate),
            ):
                print(
                    f"{name}: median {statistics.median(found):.0f} ms, {min(found):.0f} to {max(found):.0f}"
                )
            begin = time.monotonic()
            before, after = dragged(view, worker)
            print(
                f"{DRAGS} drags in {time.monotonic() - begin:.0f} s: page {before[0]:.1f} to {after[0]:.1f} MB, "
                f"worker {before[1]:.0f} to {after[1]:.0f} MB"
            )
        browser.close()
    explorer.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
