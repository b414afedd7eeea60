"""A case is what its files said when it was loaded, whatever becomes of the files and of the working folder."""

import shutil

import pytest

import orchestrator as gfor
from orchestrator.cases.case import load_case
from orchestrator.core.errors import InputError
from tests.cases.form.test_case_files import LOOP
from tests.systems.coupling.small_fmus import small_fmu

CASE = (
    LOOP
    + """\
[scenarios.one]
parameters = ["one.toml"]
[scenarios.two]
"""
)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "fmus").mkdir()
    shutil.copy(small_fmu("integrator").path, tmp_path / "fmus" / "x.fmu")
    shutil.copy(small_fmu("gain").path, tmp_path / "fmus" / "k.fmu")
    (tmp_path / "one.toml").write_text('[set]\n"k.K" = -2.0\n', encoding="utf-8")
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    return tmp_path


def test_a_parameter_file_that_is_edited_later_changes_nothing(folder):
    case = gfor.load(folder / "case.toml")
    scenario = case.scenario("one")
    (folder / "one.toml").write_text('[set]\n"k.K" = -1.0\n', encoding="utf-8")
    assert scenario.run(stop=0.01).result.modes.prepared.values["k.K"] == -2.0
    assert case.scenario("one").values["k.K"] == -2.0
    assert gfor.load(folder / "case.toml").scenario("one").values["k.K"] == -1.0


def test_a_parameter_file_that_cannot_be_read_concerns_its_scenario_only(folder):
    (folder / "one.toml").unlink()
    case = gfor.load(folder / "case.toml")
    assert case.scenario("two").values["k.K"] == -3.0
    with pytest.raises(
        InputError, match=r"parameters\.0: .*one\.toml: the parameter file cannot be read"
    ):
        case.scenario("one")


def test_a_changed_fmu_is_named_before_another_run(folder):
    scenario = gfor.load(folder / "case.toml").scenario("one")
    shutil.copy(small_fmu("lag").path, folder / "fmus" / "x.fmu")
    with pytest.raises(InputError, match=r"which changes the FMU of x; load the case again"):
        scenario.run(stop=0.01)


def test_a_case_holds_in_another_folder(folder, monkeypatch):
    monkeypatch.chdir(folder)
    case = gfor.load("case.toml")
    scenario = case.scenario("one")
    (folder / "elsewhere").mkdir()
    monkeypatch.chdir(folder / "elsewhere")
    assert scenario.run(stop=0.01).failure is None
    assert case.scenario("two").values["k.K"] == -3.0
    assert case.sweep({"k.K": [-2.0, -1.0]}, ["two"], frequencies=(0, 1000)).failures().empty


@pytest.mark.parametrize("name", ["case.toml", "one.toml"])
def test_a_sweep_after_an_edit_says_what_happened(folder, name):
    case = gfor.load(folder / "case.toml")
    with (folder / name).open("a", encoding="utf-8") as file:
        file.write("\n# edited\n")
    with pytest.raises(
        InputError, match=r"has another text now than when the study loaded it; load the case again"
    ):
        case.sweep({"k.K": [-2.0, -1.0]}, ["one"])


def test_the_case_file_keeps_the_path_that_was_given(folder, monkeypatch):
    monkeypatch.chdir(folder)
    assert str(load_case("case.toml").path) == "case.toml"
