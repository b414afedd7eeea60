"""A folder of a screening or a sweep in `gfor explore`: its cells, and the live case behind each."""

import json
import math
import threading
from contextlib import contextmanager

import pandas as pd
import pytest

import orchestrator as gfor
from orchestrator.cases.case import load_case
from orchestrator.face.cli import main
from orchestrator.face.explore.copied import copied
from orchestrator.face.explore.server import Explorer
from orchestrator.face.explore.worker import Desk
from orchestrator.linear.spectra.modes import damping_ratio
from orchestrator.output.report.explorer_cells import read_cells
from orchestrator.studies.points.executor import Serial
from orchestrator.studies.points.points import Work
from orchestrator.studies.points.store import PointStore
from orchestrator.studies.screening.request import ScreeningRequest
from orchestrator.studies.screening.study import plan_screening, run_screening
from tests.cases.new.test_widened_limits import new_case
from tests.face.explore.test_page import (
    browser,
    computed,
    needs_chromium,
    of_command,
    opened,
    shown,
)

__all__ = ["browser"]

POINTS = {
    "night": {"load": 0.9, "generation": 0.9},
    "day": {"line_4_5.in_service": 0},
    "late": {"sg3.in_service": 0},
}


@pytest.fixture(scope="module", params=["slack", "droop"])
def screened(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("screened")
    points = pd.DataFrame([{"name": name, **given} for name, given in POINTS.items()])
    screening = gfor.load("wscc9").screen(
        points, "sg3,load_8", "gfor", sharing=request.param, workers=1, progress=False
    )
    screening.save(folder)
    return folder, screening.items()


def test_cells_of_a_screening_have_the_figures_of_its_items(screened):
    folder, items = screened
    study = read_cells(folder)
    assert (study["case"], study["scenario"], [c["name"] for c in study["columns"]]) == (
        "wscc9",
        "gfor",
        [*POINTS],
    )
    places = {
        (r["name"], c["name"]): cell
        for r, row in zip(study["rows"], study["cells"], strict=True)
        for c, cell in zip(study["columns"], row, strict=True)
    }
    assert len(places) >= len(items) == 8
    for item in items.itertuples():
        cell = places[item.outage, item.point]
        assert cell.get("percent", math.nan) == pytest.approx(
            item.least_damping_percent, nan_ok=True
        )
        assert cell.get("stable") == item.stable


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::orchestrator.face.api.scenario.UnusualDataWarning")
def test_the_live_case_of_each_cell_has_the_modes_of_the_screening(screened):
    folder, _ = screened
    study = read_cells(folder)
    desk, seen = Desk(study["case"], False), []
    for row, cells in zip(study["rows"], study["cells"], strict=True):
        for column, cell in zip(study["columns"], cells, strict=True):
            if "percent" not in (cell or {}):
                continue
            question = {
                "ask": "cell",
                "scenario": "gfor",
                "values": study["values"] | column["values"],
                "own": column["out"],
                "lost": row["out"],
                "sharing": study["sharing"],
            }
            values = desk.answer(question, print)["values"]
            modes = gfor.load("wscc9").scenario("gfor", values).modes(tuple(study["range"]))
            least = min(mode.damping_percent for mode in modes)
            # a screening has no communication step
            assert least == pytest.approx(cell["percent"], abs=0.01)
            seen.append((row["name"], column["name"]))
    # a unit out, and a lost load that others feed less for
    assert {("intact", "late"), ("load_8", "day")} <= set(seen)


@pytest.mark.filterwarnings("ignore::orchestrator.face.api.scenario.UnusualDataWarning")
def test_a_cell_beyond_a_limit_is_opened_with_the_limit_widened_as_the_screening_has_it(tmp_path):
    path = new_case(tmp_path, exciter="0.05 -5.0 0.9 /")
    plan = plan_screening(load_case(path), ScreeningRequest(None, "sg3", "base"))
    items = run_screening(plan, Work(Serial(), PointStore(tmp_path / "points"))).items
    (item,) = (one for one in items if one.outage.elements)
    question = {"ask": "cell", "scenario": "base", "own": [], "lost": list(item.outage.elements)}
    desk = Desk(str(path), False)
    values = desk.answer(question, print)["values"]
    assert {one.name: one.taken for one in item.record.widenings}.items() <= values.items()
    modes = gfor.load(path).scenario("base", values).modes()
    seen = item.record.eigenvalues[list(item.record.critical)]
    assert min(mode.damping_percent for mode in modes) == pytest.approx(
        100 * min(map(damping_ratio, seen)), abs=0.01
    )


@pytest.mark.slow
def test_cells_of_a_sweep_are_its_followed_modes(tmp_path):
    sweep = gfor.load("two_area").sweep(
        {"gfor.pod_p.K": [100, 150]}, "pod_p", workers=1, progress=False
    )
    sweep.save(tmp_path)
    study = read_cells(tmp_path)
    table = sweep.table()
    named = table[table["mode"] == "electromechanical"]
    assert [cell["percent"] for cell in study["cells"][0]] == pytest.approx(
        list(named["damping_percent"])
    )
    assert [column["values"] for column in study["columns"]] == [
        {"gfor.pod_p.K": 100.0},
        {"gfor.pod_p.K": 150.0},
    ]
    assert study["followed"] is True


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"format": 7}, "format is 7"),
        ({"cells": []}, "do not fit"),
        ({"rows": [{"name": 3}]}, "rows.0.name"),
        ({"range": None}, "range"),
        ({"values": []}, "values"),
        ({"cells": [[{"percent": float("nan")}]]}, "finite"),
        ({"rows": [], "cells": []}, "rows"),
        (None, "there is no cells.json"),
    ],
)
def test_what_is_no_study_is_refused_by_name(tmp_path, capsys, change, text):
    if change is not None:
        whole = {
            "format": 1,
            "title": "",
            "case": "wscc9",
            "hash": "",
            "scenario": "gfor",
            "range": [0.1, 2.0],
            "values": {},
            "sharing": None,
            "followed": False,
            "rows": [{"name": "a"}],
            "columns": [{"name": "b"}],
            "cells": [[None]],
        }
        (tmp_path / "cells.json").write_text(json.dumps(whole | change), encoding="utf-8")
    assert main(["explore", str(tmp_path), "--no-browser"]) == 2
    error = capsys.readouterr().err
    assert text in error
    assert str(tmp_path) in error


def test_what_is_copied_names_the_step_of_the_study():
    found = copied(gfor.load("infinite_bus").file, "infinite_bus", "dip", {}, (0.1, 2.0), step=5e-4)
    assert found["command"].endswith("--step '0.0005 s'")
    assert "step=0.0005)" in found["python"]
    assert found["toml"].startswith("# with --step '0.0005 s'\n[scenarios.explored]")


@contextmanager
def served(folder):
    study = read_cells(folder)
    beginning = {
        "case": study["case"],
        "scenario": "gfor",
        "values": {},
        "range": study["range"],
        "study": study,
    }
    explorer = Explorer(study["case"], beginning)
    threading.Thread(target=explorer.serve, daemon=True).start()
    yield explorer
    explorer.close()


@needs_chromium
@pytest.mark.slow
@pytest.mark.parametrize("screened", ["slack"], indirect=True)
@pytest.mark.filterwarnings("ignore::orchestrator.face.api.scenario.UnusualDataWarning")
def test_a_click_on_a_cell_opens_it_and_faults_places_and_scenario_are_kept(
    browser,
    screened,
    capsys,
    tmp_path,
    monkeypatch,
):
    monkeypatch.chdir(tmp_path)
    folder, _ = screened
    with served(folder) as explorer, opened(browser, explorer.address) as view:
        assert view.locator("#tab-study").get_attribute("aria-selected") == "true"
        view.locator("#cells").focus()
        view.keyboard.press("ArrowRight")
        view.keyboard.press("Enter")
        view.locator("#study-said", has_text="Open now").wait_for()
        content = of_command(view, capsys)
        least = min(content["modes"], key=lambda m: m["damping_percent"])
        assert (
            f"Live, least damped: {least['frequency_hz']:.3f} Hz, {least['damping_percent']:.2f} %"
            in view.locator("#study-said").inner_text()
        )
        figures = [
            row.locator("td").all_inner_texts()[:2] for row in view.locator("#table tbody tr").all()
        ]
        assert figures == shown(content["modes"])
        view.locator("#tab-network").click()
        bus = view.locator('[data-thing="bus bus_7"]')
        box = bus.locator("circle").bounding_box()
        view.mouse.move(box["x"] + 4, box["y"] + 4)
        view.mouse.down()
        view.mouse.move(box["x"] + 50, box["y"] + 40, steps=4)
        view.mouse.up()
        moved = bus.locator("circle").bounding_box()
        assert abs(moved["x"] - box["x"]) > 20
        bus.click(force=True)
        view.locator("#element button", has_text="add").click()
        computed(view, 3)
        view.locator("#tab-response").click()
        assert "bus fault, bus bus_7, duration 100 ms" in view.locator("#events").inner_text()
        view.locator("#copy").click()
        view.locator("#dialog button", has_text="Save as scenario").click()
        said = view.locator("#dialog [role=status]", has_text="Written: ")
        said.wait_for()
        file = tmp_path / said.inner_text().removeprefix("Written: ").split(",")[0]
    saved = gfor.load(file).scenario("explored")
    assert any("bus_7" in str(event) for event in saved.prepared.events)
    assert "bus_7" in saved.prepared.case.table.diagram.positions
    assert shown(saved.modes().as_json()["scenarios"][0]["modes"]) == shown(content["modes"])


@pytest.mark.slow
def test_a_converter_with_a_pod_can_be_out():
    """Modes are named with all PODs at rest; one that is out of service has no instance to be set."""
    values = {f"grid.{unit}.connected": False for unit in ("gfor1", "sg1")}
    values |= {
        "sg2.P_0": 1.030949925781284,
        "sg3.P_0": 1.0521636820326883,
        "sg4.P_0": 1.030949925781284,
    }
    modes = gfor.load("kundur").scenario("pod_p", values).modes()
    assert min(mode.damping_percent for mode in modes) == pytest.approx(-4.95, abs=0.01)


@needs_chromium
@pytest.mark.slow
@pytest.mark.parametrize("screened", ["slack"], indirect=True)
def test_a_cell_that_cannot_be_opened_has_no_live_figure(browser, screened):
    folder, _ = screened
    with served(folder) as explorer, opened(browser, explorer.address) as view:
        view.evaluate("() => { study().values['gfor3.droop.R_f'] = -1; }")
        view.locator("#cells").focus()
        view.keyboard.press("Enter")
        view.locator("#study-said", has_text="R_f").wait_for()
        assert "Live" not in view.locator("#study-said").inner_text()
