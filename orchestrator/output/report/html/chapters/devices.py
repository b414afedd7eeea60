"""Chapters of devices and of their networks: acceptance tests, certificates, network strength, Nyquist's criterion."""

from base64 import b64encode
from collections.abc import Sequence
from html import escape
from itertools import chain
from pathlib import Path

from orchestrator.core.errors import number_of
from orchestrator.output.report.html.chapters.chapter import Chapter, Content
from orchestrator.output.report.html.elements import table
from orchestrator.output.report.short_texts import short
from orchestrator.output.report.strength_table import strength_table

_LONGEST = 300
"""Characters of an answer that names the buses of a scenario; the table below has all."""


def of_check(file: Path, c: Content) -> Chapter:
    bad = [check for check in c["checks"] if check["verdict"] == "fail"]
    remarks = sum(check["verdict"] == "remark" for check in c["checks"])
    name = Path(c["fmu"]).name
    answer = f"{name}: " + (
        "no check failed" if c["trusted"] else ", ".join(c["faults"]) or "not to be judged here"
    )
    shade = {"fail": "bad", "pass": "good"}
    rows = [
        [
            escape(x["question"]),
            f'<span class="{shade.get(x["verdict"], "soft")}">{escape(x["verdict"])}</span>',
            escape(x["evidence"]),
            escape(x["remedy"]),
        ]
        for x in c["checks"]
    ]
    untrusted = False if bad else None
    return Chapter(
        file,
        "Can this FMU be trusted in a co-simulation?",
        answer=answer,
        good=True if c["trusted"] else untrusted,
        sure=f"{number_of(len(c['checks']), 'check')}, {remarks} with a remark",
        not_judged=[*c["not_supported"], *_unjudged(c["checks"])],
        content=table("Checks", ["Question", "Verdict", "Evidence", "Remedy"], rows, left=4),
    )


def of_certificate(file: Path, c: Content) -> Chapter:
    open_ = [
        text if isinstance(text, str) else f"X_L = {text:g} pu"
        for text in (*c["departures"], *c["missing"])
    ]
    warned = [
        texts for point in c.get("points", []) for texts in point.get("warnings", {}).values()
    ]
    check: Content = c.get("acceptance") or {}
    open_ += dict.fromkeys(_unjudged(check.get("checks", [])))
    trusted = check.get("trusted") is not False
    good = {"passes": trusted, "fails": False}.get(c["verdict"])
    tests = number_of(len(c["rows"]), "test") if "rows" in c else ""
    sure = f"judged: {c['judged']}" if c.get("judged") else tests
    question = f"Does the converter pass the tests of {c['code'].upper() if 'code' in c else 'the grid code'}?"
    return Chapter(
        file,
        question,
        c["sentence"],
        good,
        sure,
        not_judged=open_,
        doubts=list(dict.fromkeys(chain(*warned))),
        page="certificate.html",
    )


def of_matrix(file: Path, c: Content) -> Chapter:
    open_ = (
        (x, x["failure"] or (x["missing"] and f"{x['missing']} not tested")) for x in c["cells"]
    )
    lost = [f"{x['device']}, {x['code']}: {text}" for x, text in open_ if text]
    return Chapter(
        file,
        "Which converter passes which grid code?",
        c["sentence"],
        c["exit_code"] == 0,
        f"{number_of(len(c['cells']), 'pair')} of a device and a code",
        lost,
        page="matrix.html",
    )


def _unjudged(checks: Sequence[Content]) -> list[str]:
    return [str(x["figures"]["not_judged"]) for x in checks if "not_judged" in x["figures"]]


def of_strengths(file: Path, c: Content) -> Chapter:
    said = dict[str, list[str]]()
    tables = dict[str, list[str]]()  # the scenarios that have the same figures at all buses
    for scenario in c["scenarios"]:
        weakest, *_ = buses = sorted(scenario["buses"], key=lambda b: b["s_sc_mva"])
        ratios = {b["bus"]: b["scr"] for b in buses if b["scr"] is not None}
        text = "".join(f", SCR {scr:.2f} at {bus}" for bus, scr in ratios.items())
        text = f"weakest is {weakest['bus']} with {weakest['s_sc_mva']:.0f} MVA{text}"
        said.setdefault(short(text, _LONGEST), []).append(scenario["name"])
        tables.setdefault(strength_table("{}", buses).html(), []).append(scenario["name"])
    answer = "; ".join(f"{text} ({', '.join(names)})" for text, names in said.items())
    content = "".join(
        text.replace("{}", f"Short-circuit power: {escape(', '.join(names))}", 1)
        for text, names in tables.items()
    )
    return Chapter(
        file,
        "How strong is the network?",
        answer=answer,
        good=None,
        sure=c["convention"],
        not_judged=(),
        content=content,
    )


def _retuned(parameter: Content) -> list[str]:
    """Return the row of a parameter that could be retuned."""
    needed, confirmed = parameter["needed"], parameter["confirmed"]
    return [
        escape(parameter["name"]),
        f"{parameter['now']:.4g}",
        "" if needed is None else f"{needed:.4g}",
        "" if confirmed is None else f"{confirmed['verdict']}, {confirmed['distance']:.4f}",
        escape(parameter["remark"]),
    ]


def of_nyquist(file: Path, c: Content) -> Chapter:
    rows = [
        [name, f"{m['value']:.4g}", f"{m['frequency_hz']:.4g}"]
        for name, m in c["margins"].items()
        if m
    ]
    content = table("Margins", ["Margin", "Value", "at [Hz]"], rows)
    found = c.get("retune")
    if found:
        made = [_retuned(x) for x in found["parameters"]]
        wanted = f"What to retune for a distance of {found['distance_wanted']:g} from −1"
        content += table(wanted, ["Parameter", "Now", "Needed", "Confirmed", "Remark"], made)
    for picture in (
        file.with_name(name) for name in ("eigenloci.png", "matrices.png", "retune.png")
    ):
        if picture.is_file():
            data = b64encode(picture.read_bytes()).decode()
            content += f'<p><img alt="{picture.stem}" style="max-width: 100%" src="data:image/png;base64,{data}"></p>'
    good = {"stable": True, "unstable": False}.get(c["verdict"])
    agree = "modes agree" if c["modes_stable"] == good else "the modes do NOT agree"
    modes = "no modes asked" if c["modes_stable"] is None else agree
    return Chapter(
        file,
        f"Is {c['device']} stable at {c['network']}?",
        answer=c["sentence"],
        good=good,
        sure=f"encirclements; {modes}",
        not_judged=c["reasons"],
        content=content,
    )
