"""The report as a page: what it holds, and what a browser makes of it."""

import re

import numpy as np
import pytest

from orchestrator.core.errors import InputError
from orchestrator.face.cli import main
from orchestrator.output.report.html.charts import (
    ChartCurve,
    Frame,
    Mark,
    complex_plane,
    line_chart,
    thinned,
)
from orchestrator.output.report.html.page import write_report
from tests.support.chromium import needs_chromium, running_browser


@pytest.fixture(scope="module")
def page(undrawn, tmp_path_factory):
    """Run, sweep and design of the two-area case in two scenarios, and the report on them."""
    folder = tmp_path_factory.mktemp("report")
    chosen = ["--scenario", "base", "--scenario", "pod_p"]
    assert main(["run", "two_area", *chosen, "--stop", "5", "--linear", "--out", str(folder)]) == 0
    sweep = folder / "sweep"
    assert (
        main(
            [
                "sweep",
                "two_area",
                *chosen,
                "--vary",
                "grid.X_L=0.05:0.3:4",
                "--workers",
                "1",
                "--out",
                str(sweep),
            ]
        )
        == 0
    )
    assert (
        main(["design", "two_area", "--controller", "pod_p", "--out", str(folder / "pod_p.toml")])
        == 0
    )
    (folder / "somebody_elses.json").write_text("no JSON", encoding="utf-8")
    assert main(["report", str(folder), str(sweep)]) == 0
    return folder / "report.html"


def test_the_page_needs_nothing_but_itself(page):
    text = page.read_text(encoding="utf-8")
    assert len(text) < 1_500_000
    for part in ("src=", "http:", "https:", "@import", "url(http"):
        assert part not in text.replace("http://www.w3.org/2000/svg", "")
    for heading in (
        "What was studied",
        "Operating point",
        "Trajectories along grid.X_L",
        "Design of POD-P",
        "Time responses",
        "Communication step",
        "Provenance",
    ):
        assert f"<h2>{heading}</h2>" in text
    assert "−0.90" in text  # the unstable base case, with its sign
    assert "0.2020" in text  # T_S1
    for margin in ("Gain, upwards", "Phase", "Delay"):
        assert f">{margin}</" in text
    for at in ("84.8° at 0.753 Hz", "49.0 ms at 5.88 Hz", "of the gain: no eigenvalue unstable"):
        assert at in text
    assert "to 20.59 % of the mode's frequency in rad/s, which is 20.17 % of damping" in (
        text.replace("&#x27;", "'")
    )
    assert 'name = "two_area"' in text.replace("&quot;", '"')


@needs_chromium
def test_a_browser_shows_it_without_errors_answers_the_pointer_and_prints(page, tmp_path):
    pypdf = pytest.importorskip("pypdf")
    with running_browser() as browser:
        view = browser.new_page(viewport={"width": 1100, "height": 900})
        errors = []
        view.on("pageerror", lambda error: errors.append(str(error)))
        view.on(
            "console",
            lambda message: errors.append(message.text) if message.type == "error" else None,
        )
        view.goto(page.as_uri())
        charts = view.locator("svg.chart")
        assert charts.count() >= 8
        assert all(
            box["width"] > 300 and box["height"] > 80
            for box in (c.bounding_box() for c in charts.all())
        )

        mark = view.locator("svg g.tip").first
        mark.scroll_into_view_if_needed()
        mark.hover(force=True)
        tooltip = view.locator("#tooltip")
        assert "damping" in tooltip.inner_text()
        assert "Hz" in tooltip.inner_text()

        response = view.locator('svg[data-kind="lines"][aria-label*="Frequency difference"]')
        response.scroll_into_view_if_needed()
        response.hover(position={"x": 400, "y": 60})
        assert "Base (only SG):" in tooltip.inner_text()
        assert "linear" in tooltip.inner_text()

        view.pdf(path=tmp_path / "report.pdf", format="A4")
    assert errors == []
    sheets = pypdf.PdfReader(tmp_path / "report.pdf").pages
    assert 3 < len(sheets) < 20
    assert "Two-area" in sheets[0].extract_text()


@pytest.mark.slow  # or the quick ones would make the page as well
def test_what_is_no_folder_of_a_run_is_said(tmp_path, page):
    with pytest.raises(InputError, match="nothing in it can be used for a report"):
        write_report(tmp_path)
    with pytest.raises(InputError, match="no such file or folder"):
        write_report(page.parent, [tmp_path / "nowhere"])
    (tmp_path / "screening.html").write_text("a page")
    with pytest.raises(
        InputError, match=r"nothing in it can be used for a report.*own: screening.html"
    ):
        write_report(page.parent, [tmp_path])


def test_names_cannot_break_the_page():
    x = np.array([0.0, 1.0])
    svg = line_chart("<b>", "x", "y < 1", [ChartCurve('"><script>alert(1)</script>', "#000", x, x)])
    assert "<script>" not in svg
    assert "<b>" not in svg


def test_a_thinned_curve_keeps_its_peaks():
    x = np.linspace(0, 20, 20_001)
    y = np.sin(40 * x)
    y[7_777] = 5.0
    fewer_x, fewer_y = thinned(x, y)
    assert len(fewer_x) < 700
    assert fewer_y.max() == 5.0
    assert (fewer_x[0], fewer_x[-1]) == (0, 20)


def test_a_frame_without_extent_still_has_axes():
    chart = line_chart(
        "flat", "x", "y", [ChartCurve("c", "#000", np.array([0.0, 1.0]), np.zeros(2))]
    )
    assert "nan" not in chart
    assert Frame((0, 2), (0, 1), "", "").at(1, 0)[0] > 0


def test_a_curve_far_from_zero_fills_its_frame():
    """A frequency that moves by 20 mHz at 50 Hz: the margins are parts of what moves, and not of its value."""
    x, y = np.linspace(0, 1, 50), np.linspace(49.99, 50.01, 50)
    chart = line_chart("frequency", "s", "Hz", [ChartCurve("f", "#000", x, y)])
    (points,) = re.findall(r'<polyline points="([^"]*)"', chart)
    heights = [float(pair.split(",")[1]) for pair in points.split()]
    top, bottom = (
        float(re.search(rf'data-{edge}="(\S+)"', chart)[1]) for edge in ("top", "bottom")
    )
    assert top < min(heights) < top + 0.1 * (bottom - top)
    assert bottom - 0.1 * (bottom - top) < max(heights) < bottom


def test_the_fastest_eigenvalue_stands_in_the_picture():
    """Right of the axis, from which the picture begins; and the right half plane is seen as well."""
    text = complex_plane("plane", [Mark(x, 2.0, "red", "a mode", "circle") for x in (-10.0, 0.0)])
    fastest, still = (float(x) for x in re.findall(r'<circle class="tip" cx="(\S+)"', text))
    begin, end = (
        Frame((0, 1), (0, 1), "", "").at(0, 0)[0],
        Frame((0, 1), (0, 1), "", "").at(1, 0)[0],
    )
    assert begin + 10 < fastest < still < end


def test_rays_of_equal_damping_stand_at_their_percent():
    """Each ends where it leaves the picture; its slope is that of its damping, f/|σ| = sqrt(1 − ζ²)/(2π·ζ)."""
    text = complex_plane("plane", [Mark(-1.0, 2.0, "red", "a mode")])
    shown = [
        int(percent) for percent in re.findall(r'<text class="faint"[^>]*>(\d+) %</text>', text)
    ]
    assert shown == [5, 10, 15, 20, 30]
    rays = [
        [float(x) for x in ray]
        for ray in re.findall(r'class="ray" d="M(\S+) (\S+)L(\S+) (\S+)"', text)
    ]
    steepness = [(y0 - y1) / (x0 - x1) for x0, y0, x1, y1 in rays]
    wanted = [np.sqrt(1 - z**2) / z for z in np.array(shown) / 100]
    assert np.array(steepness) / steepness[0] == pytest.approx(
        np.array(wanted) / wanted[0], rel=0.02
    )
