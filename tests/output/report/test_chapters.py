"""A report of results of any study: its first page, its chapters, what cannot be used, and what changed since."""

import json
import re
import shutil
import warnings
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from orchestrator.core.errors import InputError
from orchestrator.output.report.html.chapters.devices import of_strengths
from orchestrator.output.report.html.chapters.files import _without_answer, chapters_of
from orchestrator.output.report.html.chapters.runs import of_run
from orchestrator.output.report.html.chapters.studies import (
    _without_derivative,
    of_screening,
    of_site,
    of_sweep,
)
from orchestrator.output.report.html.elements import table, with_units_held
from orchestrator.output.report.html.first_page import first_page
from orchestrator.output.report.html.least_damped import LeastDamped
from orchestrator.output.report.html.page import _PICTURE, _with_first_picture_above, write_report
from orchestrator.output.report.html.sections import findings
from orchestrator.output.results import origin
from orchestrator.output.results.manifest import ResultsWarning, read_manifest, write_manifest
from orchestrator.studies.sweep.limit import Ending, ParameterLimit, Until

SHEET = {
    "controller": "pod_p",
    "target_mode": {"real": -0.39, "imag": 3.65},
    "predicted_mode": {"real": -0.7, "imag": 3.65},
    "achieved_mode": {"real": -0.8, "imag": 3.6},
    "sensitivity": {"magnitude": 0.01, "phase_deg": 30.0},
    "T_S1": 0.2,
    "T_S2": 0.1,
    "N_S": 2,
    "K": 200.0,
    "K_unbounded": 150.0,
    "met": False,
    "verdict": "not met: <b>20 %</b> are wanted",
    "target_damping_ratio": 0.106,
    "achieved_damping_ratio": 0.18,
    "requirement": {"damping_ratio": 0.2},
    "mode": "electromechanical",
    "warnings": ["two modes are close"],
    "questions": ["what are its loads?"],
}
SCREENING = {
    "questions": ["no governor?"],
    "points": 2,
    "outages": 3,
    "items": 8,
    "stable": None,
    "counted_at_all_frequencies": False,
    "modes": [
        {
            "worst": {
                "point": "mon",
                "outage": "line_1",
                "frequency_hz": 0.93,
                "damping_percent": 3.8,
            }
        }
    ],
    "failures": [
        {
            "point": "mon",
            "outage": "sg3",
            "status": "no power flow",
            "why": "sg5 would need 129 %. Let other units share it",
        }
    ],
}
CHECK = {
    "fmu": "vendor.fmu",
    "trusted": False,
    "faults": ["wrong rated frequency"],
    "not_supported": [],
    "checks": [
        {
            "question": "Is it at rest?",
            "verdict": "fail",
            "evidence": "omega is 0.8333",
            "remedy": "set f_n",
            "figures": {"not_judged": "anything after it"},
        }
    ],
}
CERTIFICATE = {
    "sentence": "It passes at all.",
    "verdict": "passes",
    "passed": True,
    "files": {},
    "seal": "0",
    "judged": "9 of 9",
    "missing": [],
    "departures": [],
    "acceptance": {"checks": [{"figures": {"not_judged": "what dips leave behind"}}]},
    "points": [{"X_L": 0.1, "warnings": {"pod": ["1.2 pu at X_L = 0.1"]}}],
}
COMPARISON = [
    {
        "expression": "sg1.omega",
        "unit": "pu",
        "deviations": [1, 2],
        "largest": 0.5,
        "at": 1.2,
        "rms": 0.1,
    }
]

IDENTIFIED = [
    {
        "real": -0.3,
        "imag": 5.8,
        "frequency_hz": 0.923,
        "damping_percent": 5.2,
        "amplitude": 0.1,
        "doubts": ["it is at the window's edge"],
    }
]

SENSITIVITIES = [
    {
        "derivative": "total",
        "scenario": "pod",
        "stable": True,
        "warnings": ["beyond its rating: gfor"],
        "mode": {"frequency_hz": 0.9, "damping_percent": 4.2, "name": None},
        "sensitivities": [
            {
                "parameter": f"gfor.{name}",
                "value": 1.0,
                "unit": "pu",
                "damping_points_per_percent": points,
                "frequency_hz_per_percent": 0.0,
                "doubts": "",
                "reason": "" if points else "it holds no steady state",
            }
            for name, points in (("a", 0.01), ("b", -0.2), ("c", None))
        ],
    }
]
INTERACTIONS = {
    "interaction_modes": [{}],
    "worst_pair": ["A", "B"],
    "unknown_pairs": [],
    "vendors": ["A", "B"],
    "stand_in": "x",
    "pairs": [{"vendors": ["A", "B"], "stable": True, "sentence": "A and B agree"}],
    "warnings": [],
    "as_in_the_case": {"stable": False},
}
SOURCE = [
    {
        "record": "ring",
        "places": ["N", "S"],
        "remarks": ["a gap"],
        "questions": ["is H meant?"],
        "oscillations": [
            {
                "frequency_hz": 0.8,
                "kind": "forced",
                "source": "sg2",
                "reason": "it feeds",
                "advice": "look there",
            },
            {
                "frequency_hz": 1.1,
                "kind": "not known",
                "source": None,
                "reason": "too short",
                "advice": "record longer",
            },
        ],
    }
]
SCR = {
    "convention": "from 1 pu",
    "scenarios": [
        {
            "name": name,
            "buses": [
                {"bus": "bus_1", "s_sc_mva": 900.0, "scr": 3.0},
                {"bus": "bus_2", "s_sc_mva": 400.0, "scr": None},
            ],
        }
        for name in ("base", "pod")
    ],
}


@pytest.fixture
def folders(tmp_path):
    """A folder of each study, with its JSON alone."""
    for name, file, content in (
        ("design", "pod_p.json", SHEET),
        ("screen", "screening.json", SCREENING),
        ("check", "check.json", CHECK),
        ("certify", "certificate.json", CERTIFICATE),
        ("compare", "differences.json", COMPARISON),
        ("ring", "ring.json", IDENTIFIED),
        ("moved", "sensitivities.json", SENSITIVITIES),
        ("vendors", "interactions.json", INTERACTIONS),
        ("source", "source.json", SOURCE),
        ("scr", "scr.json", SCR),
    ):
        (tmp_path / name).mkdir()
        (tmp_path / name / file).write_text(json.dumps(content), encoding="utf-8")
    names = (
        "design",
        "screen",
        "check",
        "certify",
        "compare",
        "ring",
        "moved",
        "vendors",
        "source",
        "scr",
    )
    return [tmp_path / name for name in names]


def written(folders, tmp_path, **more):
    return write_report(folders[0], folders[1:], tmp_path / "page.html", **more).read_text(
        encoding="utf-8"
    )


def test_a_headline_breaks_nowhere_between_a_figure_and_its_unit():
    held = with_units_held('<p class="verdict"><b>-0.90 % at 2 of 3, 12 s</b></p><pre>12 s</pre>')
    assert held == (
        '<p class="verdict"><b>−0.90\N{NO-BREAK SPACE}% at 2 of 3, 12\N{NO-BREAK SPACE}s</b></p><pre>12 s</pre>'
    )


def test_the_first_page_answers_every_study(folders, tmp_path):
    text = written(folders, tmp_path)
    first = text[: text.index("<section")]
    for said in (
        "not as required: with K = 200 pu the mode has 18.00 % of damping, 10.60 % before, 20.00 % wanted",
        "not known whether stable everywhere of 2 operating points and 3 outages; least damped 0.930 Hz, 3.80 %",
        "mon, outage sg3: no power flow: sg5 would need 129 %",
        "growth outside of the range was counted at some of them only",
        "vendor.fmu: wrong rated frequency",
        "anything after it",
        "It passes at all.",
        "judged: 9 of 9",
        "what dips leave behind",
        "1.2 pu at X_L = 0.1",
        "sg1.omega differs most, by 0.5 pu at 1.200 s",
        "two modes are close",
        "strongest oscillation: 0.923 Hz, 5.20 %",
        "what are its loads?",
        "is H meant?",
        "no governor?",
        "0.900 Hz, 4.20 %: most by gfor.b (−0.2), gfor.a (+0.01) points for 1 % more",
        "it holds no steady state",
        "0.923 Hz: it is at the window's edge".replace("'", "&#x27;"),
        "beyond its rating: gfor",
        "0.800 Hz: forced, from sg2; 1.100 Hz: not known",
        "1.100 Hz: too short",
        "a gap",
        "weakest is bus_2 with 400 MVA, SCR 3.00 at bus_1 (base, pod)",
    ):
        assert said in first
    assert 'class="bad">not as required' in first
    assert 'class="bad">UNSTABLE as in the case; 1 mode that vendors share; A and B agree' in first
    assert first.count("<svg") == 1
    assert 'class="good">It passes' in first
    assert "<b>20 %</b>" not in text  # a verdict is text


def test_a_chapter_takes_the_sections_of_the_results_own_page(folders, tmp_path):
    page = '<nav></nav><section id="section-0"><h2>Outages</h2><a href="#figure-1">1</a><i id="figure-1"></i></section>'
    (folders[1] / "screening.html").write_text(f"<main>{page}</main>", encoding="utf-8")
    text = written(folders, tmp_path)
    assert "<h3>Outages</h3>" in text
    assert 'href="#chapter-2-figure-1"' in text
    assert 'id="chapter-2-figure-1"' in text


def test_provenance_names_command_code_and_date(gfor, tmp_path):
    code, _, err = gfor(
        "modes", "two_area_rms", "--scenario", "gfor", "--out", str(tmp_path / "modes")
    )
    assert code == 0, err
    code, _, err = gfor("report", str(tmp_path / "modes"))
    assert code == 0, err
    text = (tmp_path / "modes" / "report.html").read_text(encoding="utf-8")
    manifest = json.loads((tmp_path / "modes" / "manifest.json").read_text())
    assert manifest["command"].startswith("gfor modes two_area_rms --scenario gfor --out ")
    assert manifest["code"][:12] in text
    assert "SG + GFOR: stable, least damped 0.581 Hz, 10.63 %" in text
    assert "nothing was run" in text


@pytest.mark.usefixtures("undrawn")
def test_a_runs_row_says_what_was_given_and_which_models_were_run(gfor, tmp_path):
    given = (
        "--set",
        "models=emt",
        "--step",
        "100 us",
        "--stop",
        "10 ms",
        "--fault",
        "bus_2, 5 ms, from 2 ms",
    )
    assert gfor("run", "two_area_rms", "--scenario", "gfor", *given, "--out", tmp_path)[0] == 0
    text = write_report(tmp_path, short=True).read_text(encoding="utf-8")
    text = text.replace("\N{NO-BREAK SPACE}", " ")
    assert (
        "SG + GFOR, with fault &quot;bus_2, 5 ms, from 2 ms&quot;, models = emt: not known" in text
    )
    assert "<li>How sure: EMT models, loads constant impedance" in text
    assert "phasor models; modes" not in text


def test_what_changed_since_an_older_page(folders, tmp_path):
    written(folders, tmp_path)
    old = shutil.copy(tmp_path / "page.html", tmp_path / "old.html")
    assert "No answer differs from old.html" in written(
        folders, tmp_path, against=tmp_path / "old.html"
    )
    (folders[0] / "pod_p.json").write_text(
        json.dumps(SHEET | {"warnings": ["gfor is beyond its rating"]})
    )
    text = written(folders, tmp_path, against=old)
    assert (
        "doubt: gfor is beyond its rating"
        in text[text.index("Answers that differ") : text.index("</section>")]
    )
    (folders[0] / "pod_p.json").write_text(
        json.dumps(SHEET | {"met": True, "K": 300.0}), encoding="utf-8"
    )
    text = written(folders[:4], tmp_path, against=old)
    changed = text[text.index("Answers that differ") : text.index("</section>")]
    assert "not as required: with K = 200" in changed
    assert "yes: with K = 300" in changed
    assert "not there any more" in changed
    assert "It passes" not in changed


def test_figures_that_moved_between_two_folders(folders, tmp_path):
    new = tmp_path / "new" / "inner"
    shutil.copytree(folders[1], new)
    worst = {"point": "mon", "outage": "line_1", "frequency_hz": 0.93, "damping_percent": 4.5}
    (new / "screening.json").write_text(json.dumps(SCREENING | {"modes": [{"worst": worst}]}))
    text = write_report(new.parent, [], tmp_path / "page.html", folders[1], short=True).read_text(
        encoding="utf-8"
    )
    assert "3.80 to 4.50 (+0.7)" in text
    both = written([folders[1], new], tmp_path, against=folders[1])
    assert "not there" in both[both.index("Answers that differ") :]  # its twin is as it was
    assert "Which operating point and which outage is worst? (inner)" in both
    written([new, folders[1]], tmp_path)
    old = shutil.copy(tmp_path / "page.html", tmp_path / "old.html")
    text = written([folders[1]], tmp_path, against=old)
    changed = text[text.index("Answers that differ") : text.index("</section>")]
    assert "not there any more" in changed
    assert "+0.7" not in changed  # the other folder's answer is no earlier one of this


def in_another_folder(folders, tmp_path, **worst):
    """The screening once more, elsewhere, with another least damped mode; what the page says changed."""
    new = tmp_path / "new" / "inner"
    shutil.copytree(folders[1], new)
    place = {"point": "mon", "outage": "line_1"}
    shares = worst.pop("participation")
    mode = {"worst": place | worst, "participation": shares}
    (new / "screening.json").write_text(json.dumps(SCREENING | {"modes": [mode]}))
    page = tmp_path / "page.html"
    text = write_report(new.parent, [], page, folders[1], short=True).read_text(encoding="utf-8")
    return text[text.index("Answers that differ") : text.index("</section>")]


@pytest.mark.parametrize(
    ("frequency", "shares", "like"),
    [
        (0.93, {"sg1": 0.6, "sg2": 0.3}, True),
        (0.85, {"sg1": 0.5, "sg2": 0.3, "gfor": 0.2}, True),
        (1.40, {"sg1": 0.6, "sg2": 0.3}, False),  # beyond 30 % of the frequency
        (0.95, {"sg3": 0.7, "sg1": 0.2}, False),  # a machine's own mode close by
    ],
)
def test_the_least_damped_of_two_results_may_be_two_modes(
    folders, tmp_path, frequency, shares, like
):
    """The swing rose beyond the other mode, which is least damped now: 3.80 to 4.50 is no change of either."""
    first = SCREENING["modes"][0] | {"participation": {"sg1": 0.6, "sg2": 0.3}}
    (folders[1] / "screening.json").write_text(json.dumps(SCREENING | {"modes": [first]}))
    changed = in_another_folder(
        folders, tmp_path, frequency_hz=frequency, damping_percent=4.5, participation=shares
    )
    assert ("3.80 to 4.50 (+0.7)" in changed) is like
    who = max(shares, key=shares.get)
    said = (
        "figures of another mode: 0.930 Hz, 3.80 % (sg1) before, "
        f"{frequency:.3f} Hz, 4.50 % ({who}) now"
    )
    assert (said in changed) is not like


def test_a_page_that_keeps_no_modes_tells_no_change_of_one(folders, tmp_path):
    """As pages were before they kept whose figures they give."""
    written(folders, tmp_path)
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    old = tmp_path / "old.html"
    old.write_text(re.sub(r'"least":\[[^]]*\],', "", page).replace("3.80 %", "3.10 %"))
    assert '"least"' not in old.read_text(encoding="utf-8")
    text = written(folders, tmp_path, against=old)
    changed = text[text.index("Answers that differ") : text.index("</section>")]
    assert "the older page does not say which modes its figures are of" in changed
    assert "3.10 to 3.80" not in changed


def test_a_design_s_limiting_mode_may_be_another_one():
    """As a design over points gives it: an eigenvalue and the machine that takes part most."""
    mode = {"real": -0.35, "imag": 6.9, "damping_ratio": 0.0507, "who": "sg1"}
    first = LeastDamped.of_design_mode(mode)
    assert first.words == "1.098 Hz, 5.07 % (sg1)"
    assert first.is_like(LeastDamped.of_design_mode(mode | {"real": -0.5}))
    assert not first.is_like(LeastDamped.of_design_mode(mode | {"who": "sg3"}))
    assert not first.is_like(LeastDamped.of_design_mode(mode | {"imag": 3.4}))


def test_a_run_tells_whose_modes_its_figures_are_of(folders, tmp_path):
    """Of a run, and of what its events leave: each figure has its own mode."""
    least = {"frequency_hz": 0.54, "damping_percent": 3.2, "components": {"sg1": 0.9}}
    later = {"frequency_hz": 1.1, "damping_percent": 2.1, "components": {"sg3": 0.8}}
    scenario = {"name": "base", "answer": least | {"stable": True, "after_events": later}}
    told = of_run(tmp_path, [scenario]).least
    assert [mode.words for mode in told] == ["0.540 Hz, 3.20 % (sg1)", "1.100 Hz, 2.10 % (sg3)"]
    assert not told[0].is_like(told[1])


def test_what_cannot_be_used_is_named(folders, tmp_path):
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "table.json").write_text('{"a": 1}')
    (tmp_path / "other" / "notes.html").write_text("a page")
    with pytest.raises(
        InputError, match=r"other: nothing in it can be used.*own: notes.html.*run, modes, screen"
    ):
        write_report(folders[0], [tmp_path / "other"], tmp_path / "page.html")
    with pytest.raises(InputError, match="no such file or folder"):
        write_report(folders[0], [tmp_path / "nowhere"])
    (folders[2] / "check.json").write_text(json.dumps(CHECK | {"checks": None}))
    with pytest.raises(InputError, match=r"check.json: it is not as its study writes it"):
        write_report(folders[2], [], tmp_path / "page.html")
    with pytest.raises(InputError, match="it is no page of `gfor report`"):
        write_report(folders[0], [], tmp_path / "page.html", tmp_path / "other" / "notes.html")


def test_a_file_that_was_changed_since_is_refused(gfor, tmp_path):
    code, _, err = gfor(
        "site", "two_area_rms", "--scenario", "gfor", "--confirm", "0", "--out", str(tmp_path)
    )
    assert code == 0, err
    assert "where to put POD-P" in (tmp_path / "site.html").read_text(encoding="utf-8")
    write_report(tmp_path)
    assert "bus_2 is the best place for POD-P" in (tmp_path / "report.html").read_text(
        encoding="utf-8"
    )
    content = (tmp_path / "site.json").read_text().replace("bus_2 is the best", "bus_3 is the best")
    (tmp_path / "site.json").write_text(content)
    with pytest.raises(InputError, match="SHA-256 differs"):
        write_report(tmp_path)


def test_a_page_tells_of_the_mode_that_the_name_was_without_the_controller(gfor, tmp_path):
    """With this gain another mode, at 0.202 Hz, fits the name as well."""
    planted = "--set", "grid.X_L=0.3", "--set", "gfor.pod_p.K=200"
    assert (
        gfor(
            "modes",
            "two_area",
            "--scenario",
            "gfor",
            "--scenario",
            "pod_p",
            *planted,
            "--out",
            tmp_path,
        )[0]
        == 0
    )
    assert gfor("report", tmp_path, "--out", tmp_path / "page.html")[0] == 0
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    rows = [
        re.sub(r"<[^>]+>", " ", row).split() for row in re.findall(r"<tr>.*?</tr>", page, re.DOTALL)
    ]
    named = [row for row in rows if "electromechanical" in row]
    assert [row[row.index("electromechanical") - 2] for row in named] == ["0.3502", "0.7257"]


def test_the_answer_of_a_search_for_a_limit_is_on_the_page(tmp_path):
    tried = [
        {"value": v, "kind": kind, "damping_percent": 5.0}
        for v, kind in ((2.0, "fails"), (9.0, "holds"))
    ]
    limit = ParameterLimit(
        "grid.scr",
        "1",
        "base",
        "Base",
        Until(),
        Ending.FAILS,
        6.87,
        6.86,
        None,
        "",
        tried,
        (),
        "",
        2.0,
    )
    (tmp_path / "limits.json").write_text(json.dumps([limit.as_json()]), encoding="utf-8")
    (chapter,) = chapters_of(tmp_path)
    swept = xr.Dataset({"damping": ("k", [3.0]), "named": ("k", [1])})
    assert of_sweep(tmp_path, swept).answer == chapter.answer
    assert (chapter.question, chapter.answer) == (
        "How far may grid.scr go?",
        f"base: {limit.sentence}",
    )
    assert "6.87" in chapter.answer


def made(folder, name, content, run="r", **inputs):
    folder.mkdir(exist_ok=True)
    (folder / f"{name}.json").write_text(json.dumps(content), encoding="utf-8")
    command = f"gfor {name} --json own.toml --set models=emt --html=p.html --parameters p.toml --out {folder}"
    origin.said.append(lambda: {"command": command, "inputs": inputs})
    write_manifest(folder, run, [f"{name}.json"])
    origin.said.pop()
    return folder


def test_results_of_two_versions_of_a_file_are_not_one_study(tmp_path):
    first = made(tmp_path / "old", "scr", SCR, **{"own.raw": "1a", "old/ring.csv": "5"})
    again = made(tmp_path / "again", "scr", SCR, **{"net/own.raw": "1a", "again/ring.csv": "6"})
    edited = made(tmp_path / "new", "scr", SCR, **{"own.raw": "2b"})
    assert "one study" not in written([first, again], tmp_path)
    for code in ("nts", "ercot"):  # each certificate keeps files of the same names
        sealed = CERTIFICATE | {"made": "2026-01-01", "files": {"converter.fmu": code}}
        made(tmp_path / code, "certificate", sealed)
    assert "one study" not in written([tmp_path / "nts", tmp_path / "ercot"], tmp_path)
    with pytest.warns(
        ResultsWarning, match=r"own\.raw differs between .*old.*again.*and .*new.*not comparable"
    ):
        text = written([first, again, edited], tmp_path, short=True)
    assert 'class="bad">own.raw differs between' in text
    kept = json.loads(text[text.index('id="answers">') + 13 :].partition("</script>")[0])
    assert kept[0]["answer"].startswith("NO: own.raw differs")
    assert kept[1]["given"] == "gfor scr own.toml --set models=emt --parameters p.toml"


def basis(machine="genrou", loads="constant power", network="own.raw"):
    return {
        "models": "emt",
        "basis": {"network": network, "loads": loads, "machines": {"sg1": machine, "sg2": machine}},
    }


@pytest.mark.parametrize(
    ("other", "said"),
    [
        (basis(), ""),
        ({}, ""),
        (
            basis("genrou, emf e''"),
            "model of sg1 of own.raw and 1 more: genrou in .*one.* and genrou, emf e'' in .*two",
        ),
        (
            basis(loads="constant impedance"),
            "load model of own.raw: constant power in .*, and constant impedance in ",
        ),
        (
            basis("gencls", network="new.raw"),
            "network: own.raw in .*one.* and new.raw in .*two.*; figures are not",
        ),
    ],
)
def test_rows_of_other_networks_or_models_are_told_above_them(tmp_path, other, said):
    places = [
        made(tmp_path / "one", "design", SHEET | basis()),
        made(tmp_path / "two", "screening", SCREENING | other),
    ]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        text = written(places, tmp_path, short=True)
    found = [str(one.message) for one in caught]
    assert len(found) == bool(said)
    assert re.search(said, "".join(found))
    assert ("one study" in text) == bool(said)
    assert "EMT models, loads constant power; " in text


def test_a_fault_has_a_question_of_its_own(tmp_path):
    calm = {"name": "base", "title": "Base", "stable": True, "warnings": ["not solved"]} | basis()
    hit = calm | {
        "name": "hit",
        "title": "Hit",
        "stable": False,
        "events": ["t = 1 s: grid.b.fault.R = 0, grid.b.fault.on = 1"],
        "bus_faults": ["b"],
    }
    asked = {
        s["name"]: of_run(tmp_path, [s]).question
        for s in (calm, hit, calm | {"events": ["t = 1 s: sg1.P_ref = 1"]})
    }
    assert asked == {
        "base": "Is the network stable, and which swing is damped least?",
        "hit": "Is the fault survived, and which swing is damped least?",
    }


def test_open_points_of_a_site_are_those_that_the_study_names(tmp_path):
    site = {"agrees": True, "confirmed": True, "answer": "bus_2", "sure": []}
    file = tmp_path / "site.json"
    remark = {"remarks": ["not judged is how a remark may begin"]}
    assert not of_site(file, site | remark).not_judged
    open_points = ["outage tie: it has no power flow"]
    assert of_site(file, site | remark | {"open_points": open_points}).not_judged == open_points
    (left_out,) = of_site(file, site | {"terminals_left_out": ["bus_30", "bus_31"]}).not_judged
    assert left_out.startswith("the terminals of units, bus_30, bus_31")


SHAKY = {"stable": False, "verdict": "UNSTABLE", "frequency_hz": 0.57, "damping_percent": -0.9}
CALM = {"stable": True, "verdict": "stable", "frequency_hz": 0.76, "damping_percent": 22.6}


@pytest.mark.parametrize(
    ("counted", "sure", "lost"),
    [
        (2, "growth outside of the range was counted at 2 of 7 of them only", True),
        (0, "growth outside of the range was counted at 0 of 7 of them only", True),
        (7, "growth was counted at all frequencies", False),
        (True, "growth was counted at all frequencies", False),
        (False, "growth outside of the range was counted at some of them only", False),
    ],
)
def test_a_screening_says_at_how_many_cases_growth_was_counted(tmp_path, counted, sure, lost):
    """Two counted cases of 49 were once told as *at all frequencies*; results of earlier versions have yes or no."""
    found = of_screening(
        tmp_path / "screening.json", SCREENING | {"counted_at_all_frequencies": counted}
    )
    assert found.sure == f"7 of 8 cases computed, {sure}"
    assert any("--whole" in text for text in found.not_judged) == lost
    assert not any("not computed yet" in text for text in found.not_judged)


def test_a_page_of_one_study_asks_its_question_once_above_the_answer(tmp_path):
    text = written([made(tmp_path / "screen", "screening", SCREENING)], tmp_path, short=True)
    assert text.count('<p class="question">') == 0
    assert "<h1>Which operating point and which outage is worst?</h1>" in text
    design = written([made(tmp_path / "design", "design", SHEET)], tmp_path, short=True)
    assert design.count('<p class="question">') == 1  # its title names the controller


def test_a_picture_takes_its_legend_along_to_the_first_page():
    """The reddest bus of a siting need not be the best place: the caption says what the colours are."""
    caption = "<figcaption><b>Figure 1.</b> the redder</figcaption>"
    text = f'<figure id="figure-1"><svg class="chart">…</svg>{caption}</figure><p>further</p>'
    (found,) = re.findall(_PICTURE, text, re.DOTALL)
    assert found.endswith(caption)


def test_an_unfinished_screening_names_what_is_left(tmp_path):
    found = of_screening(tmp_path / "screening.json", SCREENING | {"complete": False})
    assert "the cases that were not computed yet" in found.not_judged


def test_a_screening_answers_in_the_words_of_the_terminal(tmp_path):
    """A unit beyond its rating is judged: what the verdict says of it stands once, and not as *not judged*."""
    content = SCREENING | {"beyond_rating": "at 2 of 7 a unit is beyond its rating", "points": 1}
    verdict = "UNSTABLE: at 1 of 8 points and outages; at 2 of 7 a unit is beyond its rating"
    new = of_screening(tmp_path / "screening.json", content | {"verdict": verdict})
    assert (new.answer, list(new.doubts)) == (verdict, [])
    old = of_screening(tmp_path / "screening.json", content)
    assert list(old.doubts) == [content["beyond_rating"]]
    assert not any("rating" in text for text in (*new.not_judged, *old.not_judged))
    assert any(text.startswith("outage sg3: no power flow") for text in new.not_judged)


def test_the_first_picture_is_told_once_by_its_number():
    """It moves to the top with the number by which its section calls it."""
    picture = '<svg class="chart">…</svg><figcaption>1</figcaption>'
    numbered = [("A", f'<a href="#figure-1">Figure 1</a><figure id="figure-1">{picture}</figure>.')]
    above, (section,) = _with_first_picture_above(numbered)
    assert above == f'<figure id="figure-1">{picture}</figure>'
    assert section == ("A", '<a href="#figure-1">Figure 1</a>.')
    map_alone = f'<section><h3>Map</h3><figure id="figure-1">{picture}</figure></section><p>all</p>'
    assert _with_first_picture_above([("C", map_alone)])[1] == [("C", "<p>all</p>")]
    above, (section, _) = _with_first_picture_above([("B", f"<p>{picture}</p>"), ("D", "")])
    assert above == picture
    assert "stands at the top" in section[1]
    assert _with_first_picture_above([("B", picture)])[1] == [("B", "")]  # nobody else's picture


@pytest.mark.parametrize(
    ("cells", "is_text"),
    [
        (["sg3 43%", "sg4 33%"], True),
        (["", "the window has 1.2 periods", ""], True),
        (['<b class="bad">UNSTABLE</b>', "stable"], True),
        (["17.51", "–", "not known"], False),
        (["0.473 Hz, 17.51 %", "−0.9"], False),
        (["", ""], False),
    ],
)
def test_words_stand_left_and_figures_right(cells, is_text):
    text = table("Modes", ["Mode", "What"], [["a", cell] for cell in cells])
    assert text.count("<td class=text>") == len(cells) * (1 + is_text)


def test_what_all_stable_rows_have_in_common_is_told_once(tmp_path):
    calm = "keeps synchronism and settles by 20 s"
    remarks = {"p": f"{calm}; sg1 alone", "q": calm, "base": f"{calm}; grows"}
    scenarios = [
        {"name": name, "answer": (SHAKY if name == "base" else CALM) | {"remark": remark}}
        for name, remark in remarks.items()
    ]
    text = first_page([of_run(tmp_path, scenarios)])
    rows = re.findall(r'<span class="remark">(.*?)</span>', text)
    assert rows == ["sg1 alone", "", f"{calm}; grows"]
    assert f"<p>Each stable one: {calm}.</p>" in text
    bare = first_page([of_run(tmp_path, [{"name": "p", "answer": CALM}])])
    assert ">Remark<" not in bare


def test_networks_that_are_equally_strong_have_one_table(tmp_path):
    """Five scenarios of two networks once had five tables, and a scenario's name lost its letters: ``Pss``."""
    bus = {"bus": "bus_8", "s_sc_mva": 2165.0, "scr": None}
    weak = bus | {"s_sc_mva": 2127.0, "scr": 6.91}
    found = [("pss", bus), ("no_pss", bus), ("gfor", weak)]
    scenarios = [{"name": name, "buses": [one]} for name, one in found]
    chapter = of_strengths(tmp_path / "scr.json", {"scenarios": scenarios, "convention": "c = 1"})
    captions = re.findall("<caption>(.*?)</caption>", chapter.content)
    assert captions == ["Short-circuit power: pss, no_pss", "Short-circuit power: gfor"]
    assert chapter.answer == (
        "weakest is bus_8 with 2165 MVA (pss, no_pss); "
        "weakest is bus_8 with 2127 MVA, SCR 6.91 at bus_8 (gfor)"
    )


def test_parameters_without_a_derivative_are_told_by_their_reason():
    rows = [("a", "no steady state"), ("b", ""), ("c", "no steady state"), ("d", "discrete")]
    told = _without_derivative([{"parameter": name, "reason": why} for name, why in rows])
    assert told == ["a, c: no steady state", "d: discrete"]


def test_a_chapter_from_a_page_leaves_out_the_verdict_that_was_told():
    page = '<p class="verdict"><b>bus_1 &lt; bus_2</b></p><p>rest</p>'
    assert _without_answer(page, "bus_1 < bus_2; elsewhere less") == "<p>rest</p>"
    assert _without_answer(page, "another") == page


def test_what_the_first_page_did_not_judge_is_not_told_again():
    finding = {"kind": "not_judged", "message": "whether x < y settles"}
    run = SimpleNamespace(
        ended_early=None,
        scenarios=[{"title": "Base", "failure": None, "findings": [finding], "warnings": []}],
    )
    assert "whether x &lt; y settles" in findings(run)
    assert findings(run, above="Base: whether x &lt; y settles") == ""


def test_an_answer_that_begins_with_a_name_keeps_its_letters(tmp_path):
    """``gfor site --buses Bus_29`` finds no bus."""
    found = of_screening(tmp_path / "screening.json", SCREENING)
    assert ">bus_29 is the best" in first_page([replace(found, answer="bus_29 is the best")])
    assert ">Not as required: no" in first_page([replace(found, answer="not as required: no")])


def test_of_two_scenarios_only_the_unstable_one_is_red(tmp_path):
    scenarios = [
        {"name": "base", "title": "Base", "answer": SHAKY | {"remark": "grows"}},
        {"name": "p", "title": "POD-P", "answer": CALM, "warnings": ["no governor"]},
        {"name": "q", "title": "POD-Q", "answer": CALM | {"damping_percent": 10.6}},
    ]
    text = first_page([of_run(tmp_path, scenarios)])
    red, green = (re.findall(f'<b class="{shade}">(.*?)</b>', text) for shade in ("bad", "good"))
    assert red == ["Base: UNSTABLE, its least damped swing has −0.90 %", "UNSTABLE"]
    both = "the least damped swing has 10.60 % (POD-Q) to 22.60 % (POD-P)"
    assert green == [f"POD-P, POD-Q: stable, {both}", "stable", "stable"]
    assert text.count("grows") == text.count("no governor") == 1
    assert "<li>Doubts: no governor</li><li>Not judged: nothing was left out</li>" in text


def test_the_sentence_for_the_boss_counts_the_scenarios_that_are_well(tmp_path):
    """Four titles once stood in it, each also in the table below, which made a paragraph of the answer."""
    well = [
        {"name": name, "title": name.upper(), "answer": CALM | {"damping_percent": percent}}
        for name, percent in (("p", 22.6), ("q", 24.9), ("pq", 23.9))
    ]
    base = {"name": "base", "title": "Base", "answer": SHAKY}
    spread = "stable, the least damped swing has 22.60 % (P) to 24.90 % (Q)"
    text = first_page([of_run(tmp_path, [*well, base])])
    assert re.findall(r'<p class="verdict">.*?</p>', text) == [
        '<p class="verdict"><b class="bad">Base: UNSTABLE, its least damped swing has −0.90 %</b>; '
        f'<b class="good">the 3 others: {spread}</b>.</p>'
    ]
    assert f'<b class="good">All 3: {spread}</b>' in first_page([of_run(tmp_path, well)])


def test_what_several_rows_do_not_judge_is_told_once(tmp_path):
    long = "the file is not solved"
    rows = [
        replace(chapter, source=tmp_path, not_judged=texts)
        for chapter, texts in zip(
            [of_run(tmp_path, [])] * 3, ([long, "own"], ["another"], [long]), strict=True
        )
    ]
    text = first_page(rows)
    assert (
        text.count(long),
        text.count("note 1"),
        text.count("Note 1: "),
        text.count("note 2"),
    ) == (1, 2, 1, 0)
    assert text.count(">own<") == text.count(">another<") == 1


def test_what_is_found_in_a_runs_record_is_of_the_runs_inputs(gfor, tmp_path):
    t = np.arange(0, 10, 0.02)
    folders = {
        run: made(tmp_path / run, "scr", SCR, **{"own.raw": of})
        for run, of in (("old", "1a"), ("new", "2b"))
    }
    for run, folder in folders.items():
        rows = "".join(f"{x},{np.exp(-0.2 * x) * np.sin(5 * x)}\n" for x in t)
        (folder / "trajectory.csv").write_text(f"time,sg.w\n{rows}", encoding="utf-8")
        origin.said.append(lambda of={"old": "1a", "new": "2b"}[run]: {"inputs": {"own.raw": of}})
        write_manifest(folder, "r", ["scr.json", "trajectory.csv"])
        origin.said.pop()
        assert (
            gfor(
                "signal",
                "identify",
                folder / "trajectory.csv",
                "sg.w",
                "--out",
                tmp_path / f"of_{run}",
            )[0]
            == 0
        )
    assert "one study" not in written([folders["old"], tmp_path / "of_old"], tmp_path)
    with pytest.warns(ResultsWarning, match=r"own\.raw differs between .*old.* and .*of_new"):
        written([folders["old"], tmp_path / "of_new"], tmp_path)
    both = made(tmp_path / "both", "scr", SCR, **{"old/own.raw": "1a", "new/own.raw": "2b"})
    assert "one study" not in written([folders["old"], both], tmp_path)


def test_every_row_says_what_was_given_and_of_which_models(tmp_path):
    kinds = {
        "design": SHEET,
        "screening": SCREENING,
        "sensitivities": SENSITIVITIES,
        "scr": SCR,
        "source": SOURCE,
    }
    places = []
    for name, content in kinds.items():
        parts = content if isinstance(content, list) else [content]
        parts = [one | {"models": "emt", "questions": [f"is {name} meant?"]} for one in parts]
        places.append(made(tmp_path / name, name, parts if isinstance(content, list) else parts[0]))
    text = written(places, tmp_path, short=True)
    for name in kinds:
        assert f"gfor {name} own.toml --set models=emt --parameters p.toml</span>" in text
        assert f"is {name} meant?" in text
    assert text.count("EMT models; ") == len(kinds)
    assert "--out" not in text[: text.index("<section")]


def test_a_result_is_not_told_with_the_command_of_a_later_one(tmp_path):
    place = made(tmp_path / "both", "scr", SCR)
    origin.said.append(lambda: {"command": "gfor later"})
    write_manifest(place, "later", [], before=read_manifest(place))
    origin.said.pop()
    text = written([place], tmp_path)
    assert "gfor later" not in text
    assert "own.toml" not in text


def test_a_design_at_the_edge_says_that_there_is_no_margin(tmp_path):
    thin = SHEET | {"met": True, "thin_margin_damping_ratio": 0.0957}
    text = written([made(tmp_path / "thin", "design", thin)], tmp_path)
    headline = text[: text.index("<section")].replace("\N{NO-BREAK SPACE}", " ")
    assert "20.00 % wanted; no margin: 9.57 % with 20 % more gain" in headline


def test_a_design_says_that_less_gain_has_more_damping(tmp_path):
    """The first sentence had 22.72 % with 200 pu, and a later one 36.17 % with 50 pu."""
    less = SHEET | {"met": True, "less_gain": {"K": 50.0, "damping_ratio": 0.3617}}
    text = written([made(tmp_path / "less", "design", less)], tmp_path)
    headline = text[: text.index("<section")].replace("\N{NO-BREAK SPACE}", " ")
    assert "20.00 % wanted; less gain has more: 36.17 % with K = 50 pu" in headline


def test_a_prediction_says_its_gain_if_a_bound_changed_it(tmp_path):
    """With K 18.5 pu predicted and 200 pu set, the two modes are of different gains."""
    text = written([made(tmp_path / "bounded", "design", SHEET)], tmp_path)
    assert "Predicted with K = 150 pu" in text.replace("\N{NO-BREAK SPACE}", " ")
    free = written([made(tmp_path / "free", "design", SHEET | {"K_unbounded": 200.0})], tmp_path)
    assert "redicted with K" not in free


def test_a_design_says_its_figures_once_with_units_and_by_the_planners_name(tmp_path):
    remark = "the sensitivity asks for K = 18.45 pu, and the bounds allow no less"
    said = f"the target has 18.00 % of damping, 20.00 % are required; {remark}"
    sheet = SHEET | {"controller": "pod_p", "verdict": said, "remarks": [remark]}
    text = written([made(tmp_path / "one", "design", sheet)], tmp_path)
    text = text.partition('id="answers"')[0].replace("\N{NO-BREAK SPACE}", " ")
    assert "<h1>Design of POD-P</h1>" in text
    assert "pod_p" not in text
    assert text.count(remark) == 1
    assert "the target has" not in text
    assert "with K = 200 pu the mode" in text
    assert "no margin" not in written(
        [made(tmp_path / "wide", "design", SHEET | {"met": True})], tmp_path
    )
