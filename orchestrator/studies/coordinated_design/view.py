"""A design over operating points as Python has it, and its files: parameters, JSON, rows for points and converters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from orchestrator.cases.form.parameter_files import parameter_file_text
from orchestrator.core.late import pd
from orchestrator.core.safe_files import write_text
from orchestrator.core.truth import NoTruth
from orchestrator.output.report.column_table import Column, ColumnTable
from orchestrator.output.report.notebook import headline, page
from orchestrator.output.report.terminal_tables import PlainTable, make_table
from orchestrator.output.results.file_writers import save_json
from orchestrator.output.results.manifest import made_now
from orchestrator.studies.coordinated_design.search import RankedConverter
from orchestrator.studies.coordinated_design.settings import PodGroup
from orchestrator.studies.coordinated_design.study import PointsDesign, values_of
from orchestrator.studies.coordinated_design.verdict import JudgedPoint, PlacedMode, PointsVerdict
from orchestrator.studies.coordinated_design.words import (
    about_settings,
    remarks,
    verdict_sentence,
    what_it_rests_on,
)
from orchestrator.studies.pod_design.closed_loop import PodSetting
from orchestrator.studies.pod_design.view import COMMAND, parameter_file_path

_ROWS = 12


class CoordinatedDesign(NoTruth, ask=".met, which is True, False, or None where it is not known"):
    """POD controllers for many operating points and outages. `Case.design_over_points` makes it.

    Attributes
    ----------
    result
        Every figure on the way.
    """

    def __init__(self, result: PointsDesign) -> None:
        self.result = result

    @property
    def met(self) -> bool | None:
        """True if the wanted damping is reached at every point; where none is wanted, if the least one is better.

        None where points have no modes, and no other point says no."""
        return self.result.verdict.met

    @property
    def verdict(self) -> str:
        """The verdict in one sentence, with the point, the outage and the mode that limit."""
        return verdict_sentence(self.result.verdict)

    @property
    def parameters(self) -> dict[str, Any]:
        """The settings by ``component.variable``: the values of a scenario with these controllers."""
        return values_of(self.result.plan.groups, self.result.settings)

    def points(self) -> pd.DataFrame:
        """One row for each operating point with each outage: status, verdict, damping without and with it [%]."""
        return points_table(self.result.verdict).frame()

    def ranking(self) -> pd.DataFrame:
        """One row for each converter, the best first: what a controller there alone would give."""
        return ranking_table(self.result).frame()

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor design --points --json`` prints, as JSON's types."""
        return as_json(self.result)

    def save(self, path: str | Path, command: str | None = None) -> list[Path]:
        """Write the parameter file, and beside it JSON, a row for each point and a row for each converter.

        ``command``: what the file names as its origin; by default the call in Python.
        """
        file = parameter_file_path(path)
        said = (
            command or f"gfor.load({self.result.plan.case.name!r}).design_over_points(…) in Python"
        )
        points, ranking = file.with_suffix(".csv"), file.with_name(f"{file.stem}_ranking.csv")
        write_text(file, parameter_file_text(self.parameters, provenance(self.result, said)))
        save_json(self.as_json() | {"made": made_now()}, file.with_suffix(".json"))
        points_table(self.result.verdict).save(points)
        ranking_table(self.result).save(ranking)
        return [file, file.with_suffix(".json"), points, ranking]

    def __repr__(self) -> str:
        return f"<CoordinatedDesign for {self.result.plan.case.name}: {self.verdict}>"

    def _repr_html_(self) -> str:
        settings = ", ".join(f"{k} = {v}" for k, v in self.parameters.items())
        lines, top = [what_it_rests_on(self.result), settings], headline(self.verdict, self.met)
        title = f"Design over points of {self.result.plan.case.name}"
        return page(title, lines, self.points(), verdict=top)


def as_json(design: PointsDesign) -> dict[str, Any]:
    plan, request, verdict = design.plan, design.plan.request, design.verdict
    lowered = [
        _where(point) | {"before": _mode(point.target_before), "after": _mode(point.target)}
        for point in verdict.lowered
    ]
    apart = [_where(point) | {"mode": _mode(mode)} for point, mode in verdict.apart]
    limiting = None
    if verdict.limiting is not None:
        limiting = _where(verdict.limiting) | {"mode": _mode(verdict.limiting.target)}
    failed = [_where(point) | {"why": point.why_not} for point in verdict.failed]
    harmed = [_where(point) | {"mode": _mode(point.other)} for point in verdict.harmed]
    astray = [_where(point) | {"difference": point.astray} for point in verdict.astray]
    return {
        **plan.prepared.about,
        "verdict": verdict_sentence(verdict),
        "met": verdict.met,
        "stable": verdict.stable,
        "wanted_damping_ratio": request.damping,
        "modes": list(request.modes) or "all",
        "least_damping_of_others": request.least_damping,
        "gain_bounds": list(request.gain_bounds),
        "lowered": lowered,
        "worst_damping_ratio": {"before": verdict.worst_before, "after": verdict.worst},
        "least_of_all": {
            "before": _least_json(verdict.least_before, "least_before"),
            "after": _least_json(verdict.least, "least"),
        },
        "apart": apart,
        "thin_margin_damping_ratio": verdict.thin,
        "limiting": limiting,
        "points": len(plan.read.points),
        "outages": len(plan.read.outages) - 1,
        "items": len(verdict.points),
        "failed": failed,
        "unstable": list(map(_where, verdict.unstable)),
        "harmed": harmed,
        "astray": astray,
        "unforeseen": list(map(_where, verdict.unforeseen)),
        "warnings": [*about_settings(design), *remarks(verdict)],
        "left_out": [group.name for group in design.left_out],
        "settings": [_setting_json(group, setting) for group, setting in design.used],
        "all": list(map(_point_json, verdict.points)),
        "ranking": list(map(_ranked, design.ranking)),
        "search": {
            "worst_damping_ratio": design.found.worth.worst,
            "evaluations": design.evaluations,
            "linear_programs": design.found.steps,
        },
    }


def _setting_json(group: PodGroup, setting: PodSetting) -> dict[str, Any]:
    compensation: dict[str, float | None] = dict.fromkeys(("T_S1", "T_S2", "N_S"))
    if not group.has_gain_alone:
        T_S1, T_S2 = setting.filters.T_S1, setting.filters.T_S2
        compensation = {"T_S1": T_S1, "T_S2": T_S2, "N_S": group.stages}
    return {
        "controller": group.controller,
        "components": list(group.components),
        "K": setting.gain,
        **compensation,
    }


def _point_json(point: JudgedPoint) -> dict[str, Any]:
    return _where(point) | {
        "stable": point.stable,
        "before": _mode(point.target_before),
        "after": _mode(point.target),
        "least_of_all_before": _mode(point.least_before),
        "least_of_all_after": _mode(point.least),
        "allowed": None if point.worth is None else point.worth.allowed,
        "why": point.why_not,
    }


def _where(point: JudgedPoint) -> dict[str, Any]:
    return {"point": point.point.name, "outage": point.outage.name, "place": point.point.place}


def _least_json(point: JudgedPoint | None, name: str) -> dict[str, Any] | None:
    return None if point is None else _where(point) | {"mode": _mode(getattr(point, name))}


def _mode(mode: PlacedMode | None) -> dict[str, Any] | None:
    if mode is None:
        return None
    return {
        "real": mode.value.real,
        "imag": mode.value.imag,
        "damping_ratio": mode.damping_ratio,
        "who": mode.who,
    }


def _ranked(one: RankedConverter) -> dict[str, Any]:
    setting = one.setting
    gain = T_S1 = T_S2 = None
    if setting is not None:
        gain = setting.gain
        # without stages that are designed there are no time constants: the device's own may be others
        if one.stages:
            T_S1, T_S2 = setting.filters.T_S1, setting.filters.T_S2
    return {
        "component": one.place.component,
        "controller": one.place.controller,
        "worst_damping_ratio": one.worst,
        "worst_damping_ratio_of_all_modes": one.least,
        "K": gain,
        "T_S1": T_S1,
        "T_S2": T_S2,
        "shift_rad_s_per_pu": one.shift,
    }


def settings_table(design: PointsDesign) -> PlainTable:
    columns = ("Controller", "K [pu]", "T_S1 [s]", "T_S2 [s]", "N_S", "Lead [°]", "of")
    rows = [
        (group.name, *_setting(group, setting), str(len(group.components)))
        for group, setting in design.used
    ]
    return make_table("Settings", *columns, rows=rows)


def _setting(group: PodGroup, setting: PodSetting) -> list[str]:
    filters = setting.filters
    if group.has_gain_alone:
        return [f"{setting.gain:.5g}", "fixed", "fixed", "fixed", "–"]
    angle = filters.N_S * filters.stage_angle_deg if filters.T_S1 else 0.0
    return [
        f"{setting.gain:.5g}",
        f"{filters.T_S1:.4f}",
        f"{filters.T_S2:.4f}",
        str(filters.N_S),
        f"{angle:+.1f}",
    ]


def points_table(verdict: PointsVerdict) -> ColumnTable[JudgedPoint]:
    """Each operating point with each outage; "" where there is no figure."""

    def of(mode: PlacedMode | None, figure: str) -> float | str:
        if mode is None:
            return ""
        return 100 * mode.damping_ratio if figure == "damping" else mode.frequency_hz

    of_all = "all modes [%]" if verdict.names or verdict.some_apart else ""
    return ColumnTable(
        "Points and outages",
        (
            Column("Point", lambda p: p.point.name, name="point"),
            Column("Outage", lambda p: p.outage.name, name="outage"),
            Column("", lambda p: p.point.hours, name="hours"),
            Column("", _status, name="status"),
            Column("", lambda p: _lower(p.stable), name="stable"),
            Column(
                "before [%]",
                lambda p: of(p.target_before, "damping"),
                _two,
                "damping_before_percent",
            ),
            Column(
                "f before [Hz]",
                lambda p: of(p.target_before, "frequency"),
                _three,
                "frequency_before_hz",
            ),
            Column("with it [%]", lambda p: of(p.target, "damping"), _two, "damping_percent"),
            Column("f [Hz]", lambda p: of(p.target, "frequency"), _three, "frequency_hz"),
            Column(
                "",
                lambda p: of(p.least_before, "damping"),
                _two,
                "least_of_all_before_percent",
            ),
            Column(of_all, lambda p: of(p.least, "damping"), _two, "least_of_all_percent"),
            Column("Who", lambda p: "" if p.target is None else p.target.who, name="who"),
            Column(
                "", lambda p: "" if p.worth is None else _lower(p.worth.allowed), name="allowed"
            ),
            Column("", _reason, name="why"),
            Column("Stable", lambda p: {True: "yes", False: "NO", None: "not known"}[p.stable]),
        ),
        verdict.points,
        left=2,
    )


def _status(point: JudgedPoint) -> str:
    """The status with the controllers, or that before where already this could not be computed."""
    return str(point.after.status if point.before.computed else point.before.status)


def _reason(point: JudgedPoint) -> str:
    """Why it has no figures, and what is to be doubted of those that it has."""
    return "; ".join(filter(None, (point.why_not, *point.after.warnings)))


def _lower(value: bool | None) -> str:
    return "" if value is None else str(value).lower()


def _two(figure: float | str) -> str:
    return "–" if isinstance(figure, str) else f"{figure:.2f}"


def _three(figure: float | str) -> str:
    return "–" if isinstance(figure, str) else f"{figure:.3f}"


def least_damped_table(verdict: PointsVerdict) -> ColumnTable[JudgedPoint]:
    having = [(point, point.target) for point in verdict.known if point.target is not None]
    ordered = [point for point, _ in sorted(having, key=lambda entry: entry[1].damping_ratio)][
        :_ROWS
    ]
    title = f"The {len(ordered)} least damped of {len(verdict.points)} points and outages"
    return replace(points_table(verdict), title=title, rows=ordered)


def ranking_table(design: PointsDesign) -> ColumnTable[RankedConverter]:
    """Converters by what a controller there alone would give; "" where no controller was searched."""

    def setting(name: str) -> Callable[[RankedConverter], Any]:
        def value(one: RankedConverter) -> Any:
            found = _ranked(one)[name]
            return "" if found is None else found

        return value

    def in_format(form: str) -> Callable[[Any], str]:
        return lambda figure: "–" if figure == "" else f"{figure:{form}}"

    names = design.plan.request.modes
    of_wanted = "least damping [%]"
    of_all = ""
    if names or any(one.worst != one.least for one in design.ranking):
        of_wanted = "of the modes that any moves [%]"
        of_all = "of all modes [%]"
    if names:
        of_wanted = f"of {', '.join(names)} [%]"

    title = "Converters by what a controller there alone gives: the least damping of all points, computed anew"
    return ColumnTable(
        title,
        (
            Column("Converter", lambda one: one.place.component, name="converter"),
            Column("Controller", lambda one: one.place.controller, name="controller"),
            Column(of_wanted, lambda one: _least_damping(one, one.worst)),
            Column(of_all, lambda one: _least_damping(one, one.least)),
            Column("", lambda one: _percent(one.worst), name="least_damping_percent"),
            Column("", lambda one: _percent(one.least), name="least_damping_of_all_percent"),
            Column("K [pu]", setting("K"), in_format(".4g"), "K"),
            Column("T_S1 [s]", setting("T_S1"), in_format(".4f"), "T_S1"),
            Column("T_S2 [s]", setting("T_S2"), in_format(".4f"), "T_S2"),
            Column(
                "shift by 1 pu [rad/s]",
                setting("shift_rad_s_per_pu"),
                in_format(".3g"),
                "shift_rad_s_per_pu",
            ),
        ),
        design.ranking,
        2,
        _ROWS,
        "the files",
    )


def _least_damping(one: RankedConverter, ratio: float | None) -> str:
    if one.setting is None:
        return "–"
    return "unstable or not known" if ratio is None else f"{100 * ratio:.2f}"


def _percent(ratio: float | None) -> float | str:
    return "" if ratio is None else 100 * ratio


def provenance(design: PointsDesign, command: str) -> list[str]:
    plan = design.plan
    return [
        f"POD controllers for {plan.case.name}, scenario {plan.prepared.name}, designed over {len(design.points)} "
        "operating points and outages",
        f"{COMMAND}{command}",
        verdict_sentence(design.verdict).replace("\n", " "),
        "K in pu of the converter's rating, T_S1 and T_S2 in s",
    ]
