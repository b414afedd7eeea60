"""Chapters of studies of many points: screening, siting, designs, limits and sweeps, sensitivities, interactions."""

import json
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import xarray as xr

from orchestrator.cases.questions.idle_values import DAMPING_CONTROLLERS
from orchestrator.core.errors import few, number_of
from orchestrator.core.options import Option
from orchestrator.core.truth import all_true
from orchestrator.output.report.colours import colour
from orchestrator.output.report.html import studies
from orchestrator.output.report.html.chapters.chapter import (
    Chapter,
    Content,
    bases_of,
    kinds_of,
    modes_map,
)
from orchestrator.output.report.html.charts import bar_chart
from orchestrator.output.report.html.elements import VERDICTS, table, with_minus
from orchestrator.output.report.html.least_damped import LeastDamped
from orchestrator.output.report.short_texts import first_sentence

_SHOWN = 4
"""Parameters that an answer names and a picture shows: the strongest ones."""

_DESIGNED = ("target", "predicted", "achieved")


def of_screening(file: Path, c: Content) -> Chapter:
    least = min(c["modes"], key=lambda mode: mode["worst"]["damping_percent"], default=None)
    told = []
    if least is not None:
        told.append(LeastDamped.of({**least["worst"], "components": least.get("participation")}))
    lost = []
    for failure in c["failures"]:
        point = "" if c["points"] == 1 else f"{failure['point']}, "
        why = f"{failure['status']}: {first_sentence(failure['why'])}"
        lost.append(f"{point}outage {failure['outage']}: {why}")
    verdict = c.get("verdict")  # none in results of earlier versions
    beyond = c.get("beyond_rating") if verdict is None else None  # the verdict tells of it
    if not c.get("complete", True):
        lost.append("the cases that were not computed yet")
    computed = int(c["items"]) - len(c["failures"])
    counted = c["counted_at_all_frequencies"]
    if not isinstance(counted, bool) and counted < computed:
        lost.append(
            f"growth outside of the range at {computed - counted} of {computed} cases: "
            + Option.WHOLE
            + " counts it"
        )
    return Chapter(
        file,
        "Which operating point and which outage is worst?",
        verdict or _verdict_by_figures(c, least),
        c["stable"],
        f"{computed} of {number_of(c['items'], 'case')} computed, {_growth_counted(counted, computed)}",
        lost,
        doubts=[beyond] if beyond else [],
        page="screening.html",
        least=told,
    )


def _verdict_by_figures(c: Content, least: Content | None) -> str:
    """Return the verdict on a screening that has not written it."""
    where = "somewhere" if c["stable"] is False else "everywhere"
    points, outages = number_of(c["points"], "operating point"), number_of(c["outages"], "outage")
    answer = f"{VERDICTS[c['stable']]} {where} of {points} and {outages}"
    if least is None:
        return answer
    worst = least["worst"]
    at = "" if c["points"] == 1 else f"{worst['point']}, "
    figures = f"{worst['frequency_hz']:.3f} Hz, {worst['damping_percent']:.2f} %"
    return f"{answer}; least damped {figures}, {at}outage {worst['outage']}"


def _growth_counted(counted: int, computed: int) -> str:
    """Tell at how many cases growth at any frequency was counted; results of earlier versions say yes or no."""
    everywhere = counted if isinstance(counted, bool) else counted >= computed
    if everywhere:
        return "growth was counted at all frequencies"
    some = "some" if isinstance(counted, bool) else f"{counted} of {computed}"
    return f"growth outside of the range was counted at {some} of them only"


def of_site(file: Path, c: Content) -> Chapter:
    sure = "; ".join(c["sure"])
    good = bool(c["confirmed"]) or None if c["agrees"] else False
    least = [LeastDamped.of(mode) for mode in c.get("modes", ())[:1]]
    terminals = c.get("terminals_left_out", ())
    lost = [*c.get("open_points", ())]
    if terminals:
        named = few(terminals, _SHOWN)
        lost.append(f"the terminals of units, {named}: " + Option.BUSES + " 'bus_*' takes them")
    return Chapter(
        file,
        "Where does a converter help most?",
        c["answer"],
        good,
        sure,
        lost,
        page="site.html",
        least=least,
    )


def of_design(file: Path, c: Content) -> Chapter:
    controller = DAMPING_CONTROLLERS.get(c["controller"], c["controller"])
    before, after = (100 * c[f"{when}_damping_ratio"] for when in ("target", "achieved"))
    wanted = 100 * c["requirement"]["damping_ratio"]
    answer = (
        f"{'yes' if c['met'] else 'not as required'}: with K = {c['K']:.4g} pu the mode has {after:.2f} % of damping, "
        f"{before:.2f} % before, {wanted:.2f} % wanted"
    )
    less = c.get("less_gain")
    if less:
        answer += (
            f"; less gain has more: {100 * less['damping_ratio']:.2f} % with K = {less['K']:.4g} pu"
        )
    thin = c.get("thin_margin_damping_ratio")
    if thin:
        answer += f"; no margin: {100 * thin:.2f} % with 20 % more gain"
    spoilt = c.get("larger_gain_spoils")
    if c["met"] and spoilt:
        answer += f"; no margin: with 20 % more gain {spoilt}"
    told = c.get("remarks", [c["verdict"]])  # results of earlier versions have the verdict alone
    sure = "; ".join(["closed loop of the coupled FMUs", *told])
    words = ("without the controller", studies.predicted(c), "with it")
    modes = {word: [c[f"{which}_mode"]] for word, which in zip(words, _DESIGNED, strict=True)}
    content = modes_map("The mode that was designed for", modes) + studies.design(dict(c))
    return Chapter(
        file,
        f"Does {controller} damp the {c['mode']} mode?",
        answer,
        bool(c["met"]),
        sure,
        content=content,
        title=f"Design of {controller}",
    )


def of_coordinated(file: Path, c: Content) -> Chapter:
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


def of_limits(file: Path, found: Any) -> Chapter:
    answer = _limits_text(found)
    sure = f"{sum(len(x['tried']) for x in found)} values tried, then bisected"
    return Chapter(file, f"How far may {found[0]['parameter']} go?", answer, None, sure)


def _limits_text(found: Any) -> str:
    """Every limit of every scenario; an older result has the first alone."""
    return "; ".join(
        f"{x['scenario']}: {'; '.join(x.get('lines') or [x['sentence']])}" for x in found
    )


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
    open_ = [f"stability at {number_of(unknown, 'point')}"] if unknown else []
    doubts = json.loads(sweep.attrs.get("warned", "[]"))
    about = {
        "models": sweep.attrs.get("models"),
        "basis": json.loads(sweep.attrs.get("basis", "{}")),
    }
    models, bases = "".join(f"{kind}; " for kind in kinds_of([about])), bases_of([about])
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
            doubts=doubts,
            bases=bases,
        )
    told = json.loads(sweep.attrs.get("verdicts", "[]"))  # none in results of earlier versions
    said = "; ".join(_verdict_of_scenario(one, alone=len(told) == 1) for one in told)
    good = all_true(one["stable"] for one in told) if told else None
    if lost and not told:
        said, good = f"UNSTABLE at {number_of(lost, 'point')}", False
    least_damping = f"least damping {float(least.min()):.2f} % at {where}"
    return Chapter(
        place,
        f"How do the modes move along {studies.axis_of(sweep)}?",
        "; ".join(filter(None, (said, least_damping))),
        good,
        f"{models}each point is a linear model of the coupled FMUs there",
        open_,
        doubts=doubts,
        bases=bases,
    )


def _verdict_of_scenario(told: Content, *, alone: bool) -> str:
    """A scenario's verdict over all points; the only one needs no name."""
    return str(told["sentence"]) if alone else f"{told['scenario']}: {told['sentence']}"


def of_interactions(file: Path, c: Content) -> Chapter:
    worst = next((p for p in c["pairs"] if p["vendors"] == c["worst_pair"]), None)
    whole = c["as_in_the_case"]["stable"]
    verdicts = [whole, *(one["stable"] for one in (*c["pairs"], *c.get("assignments", [])))]
    good = all_true(verdicts)
    answer = f"{VERDICTS[whole]} as in the case; {number_of(len(c['interaction_modes']), 'mode')} that vendors share"
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


def of_sensitivities(file: Path, c: Content) -> Chapter:
    key, mode = "damping_points_per_percent", c["mode"]
    found = sorted((r for r in c["sensitivities"] if r[key]), key=lambda r: -abs(r[key]))
    first = found[:_SHOWN]
    rows = [
        [
            escape(r["parameter"]),
            f"{r['value']:.5g} {escape(r['unit'])}".removesuffix(" 1"),
            with_minus(f"{r[key]:+.3g}"),
            with_minus(f"{r['frequency_hz_per_percent']:+.3g}"),
            escape(r["doubts"]),
        ]
        for r in found
    ]
    said = (
        ", ".join(f"{r['parameter']} ({with_minus(f'{r[key]:+.2g}')})" for r in first)
        or "no parameter"
    )
    answer = f"{mode['frequency_hz']:.3f} Hz, {mode['damping_percent']:.2f} %: most by {said} points for 1 % more"
    answer = f"UNSTABLE; {answer}" if c["stable"] is False else answer
    bars = ""
    if first:
        bars = bar_chart(
            "Points of damping",
            [r["parameter"] for r in first],
            [("1 % more", colour(1), [abs(r[key]) for r in first])],
            "Points by 1 %, without sign",
        )
    columns = ["Parameter", "Value", "Points by 1 %", "Hz by 1 %", "Doubts"]
    return Chapter(
        file,
        f"What moves the {mode['name'] or 'critical'} mode of {c['scenario']}?",
        answer=answer,
        good=None,
        sure=f"{c['derivative']} derivatives by {number_of(len(found), 'parameter')}",
        not_judged=_without_derivative(c["sensitivities"]),
        content=bars + table("By the size of their effect", columns, rows),
    )


def _without_derivative(sensitivities: Sequence[Content]) -> list[str]:
    """Tell each reason once, with the parameters that have no derivative for it."""
    told = dict[str, list[str]]()
    for one in sensitivities:
        if one["reason"]:
            told.setdefault(one["reason"], []).append(one["parameter"])
    return [f"{few(names, _SHOWN)}: {reason}" for reason, names in told.items()]
