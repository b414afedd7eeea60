"""Results of any study as a chapter of a report: its question, its answer in plain words, how sure it is, what was not
judged, and its figures."""

import json
import re
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from html import escape
from itertools import chain
from math import pi
from pathlib import Path
from typing import Any

import xarray as xr

from orchestrator.core.errors import InputError, counted
from orchestrator.output.report.html import studies
from orchestrator.output.report.html.charts import Mark, bar_chart, complex_plane, legend
from orchestrator.output.report.html.elements import VERDICTS, colour, damping, table
from orchestrator.output.report.html.least_damped import LeastDamped
from orchestrator.output.report.html.origins import origin_of
from orchestrator.output.report.html.verdict_lines import VerdictLine
from orchestrator.output.report.tables import short
from orchestrator.output.results.manifest import read_manifest

_FEW, _LONGEST, _FASTEST = 4, 300, -5.0  # of a list; of a text; real part [1/s] of modes on a map
_DESIGNED = {"without": "target", "predicted": "predicted", "with": "achieved"}


@dataclass(frozen=True)
class Chapter:
    """Content of one result; ``page`` is the name of its own page, whose sections are the chapter, in the place of
    ``content``; ``title`` is its heading, in the place of the question."""

    source: Path
    question: str
    answer: str
    good: bool | None
    sure: str = ""
    not_judged: Sequence[str] = ()
    content: str = ""
    page: str = ""
    title: str = ""
    bases: Sequence[Mapping[str, Any]] = ()  # what figures rest on: `PreparedScenario.basis`
    names: Mapping[str, str] = field(default_factory=dict)  # `ElementNames.shown`
    least: Sequence[LeastDamped] = ()  # the modes whose figures the answer gives, in its order
    lines: Sequence[VerdictLine] = ()  # of a study of scenarios: the answer by scenario
    beside: Sequence[str] = ()  # of such a study: the answer's part that is of no scenario

    @cached_property
    def origin(self) -> dict[str, Any]:
        """Return what the result says of itself, as `origin_of` has it."""
        return origin_of(self.source)


Content = Mapping[str, Any]


def chapters_of(place: Path) -> list[Chapter]:
    files = [place] if place.is_file() else sorted(place.glob("*.json"))
    if place.is_dir() and (place / "sweep.nc").is_file():
        files = [file for file in files if file.name != "limits.json"]  # `of_sweep` tells of it
    if place.is_dir() and (manifest := read_manifest(place)) is not None:
        manifest.check(file.name for file in files)
    found = []
    for file in files:
        try:
            content = json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            if file == place:
                raise InputError(
                    f"{file}: it is no study's result; give a study's folder or .json"
                ) from error
            continue  # somebody else's
        keys = (
            set(content)
            if isinstance(content, dict)
            else set(content[0])
            if content and content[0]
            else set()
        )
        for wanted, make in _KINDS:
            if wanted <= keys:
                each = (
                    content if isinstance(content, list) and make is _sensitivities else [content]
                )
                try:
                    found += [_with_models(make(file, one), one) for one in each]
                except (KeyError, TypeError, IndexError, AttributeError, ValueError) as error:
                    raise InputError(
                        f"{file}: it is not as its study writes it ({error!r}); run the study again"
                    ) from error
                break
    return found


def of_run(
    folder: Path, scenarios: Sequence[Content], content: str = "", beside: Sequence[str] = ()
) -> Chapter:
    """Of a run's summary, or the same of `gfor modes`; ``beside``: what devices bring."""
    open_ = []
    lines = [VerdictLine.of(scenario) for scenario in scenarios]
    for line, s in zip(lines, scenarios, strict=True):
        open_ += [
            f"{line.scenario}: {f['message']}"
            for f in s.get("findings", [])
            if f["kind"] == "not_judged"
        ]
        open_ += [f"{line.scenario}: {s['failure']}"] if s.get("failure") else []
        if line.stable is None and not line.remark:
            reason = (s.get("stability") or {}).get("reason")
            open_.append(f"{line.scenario}: {reason or 'stability'}")
    open_ += dict.fromkeys(text for s in scenarios for text in s.get("warnings", []))
    verdicts = [line.stable for line in lines]
    good = False if False in verdicts else None if None in verdicts else True
    basis = (
        "modes of the FMUs that were simulated"
        if any("step_size_s" in s for s in scenarios)
        else ("linear model of the FMUs at the operating point; nothing was run")
    )
    asked = "Is the fault survived" if any(map(has_fault, scenarios)) else "Is the network stable"
    return Chapter(
        folder,
        f"{asked}, and which swing is damped least?",
        "; ".join([*(line.words for line in lines), *beside]),
        good,
        "; ".join([*_kinds(scenarios), basis]),
        open_,
        content,
        bases=_bases(scenarios),
        least=[mode for line in lines for mode in line.modes],
        lines=lines,
        beside=beside,
    )


def _modes(file: Path, content: Content) -> Chapter:
    rows = [
        [
            escape(s["name"]),
            f"{m['frequency_hz']:.4f}",
            damping(m["damping_percent"]),
            escape(m["name"] or ""),
            escape(", ".join(f"{c} {share:.0%}" for c, share in list(m["components"].items())[:3])),
        ]
        for s in content["scenarios"]
        for m in s["modes"]
    ]
    columns = ["Scenario", "f [Hz]", "Damping [%]", "Name", "Who"]
    groups = {s["name"]: s["modes"] for s in content["scenarios"]}
    shown = _map("Modes", groups) + table("Modes", columns, rows)
    made = of_run(file, content["scenarios"], shown, beside=content.get("beside", []))
    sure = "; ".join(
        filter(None, (made.sure, content["facts"], f"steps of {1e3 * content['step_size_s']:g} ms"))
    )
    return replace(made, sure=sure)


def _map(name: str, groups: Mapping[str, Sequence[Content]]) -> str:
    """The eigenvalues of each group, without those that are over at once, where there are any."""
    shades = {label: colour(k) for k, label in enumerate(groups)}
    marks = [
        Mark(
            z["real"],
            (hz := abs(z["imag"]) / (2 * pi)),
            shades[label],
            f"{label}: {hz:.3f} Hz, {z['real']:.3f} 1/s",
        )
        for label, found in groups.items()
        for z in found
        if z["real"] > _FASTEST
    ]
    return legend(shades.items()) + complex_plane(name, marks) if marks else ""


def _with_models(chapter: Chapter, content: Any) -> Chapter:
    records = [
        one
        for one in (content if isinstance(content, list) else [content])
        if isinstance(one, dict)
    ]
    told = (one.get(key) for one in records for key in ("warnings", "questions"))
    more = chain(*(texts for texts in told if isinstance(texts, list)))
    sure = "; ".join(filter(None, (*_kinds(records), chapter.sure)))
    bases = [*chapter.bases, *_bases(records)]
    return replace(
        chapter,
        sure=sure,
        not_judged=list(dict.fromkeys([*chapter.not_judged, *more])),
        bases=bases,
        names={name: shown for one in records for name, shown in one.get("names", {}).items()},
    )


def _bases(records: Sequence[Content]) -> list[Content]:
    return [one["basis"] for one in records if one.get("basis")]


def _kinds(records: Sequence[Content]) -> list[str]:
    """Models of each kind, with what they take loads for."""
    loads = (one.get("basis", {}).get("loads") for one in records)
    return list(
        dict.fromkeys(
            f"{one['models']} models" + (f", loads {law}" if law else "")
            for one, law in zip(records, loads, strict=True)
            if one.get("models")
        )
    )


def has_fault(scenario: Content) -> bool:
    return any(".fault.on = 1" in text for text in scenario.get("events", ()))


def _screening(file: Path, c: Content) -> Chapter:
    where = "somewhere" if c["stable"] is False else "everywhere"
    points, outages = counted(c["points"], "operating point"), counted(c["outages"], "outage")
    answer = f"{VERDICTS[c['stable']]} {where}: {points}, {outages}"
    least = min(c["modes"], key=lambda mode: mode["worst"]["damping_percent"], default=None)
    told = []
    if least is not None:
        worst = least["worst"]
        told.append(LeastDamped.of({**worst, "components": least.get("participation")}))
        answer += (
            f"; least damped {worst['frequency_hz']:.3f} Hz, {worst['damping_percent']:.2f} %, "
            f"{'' if c['points'] == 1 else worst['point'] + ', '}outage {worst['outage']}"
        )
    lost = [c["beyond_rating"]] if c.get("beyond_rating") else []
    lost += [f"{f['point']}, {f['outage']}: {f['status']}: {f['why']}" for f in c["failures"]]
    growth = (
        "growth was counted at all frequencies"
        if c["counted_at_all_frequencies"]
        else ("growth outside of the range was counted at some points only")
    )
    return Chapter(
        file,
        "Which operating point and which outage is worst?",
        answer,
        c["stable"],
        f"{counted(c['items'], 'case')} computed, {growth}",
        lost,
        page="screening.html",
        least=told,
    )


def _site(file: Path, c: Content) -> Chapter:
    open_ = [
        text.removeprefix("not judged: ") for text in c["remarks"] if text.startswith("not judged")
    ]
    sure = "; ".join(c["sure"])
    good = True if c["agrees"] and c["confirmed"] else None if c["agrees"] else False
    least = [LeastDamped.of(mode) for mode in c.get("modes", ())[:1]]
    return Chapter(
        file,
        "Where does a converter help most?",
        c["answer"],
        good,
        sure,
        open_,
        page="site.html",
        least=least,
    )


def _design(file: Path, c: Content) -> Chapter:
    before, after = (100 * c[f"{when}_damping_ratio"] for when in ("target", "achieved"))
    wanted = 100 * c["requirement"]["damping_ratio"]
    answer = (
        f"{'yes' if c['met'] else 'not as required'}: with K = {c['K']:.4g} the mode has {after:.2f} % of damping, "
        f"{before:.2f} % before, {wanted:.2f} % wanted"
    )
    thin = c.get("thin_margin_damping_ratio")
    if thin:
        answer += f"; no margin: {100 * thin:.2f} % with 20 % more gain"
    if c["met"] and (spoilt := c.get("larger_gain_spoils")):
        answer += f"; no margin: with 20 % more gain {spoilt}"
    sure = f"closed loop of the coupled FMUs: {c['verdict']}"
    modes = {word: [c[f"{which}_mode"]] for word, which in _DESIGNED.items()}
    content = _map("The mode that was designed for", modes) + studies.design(dict(c))
    return Chapter(
        file,
        f"Does {c['controller']} damp the {c['mode']} mode?",
        answer,
        bool(c["met"]),
        sure,
        content=content,
        title=f"Design of {c['controller']}",
    )


def _coordinated(file: Path, c: Content) -> Chapter:
    lost = [f"{f['point']}, {f['outage']}: {f['why']}" for f in c["failed"]]
    limiting = c.get("limiting")
    return Chapter(
        file,
        "Do damping controllers help at all operating points?",
        c["verdict"],
        bool(c["met"]),
        f"checked at {c['items']} points and outages",
        lost,
        least=[LeastDamped.of_design_mode(limiting["mode"])]
        if limiting and limiting.get("mode")
        else [],
    )


def _certificate(file: Path, c: Content) -> Chapter:
    open_ = [
        text if isinstance(text, str) else f"X_L = {text:g} pu"
        for text in (*c["departures"], *c["missing"])
    ]
    warned = [
        texts for point in c.get("points", []) for texts in point.get("warnings", {}).values()
    ]
    check: Content = c.get("acceptance") or {}
    open_ += dict.fromkeys([*chain(*warned), *_unjudged(check.get("checks", []))])
    trusted = check.get("trusted") is not False
    good = {"passes": trusted, "fails": False}.get(c["verdict"])
    sure = (
        f"judged: {c['judged']}"
        if c.get("judged")
        else counted(len(c["rows"]), "test")
        if "rows" in c
        else ""
    )
    question = f"Does the converter pass the tests of {c['code'].upper() if 'code' in c else 'the grid code'}?"
    return Chapter(file, question, c["sentence"], good, sure, open_, page="certificate.html")


def _matrix(file: Path, c: Content) -> Chapter:
    open_ = (
        (x, x["failure"] or (x["missing"] and f"{x['missing']} not tested")) for x in c["cells"]
    )
    lost = [f"{x['device']}, {x['code']}: {text}" for x, text in open_ if text]
    return Chapter(
        file,
        "Which converter passes which grid code?",
        c["sentence"],
        c["exit_code"] == 0,
        f"{counted(len(c['cells']), 'pair')} of a device and a code",
        lost,
        page="matrix.html",
    )


def _unjudged(checks: Sequence[Content]) -> list[str]:
    return [str(x["figures"]["not_judged"]) for x in checks if "not_judged" in x["figures"]]


def _check(file: Path, c: Content) -> Chapter:
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
    good = True if c["trusted"] else False if bad else None
    return Chapter(
        file,
        "Can this FMU be trusted in a co-simulation?",
        answer,
        good,
        f"{counted(len(c['checks']), 'check')}, {remarks} with a remark",
        [*c["not_supported"], *_unjudged(c["checks"])],
        table("Checks", ["Question", "Verdict", "Evidence", "Remedy"], rows, left=4),
    )


def _limits_text(found: Any) -> str:
    """Every limit of every scenario; an older result has the first alone."""
    return "; ".join(
        f"{x['scenario']}: {'; '.join(x.get('lines') or [x['sentence']])}" for x in found
    )


def _limits(file: Path, found: Any) -> Chapter:
    answer = _limits_text(found)
    sure = f"{sum(len(x['tried']) for x in found)} values tried, then bisected"
    return Chapter(file, f"How far may {found[0]['parameter']} go?", answer, None, sure)


def _comparison(file: Path, signals: Any) -> Chapter:
    rows = [
        [
            escape(s["expression"]),
            escape(s["unit"]),
            f"{s['largest']:.4g}",
            f"{s['at']:.3f}",
            f"{s['rms']:.4g}",
        ]
        for s in signals
    ]
    first = signals[0]
    answer = f"{first['expression']} differs most, by {first['largest']:.4g} {first['unit']} at {first['at']:.3f} s"
    columns = ["Signal", "Unit", "Largest difference", "at [s]", "RMS"]
    return Chapter(
        file,
        "How do two runs differ?",
        answer,
        None,
        counted(len(signals), "signal"),
        (),
        table("Differences", columns, rows, left=2),
    )


def _identified(file: Path, modes: Any) -> Chapter:
    rows = [
        [
            f"{m['frequency_hz']:.4f}",
            damping(m["damping_percent"]),
            f"{m['amplitude']:.3g}",
            escape("; ".join(m["doubts"])),
        ]
        for m in modes
    ]
    swing = next((m for m in modes if m["frequency_hz"]), None)
    figures = (
        f"{swing['frequency_hz']:.3f} Hz, {swing['damping_percent']:.2f} %"
        if swing
        else "no oscillation"
    )
    sure = f"{sum(not m['doubts'] for m in modes)} of {counted(len(modes), 'mode')} without a doubt"
    doubts = [f"{m['frequency_hz']:.3f} Hz: {text}" for m in modes for text in m["doubts"]]
    return Chapter(
        file,
        "With which modes does a record ring?",
        f"strongest: {figures}",
        None,
        sure,
        doubts,
        _map("Modes", {"record": modes})
        + table("Modes", ["f [Hz]", "Damping [%]", "Amplitude", "Doubts"], rows, left=0),
    )


def _interactions(file: Path, c: Content) -> Chapter:
    worst = next((p for p in c["pairs"] if p["vendors"] == c["worst_pair"]), None)
    whole = c["as_in_the_case"]["stable"]
    verdicts = [whole, *(one["stable"] for one in (*c["pairs"], *c.get("assignments", [])))]
    good = False if False in verdicts else None if None in verdicts else True
    answer = f"{VERDICTS[whole]} as in the case; {counted(len(c['interaction_modes']), 'mode')} that vendors share"
    answer += f"; {worst['sentence']}" if worst else ""
    sure = f"each of {len(c['vendors'])} vendors alone and each pair, the others as {c['stand_in']}"
    lost = [f"pair {' and '.join(pair)}" for pair in c["unknown_pairs"]]
    return Chapter(
        file,
        "Do several vendors' converters agree?",
        answer,
        good,
        sure,
        lost,
        page="interactions.html",
        least=_of_pair(worst or {}),
    )


def _of_pair(pair: Content) -> list[LeastDamped]:
    """The mode that a pair's sentence tells of."""
    if pair.get("mode_hz") is None:
        return []
    return [LeastDamped(pair["mode_hz"], pair["mode_together_percent"], {})]


def _sensitivities(file: Path, c: Content) -> Chapter:
    key, mode = "damping_points_per_percent", c["mode"]
    found = sorted((r for r in c["sensitivities"] if r[key]), key=lambda r: -abs(r[key]))
    first = found[:_FEW]
    rows = [
        [
            escape(r["parameter"]),
            f"{r['value']:.5g} {escape(r['unit'])}",
            f"{r[key]:+.3g}",
            f"{r['frequency_hz_per_percent']:+.3g}",
            escape(r["doubts"]),
        ]
        for r in found
    ]
    said = ", ".join(f"{r['parameter']} ({r[key]:+.2g})" for r in first) or "no parameter"
    answer = f"{mode['frequency_hz']:.3f} Hz, {mode['damping_percent']:.2f} %: most by {said} points for 1 % more"
    answer = f"UNSTABLE; {answer}" if c["stable"] is False else answer
    size = "Points by 1 %, without sign"
    bars = (
        bar_chart(
            "Points of damping",
            [r["parameter"] for r in first],
            [("1 % more", colour(1), [abs(r[key]) for r in first])],
            size,
        )
        if first
        else ""
    )
    columns = ["Parameter", "Value", "Points by 1 %", "Hz by 1 %", "Doubts"]
    return Chapter(
        file,
        f"What moves the {mode['name'] or 'critical'} mode of {c['scenario']}?",
        answer,
        None,
        f"{c['derivative']} derivatives by {counted(len(found), 'parameter')}",
        [f"{r['parameter']}: {r['reason']}" for r in c["sensitivities"] if r["reason"]],
        bars + table("By the size of their effect", columns, rows),
    )


def _sources(file: Path, records: Any) -> Chapter:
    records = records if isinstance(records, list) else [records]
    found = [
        (f"{x['frequency_hz']:.3f} Hz", x, c["record"]) for c in records for x in c["oscillations"]
    ]
    said = [
        f"{at}: {x['kind']}" + (f", from {x['source']}" if x["source"] else "")
        for at, x, _ in found
    ]
    unnamed = [
        f"{at}: {x['reason']}" for at, x, _ in found if not x["source"] and x["kind"] != "mode"
    ]
    rows = [
        [record, at, x["kind"], x["source"] or "not named", x["reason"], x["advice"]]
        for at, x, record in found
    ]
    return Chapter(
        file,
        "Where does the oscillation come from?",
        "; ".join(said) or "nothing oscillates",
        None,
        f"power and voltage of {sum(len(c['places']) for c in records)} places",
        [*unnamed, *(text for c in records for text in c["remarks"])],
        table(
            "Oscillations",
            ["Record", "Oscillation", "Kind", "Source", "Why", "Next"],
            [[escape(cell) for cell in row] for row in rows],
            left=6,
        ),
    )


def _strengths(file: Path, c: Content) -> Chapter:
    said, rows = dict[str, list[str]](), []
    for scenario in c["scenarios"]:
        weakest, *_ = buses = sorted(scenario["buses"], key=lambda b: b["s_sc_mva"])
        ratios = {b["bus"]: "–" if b["scr"] is None else f"{b['scr']:.2f}" for b in buses}
        text = "".join(f", SCR {scr} at {bus}" for bus, scr in ratios.items() if scr != "–")
        text = f"weakest is {weakest['bus']} with {weakest['s_sc_mva']:.0f} MVA{text}"
        said.setdefault(short(text, _LONGEST), []).append(scenario["name"])
        rows += [
            [escape(scenario["name"]), escape(b["bus"]), f"{b['s_sc_mva']:.0f}", ratios[b["bus"]]]
            for b in buses
        ]
    answer = "; ".join(f"{', '.join(names)}: {text}" for text, names in said.items())
    return Chapter(
        file,
        "How strong is the network?",
        answer,
        None,
        c["convention"],
        (),
        table("Short-circuit power", ["Scenario", "Bus", "S_sc [MVA]", "SCR"], rows, left=2),
    )


def _nyquist(file: Path, c: Content) -> Chapter:
    rows = [
        [name, f"{m['value']:.4g}", f"{m['frequency_hz']:.4g}"]
        for name, m in c["margins"].items()
        if m
    ]
    content = table("Margins", ["Margin", "Value", "at [Hz]"], rows)
    found = c.get("retune")
    if found:
        made = [
            [
                escape(x["name"]),
                f"{x['now']:.4g}",
                "" if x["needed"] is None else f"{x['needed']:.4g}",
                ""
                if (said := x["confirmed"]) is None
                else f"{said['verdict']}, {said['distance']:.4f}",
                escape(x["remark"]),
            ]
            for x in found["parameters"]
        ]
        wanted = f"What to retune for a distance of {found['distance_wanted']:g} from −1"
        content += table(wanted, ["Parameter", "Now", "Needed", "Confirmed", "Remark"], made)
    for picture in (
        file.with_name(name) for name in ("eigenloci.png", "matrices.png", "retune.png")
    ):
        if picture.is_file():
            data = b64encode(picture.read_bytes()).decode()
            content += f'<p><img alt="{picture.stem}" style="max-width: 100%" src="data:image/png;base64,{data}"></p>'
    good = {"stable": True, "unstable": False}.get(c["verdict"])
    modes = (
        "no modes asked"
        if c["modes_stable"] is None
        else "modes agree"
        if c["modes_stable"] == good
        else ("the modes do NOT agree")
    )
    return Chapter(
        file,
        f"Is {c['device']} stable at {c['network']}?",
        c["sentence"],
        good,
        f"encirclements; {modes}",
        c["reasons"],
        content,
    )


_KINDS: tuple[tuple[set[str], Callable[[Path, Any], Chapter]], ...] = (
    ({"device", "buses", "confirmed", "answer"}, _site),
    ({"holds_at", "beyond", "sentence"}, _limits),
    ({"counted_at_all_frequencies", "failures", "modes"}, _screening),
    ({"controller", "target_mode", "T_S1", "verdict"}, _design),
    ({"settings", "verdict", "met", "ranking"}, _coordinated),
    ({"cells", "codes", "sentence"}, _matrix),
    ({"sentence", "verdict", "files", "seal"}, _certificate),
    ({"trusted", "checks", "faults"}, _check),
    ({"scenarios", "facts", "step_size_s"}, _modes),
    ({"expression", "deviations", "rms"}, _comparison),
    ({"interaction_modes", "pairs", "worst_pair"}, _interactions),
    ({"derivative", "sensitivities"}, _sensitivities),
    ({"record", "places", "oscillations"}, _sources),
    ({"convention", "scenarios"}, _strengths),
    ({"amplitude", "doubts"}, _identified),
    ({"crossings", "margins", "sentence"}, _nyquist),
)
"""What the JSON of each study has, the first that fits."""


def sections(chapter: Chapter, number: int) -> str:
    place = chapter.source if chapter.source.is_dir() else chapter.source.parent
    if not chapter.page or not (place / chapter.page).is_file():
        return chapter.content
    found = re.search(
        r"</nav>(.*)</main>", (place / chapter.page).read_text(encoding="utf-8"), re.DOTALL
    )
    text = found[1] if found else ""
    text = re.sub(r'(id="|href="#)(section|figure)-', rf"\1chapter-{number}-\2-", text)
    text = re.sub(r"(clip-)(\d+)", rf"\g<1>{number}-\2", text)
    return re.sub(r"<(/?)h([23])>", lambda m: f"<{m[1]}h{int(m[2]) + 1}>", text)


def limits_of(place: Path) -> list[Any]:
    file = place / "limits.json"
    return list(json.loads(file.read_text(encoding="utf-8"))) if file.is_file() else []


def of_sweep(place: Path, sweep: xr.Dataset) -> Chapter:
    named = sweep["damping"].where(sweep["named"] == 1)
    least = named if bool(named.notnull().any()) else sweep["damping"]
    at = least.where(least == least.min(), drop=True)
    where = ", ".join(f"{d} = {at[d].values[0]:.4g}" for d in at.dims if at[d].dtype.kind == "f")
    stable = sweep.get("stable")
    lost = 0 if stable is None else int((stable == 0).sum())
    unknown = 0 if stable is None else int((~stable.isin([0, 1])).sum())
    open_ = [f"stability at {counted(unknown, 'point')}"] if unknown else []
    open_ += json.loads(sweep.attrs.get("warned", "[]"))
    about = {
        "models": sweep.attrs.get("models"),
        "basis": json.loads(sweep.attrs.get("basis", "{}")),
    }
    models, bases = "".join(f"{kind}; " for kind in _kinds([about])), _bases([about])
    limits = limits_of(place)
    if limits:
        said = _limits_text(limits)
        holds = all(one["ends_with"] == "holds" for one in limits)
        return Chapter(
            place,
            f"How far may {limits[0]['parameter']} go?",
            said,
            holds or None,
            f"{models}coarse values, then bisection; each is of the coupled FMUs at an operating point of its own",
            [*open_, "narrow pieces between the values that were tried"],
            bases=bases,
        )
    answer = f"least damping {float(least.min()):.2f} % at {where}" + (
        f"; UNSTABLE at {counted(lost, 'point')}" if lost else ""
    )
    return Chapter(
        place,
        f"How do the modes move along {studies.axis_of(sweep)}?",
        answer,
        False if lost else None,
        f"{models}each point is a linear model of the coupled FMUs there",
        open_,
        bases=bases,
    )
