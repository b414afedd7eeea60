"""An FMU that is kept is known without its model being built."""

from dataclasses import replace

import pytest

from fmus.grid.two_area import TWO_AREA
from fmus.toolchain import notes
from orchestrator.cases import catalogue_fmus
from orchestrator.cases.catalogue_fmus import catalogue_fmu, plan_fmu

WANTED = [
    ("infinite_bus", None, False, ()),
    ("infinite_bus", None, True, ()),
    ("synchronous_generator", None, False, ()),
    ("synchronous_generator", None, False, (("exciter", "st1a"),)),
    ("two_area_grid", TWO_AREA, False, ()),
    ("two_area_grid", replace(TWO_AREA, stray_B=0.1), False, ()),
    ("two_area_grid", replace(TWO_AREA, lines=(replace(TWO_AREA.lines[0], X=0.1 + 1e-16),)), False, ()),
]


@pytest.fixture(autouse=True)
def fresh():
    plan_fmu.cache_clear()
    yield
    plan_fmu.cache_clear()


def test_no_model_is_built_to_find_its_kept_fmu(monkeypatch):
    built = catalogue_fmu("infinite_bus")
    plan_fmu.cache_clear()
    monkeypatch.setattr(catalogue_fmus, "build_model", lambda *_, **__: pytest.fail("the model is built"))
    assert plan_fmu("infinite_bus").description.guid == built.guid


def test_each_argument_names_a_note_of_its_own(tmp_path, monkeypatch):
    """A line's reactance counts to its last bit."""
    monkeypatch.setenv("GFOR_COSIM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(catalogue_fmus, "_recipe", lambda *asked: pytest.fail(repr(asked)))
    asked = []
    monkeypatch.setattr(catalogue_fmus, "noted", lambda entry, text, _: asked.append((entry, text)) or ["", ""])
    for arguments in WANTED:
        with pytest.raises(pytest.fail.Exception):
            plan_fmu(*arguments)
    assert len({notes.note_of(*one) for one in asked}) == len(WANTED)


def test_a_note_of_an_fmu_that_is_gone_leads_to_its_building(tmp_path, monkeypatch):
    monkeypatch.setenv("GFOR_COSIM_CACHE", str(tmp_path / "cache"))
    first = plan_fmu("probe_a")
    plan_fmu.cache_clear()
    second = plan_fmu("probe_a")
    assert first.recipe.digest == second.recipe.digest
    assert first.description.guid == second.description.guid
