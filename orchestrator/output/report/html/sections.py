"""The sections of the page that a run fills: findings, operating point, modes, responses, provenance."""

import json
from html import escape

import numpy as np

from orchestrator.core.errors import number_of
from orchestrator.output.report.colours import colour
from orchestrator.output.report.html.charts import (
    ChartCurve,
    Mark,
    bar_chart,
    complex_plane,
    legend,
    line_chart,
)
from orchestrator.output.report.html.elements import SHADES, Figures, table
from orchestrator.output.report.html.folder import Results
from orchestrator.output.report.linearised import exceptions_in_words
from orchestrator.output.report.mode_tables import mode_shifts, named_modes, ring_downs
from orchestrator.output.report.power_flow import flow_table
from orchestrator.output.results.signals import relative_difference, signal
from orchestrator.simulation.watch.finding import NOT_JUDGED

_BARS = 8

_KINDS = {
    "growth": "the undisturbed state grows",
    "undisturbed_motion": "the undisturbed state moves",
    "growing_oscillation": "growing oscillation",
    "sustained_oscillation": "sustained oscillation",
    "run_away": "run-away",
    "excursion": "a speed leaves its band and comes back",
    "active_limit": "active limit",
    "loss_of_synchronism": "loss of synchronism",
    "not_judged": "not judged",
    "trip": "a relay trips",
    "stall": "a motor stalls",
    "interruption": "a DC line is interrupted",
    "not_finite": "not a number",
}


_NOTHING = (
    "The runs were watched for growth of the undisturbed state, growing and sustained oscillations, limits that stay "
    "active, loss of synchronism and values that are no numbers; nothing of it was found."
)


def titles(results: Results) -> dict[str, str]:
    return {s["name"]: s["title"] for s in results.scenarios}


def scenario_legend(results: Results, circles: str = "") -> str:
    return legend(((s["title"], colour(k)) for k, s in enumerate(results.scenarios)), circles)


def findings(results: Results, above: str = "") -> str:
    """Return what a reader in a hurry should take away, from the figures themselves; ``above``: what the page has told
    before, and does not tell again."""
    items = []
    early = results.ended_early
    if early:
        shade = "soft" if early["word"] == "interrupted" else "bad"
        items.append(f'<b class="{shade}">{escape(early["word"])}</b> {escape(early["place"])}')
    for s in results.scenarios:
        if s.get("interrupted"):
            items.append(
                f'{escape(s["title"])}: <span class="soft">the run was {escape(s["failure"])}</span>'
            )
        elif s["failure"]:
            items.append(
                f'{escape(s["title"])}: <span class="bad">the run failed</span>: {escape(s["failure"])}'
            )
        items += [
            f'{escape(s["title"])}: <span class="{"soft" if f["kind"] == NOT_JUDGED else "bad"}">'
            f"{escape(_KINDS.get(f['kind'], f['kind']))}</span>: "
            f"{escape(f['message'])}"
            for f in s.get("findings", [])
            if f["message"] != s["failure"] and escape(f["message"]) not in above
        ]
    warnings = "".join(
        f'<div class="warning"><b>{escape(s["title"])}:</b> {escape(text)}</div>'
        for s in results.scenarios
        for text in s["warnings"]
    )
    found = f"<ul>{''.join(f'<li>{item}</li>' for item in items)}</ul>" if items else ""
    by_modes = "".join(
        f'<li>{escape(s["title"])}: <b class="{SHADES[v["stable"]]}">{escape(v["sentence"])}</b></li>'
        for s in results.scenarios
        if (v := s.get("stability"))
    )
    details = f"<details><summary>By the modes at the operating point</summary><ul>{by_modes}</ul></details>"
    told = found + (details if by_modes else "")
    return (f'<div class="findings">{told}</div>' if told else "") + warnings


def studied(results: Results) -> str:
    case = results.case.table
    rows = []
    for s in results.scenarios:
        scenario = case.scenarios.get(s["name"])
        differs = ", ".join(f"{k} = {v}" for k, v in scenario.set.items()) if scenario else ""
        removed = f"without {', '.join(scenario.remove)}" if scenario and scenario.remove else ""
        rows.append(
            [
                escape(s["title"]),
                escape("; ".join(x for x in (removed, differs) if x) or "as the case"),
                escape("; ".join(s.get("events", [])) or "none"),
                str(s["states"]),
            ]
        )
    first = results.scenarios[0]
    solver = (
        f"Coupled as FMUs with a communication step of {1e6 * first['step_size_s']:g} µs "
        f"({escape(first['schedule'])}), simulated for {first['stop_time']:g} s. {_linearised(results)}"
    )
    source = f"<p>{escape(case.source)}</p>" if case.source else ""
    return f"{source}<p>{solver}</p>{_isolated(results)}" + table(
        "Scenarios", ["Scenario", "What differs", "Events", "States"], rows, left=3
    )


def _isolated(results: Results) -> str:
    found = {
        name: tuple(p["name"] for p in listed if p["in_force"])
        for s in results.scenarios
        for name, listed in s.get("isolated", {}).items()
    }
    sentences = [
        f"{', '.join(name for name, has in found.items() if has == names)} ran in a process of its own, with: "
        f"{', '.join(names)}."
        for names in dict.fromkeys(found.values())
    ]
    return f"<p>{escape(' '.join(sentences))}</p>" if sentences else ""


def _linearised(results: Results) -> str:
    sources: dict[str, str] = {}
    errors: dict[str, float] = {}
    for s in results.scenarios:
        sources |= s.get("linearised", {})
        errors |= s.get("fit_errors", {})
    if not sources:
        return "How the linear models were found was not recorded."
    exceptions = exceptions_in_words(sources, errors)
    if exceptions is not None:
        return escape(exceptions)
    return (
        "Modes come from perturbing the running FMUs around the coupled steady state: the linear model is that of the "
        "FMUs that were simulated."
    )


def operating_point(results: Results) -> str:
    rows, details = [], []
    for s in results.scenarios:
        flow = s.get("power_flow")
        low = high = "–"
        if flow:
            low, high = (f"{pick(v[0] for v in flow['buses'].values()):.4f}" for pick in (min, max))
            regions = flow.get("regions", {})
            buses = [
                {"name": bus, "v_pu": v, "angle_deg": angle, **regions.get(bus, {})}
                for bus, (v, angle) in flow["buses"].items()
            ]
            found = {
                "machines": flow.get("machines", []),
                "buses": buses,
                "branches": flow.get("branches", []),
            }
            shown = [
                flow_table("Units" if kind == "machines" else kind.capitalize(), kind, listed)
                for kind, listed in found.items()
            ]
            details.append(
                f"<details><summary>{escape(s['title'])}: {number_of(len(found['machines']), 'unit')}, "
                f"{number_of(len(buses), 'bus')}</summary>"
                f"{''.join(table.html() for table in shown)}</details>"
            )
        residual = f"{flow['residual']:.1e}" if flow else "–"
        change = "–" if s["residual"] is None else f"{s['residual']:.1e}"
        rows.append([escape(s["title"]), change, residual, low, high])
    columns = [
        "Scenario",
        "Change in one step [pu]",
        "Power-flow mismatch [pu]",
        "Lowest voltage [pu]",
        "Highest [pu]",
    ]
    return table("Coupled steady state", columns, rows) + "".join(details)


def modes(results: Results, figures: Figures) -> str:
    reference = results.case.table.reference
    compared = reference is not None and any(s["references"] for s in results.scenarios)
    title = reference.title if reference else None
    parts = [named_modes(results.scenarios, title, with_names=True).html()]
    if reference and compared:
        parts.append(f'<p class="soft">{escape(reference.title)}: {escape(reference.source)}</p>')
    picture, link = figures.add(
        scenario_legend(results, reference.title if reference and compared else "")
        + complex_plane("Eigenvalue map", _marks(results), highest_hz=_highest(results)),
        "Modes from 0.1 Hz up with rays of equal damping; modes with a name are large"
        + (f"; circles: {reference.title}." if reference and compared else "."),
    )
    parts.append(f"<p>{link} shows all modes; the pointer on one shows what it is.</p>{picture}")
    return "".join(parts) + _participation(results, figures)


def _highest(results: Results) -> float | None:
    named = [m["frequency_hz"] for s in results.scenarios for m in s["modes"].values()]
    return 1.25 * max(named) if named else None


def _marks(results: Results) -> list[Mark]:
    marks, title = [], titles(results)
    order = {name: k for k, name in enumerate(title)}
    highest = _highest(results) or float("inf")
    for row in results.modes:
        real, hz = float(row["real [1/s]"]), float(row["frequency [Hz]"])
        if real < -3 or hz > highest:
            continue
        name = f"{row['name']} mode, " if row["name"] else ""
        text = (
            f"{name}{title[row['scenario']]}\n{hz:.3f} Hz, damping {float(row['damping [%]']):.2f} %\n"
            + "\n".join(row["participation"].split("; ")[:4])
        )
        marks.append(Mark(real, hz, colour(order[row["scenario"]]), text, large=bool(row["name"])))
    for k, s in enumerate(results.scenarios):
        for name, theirs in s["references"].items():
            ratio = theirs["damping_percent"] / 100
            default = -ratio / np.sqrt(1 - ratio**2) * 2 * np.pi * theirs["frequency_hz"]
            at = f"{theirs['frequency_hz']:.2f} Hz, {theirs['damping_percent']:.2f} %"
            text = f"{name}, {s['title']}: reference\n{at}"
            marks.append(
                Mark(theirs.get("real", default), theirs["frequency_hz"], colour(k), text, "circle")
            )
    return marks


def _participation(results: Results, figures: Figures) -> str:
    parts, title = [], titles(results)
    for name in dict.fromkeys(n for s in results.scenarios for n in s["modes"]):
        shares: dict[str, dict[str, float]] = {}
        for row in results.participation:
            if row["name"] == name and row["of"] == "component":
                shares.setdefault(row["scenario"], {})[row["element"]] = 100 * float(
                    row["participation"]
                )
        most = {c: max(s.get(c, 0.0) for s in shares.values()) for s in shares.values() for c in s}
        components = sorted(most, key=lambda c: -most[c])[:_BARS]
        if not components:
            continue
        bars = [
            (title[s], colour(k), [shares.get(s, {}).get(c, 0.0) for c in components])
            for k, s in enumerate(title)
        ]
        picture, link = figures.add(
            bar_chart(f"Participation in the {name} mode", components, bars),
            f"Participation of whole components in the {name} mode: the sum over their states.",
        )
        sides = "; ".join(
            f"{escape(s['title'])}: {escape(', '.join(a[:4]) or '–')}"
            + (f" against {escape(', '.join(b[:4]))}" if b else ", with no machine opposite")
            for s in results.scenarios
            if (swing := s.get("swing", {}).get(name))
            for a, b in [swing]
        )
        parts.append(
            f"<p>{link}: who takes part in the {escape(name)} mode. Who swings against whom: {sides}.</p>{picture}"
        )
    return "".join(parts)


def responses(results: Results, figures: Figures) -> str:
    parts = [scenario_legend(results)]
    if not results.case.table.plots:
        parts = [
            "<p>The case has no [[plots]], so no curve is drawn; `gfor new` writes such tables.</p>"
        ]
    for plot in results.case.table.plots:
        charts, columns = [], []
        for panel in plot.panels:
            curves, deviations = _curves(
                results, panel.signal, panel.scale, 0 if panel.also else None
            )
            for k, further in enumerate(panel.also, start=1):
                curves += _curves(results, further, panel.scale, k)[0]
            if curves:
                charts.append(
                    line_chart(f"{plot.title}: {panel.label}", "Time [s]", panel.label, curves)
                )
                columns.append((panel.label, deviations))
        if charts:
            dashed = " Dashed: response of the linear model." if results.linear else ""
            picture, link = figures.add("".join(charts), f"{plot.title}.{dashed}")
            rows = [
                [escape(title), *(deviations.get(name, "–") for _, deviations in columns)]
                for name, title in titles(results).items()
            ]
            linear = (
                " (largest difference of the linear model, as a share of it)"
                if results.linear
                else ""
            )
            caption = f"Largest deviation from the start{linear}"
            figures_of_it = table(caption, ["Scenario", *(label for label, _ in columns)], rows)
            heading = (
                f"<h3>{escape(plot.title)}</h3><p>{link} shows the responses to the events.</p>"
            )
            parts.append(f"{heading}{picture}{figures_of_it}")
    return "".join(parts) + _ring_downs(results) + _watched(results)


def _watched(results: Results) -> str:
    rows = [
        [
            escape(s["title"]),
            escape(_KINDS.get(f["kind"], f["kind"])),
            escape(f["component"]),
            escape(f["variable"]),
            f"{f['time']:.4g}",
            "the end" if f["until"] is None else f"{f['until']:.4g}",
        ]
        for s in results.scenarios
        for f in s.get("findings", [])
    ]
    columns = ["Scenario", "Found", "Component", "Variable", "From [s]", "To [s]"]
    if rows:
        return table("What was found in the runs", columns, rows, left=4)
    watched = all("findings" in s for s in results.scenarios)
    return f'<p class="soft">{_NOTHING}</p>' if watched else ""


def _curves(
    results: Results, expression: str, scale: float, place: int | None = None
) -> tuple[list[ChartCurve], dict[str, str]]:
    """One signal in every scenario, and how far it goes; ``place`` is its place among several of one panel."""
    curves, deviations = [], {}
    for k, s in enumerate(results.scenarios):
        recorded, linear = results.trajectories.get(s["name"]), results.linear.get(s["name"])
        if recorded is None or (seen := signal(recorded, expression)) is None:
            continue
        x, y = seen["time"].values, scale * seen.values
        alone = place is not None and len(results.scenarios) == 1
        name = expression if alone else f"{s['title']}: {expression}"
        name = s["title"] if place is None else name
        curves.append(ChartCurve(name, colour(place if alone and place is not None else k), x, y))
        text = f"{np.abs(y - y[0]).max():.3g}"
        if linear is not None and (answer := signal(linear, expression)) is not None:
            times, values = answer["time"].values, scale * answer.values
            curves.append(ChartCurve(f"{s['title']}, linear", "#000", times, values, True))
            share = relative_difference(seen, answer)
            text += f" ({100 * share:.2g} %)" if np.isfinite(share) else ""
        deviations[s["name"]] = text
    return curves, deviations


def _ring_downs(results: Results) -> str:
    # results of earlier versions do not have the mode of the system that rings
    shown = ring_downs(
        [{"ring_down_mode": next(iter(s["modes"].values()), None), **s} for s in results.scenarios]
    )
    return "" if shown is None else shown.html()


def step_sizes(results: Results) -> str:
    title = titles(results)
    return mode_shifts(
        (
            title[row["scenario"]],
            row["schedule"],
            float(row["step size [s]"]),
            float(row["shift [rad/s]"]),
        )
        for row in results.step_sizes
    ).html()


def provenance(results: Results) -> str:
    parts = []
    attributes = next((d.attrs for d in results.trajectories.values()), {})
    if attributes:
        versions = json.loads(attributes["versions"])
        parts.append(f"<p>{escape(', '.join(f'{name} {v}' for name, v in versions.items()))}</p>")
    fmus: dict[str, tuple[str, str, str]] = {}
    for dataset in results.trajectories.values():
        fmus |= {
            n: (f["model"], f["guid"], f["tool"])
            for n, f in json.loads(dataset.attrs["fmus"]).items()
        }
    rows = [[escape(name), *map(escape, content)] for name, content in fmus.items()]
    if rows:
        listed = table("FMUs", ["Component", "Model", "Guid", "Made by"], rows, left=4)
        parts.append(
            f"<details><summary>{len(rows)} FMUs with their guids</summary>{listed}</details>"
        )
    text = f"<pre>{escape(results.case.text)}</pre>"
    parts.append(
        f"<details><summary>Case file {escape(results.case.name)}</summary>{text}</details>"
    )
    return "".join(parts)
