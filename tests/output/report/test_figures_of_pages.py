"""Every figure of a report's pages is one of the results that it tells of, and a run's power flow that of its FMUs."""

import csv
import json
import re

import numpy as np
import pytest
import xarray as xr

import orchestrator as gfor
from orchestrator.cases.scenario.flow_figures import power_flow_json
from orchestrator.face.cli import main
from orchestrator.output.report.html.page import write_report
from orchestrator.studies.modes.modes import running
from orchestrator.studies.runs.files import _power_flow
from tests.support.figures import (
    SLIPS,
    foreign_in_json,
    foreign_in_page,
    unlike_eigenvalues,
    unseen_in_page,
    unseen_slips,
)

S_BASE = 100.0  # [MVA]
RATINGS = {"gfor": 1500.0, "sg1": 1500.0, "sg2": 5000.0}  # [MVA]


@pytest.fixture(scope="module")
def folder(undrawn, tmp_path_factory):
    """Results of five studies, and a page of them all."""
    place = tmp_path_factory.mktemp("pages")
    points = place / "points.csv"
    points.write_text("name,grid.X_L\nshort,0.0513\nusual,0.1137\n", encoding="utf-8")
    for scenario, words in (
        ("gfor", ["run", "--stop", "3", "--linear"]),
        ("gfor", ["modes"]),
        ("gfor", ["screen", "--points", str(points), "--workers", "1"]),
        ("base", ["site"]),
        ("gfor", ["scr"]),
    ):
        study, *more = words
        given = [study, "two_area_rms", "--scenario", scenario, *more, "--out", str(place / study)]
        assert main(given) in (0, 2)
    return place


def numbers_in(folder):
    """All figures that the results' files hold; sizes of files, which manifests have, are none of a study."""
    held = {}
    for path in folder.glob("*/*"):
        if path.suffix == ".json":
            held[path] = json.loads(path.read_text(encoding="utf-8"))
            if path.name == "manifest.json":
                for file in held[path]["files"].values():
                    file.pop("bytes")
        if path.suffix == ".csv" and path.parent != folder:
            rows = csv.DictReader(path.read_text(encoding="utf-8").splitlines())
            held[path] = [{key: as_number(text) for key, text in row.items()} for row in rows]
    return list(held.values())


def as_number(text):
    try:
        return float(text)
    except ValueError:
        return None


STUDIES = ("run", "modes", "screen", "site", "scr")
LOAD_CHANGE = 1.01
OF_THE_SOURCE = [631, 2020, 40, 47, 2024]
"""Numbers of the norm, its tables and years, which the case names as its source."""


def deviations(run):
    """How far the plotted signals go from where they start, worked out of the recording."""
    recorded = xr.open_dataset(run / "gfor" / "trajectory.nc")
    swing = recorded["sg1.omega"] - recorded["sg2.omega"]
    shown = [recorded["gfor.delta_p_pod"], recorded["gfor.p"], recorded["gfor.q"], 1e3 * swing]
    shown += [recorded["gfor.omega"]]
    return [float(abs(signal - signal[0]).max()) for signal in shown]


def test_of_the_page(folder):
    page = write_report(folder / "run", [folder / name for name in STUDIES[1:]]).read_text("utf-8")
    page = re.sub(r"\d{4}-\d\d-\d\d \d\d:\d\d", "", page.replace(str(folder), ""))
    page = re.sub(r"(?<![-\w])[0-9a-f]{12,}\b", "", page)  # hashes: 61388682e044 reads as a figure
    held = numbers_in(folder)
    site = json.loads((folder / "site" / "site.json").read_text(encoding="utf-8"))
    # a page of `gfor site` counts by 100 MW/Hz
    by_100 = [100 * bus["shift"]["electromechanical"]["damping_points"] for bus in site["buses"]]
    advised = [float(text) for text in re.findall(r"--stop ([\d.]+)", str(held))]
    source = [held, deviations(folder / "run"), by_100, OF_THE_SOURCE, advised, LOAD_CHANGE]
    assert foreign_in_page(page, source) == []
    assert unseen_in_page(page, source) == []
    assert "Mode [rad/s]" in page
    assert unlike_eigenvalues(page) == []


def test_of_a_runs_power_flow():
    """MW and Mvar of units, branches and losses, from the currents that the FMUs give and the line's reactance."""
    prepared = gfor.load("two_area_rms").scenario("gfor").prepared
    said = _power_flow(prepared)
    with running(prepared) as master:
        ports = {
            name: master.components[name].values(["v_re", "v_im", "i_re", "i_im"])
            for name in ("gfor", "sg1", "sg2")
        }
    voltages = {name: complex(p["v_re"], p["v_im"]) for name, p in ports.items()}
    powers = {
        name: S_BASE * voltages[name] * complex(p["i_re"], -p["i_im"]) for name, p in ports.items()
    }
    ends = voltages["gfor"], voltages["sg2"]
    current = (ends[0] - ends[1]) / 0.1j
    flows = [S_BASE * ends[0] * current.conjugate(), -S_BASE * ends[1] * current.conjugate()]
    parts = [[z.real, z.imag] for z in (*powers.values(), *flows)]
    total, fed = sum(powers.values()).real, powers["sg2"].real
    source = {
        "power_percent": 100 * fed / total,
        "loading_percent": [100 * abs(powers[n]) / S for n, S in RATINGS.items()],
        "all": [parts, total, fed, sum(flows).real, list(RATINGS.values())],
        "voltages": [[abs(v), np.degrees(np.angle(v))] for v in ends],
    }
    for shown in (said, power_flow_json(prepared)):
        assert foreign_in_json(shown, source) == []
        assert unseen_slips(shown, source) == []
    for slip, factor in SLIPS.items():
        wrong = {"p_mw": factor * said["units"]["gfor"]["p_mw"]}
        assert foreign_in_json(wrong, source), slip
