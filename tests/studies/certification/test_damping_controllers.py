"""What --pod names is set where the FMU has it, contradicted nowhere, and else declared."""

import tomllib
from dataclasses import replace

import pytest

from orchestrator.core.errors import InputError
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.studies.certification import study as study_module
from orchestrator.studies.certification.case_file import write_case
from orchestrator.studies.certification.damping_controllers import (
    DECLARED,
    READ,
    SET,
    UNKNOWN,
    UNSEEN,
    damping_controllers,
)
from orchestrator.studies.certification.request import PODS, CertificationRequest
from tests.studies.certification.fabricated import figures, rings
from tests.studies.certification.test_recomputing import BOUND


def controllers(request):
    return damping_controllers(bound_fmu(request.fmu, request.binding), request)


@pytest.mark.parametrize("pod", PODS)
def test_what_is_named_is_set_and_what_is_not_is_switched_off(tmp_path, fmu_path, pod):
    request = CertificationRequest(fmu_path("gfor"), pod=pod)
    found = controllers(request)
    assert (found.pod, found.source) == (pod, SET)
    case = write_case(request, found.settings, tmp_path)
    values = tomllib.loads(case.text)["scenarios"]["with"]["set"]
    assert values == {f"converter.pod_{x}.enabled": x in pod.removeprefix("none") for x in "pq"}
    (prepared,) = case.prepare(["with"])
    assert {x: prepared.values[f"converter.pod_{x}.enabled"] for x in "pq"} == {
        x: x in pod.removeprefix("none") for x in "pq"
    }


@pytest.mark.parametrize(("pod", "said"), [("p", False), ("none", True), ("q", True)])
def test_a_contradiction_is_refused(tmp_path, fmu_path, gfor, pod, said):
    code, _, error = gfor(
        "certify",
        fmu_path("gfor"),
        "--pod",
        pod,
        "--set",
        f"pod_p.enabled={str(said).lower()}",
        "--out",
        tmp_path,
    )
    assert code == 2
    assert f"--pod {pod} needs pod_p.enabled = {str(not said).lower()}" in error
    assert "--set has" in error


def test_without_a_word_the_fmus_own_variables_say(fmu_path):
    assert controllers(CertificationRequest(fmu_path("gfor"))).pod == "none"
    found = controllers(CertificationRequest(fmu_path("gfor"), values={"pod_q.enabled": True}))
    assert (found.pod, found.source) == ("q", READ)


def test_a_foreign_fmu_cannot_show_it(tmp_path, gallery):
    fmu, binding = gallery("converter_power_si")
    found = controllers(CertificationRequest(fmu, binding, pod="p"))
    assert (found.pod, found.source, found.settings) == ("p", DECLARED, {})
    assert controllers(CertificationRequest(fmu, binding)).source == UNKNOWN


def test_a_vendors_own_switch_is_set_and_listed(tmp_path, gallery, gfor, monkeypatch):
    """A variable of any name, as `R_f` here, is given by --set; what it means the applicant declares."""
    monkeypatch.setattr(study_module, "compute_point", rings)
    fmu, binding = gallery("converter_power_si")
    arguments = (
        "certify",
        fmu,
        "--binding",
        binding,
        "--no-check",
        "--pod",
        "p",
        "--set",
        "R_f=0.04",
    )
    assert gfor(*arguments, "--reactances", "0.1", "--workers", 1, "--out", tmp_path)[0] == 3
    content = figures(tmp_path)
    assert content["values"] == {"R_f": 0.04}
    (row,) = [row for row in content["parameters"] if row["name"] == "R_f"]
    assert (row["start"], row["used"], row["changed_by"]) == (0.02, 0.04, "--set")
    page = (tmp_path / "certificate.html").read_text(encoding="utf-8")
    assert f"POD-P ({DECLARED})" in page
    assert "R_f = 0.04" in page


def test_a_switch_that_the_binding_sets_must_agree(tmp_path, fmu_path):
    binding = tmp_path / "mine.toml"
    binding.write_text(BOUND, encoding="utf-8")  # it switches POD-Q on
    with pytest.raises(
        InputError, match=r"--pod p needs pod_q.enabled = false, but the binding .* = true"
    ):
        controllers(CertificationRequest(fmu_path("gfor"), binding, pod="p"))
    found = controllers(CertificationRequest(fmu_path("gfor"), binding, pod="q"))
    assert (found.source, found.settings) == (SET, {"pod_p.enabled": False})
    assert controllers(CertificationRequest(fmu_path("gfor"), binding)).pod == "q"


def test_a_switch_of_another_name_is_set_through_the_binding(tmp_path, fmu_path):
    binding = tmp_path / "mine.toml"
    switch = '[signals]\n"pod_p.enabled" = { variable = "pod_q.enabled" }\n'
    # it is set there
    binding.write_text(BOUND.replace("[parameters]", f"{switch}[parameters]"), encoding="utf-8")
    with pytest.raises(
        InputError, match=r"--pod none needs pod_p.enabled = false, but the binding .* = true"
    ):
        controllers(CertificationRequest(fmu_path("gfor"), binding, pod="none"))
    binding.write_text(BOUND.replace('"pod_q.enabled" = true', "") + switch, encoding="utf-8")
    found = controllers(CertificationRequest(fmu_path("gfor"), binding, pod="p"))
    assert (found.pod, found.settings) == ("p", {"pod_p.enabled": True})
    case = write_case(
        CertificationRequest(fmu_path("gfor"), binding, pod="p"), found.settings, tmp_path
    )
    assert case.prepare(["with"])[0].values["converter.pod_p.enabled"] is True


def without_outputs(description, *names):
    """The FMU's description, less some variables."""
    kept = {name: info for name, info in description.variables.items() if name not in names}
    return replace(description, variables=kept)


@pytest.mark.parametrize(
    ("hidden", "pod", "source", "headline"),
    [
        ((), "pq", SET, "with POD-P and POD-Q"),
        (("delta_p_pod",), "none", SET, "without POD"),
        (("delta_p_pod",), "q", SET, "with POD-Q"),
        (("delta_p_pod",), "p", f"{SET}; {UNSEEN} (POD-P)", f"with POD-P ({UNSEEN})"),
        (
            ("delta_p_pod", "delta_q_pod"),
            "pq",
            f"{SET}; {UNSEEN} (POD-P and POD-Q)",
            f"with POD-P and POD-Q ({UNSEEN})",
        ),
        (
            ("pod_p.enabled", "pod_q.enabled"),
            "p",
            DECLARED,
            "with POD-P as declared by the applicant",
        ),
        (
            ("pod_p.enabled",),
            "pq",
            f"{SET}, except POD-P: {DECLARED}",
            "with POD-P as declared by the applicant and POD-Q",
        ),
    ],
)
def test_what_no_output_shows_and_what_is_only_declared_is_said_in_the_headline(
    fmu_path, hidden, pod, source, headline
):
    request = CertificationRequest(fmu_path("gfor"), pod=pod)
    found = damping_controllers(without_outputs(bound_fmu(request.fmu, None), *hidden), request)
    assert (found.source, found.in_words()) == (source, headline)


def test_the_certificate_says_in_its_first_line_that_a_controller_is_only_declared(
    tmp_path, gallery, gfor, monkeypatch
):
    monkeypatch.setattr(study_module, "compute_point", rings)
    fmu, binding = gallery("converter_power_si")
    _, text, _ = gfor(
        "certify",
        fmu,
        "--binding",
        binding,
        "--no-check",
        "--pod",
        "p",
        "--reactances",
        "0.1",
        "--workers",
        1,
        "--out",
        tmp_path,
    )
    said = " ".join(text.split())
    assert "with POD-P as declared by the applicant was judged nowhere" in said
    assert "what POD-P changes is not known: no switch turns it off" in said
    assert "with POD-P as declared by the applicant was judged" in figures(tmp_path)["sentence"]
