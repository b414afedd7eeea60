"""Other devices at the places of a case: in phasor networks, among units, and without changing what swings."""

from dataclasses import replace

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.form.devices import Device
from orchestrator.studies.interactions.exchange import (
    exchanged_case,
    stand_in_at,
    vendors_device_at,
)
from orchestrator.studies.interactions.places import GENERATORS, GRID, places_of
from orchestrator.studies.interactions.point import compute_system
from orchestrator.studies.interactions.request import InteractionsRequest
from orchestrator.studies.interactions.study import plan_interactions
from orchestrator.studies.interactions.systems import NONE, Kind, SystemName
from orchestrator.studies.modes.modes import compute_modes
from tests.studies.interactions.park import folder
from tests.support.bindings import GFOR_RATED


def test_nothing_exchanged_is_the_case_itself():
    case = load_case("two_area")
    assert exchanged_case(case, {}) is case


def test_the_stand_in_neither_damps_nor_excites_a_swing():
    """How fast it follows the voltage's angle, from 5 to 20 Hz, moves the damping of 0.5 Hz by 0.1 points at most."""
    case = load_case("two_area")
    place = places_of(case.tables_and_plans("gfor"), "grid")["gfor"]
    found = []
    for frequency in (5.0, 20.0):
        table = stand_in_at(place, "static_generation")
        table = table.model_copy(update={"parameters": table.parameters | {"f_0": frequency}})
        (prepared,) = exchanged_case(case, {"gfor": table}).prepare(["gfor"])
        swing = min(compute_modes(prepared).modes, key=lambda mode: abs(mode.frequency_hz - 0.55))
        found.append(swing.damping_percent)
    assert found[0] == pytest.approx(found[1], abs=0.1)
    assert found[0] == pytest.approx(-1.83, abs=0.1)


def test_a_network_of_phasors_has_a_stand_in_of_its_own():
    plan = plan_interactions(load_case("two_area_rms"), InteractionsRequest("gfor"))
    assert plan.stand_in == "static_generation_phasor"
    assert plan.groups == {
        "gfor": "gfor_phasor",
        "sg1": GENERATORS,
        "sg2": GENERATORS,
        "grid": GRID,
    }


def test_converters_of_units_are_exchanged_as_well():
    plan = plan_interactions(
        load_case("wscc9"), InteractionsRequest("gfor", {"units.alpha.3": 0.5})
    )
    assert {name: place.vendor for name, place in plan.places.items()} == {"gfor3": "gfor"}
    (prepared,) = exchanged_case(plan.case, plan.systems[NONE]).prepare(
        [plan.prepared.name], {}, None, None, plan.layers
    )
    assert prepared.system.components["gfor3"].description.model_name == "static_generation"
    assert prepared.power_flow.voltages == pytest.approx(
        plan.prepared.power_flow.voltages, abs=1e-9
    )


def test_a_device_behind_a_binding_is_given_what_it_knows_and_damps_as_without(fmu_path, tmp_path):
    (tmp_path / "d.toml").write_text(GFOR_RATED, encoding="utf-8")
    given = Device("D", fmu_path("gfor"), tmp_path / "d.toml")
    request = InteractionsRequest(swap=True, devices=(given,), places=("east", "north"))
    plan = plan_interactions(load_case(folder() / "park.toml"), request)
    bound, own = (
        compute_system(plan.task(plan.systems[SystemName(Kind.ASSIGNMENT, (device, "C"))]))
        for device in "DC"
    )
    assert bound.error is None
    assert [mode.real for mode in bound.modes] == pytest.approx(
        [mode.real for mode in own.modes], rel=1e-4
    )
    assert bound.stable is own.stable is True


def test_a_device_without_a_rated_frequency_is_given_none():
    places = plan_interactions(load_case(folder() / "park.toml"), InteractionsRequest()).places
    plain = places["west"]
    known = {name: info for name, info in plain.plan.description.variables.items() if name != "f_n"}
    silent = replace(
        plain,
        plan=replace(plain.plan, description=replace(plain.plan.description, variables=known)),
    )
    assert "f_n" in vendors_device_at(places["east"], plain).parameters
    assert "f_n" not in vendors_device_at(places["east"], silent).parameters
    assert "f_n" not in stand_in_at(silent, "static_generation").parameters
