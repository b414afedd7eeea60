"""A mistake in the binding is the binding's: it is said at once, in one line each, and not held against the FMU."""

import json

import pytest

from orchestrator.cli import main


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
