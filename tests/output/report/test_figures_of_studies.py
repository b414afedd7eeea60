"""Every figure of a screening, of a sweep and of both designs, as JSON, is one of the object that it was made from."""

import math

import pytest

import orchestrator as gfor
from orchestrator.linear.spectra.modes import damping_ratio
from tests.support.figures import foreign_in_json

_OF_THE_CASE = {"subject", "basis", "questions", "step_size_s"}
"""Keys of what a study says of its scenario."""


@pytest.fixture(scope="module")
def case():
    return gfor.load("two_area_rms")


@pytest.fixture(scope="module")
def points(tmp_path_factory):
    path = tmp_path_factory.mktemp("points") / "points.csv"
    path.write_text("name,grid.X_L\nshort,0.05\nusual,0.1\n", encoding="utf-8")
    return path


def said_of(study):
    return {key: value for key, value in study.as_json().items() if key not in _OF_THE_CASE}


def changed(said, place, factor):
    """The JSON with one figure times a factor."""
    if not place:
        return factor * said
    first, *rest = place
    inner = changed(said[first], rest, factor)
    if isinstance(said, dict):
        return said | {first: inner}
    return [inner if k == first else one for k, one in enumerate(said)]


def test_of_a_screening(case, points, tmp_path):
    study = case.screen(points, scenario="gfor", folder=tmp_path)
    items, summary = study.result.items, study.summary
    residues = [[abs(p), abs(q)] for mode in summary.modes for _, p, q in mode.worst.ranking()]
    counted = {
        "items": [len(items), len(study.result.plan.points)],
        "of_modes": [(len(mode.at), mode.hours) for mode in summary.modes],
        "computed": sum(str(item.record.status) == "computed" for item in items),
        "counted": sum(item.record.counted for item in items),
    }
    source = {"records": [item.record for item in items], "residues": residues, "counts": counted}
    said = said_of(study)
    assert foreign_in_json(said, source) == []
    for key, factor in (("frequency_hz", 2 * math.pi), ("damping_percent", 0.01), ("real", -1)):
        place = ["modes", 0, "worst", key]
        assert foreign_in_json(changed(said, place, factor), source), key


def test_of_a_sweep(case, tmp_path):
    study = case.sweep(vary="grid.X_L=0.05:0.1:2", scenarios="gfor", folder=tmp_path)
    (sweep,), axes = study.result.scenarios, study.result.plan.axes
    records = [*sweep.points.values()]
    source = {
        "modes": [
            [complex(value) for record in records for value in record.modes.eigenvalues],
            [one.points for one in sweep.trajectories],
        ],
        "records": [(r.named, r.stability, r.residual) for r in records],
        "axes": [float(value) for axis in axes for value in axis.values],
        "counts": [study.result.computed, study.result.stored, study.result.refined],
    }
    said = said_of(study)
    eigen = {
        "scenarios": [
            {
                "trajectories": [
                    [
                        {
                            k: p[k]
                            for k in ("values", "real", "imag", "frequency_hz", "damping_percent")
                        }
                        for p in one["points"]
                    ]
                    for one in scenario["trajectories"]
                ]
            }
            for scenario in said["scenarios"]
        ]
    }
    assert foreign_in_json(eigen, source) == []
    place = ["scenarios", 0, "trajectories", 0, 0, "frequency_hz"]
    assert foreign_in_json(changed(eigen, place, 2 * math.pi), source)


def test_of_a_design_over_points(case, points):
    study = case.design_over_points(points, ["pod_p"], scenario="gfor", damping=12, ranked=0)
    result, verdict = study.result, study.result.verdict
    source = {
        "modes": [
            mode.value
            for point in verdict.points
            for mode in (
                point.target_before,
                point.target,
                point.other,
                point.least_before,
                point.least,
            )
            if mode is not None
        ],
        "settings": [
            (setting.gain, setting.filters.T_S1, setting.filters.T_S2, group.stages)
            for group, setting in result.used
        ],
        "asked": [result.plan.request.damping, *result.plan.request.gain_bounds],
        "others": result.plan.request.least_damping,
        "search": [result.found.worth.worst, result.evaluations, result.found.steps],
        "thin": verdict.thin,
        "ranking": list(result.ranking),
        "items": [len(verdict.points), len(result.plan.read.points), 0],
    }
    said = said_of(study)
    assert foreign_in_json(said, source) == []
    for place, factor in (
        (["wanted_damping_ratio"], 100),
        (["settings", 0, "K"], 0.01),
        (["all", 0, "after", "real"], -1),
        (["all", 0, "before", "damping_ratio"], 100),
    ):
        assert foreign_in_json(changed(said, place, factor), source), place


def test_of_a_design_at_one_point(case):
    study = case.design("pod_p", scenario="gfor", margins=False)
    d = study.result
    S, setting, less = d.sensitivities, d.final.setting, d.less_gain
    bare = less.setting
    source = {
        "modes": [
            less.eigenvalue,
            d.initial,
            d.predicted,
            d.final.eigenvalue,
            d.achieved,
            *(mode.eigenvalue for around in (d.before, d.after) for mode in around.others),
        ],
        "sensitivities": [
            (abs(value), math.degrees(math.atan2(value.imag, value.real)))
            for value in (S.value, S.compensated)
        ],
        "setting": [setting.gain, setting.filters.T_S1, setting.filters.T_S2, d.target.stages],
        "less gain": [bare.gain, 0.0, 0],  # without lead/lag
        "gains": [d.unbounded_gain, d.gain_non_compensated, d.gain_compensated],
        "required": [d.required_damping, d.required_damping - damping_ratio(d.initial)],
        "asked": [*d.request.bounds(search=False), d.request.delta_gain, d.request.least_damping],
    }
    kept = {
        key: value
        for key, value in said_of(study).items()
        if key
        not in {"stability", "largest_growth_rate", "largest_real_part", "steady_state", "residual"}
    }
    assert foreign_in_json(kept, source) == []
    for place, factor in (
        (["K"], 100),
        (["sensitivity", "phase_deg"], math.pi / 180),
        (["sensitivity", "phase_deg"], -1),
        (["target_damping_ratio"], 100),
    ):
        assert foreign_in_json(changed(kept, place, factor), source), place
