"""Components belong to the area that names them or their bus."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.networks.areas import areas_of
from tests.support.scenarios import prepare_one


def test_areas_by_component_and_by_bus():
    ready = prepare_one("two_area", "gfor")
    assert areas_of({"one": ["sg1", "gfor"], "two": ["bus_3"]}, ready.system) == {
        "sg1": "one",
        "gfor": "one",
        "sg2": "two",
    }
    assert areas_of({}, ready.system) == {}


@pytest.mark.slow
def test_every_unit_of_the_118_bus_case_has_its_zone():
    case = load_case("ieee118")
    (ready,) = case.prepare(["gfor"])
    found = areas_of(case.table.analysis.areas, ready.system)
    assert set(found) == set(ready.system.components) - {"grid"}
    assert found["sg12"] == found["gfor12"] == "zone_1"
    assert (found["gfor54"], found["sg92"], found["sg113"]) == ("zone_2", "zone_3", "zone_1")
