"""A mistake in the binding is the binding's: it is said at once, in one line each, and not held against the FMU."""

import json

import pytest

from orchestrator.cases.form.names import hint_at
from orchestrator.devices.acceptance.checks import base
from orchestrator.devices.acceptance.runner import AcceptanceReport, without_consequences
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.devices.binding.misfits import WRONG_FREQUENCY
from orchestrator.devices.fmi.description import read_description
from orchestrator.face.cli import main


@pytest.fixture
def checked(gallery, tmp_path, capsys):
    """Check the converter in kV behind a binding in which one text is replaced; exit code and output."""

    def run(old, new, *options):
        fmu, binding = gallery("converter_qd_si")
        text = binding.read_text(encoding="utf-8")
        assert old in text
        path = tmp_path / "mine.toml"
        path.write_text(text.replace(old, new), encoding="utf-8")
        code = main(["fmu", "check", str(fmu), "--binding", str(path), *options])
        return code, capsys.readouterr().out

    return run


START = '[start.v_0]\nvariable = "v_0"\nvalue = "phase peak"'


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        (START, START.replace('value = "phase peak"', ""), "start.v_0"),
        ('value = "peak"', "", "current"),
        ("'vd']", "'vz']", "voltage"),
    ],
)
def test_what_is_missing_in_the_binding_is_not_the_fmus_fault(old, new, place, checked):
    code, printed = checked(old, new)
    assert code == 1
    assert "binding does not fit: mine.toml: " in printed
    assert place in printed
    assert "\\n" not in printed
    assert "modelDescription.xml" not in printed
    assert "behind mine.toml: mend it and check again" in printed
    assert "do not use it" not in printed


def test_a_unit_that_differs_from_the_declared_one_may_be_wrong_on_either_side(checked):
    code, printed = checked('value = "phase peak"', 'value = "phase peak"\nunit = "V"')
    assert code == 1
    assert "wrong units: mine.toml" in printed
    assert "give the unit that the FMU declares, or have modelDescription.xml corrected" in printed


def test_the_binding_alone_can_be_checked(checked):
    code, printed = checked("[voltage]", "[voltage]", "--only", "binding", "--json")
    report = json.loads(printed)
    assert code == 0
    assert [c["check"] for c in report["checks"]] == ["archive", "binding"]
    code, printed = checked('value = "peak"', "", "--only", "binding", "--json")
    report = json.loads(printed)
    assert code == 1
    assert report["checks"][-1]["whose"] == "the binding"


def test_the_binding_alone_needs_a_binding(gallery, capsys):
    assert main(["fmu", "check", str(gallery("converter")[0]), "--only", "binding"]) == 2
    assert "needs a binding" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("rating", "others", "kept"),
    [
        ("15 MVA", ["wrong base"], False),  # behind a wrong rating the frequency is none to judge
        ("15 MVA", ["invalid FMI"], True),
        ("15 MVA", [], True),
        ("1500 MVA", ["wrong base"], True),
    ],
)
def test_a_wrong_rating_is_one_problem(rating, others, kept, gallery, tmp_path):
    fmu, binding = gallery("converter_qd_si")
    text = binding.read_text(encoding="utf-8")
    assert 'S_n = "1500 MVA"' in text
    path = tmp_path / "rated.toml"
    path.write_text(text.replace('S_n = "1500 MVA"', f'S_n = "{rating}"'), encoding="utf-8")
    described = bound_fmu(fmu, path)
    assert bool(described.likely_cause()) == (rating == "15 MVA")
    report = AcceptanceReport(fmu, path)
    faults = [("rated_frequency", WRONG_FREQUENCY), *(("power_balance", other) for other in others)]
    report.results += [base.failed(check, fault, "seen") for check, fault in faults]
    left = [r.fault for r in without_consequences(report, described) if r.fault]
    assert left == [WRONG_FREQUENCY] * kept + others


def test_the_name_that_the_binding_gives_is_offered(gallery, tmp_path):
    fmu, _ = gallery("converter_with_damping")
    (own,) = [v.name for v in read_description(fmu).variables.values() if v.type == "Boolean"]
    path = tmp_path / "pod.toml"
    path.write_text(
        '[rating]\nS_n = "1500 MVA"\nf_n = "50 Hz"\n'
        '[voltage]\nform = "rectangular"\nvariables = ["v_re", "v_im"]\n'
        '[current]\nform = "rectangular"\nvariables = ["i_re", "i_im"]\n'
        f'[signals."pod_p.enabled"]\nvariable = "{own}"\n',
        encoding="utf-8",
    )
    described = bound_fmu(fmu, path)
    assert hint_at(described, own, [], "") == "the binding calls it pod_p.enabled: write that"
    assert hint_at(described, "P_00", ["P_0"], "") == "did you mean P_0?"
