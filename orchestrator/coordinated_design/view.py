"""A design over operating points as Python has it, and its files: parameters, JSON, rows for points and converters."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

from orchestrator.cases.parameter_files import parameter_file_text
from orchestrator.coordinated_design.ranking import RankedConverter
from orchestrator.coordinated_design.study import PointsDesign, values_of
from orchestrator.coordinated_design.verdict import JudgedPoint, PlacedMode, PointsVerdict
from orchestrator.coordinated_design.words import verdict_sentence, what_it_rests_on
from orchestrator.late import pd
from orchestrator.pod_design.view import parameter_file_path
from orchestrator.report.notebook import page
from orchestrator.results.storage import save_json
from orchestrator.safe_files import write_text

_OF_POINTS = ("point", "outage", "hours", "status", "stable", "damping_before_percent", "frequency_before_hz",
              "damping_percent", "frequency_hz", "who", "allowed", "why")  # fmt: skip
_OF_RANKING = ("converter", "controller", "least_damping_percent", "K", "T_S1", "T_S2", "shift_rad_s_per_pu")


class CoordinatedDesign:
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
        """Whether the wanted damping is reached at every point; where none is wanted, whether the least one is better.

        None where points have no modes, and no other point says no.
        """
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
        return pd.DataFrame(points_rows(self.result.verdict))

    def ranking(self) -> pd.DataFrame:
        """One row for each converter, the best first: what a controller there alone would give."""
        return pd.DataFrame(ranking_rows(self.result))

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor design --points --json`` prints, as JSON's types."""
        return as_json(self.result)

    def save(self, path: str | Path, command: str | None = None) -> list[Path]:
        """Write the parameter file, and beside it JSON, a row for each point and a row for each converter.

        Parameters
        ----------
        path
            Path of the parameter file, which ``--parameters`` and `Case.scenario` take.
        command
            The command that the file names as its origin; by default the call in Python.

        Raises
        ------
        InputError
            If the path is none, or ends in ``.json``.
        ResultsError
            If a file cannot be written.
        """
        file = parameter_file_path(path)
        said = command or f"gfor.load({self.result.plan.case.name!r}).design_over_points(…) in Python"
        points, ranking = file.with_suffix(".csv"), file.with_name(f"{file.stem}_ranking.csv")
        write_text(file, parameter_file_text(self.parameters, provenance(self.result, said)))
        save_json(self.as_json(), file.with_suffix(".json"))
        write_text(points, _csv(_OF_POINTS, points_rows(self.result.verdict)))
        write_text(ranking, _csv(_OF_RANKING, ranking_rows(self.result)))
        return [file, file.with_suffix(".json"), points, ranking]

    def __repr__(self) -> str:
        return f"<CoordinatedDesign for {self.result.plan.case.name}: {self.verdict}>"

    def _repr_html_(self) -> str:
        lines = [
            self.verdict,
            what_it_rests_on(self.result),
            ", ".join(f"{k} = {v}" for k, v in self.parameters.items()),
        ]
        return page(f"Design over points of {self.result.plan.case.name}", lines, self.points())


def as_json(design: PointsDesign) -> dict[str, Any]:
    """The design as JSON's types."""
    plan, request, verdict = design.plan, design.plan.request, design.verdict
    limiting = verdict.limiting
    return {
        "case": plan.case.name,
        "scenario": plan.prepared.name,
        "verdict": verdict_sentence(verdict),
        "met": verdict.met,
        "stable": verdict.stable,
        "wanted_damping_ratio": request.damping,
        "modes": list(request.modes) or "all",
        "least_damping_of_others": request.least_damping,
        "gain_bounds": list(request.gain_bounds),
        "worst_damping_ratio": {"before": verdict.worst_before, "after": verdict.worst},
        "limiting": None if limiting is None else _where(limiting) | {"mode": _mode(limiting.target)},
        "points": len(plan.points),
        "outages": len(plan.outages) - 1,
        "items": len(verdict.points),
        "failed": [_where(point) | {"why": point.why_not} for point in verdict.failed],
        "unstable": [_where(point) for point in verdict.unstable],
        "harmed": [_where(point) | {"mode": _mode(point.other)} for point in verdict.harmed],
        "astray": [_where(point) | {"difference": point.astray} for point in verdict.astray],
        "unforeseen": [_where(point) for point in verdict.unforeseen],
        "settings": [
            {
                "controller": group.controller,
                "components": list(group.components),
                "K": setting.gain,
                "T_S1": setting.filters.T_S1,
                "T_S2": setting.filters.T_S2,
                "N_S": group.stages,
            }
            for group, setting in zip(plan.groups, design.settings, strict=True)
        ],
        "all": [_point(point) for point in verdict.points],
        "ranking": [_ranked(one) for one in design.ranking],
        "search": {
            "worst_damping_ratio": design.found.worth.worst,
            "evaluations": design.evaluations,
            "linear_programs": design.found.steps,
        },
    }


def _where(point: JudgedPoint) -> dict[str, Any]:
    return {"point": point.point.name, "outage": point.outage.name, "place": point.point.place}


def _mode(mode: PlacedMode | None) -> dict[str, Any] | None:
    if mode is None:
        return None
    return {"real": mode.value.real, "imag": mode.value.imag, "damping_ratio": mode.damping_ratio, "who": mode.who}


def _point(point: JudgedPoint) -> dict[str, Any]:
    return _where(point) | {
        "stable": point.stable,
        "before": _mode(point.target_before),
        "after": _mode(point.target),
        "allowed": None if point.worth is None else point.worth.allowed,
        "why": point.why_not,
    }


def _ranked(one: RankedConverter) -> dict[str, Any]:
    setting = one.setting
    return {
        "component": one.place.component,
        "controller": one.place.controller,
        "worst_damping_ratio": one.worst,
        "K": None if setting is None else setting.gain,
        "T_S1": None if setting is None else setting.filters.T_S1,
        "T_S2": None if setting is None else setting.filters.T_S2,
        "shift_rad_s_per_pu": one.shift,
    }


def points_rows(verdict: PointsVerdict) -> list[dict[str, Any]]:
    """One row for each operating point with each outage; "" where there is no figure."""
    rows = []
    for point in verdict.points:
        before, after = point.target_before, point.target
        status = point.before.status if not point.before.computed else point.after.status
        why = "; ".join(text for text in (point.why_not, *point.after.warnings) if text)
        allowed = "" if point.worth is None else str(point.worth.allowed).lower()
        stable = "" if point.stable is None else str(point.stable).lower()
        figures = [figure for mode in (before, after) for figure in _figures(mode)]
        cells = (point.point.name, point.outage.name, point.point.hours, str(status), stable, *figures,
                 "" if after is None else after.who, allowed, why)  # fmt: skip
        rows.append(dict(zip(_OF_POINTS, cells, strict=True)))
    return rows


def _figures(mode: PlacedMode | None) -> tuple[float | str, float | str]:
    return ("", "") if mode is None else (100 * mode.damping_ratio, mode.frequency_hz)


def ranking_rows(design: PointsDesign) -> list[dict[str, Any]]:
    """One row for each converter, the best first; "" where no controller was searched."""
    rows = []
    for one in design.ranking:
        own = _ranked(one)
        damping = "" if one.worst is None else 100 * one.worst
        rest = ["" if own[name] is None else own[name] for name in ("K", "T_S1", "T_S2", "shift_rad_s_per_pu")]
        cells = (one.place.component, one.place.controller, damping, *rest)
        rows.append(dict(zip(_OF_RANKING, cells, strict=True)))
    return rows


def _csv(columns: tuple[str, ...], rows: list[dict[str, Any]]) -> str:
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def provenance(design: PointsDesign, command: str) -> list[str]:
    """The comments of the parameter file."""
    plan = design.plan
    return [
        f"POD controllers for {plan.case.name}, scenario {plan.prepared.name}, designed over {len(design.points)} "
        "operating points and outages",
        f"command: {command}",
        verdict_sentence(design.verdict).replace("\n", " "),
        "K in pu of the converter's rating, T_S1 and T_S2 in s",
    ]
