"""What failed criteria would take, on a converter whose answers are known."""

import json
from types import SimpleNamespace

import pytest

from orchestrator.core.errors import InputError
from orchestrator.studies.certification.codes import what_it_takes as w
from orchestrator.studies.certification.codes.all_codes import CODES
from orchestrator.studies.certification.codes.certificate import certify_code
from orchestrator.studies.certification.codes.ercot import ERCOT
from orchestrator.studies.certification.codes.needs_record import (
    confirmed_text,
    plan_text,
    remarks_of,
    save_needs,
)
from orchestrator.studies.certification.codes.sensitivity import MarginSensitivity
from orchestrator.studies.certification.request import CertificationRequest
from orchestrator.studies.points.executor import Serial


@pytest.fixture
def converter(fmu_path):
    return fmu_path("gfor", native=True)


def certified(converter, folder, values, code=ERCOT, row="inertia_down"):
    return certify_code(
        CertificationRequest(converter, None, values), code, Serial(), folder, (row,)
    )


@pytest.mark.slow
def test_the_inertia_that_is_missing_lies_in_the_droop_and_its_lag(converter, tmp_path):
    """H is in proportion to 1/R_f; a POD that is off moves nothing, and a run confirms what meets the row."""
    certificate = certified(converter, tmp_path, {"droop.R_f": 0.08})
    plan = w.plan_changes(certificate, tmp_path, ["droop.R_f", "pod_p.K", "droop.R_V"])
    assert [v.row.name for v in plan.rows] == ["inertia_down"]
    assert len(plan.tasks) == 6
    assert plan.seconds > 0
    assert plan_text(plan).startswith("6 runs of inertia_down: 3 parameters by ±5 %, about")
    (need,) = w.run_changes(plan, Serial())
    assert need.criterion.criterion == "inertia at 1 s"
    assert need.criterion.margin < 0
    first, *rest = need.sensitivities
    assert first.parameter.variable == "droop.R_f"
    assert not first.doubts
    assert first.slope == pytest.approx(-(1 + need.criterion.margin), rel=0.15)  # H ∝ 1/R_f
    pod = next(s for s in rest if s.parameter.variable == "pod_p.K")
    assert pod.idle
    assert any("pod_p.K" in text for text in remarks_of(need))
    assert w.run_changes(plan, Unused())[0].sensitivities == need.sensitivities
    w.confirm_changes(plan, [need], Serial())
    confirmed = need.confirmed
    assert confirmed.parameter.variable == "droop.R_f"
    assert confirmed.value < 0.08
    (tmp_path / "alone").mkdir()
    alone = certified(converter, tmp_path / "alone", {"droop.R_f": confirmed.value}).verdicts[0]
    assert alone.accepted is (confirmed.met and not confirmed.failing)
    assert (
        next(f.margin for f in alone.findings if f.criterion == "inertia at 1 s")
        == confirmed.margin
    )
    assert f"droop.R_f = {confirmed.value:.5g}" in confirmed_text(need)
    assert "Other rows were not run" in confirmed_text(need)
    written = json.loads(save_needs(plan, [need], tmp_path)[1].read_text(encoding="utf-8"))
    assert written["failed"][0]["sensitivities"][0]["margin_per_relative_change"] == first.slope
    assert written["failed"][0]["confirmed"]["margin"] == confirmed.margin
    assert written["left_out"]["pod_p.enabled"] == "of type Boolean"


def test_the_parameter_that_reaches_the_limit_is_tried_before_one_that_only_comes_nearer(
    monkeypatch,
):
    """The straight line's figure stands beside what the run had: both of the margin that failed."""
    far, near = (
        MarginSensitivity(
            SimpleNamespace(value=2.0, scale=2.0, allows=lambda _: True), -0.4, slope=s
        )
        for s in (0.5, 1.0)
    )
    again = SimpleNamespace(criterion="inertia", margin=0.03, accepted=True)
    need = w.CriterionNeeds("dip", again, [far, near])
    monkeypatch.setattr(w, "_task", lambda *_: None)
    result = SimpleNamespace(criteria=[again], failure=None)
    monkeypatch.setattr(w, "_computed", lambda *_: {0: result})
    w.confirm_changes(SimpleNamespace(certificate=None, folder=None), [need], Unused())
    confirmed = need.confirmed
    assert confirmed.parameter is near.parameter
    assert confirmed.change == pytest.approx(0.44)  # a tenth further than to the limit
    assert confirmed.value == pytest.approx(2.0 * 1.44)
    assert confirmed.straight_line == pytest.approx(-0.4 + 0.44)
    assert confirmed.met


class Unused:
    """An executor for what is kept: nothing is left to be computed."""

    def run(self, function, tasks):
        assert not tasks
        return iter(())

    def close(self):
        pass


@pytest.mark.slow
def test_the_duplicate_is_changed_with_its_plant(converter, tmp_path):
    """Both are the same device: a change of one of them alone would be another plant's."""
    certificate = certified(converter, tmp_path, {}, CODES["miso"], "llsm_limit")
    plan = w.plan_changes(certificate, tmp_path, ["droop.R_f"])
    changes = plan.tasks["llsm_limit", "converter.droop.R_f", 1].changes
    assert changes == (
        ("converter.droop.R_f", pytest.approx(0.0525)),
        ("duplicate.droop.R_f", pytest.approx(0.0525)),
    )
    below, above = (plan.tasks["llsm_limit", "converter.droop.R_f", sign].key for sign in (-1, 1))
    assert below != above
    with pytest.raises(InputError, match="no component of the scenario has such a parameter"):
        w.plan_changes(certificate, tmp_path, ["droop.none"])
    with pytest.raises(InputError, match="rows do not give it themselves"):
        w.plan_changes(certificate, tmp_path, ["P_0"])


@pytest.mark.slow
def test_a_certificate_without_a_failed_row_needs_nothing(converter, tmp_path):
    plan = w.plan_changes(certified(converter, tmp_path, {}), tmp_path)
    assert (plan.rows, plan.tasks) == ((), {})


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--code", "miso", "--confirm"], "--confirm: it belongs to --sensitivities"),
        (["--code", "miso", "--parameter", "K"], "--parameter: it belongs to --sensitivities"),
        (["--sensitivities"], "has no rows that can be run again"),
        (
            ["--code", "miso", "--sensitivities", "--change", "0"],
            "not a change in percent from 0.01 to 50",
        ),
        (["--code", "miso", "--sensitivities", "--change", "nan"], "not a change in percent"),
    ],
)
def test_options_that_would_do_nothing_are_refused(gfor, words, said):
    code, out, error = gfor("certify", "a.fmu", *words)
    assert (code, out) == (2, "")
    assert said in " ".join(error.split())


@pytest.mark.slow
def test_a_foreign_fmu_that_does_not_answer_for_its_parameters_is_changed_by_their_own_names(
    gallery, tmp_path
):
    """Its droop of 2 % asks for more than its rating at 51 Hz; with 2.1 % it keeps step with the source."""
    fmu, binding = gallery("converter_power_si")
    certificate = certify_code(
        CertificationRequest(fmu, binding), CODES["miso"], Serial(), tmp_path, ("rocof",)
    )
    plan = w.plan_changes(certificate, tmp_path, ["R_f"])
    need = next(n for n in w.run_changes(plan, Serial()) if n.criterion.criterion == "stable")
    (slope,) = need.sensitivities
    assert need.criterion.timed
    assert slope.parameter.value == 0.02
    assert slope.met == (False, True)
    assert slope.below < need.criterion.margin
    assert any("R_f = 0.021 pu" in text for text in remarks_of(need))
