"""The sections of the page that sweeps and designs fill."""

import json
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
import xarray as xr

from orchestrator.output.report.colours import colour
from orchestrator.output.report.html.charts import (
    ChartCurve,
    Mark,
    complex_plane,
    legend,
    line_chart,
)
from orchestrator.output.report.html.elements import Figures, damping, eigenvalue, number, table


def axis_of(sweep: xr.Dataset) -> str:
    return str([d for d in sweep["frequency"].dims if d not in ("scenario", "trajectory")][-1])


def sweep(sweep: xr.Dataset, scenarios: Sequence[Mapping[str, Any]], figures: Figures) -> str:
    axis = axis_of(sweep)
    others = [d for d in sweep["frequency"].dims if d not in ("scenario", "trajectory", axis)]
    shown = sweep.isel(dict.fromkeys(others, 0))
    names = [str(s) for s in shown["scenario"].values]
    known = [s["name"] for s in scenarios]
    shades = {s: colour(known.index(s) if s in known else k) for k, s in enumerate(names)}
    title = json.loads(sweep.attrs.get("title", "{}"))
    title |= {s["name"]: s["title"] for s in scenarios}
    unit = shown[axis].attrs.get("units", "1")
    label = f"{axis} [{unit}]" if unit != "1" else axis
    key = legend((title.get(s, s), shades[s]) for s in names)
    lines, marks = _trajectories(shown, axis, shades, title)
    ends = f"{shown[axis].values[0]:g} to {shown[axis].values[-1]:g}"
    picture, link = figures.add(
        key + complex_plane(f"Trajectories along {axis}", marks, lines, _highest(shown)),
        f"Modes for {label} from {ends} ({shown.sizes[axis]} points); the large cross is the start. "
        "Each is followed by its eigenvector, so that it keeps its name where modes cross.",
    )
    fixed = "".join(
        f"<p>At {escape(str(d))} = {float(sweep[d].values[0]):g}, the first of its values.</p>"
        for d in others
    )
    parts = [
        f"{fixed}{_unstable(shown, axis, title)}<p>{link} shows how the modes move with {escape(label)}.</p>{picture}"
    ]
    for quantity, text, tick in (
        ("damping", "Damping ratio", "Damping [%]"),
        ("frequency", "Frequency", "Frequency [Hz]"),
    ):
        curves = []
        for s in names:
            found = _curves_by_name(shown, s, axis, quantity)
            for rank, (name, points) in enumerate(found.items()):
                label_of = f"{title.get(s, s)}: {name}" if len(found) > 1 else title.get(s, s)
                curves.append(ChartCurve(label_of, shades[s], *points, dashed=rank > 0))
        if curves:
            picture, link = figures.add(
                key + line_chart(f"{text} along {axis}", label, tick, curves, 260),
                f"{text} along {label} of the modes with a name; dashed: a second mode that has it in part.",
            )
            parts.append(f"<p>{link}: {_extremes(curves, tick)}</p>{picture}")
    parts.append(_states(shown, axis, label, names, title, figures))
    return "".join(parts)


def _unstable(shown: xr.Dataset, axis: str, title: dict[str, str]) -> str:
    if "stable" not in shown:
        return ""
    lines = []
    for s in (str(name) for name in shown["scenario"].values):
        bad = shown["stable"].sel(scenario=s).values == 0
        if bad.any():
            rates = shown["largest_growth_rate"].sel(scenario=s).values[bad]
            where = ", ".join(f"{value:.4g}" for value in shown[axis].values[bad][:8])
            more = " …" if bad.sum() > 8 else ""
            lines.append(
                f'<p class="bad">{escape(title.get(s, s))}: unstable at {axis} = {where}{more} '
                f"({int(bad.sum())} of {bad.size} points, up to {rates.max():+.3g} 1/s)</p>"
            )
    return "".join(lines)


def _trajectories(
    shown: xr.Dataset, axis: str, shades: dict[str, str], title: dict[str, str]
) -> tuple[list[ChartCurve], list[Mark]]:
    lines, marks = [], []
    for s, shade in shades.items():
        one = shown.sel(scenario=s)
        for t in range(one.sizes["trajectory"]):
            real, hz, percent = (
                one[q].isel(trajectory=t).values
                for q in ("eigenvalue_real", "frequency", "damping")
            )
            there = np.isfinite(real) & (real > -3)
            if not there.any():
                continue
            name = str(one["trajectory_name"].values[t])
            lines.append(ChartCurve(name, shade, real[there], hz[there]))
            for n, k in enumerate(np.flatnonzero(there).tolist()):
                text = (
                    f"{name}, {title.get(s, s)}\n{axis} = {shown[axis].values[k]:.4g}\n"
                    f"{hz[k]:.3f} Hz, damping {percent[k]:.2f} %\n{_shares(one, t, k)}"
                )
                marks.append(
                    Mark(
                        float(real[k]),
                        float(hz[k]),
                        shade,
                        text,
                        "dot" if n else "cross",
                        large=True,
                    )
                )
    return lines, marks


def _shares(one: xr.Dataset, trajectory: int, k: int) -> str:
    values = one["participation"].isel(trajectory=trajectory).values[k]
    states = [str(s) for s in one["state"].values]
    order = np.argsort(-np.nan_to_num(values))[:3]
    return "\n".join(f"{states[i]} {values[i]:.3f}" for i in order if np.isfinite(values[i]))


def _highest(shown: xr.Dataset) -> float:
    named = shown["frequency"].where(shown["named"] == 1)
    found = (
        float(named.max()) if bool(np.isfinite(named).any()) else float(shown["frequency"].max())
    )
    return min(1.25 * found, float(shown["frequency"].max()))


def _curves_by_name(
    shown: xr.Dataset, scenario: str, axis: str, quantity: str
) -> dict[str, tuple[Any, Any]]:
    one, found = shown.sel(scenario=scenario), {}
    for t in np.flatnonzero((one["named"] == 1).any(axis).values).tolist():
        values = one[quantity].isel(trajectory=t).values
        there = np.isfinite(values)
        if there.sum() > 1:
            found[str(one["trajectory_name"].values[t])] = (
                shown[axis].values[there],
                values[there],
            )
    return found


def _extremes(curves: list[ChartCurve], unit: str) -> str:
    said = [
        f"{escape(c.label)} from {number(float(c.y[0]), 2)} to {number(float(c.y[-1]), 2)}, "
        f"least {number(float(c.y.min()), 2)} at {c.x[np.argmin(c.y)]:.3g}"
        for c in curves
    ]
    return f"{escape(unit)}: {'; '.join(said)}."


def _states(
    shown: xr.Dataset,
    axis: str,
    label: str,
    names: list[str],
    title: dict[str, str],
    figures: Figures,
) -> str:
    states = [str(s) for s in shown["state"].values]
    if not 0 < len(states) <= 6:
        return ""
    charts = []
    for s in names:
        shares = {
            state: _curves_by_name(
                shown.assign(share=shown["participation"].sel(state=state)), s, axis, "share"
            )
            for state in states
        }
        for name in next(iter(shares.values())):
            curves = [
                ChartCurve(x, colour(k + 1), *shares[x][name])
                for k, x in enumerate(states)
                if name in shares[x]
            ]
            charts.append(
                f"<h3>{escape(title.get(s, s))}: {escape(name)}</h3>"
                + line_chart(
                    f"Participation along {axis}, {s}, {name}", label, "Participation", curves, 170
                )
            )
    if not charts:
        return ""
    key = legend((state, colour(k + 1)) for k, state in enumerate(states))
    picture, link = figures.add(
        key + "".join(charts),
        f"Participation of the swing states in the modes with a name along {label}.",
    )
    return f"<p>{link}: who carries the mode along the sweep.</p>{picture}"


def predicted(sheet: Mapping[str, Any]) -> str:
    """Name the predicted mode: with its gain, where a bound keeps the designed gain away from it."""
    meant, designed = f"{sheet['K_unbounded']:.4g}", f"{sheet['K']:.4g}"
    return "predicted" if meant == designed else f"predicted with K = {meant} pu"


def design(sheet: dict[str, Any]) -> str:
    sensitivity, target = sheet["sensitivity"], sheet["target_mode"]
    modes = {
        "Target, POD off": target,
        f"P{predicted(sheet)[1:]}": sheet["predicted_mode"],
        "Achieved": sheet["achieved_mode"],
    }
    lead_lag = (
        [["Lead/lag", "fixed"]]
        if sheet["N_S"] is None
        else [
            ["T_S1 [s]", f"{sheet['T_S1']:.4f}"],
            ["T_S2 [s]", f"{sheet['T_S2']:.4f}"],
            ["N_S", str(sheet["N_S"])],
        ]
    )
    settings = [
        *lead_lag,
        ["K [pu]", f"{sheet['K']:.1f}"],
        ["K before its bounds [pu]", f"{sheet['K_unbounded']:.1f}"],
    ]
    rows = []
    for name, mode in modes.items():
        percent = -100 * mode["real"] / np.hypot(mode["real"], mode["imag"])
        rows.append(
            [
                name,
                eigenvalue(mode["real"], mode["imag"]),
                f"{mode['imag'] / 2 / np.pi:.3f}",
                damping(percent),
            ]
        )
    kind = "lead" if sensitivity["phase_deg"] >= 0 else "lag"
    needed = "" if sheet["N_S"] is None else f": a {kind} is needed"
    extra = []
    if "stability" in sheet:
        after = sheet["stability"]["after"]
        shade = {True: "good", False: "bad"}.get(after["stable"], "soft")
        extra.append(f'<p class="{shade}">With the final setting: {escape(after["sentence"])}</p>')
    if sheet.get("components"):
        extra.append(
            f"<p>Case {escape(sheet['case'])}, scenario {escape(sheet['scenario'])}, {escape(sheet['mode'])} mode; "
            f"set on {escape(', '.join(sheet['components'][:6]))}"
            + (f" … {len(sheet['components'])} in all" if len(sheet["components"]) > 6 else "")
            + f". Finite difference with ΔK = {sheet['requirement']['delta_gain']:g} pu.</p>"
        )
    return "".join(extra) + (
        f"<p>Non-compensated eigenvalue sensitivity {sensitivity['magnitude']:.4g} rad/s per pu ∠ "
        f"{number(sensitivity['phase_deg'], 1)}°{needed}.</p>"
        + table("Setting", ["Parameter", "Value"], settings)
        + table("Modes", ["Mode", "λ [rad/s]", "f [Hz]", "Damping [%]"], rows)
        + _aimed_at(sheet)
        + _margins(sheet.get("margins") or {})
    )


def _aimed_at(sheet: Mapping[str, Any]) -> str:
    """Say why the predicted mode has less damping than is required."""
    required, aimed = sheet["requirement"]["damping_ratio"], sheet["predicted_mode"]
    has = -aimed["real"] / np.hypot(aimed["real"], aimed["imag"])
    return (
        f"<p>The equations shift the real part alone, to {100 * required:.2f} % of the mode's frequency in rad/s, "
        f"which is {100 * has:.2f} % of damping; the frequency moves as well in the closed loop.</p>"
    )


def _margins(margins: dict[str, Any]) -> str:
    if not margins:
        return ""
    up, down = margins["gain_up"], margins["gain_down"]
    rows = [
        [
            "Gain, upwards",
            f"more than × {margins['largest_factor_tried']:g}" if up is None else f"× {up:.3g}",
        ],
        ["Gain, downwards", "down to 0" if down is None else f"× {down:.3g}"],
    ]
    for name, key, times, unit in (
        ("Phase", "phase_margin_deg", 1.0, "°"),
        ("Delay", "delay_margin_s", 1e3, " ms"),
    ):
        if margins.get(key) is not None:
            at = margins.get(f"{key.rpartition('_')[0]}_hz")
            there = "" if at is None else f" at {at:.3g} Hz"
            rows.append([name, f"{times * margins[key]:.1f}{unit}{there}"])
    limit = f"no eigenvalue unstable, no mode from 0.1 to 2 Hz below {100 * margins['damping_limit']:.2f} %"
    caption = f"Margins; of the gain: {limit}"
    return table(caption, ["Of the POD loop", "Value"], rows)
