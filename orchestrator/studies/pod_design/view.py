"""A POD design as Python has it, as JSON, and as a parameter file's values and comments."""

from __future__ import annotations

from dataclasses import astuple
from itertools import zip_longest
from pathlib import Path
from typing import Any

from orchestrator.cases.form.parameter_files import parameter_file_text
from orchestrator.cases.questions.idle_values import DAMPING_CONTROLLERS
from orchestrator.core.asked import path as path_of
from orchestrator.core.errors import InputError
from orchestrator.core.late import pd
from orchestrator.core.safe_files import write_text
from orchestrator.core.spelling import spelled
from orchestrator.core.truth import NoTruth
from orchestrator.linear.spectra.modes import Mode, damping_percent, damping_ratio
from orchestrator.output.report.notebook import headline, page
from orchestrator.output.results.file_writers import save_json
from orchestrator.output.results.manifest import made_now
from orchestrator.studies.pod_design.closed_loop import Placed, PodSetting
from orchestrator.studies.pod_design.design import PodDesign
from orchestrator.studies.pod_design.lead_lag import LeadLag, angle_deg
from orchestrator.studies.pod_design.margins import Margins
from orchestrator.studies.pod_design.sheet import mode_text, percent, remarks, verdict

COMMAND = "command: "
"""How the line of a parameter file begins that holds the command which made it."""
OUTCOME = "with it: "
"""How its line begins that tells the mode with the controller."""


class ControllerDesign(NoTruth, ask=".met"):
    """A POD controller, and the closed loop with it. `Case.design` makes it.

    Attributes
    ----------
    result
        Every figure on the way.
    """

    def __init__(self, result: PodDesign) -> None:
        self.result = result

    @property
    def met(self) -> bool:
        """Return whether the closed loop has the required damping, and leaves the other modes alone."""
        return self.result.met

    @property
    def parameters(self) -> dict[str, bool | float | str]:
        """The setting by ``component.variable``: the values of a scenario with this controller."""
        return parameters_of(self.result)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return what is to be borne in mind of the design."""
        return self.result.warnings

    @property
    def verdict(self) -> str:
        """The verdict in one sentence, with the bound where the gain stands at one."""
        return spelled(verdict(self.result))

    def table(self) -> pd.DataFrame:
        """The mode before and after: eigenvalue [1/s, rad/s] and damping ratio, beside the required one."""
        r = self.result
        required = 100 * r.required_damping
        rows = {
            "without the controller": (r.initial, None),
            "predicted": (r.predicted, required),
            "with it": (r.achieved, required),
        }
        cells = [
            (value.real, value.imag, damping_percent(value), wanted)
            for value, wanted in rows.values()
        ]
        return pd.DataFrame(
            cells, index=list(rows), columns=["real", "imag", "damping_percent", "required_percent"]
        )

    def as_json(self, parameter_file: str | Path | None = None) -> dict[str, Any]:
        """The same as ``gfor design --json`` prints, as JSON's types.

        Parameters
        ----------
        parameter_file
            Path of the parameter file, which the command names at the end; left out where None.
        """
        named = {} if parameter_file is None else {"parameter_file": str(parameter_file)}
        return design_json(self.result) | named

    def save(self, path: str | Path, command: str | None = None) -> Path:
        """Write the parameter file, which ``--parameters`` and `Case.scenario` take, and its JSON for ``gfor report``.

        ``command``: what the file names as its origin; by default the call in Python.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> case = gfor.load("two_area")
        >>> file = case.design("pod_p", margins=False).save("pod_p.toml")
        >>> case.scenario("gfor", parameters=[file]).values["gfor.pod_p.K"]
        200.0
        """
        if command is None:
            command = f"gfor.load({self.result.case!r}).design({self.result.request.controller!r}, …) in Python"
        file = parameter_file_path(path)
        text = parameter_file_text(self.parameters, provenance(self.result, command))
        write_text(file, text)
        save_json(self.as_json(file) | {"made": made_now()}, file.with_suffix(".json"))
        return file

    def __repr__(self) -> str:
        said = "requirement met" if self.met else f"requirement not met: {self.verdict}"
        return f"<ControllerDesign {self.result.request.controller} for {self.result.case}: {said}>"

    def _repr_html_(self) -> str:
        setting = [f"{name} = {value}" for name, value in self.parameters.items()]
        lines = [
            self.result.stability.sentence(),
            *(f"warning: {text}" for text in self.warnings),
        ]
        title, top = repr(self).strip("<>").partition(": the")[0], headline(self.verdict, self.met)
        return page(title, [*lines, ", ".join(setting)], self.table(), verdict=top)


def parameter_file_path(given: str | Path, argument: str = "path") -> Path:
    """The path of a parameter file, beside which the design's JSON finds a place of its own."""
    path = path_of(given, argument)
    if path.suffix.lower() == ".json":
        raise InputError(
            f"{argument} = {str(path)!r}; the parameter file is TOML, and the design's JSON is written beside it: "
            f"name it {path.with_suffix('.toml').name}"
        )
    return path


def design_json(d: PodDesign) -> dict[str, Any]:
    S, setting = d.sensitivities, d.final.setting
    before, after = d.stability_before, d.stability
    compensation: dict[str, float | None] = dict.fromkeys(("T_S1", "T_S2", "N_S"))
    if not d.target.has_gain_alone:
        T_S1, T_S2 = setting.filters.T_S1, setting.filters.T_S2
        compensation = {"T_S1": T_S1, "T_S2": T_S2, "N_S": d.target.stages}
    of_margins = {}
    if d.margins:
        of_margins = {
            "thin_margin_damping_ratio": d.thin_margin,
            "larger_gain_spoils": d.spoilt,
        }
    return {
        "controller": d.request.controller,
        "target_mode": _complex(d.initial),
        "sensitivity": _polar(S.value),
        **compensation,
        "K": setting.gain,
        "K_unbounded": d.unbounded_gain,
        "predicted_mode": _complex(d.predicted),
        "achieved_mode": _complex(d.achieved),
        "requirement": {
            "damping_ratio": d.required_damping,
            "increment": d.required_damping - damping_ratio(d.initial),
            "gain_bounds": list(d.request.bounds(search=d.refinement is not None)),
            "delta_gain": d.request.delta_gain,
            "least_damping_of_others": d.request.least_damping,
        },
        "less_gain": _less_gain_json(d),
        "met": d.met,
        "verdict": verdict(d),
        "remarks": remarks(d),
        **of_margins,
        "target_damping_ratio": damping_ratio(d.initial),
        "achieved_damping_ratio": d.achieved_damping,
        "followed_mode": _complex(d.final.eigenvalue),
        "compensated_sensitivity": _polar(S.compensated),
        "K_non_compensated": d.gain_non_compensated,
        "K_compensated": d.gain_compensated,
        "K_of_equations": d.gain,
        "damping_ratio_of_equations": d.designed.damping_ratio,
        "active_bound": d.active_bound,
        "worst_other_mode": {
            "before": _other_json(d.before.worst),
            "after": _other_json(d.worst_other),
        },
        "stable": after.stable,
        "largest_growth_rate": after.largest_growth_rate,
        "stability": {"before": before.as_json(), "after": after.as_json()},
        "warnings": list(d.warnings),
        "other_sign": d.other_sign or None,
        "largest_real_part": {
            "before": before.largest_growth_rate,
            "after": after.largest_growth_rate,
        },
        "margins": _margins_json(d.margins) if d.margins else None,
        "refinement": _refinement_json(d) if d.refinement else None,
        **d.prepared.about,
        "mode": d.mode_name,
        "components": list(d.target.components),
    }


def parameters_of(d: PodDesign) -> dict[str, bool | float | str]:
    return _parameters(d, d.final.setting)


def parameters_of_less_gain(d: PodDesign) -> dict[str, bool | float | str]:
    """Return the setting of `PodDesign.less_gain` by ``component.variable``; {} where there is none."""
    return {} if d.less_gain is None else _parameters(d, d.less_gain.setting)


def _parameters(d: PodDesign, setting: PodSetting) -> dict[str, bool | float | str]:
    target = d.target
    return setting.parameters(target.key, d.request.controller, target.stages, target.neutral)


def _less_gain_json(d: PodDesign) -> dict[str, Any] | None:
    if d.less_gain is None:
        return None
    return {
        "K": d.less_gain.setting.gain,
        "mode": _complex(d.less_gain.eigenvalue),
        "damping_ratio": d.less_gain.damping_ratio,
        "parameters": parameters_of_less_gain(d),
    }


def provenance(d: PodDesign, command: str) -> list[str]:
    how = "designed by eigenvalue sensitivity"
    if d.refinement:
        how += " and refined on the closed loop"
    elif d.gain_is_swept:
        how += ", with a better gain than the equations'"
    return [
        f"{DAMPING_CONTROLLERS[d.request.controller]} for {d.case}, {how}",
        f"{COMMAND}{command}",
        f"scenario {d.target.scenario}, mode {d.mode_name} without the controller: {mode_text(d.initial)}",
        f"{OUTCOME}{mode_text(d.achieved)}; required: {percent(d.required_damping)} ({'met' if d.met else 'not met'})",
        "K in pu of the converter's rating, T_S1 and T_S2 in s",
        *d.target.remarks,
    ]


def _complex(value: complex) -> dict[str, float]:
    return {"real": value.real, "imag": value.imag}


def _polar(value: complex) -> dict[str, float]:
    return {"magnitude": abs(value), "phase_deg": angle_deg(value)}


def _other_json(mode: Mode | None) -> dict[str, Any] | None:
    if mode is None:
        return None
    return _complex(mode.eigenvalue) | {
        "damping_ratio": mode.damping_ratio,
        "state": mode.participation[0][0],
    }


_LOOP_MARGINS = (
    "phase_margin_deg",
    "phase_margin_hz",
    "delay_margin_s",
    "delay_margin_hz",
    "sensitivity_peak",
    "sensitivity_peak_hz",
)
"""Keys of the fields of `LoopMargins`, in their order."""


def _margins_json(m: Margins) -> dict[str, Any]:
    loop: dict[str, float | None] = dict.fromkeys(_LOOP_MARGINS)
    if m.loop is not None:
        loop = dict(zip(_LOOP_MARGINS, astuple(m.loop), strict=True))
    return {
        "damping_limit": m.limit,
        "gain_up": m.up,
        "gain_down": m.down,
        "lost_above": _complex(m.lost_up) if m.lost_up is not None else None,
        "lost_below": _complex(m.lost_down) if m.lost_down is not None else None,
        "largest_factor_tried": m.reach,
        **loop,
        "damping_ratio_with": m.variations,
    }


def _refinement_json(d: PodDesign) -> dict[str, Any]:
    def placed_mode(p: Placed, **least: float | None) -> dict[str, Any]:
        return {
            "K": p.setting.gain,
            "mode": _complex(p.eigenvalue),
            "damping_ratio": p.damping_ratio,
            **least,
        }

    def filters(f: LeadLag) -> dict[str, float]:
        return {"T_S1": f.T_S1, "T_S2": f.T_S2}

    refinement = d.refinement
    assert refinement is not None
    return {
        "designed": filters(d.filters) | placed_mode(d.designed),
        "sweeps": [
            {
                "lead_lag": s.why,
                **filters(s.filters),
                "points": [
                    placed_mode(p, least_damping_ratio=least)
                    for p, least in zip_longest(s.points, s.least)
                ],
                "chosen": placed_mode(s.chosen, least_damping_ratio=s.chosen_least),
                "unstable_gains": list(s.unstable),
            }
            for s in refinement.sweeps
        ],
        "notes": refinement.notes,
    }
