"""An FMU that is kept is known without its model being built."""

from dataclasses import replace

import pytest

from fmus.grid.network import Line, Load, Network, Port, Shunt, Zip
from fmus.grid.two_area import TWO_AREA
from fmus.toolchain import dependencies, notes
from fmus.toolchain.cache import cache_directory
from orchestrator.cases.case import load_case
from orchestrator.cases.scenario import catalogue_fmus
from orchestrator.cases.scenario.catalogue_fmus import build_fmu, catalogue_fmu, plan_fmu
from orchestrator.core.errors import CaseError
from orchestrator.devices.fmi.description import read_description

NETWORK = Network(
    "net",
    ("one", "two"),
    (Line("line", "one", "two", X=0.1, R=0.01, B=0.02, tap=1.05),),
    (Load("town", "two", 50.0, 10.0, active=Zip(0.5, 0.5, 0.0)),),
    (Port("unit", "one"),),
    (Shunt("bank", "two", 0.0, 20.0, switched=True),),
    faults=("two",),
)

TOO_MUCH = """
name = "too_much"
title = "More load than the line can carry"
source = "made up"
[solver]
step_size = "5 ms"
stop_time = "1 s"
record_interval = "5 ms"
[power_flow]
grid = "grid"
slack = "gen"
[components.grid]
model = "phasor_grid"
[components.gen]
model = "synchronous_generator_st1_phasor"
bus = "one"
parameters = { S_n = "500 MVA", v_0 = 1.0 }
[network]
buses = ["one", "two"]
[network.lines]
line = { from = "one", to = "two", X = 0.5, B = 0.01 }
[network.loads]
town = { bus = "two", p = "400 MW", q = "80 Mvar" }
[scenarios.base]
"""

WANTED = [
    ("infinite_bus", None, False, ()),
    ("infinite_bus", None, True, ()),
    ("synchronous_generator", None, False, ()),
    ("synchronous_generator", None, False, (("exciter", "st1a"),)),
    ("two_area_grid", TWO_AREA, False, ()),
    ("two_area_grid", replace(TWO_AREA, stray_B=0.1), False, ()),
    (
        "two_area_grid",
        replace(TWO_AREA, lines=(replace(TWO_AREA.lines[0], X=0.1 + 1e-16),)),
        False,
        (),
    ),
]


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    """A cache without FMUs and notes, with the compiled libraries, which are not what is looked at."""
    folder, libraries = tmp_path / "cache", cache_directory("libraries")
    libraries.mkdir(parents=True, exist_ok=True)
    folder.mkdir()
    (folder / "libraries").symlink_to(libraries, target_is_directory=True)
    monkeypatch.setenv("GFOR_COSIM_CACHE", str(folder))


@pytest.fixture(autouse=True)
def fresh():
    plan_fmu.cache_clear()
    yield
    plan_fmu.cache_clear()


def test_no_model_is_built_to_find_its_kept_fmu(monkeypatch):
    built = catalogue_fmu("infinite_bus")
    plan_fmu.cache_clear()
    monkeypatch.setattr(
        catalogue_fmus, "build_model", lambda *_, **__: pytest.fail("the model is built")
    )
    assert plan_fmu("infinite_bus").description.guid == built.guid


def test_each_argument_names_a_note_of_its_own(tmp_path, monkeypatch):
    """A line's reactance counts to its last bit."""
    monkeypatch.setenv("GFOR_COSIM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(catalogue_fmus, "build_model", lambda *asked, **_: pytest.fail(repr(asked)))
    asked = []
    monkeypatch.setattr(catalogue_fmus, "known", lambda *one: asked.append(one))
    for arguments in WANTED:
        with pytest.raises(pytest.fail.Exception):
            plan_fmu(*arguments)
    assert len({notes.note_of(*one) for one in asked}) == len(WANTED)


@pytest.mark.usefixtures("empty_cache")
def test_a_note_of_an_fmu_that_is_gone_leads_to_its_building():
    first = build_fmu(plan_fmu("probe_a"))
    plan_fmu.cache_clear()
    assert plan_fmu("probe_a").description.guid == first.guid
    first.path.unlink()
    plan_fmu.cache_clear()
    planned = plan_fmu("probe_a")
    assert not planned.is_there
    assert build_fmu(planned).guid == first.guid
    assert first.path.is_file()


@pytest.mark.parametrize(
    ("model", "network"), [("phasor_grid", NETWORK), ("grid", NETWORK), ("gfor", None)]
)
@pytest.mark.usefixtures("empty_cache")
def test_a_plan_says_of_the_variables_what_the_fmu_says(model, network, monkeypatch):
    """All that a case is checked by: names, bounds, start values, states. Only dependencies need the equations."""
    planned = plan_fmu(model, network)
    assert not planned.is_there
    monkeypatch.setattr(
        catalogue_fmus, "build_model", lambda *_, **__: pytest.fail("it is built twice")
    )
    built = build_fmu(planned)
    assert planned.description.variables == built.variables
    assert planned.description.states == built.states
    assert planned.description.rates == built.rates
    assert planned.description.model_name == built.model_name
    assert planned.description.guid != built.guid


@pytest.mark.usefixtures("empty_cache")
def test_a_long_description_is_not_read_again(monkeypatch):
    """Where dependencies are not listed it differs by its identity alone."""
    monkeypatch.setattr(dependencies, "MOST", 0)
    with monkeypatch.context() as patch:
        patch.setattr(
            catalogue_fmus, "read_description", lambda path: pytest.fail(f"{path} is read")
        )
        built = build_fmu(plan_fmu("phasor_grid", NETWORK))
    assert built == read_description(built.path)
    assert built.guid != "not-built"


def test_a_power_flow_that_fails_builds_no_fmu(tmp_path, monkeypatch):
    monkeypatch.setenv("GFOR_COSIM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(catalogue_fmus, "_recipe", lambda *_: pytest.fail("an FMU is built"))
    path = tmp_path / "case.toml"
    path.write_text(TOO_MUCH, encoding="utf-8")
    with pytest.raises(CaseError, match="power flow: no solution"):
        load_case(path).prepare()
