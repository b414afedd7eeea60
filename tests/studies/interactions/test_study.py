"""Studies of whole systems: what a pair does, what a swap does, and where the figures come from."""

import shutil
import zipfile
from dataclasses import replace

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.form.devices import Device
from orchestrator.core.errors import CaseError, ErrorKind, InputError
from orchestrator.studies.interactions.exchange import stand_in_at
from orchestrator.studies.interactions.point import SystemRecord, compute_system
from orchestrator.studies.interactions.request import InteractionsRequest
from orchestrator.studies.interactions.study import plan_interactions
from orchestrator.studies.interactions.systems import NONE, WHOLE, Kind, SystemName
from orchestrator.studies.interactions.view import Interactions
from orchestrator.studies.modes.modes import compute_modes
from orchestrator.studies.points.failure import Failure
from tests.studies.interactions.park import folder, park, studied, swapped, written
from tests.support.scenarios import prepare_one


def pair(*vendors):
    return SystemName(Kind.PAIR, vendors)


def assigned(*devices):
    return SystemName(Kind.ASSIGNMENT, devices)


# -- what is found -----------------------------------------------------------------------------


def test_the_pair_that_is_stable_alone_and_not_together_is_the_worst():
    found = park().judgement
    assert {vendor: one.stable for vendor, one in found.alone.items()} == {
        "A": True,
        "B": True,
        "C": True,
    }
    worst = found.worst_pair
    assert worst is not None
    assert (worst.vendors, worst.fights, worst.joint.stable) == (("A", "B"), True, False)
    assert worst.joint.record.growing.real == pytest.approx(25.7, abs=0.5)
    assert worst.fall == pytest.approx(12.54, abs=0.05)
    assert [one.fights for one in found.pairs] == [True, False, False]
    assert "worst pair of 3 pairs: A + B: UNSTABLE together, though stable alone" in " ".join(
        park().sentences
    )


def test_the_system_as_it_is_has_the_modes_and_the_verdict_of_gfor_modes():
    prepared = prepare_one(folder() / "park.toml")
    modes = compute_modes(prepared, (0.1, 100.0))
    whole = park().judgement.whole.record
    assert [mode.eigenvalue for mode in whole.modes] == [mode.eigenvalue for mode in modes.modes]
    assert [mode.damping_percent for mode in whole.modes] == pytest.approx(
        [m.damping_percent for m in modes.modes]
    )
    assert [mode.components for mode in whole.modes] == [mode.by_component for mode in modes.modes]
    assert whole.stability == modes.stability.as_json()


def test_participations_of_all_groups_sum_to_one_in_every_system():
    judgement = park().judgement
    modes = [mode for system in judgement.systems.values() for mode in system.record.modes]
    assert len(modes) > 20
    for mode in modes:
        assert sum(judgement.participation(mode).values()) == pytest.approx(1.0, abs=1e-12)


def test_a_device_that_stands_at_its_own_place_is_the_case_s():
    found = swapped().judgement
    assert found.systems[assigned("A", "B")].record == found.whole.record
    assert found.worst_assignment is not None
    assert found.worst_assignment.name.names == ("B", "B")
    assert found.worst_assignment.least_damping == pytest.approx(0.55, abs=0.01)
    assert len(found.assignments) == 4


def test_equal_places_may_change_their_devices():
    """West and east are alike: A west and B east is B west and A east."""
    systems = swapped().judgement.systems
    one, other = systems[assigned("A", "B")], systems[assigned("B", "A")]
    assert one.least_damping == pytest.approx(other.least_damping, abs=1e-6)
    assert one.stable is other.stable is True


def test_an_identical_file_gives_the_same_figures(fmu_path, tmp_path):
    copied = shutil.copyfile(fmu_path("gfl"), tmp_path / "copy.fmu")
    device = Device("copy", copied, None, {"reactive_power.mode": 1.0, "pll.f_0": 20.0})
    found = studied(swap=True, devices=(device,), places=("east",)).judgement.systems
    own, same = found[assigned("B")].record, found[assigned("copy")].record
    assert same.modes == own.modes
    assert same.stability == own.stability


# -- two systems that share nothing --------------------------------------------------------------


@pytest.fixture(scope="module")
def apart():
    """Two converters, each at an infinite bus of its own."""
    parts = [
        f"""
[components.bus_{name}]
model = "infinite_bus"
parameters = {{ P_0 = 3.0, X = 0.05, R = 0.005 }}
[components.{name}]
vendor = "{name}"
model = "gfl"
parameters = {{ S_n = "600 MVA", P_0 = 0.5, Q_0 = 0.0, v_0 = 1.0, pll.f_0 = {pll} }}
"""
        + "".join(
            f'[[connections]]\nfrom = "{a}"\nto = "{b}"\n'
            for part in ("re", "im")
            for a, b in (
                (f"bus_{name}.v_{part}", f"{name}.v_{part}"),
                (f"{name}.i_{part}", f"bus_{name}.i_{part}"),
            )
        )
        for name, pll in (("A", 10.0), ("B", 25.0))
    ]
    path = folder() / "apart.toml"
    path.write_text('name = "apart"\n' + "".join(parts), encoding="utf-8")
    return studied(path).judgement


def test_systems_that_share_nothing_have_no_mode_of_interaction_and_no_worst_pair(apart):
    assert apart.modes
    assert not apart.interaction_modes
    for judged in apart.modes:
        shares = sorted(share for group, share in judged.groups.items() if group in ("A", "B"))
        assert shares[0] < 1e-6
        assert shares[1] > 0.01
    (only,) = apart.pairs
    assert only.fall == pytest.approx(0.0, abs=1e-6)
    assert apart.worst_pair is None
    assert only.joint.stable is True


# -- guards ------------------------------------------------------------------------------------


def planned(**wanted):
    return plan_interactions(load_case(folder() / "park.toml"), InteractionsRequest(**wanted))


def test_a_system_at_another_operating_point_has_no_verdict():
    plan = planned()
    place = plan.places["east"]
    table = stand_in_at(place, plan.stand_in)
    other = table.model_copy(update={"parameters": table.parameters | {"P_0": 0.81}})
    record = compute_system(plan.task({"east": other}))
    assert record.stable is None
    assert "the power flow is another one: the voltage of bus" in record.error
    assert compute_system(plan.task({"east": table})).stable is True


def test_what_grows_outside_of_the_range_counts():
    found = studied(frequencies=(0.1, 10.0)).judgement
    assert max(mode.frequency_hz for mode in found.systems[pair("A", "B")].record.modes) <= 10.0
    assert found.worst_pair.vendors == ("A", "B")
    assert found.worst_pair.joint.least_damping == pytest.approx(-9.50, abs=0.01)


def test_values_stay_with_the_device_that_they_were_given_to():
    values = {"east.pll.f_0": 12.0, "*.pll.xi": 0.8, "*.native": False}
    plan = plan_interactions(
        load_case(folder() / "park.toml"),
        InteractionsRequest(swap=True, places=("west", "east"), values=values),
    )
    tables = plan.systems[assigned("B", "A")]
    assert tables["west"].parameters["pll.f_0"] == 12.0
    assert "pll.f_0" not in tables["east"].parameters
    assert tables["east"].parameters["pll.xi"] == 0.8
    assert not any(name.startswith("pll") for name in plan.systems[NONE]["east"].parameters)
    found = compute_system(plan.task(tables))
    assert found.error is None
    changed = written(
        "changed.toml",
        ('vendor = "A"', 'vendor = "b"'),
        ('vendor = "B"', 'vendor = "a"'),
        ("reactive_power.mode = 1 }", "reactive_power.mode = 1, pll.f_0 = 12, pll.xi = 0.8 }"),
        ('pll.f_0 = "20 Hz"', "pll.xi = 0.8"),
    )
    prepared = prepare_one(changed)
    wanted = compute_modes(prepared, (0.1, 100.0))
    assert [m.eigenvalue for m in found.modes] == pytest.approx(
        [m.eigenvalue for m in wanted.modes], rel=1e-9
    )


def test_another_file_of_the_same_name_is_computed_anew(fmu_path, tmp_path):
    target, keys = tmp_path / "device.fmu", []
    for model in ("gfl", "gfl_l2ep"):
        shutil.copyfile(fmu_path(model), target)
        plan = planned(swap=True, devices=(Device("D", target),), places=("east",))
        keys.append(plan.task(plan.systems[assigned("D")]).key)
    assert keys[0] != keys[1]


def test_a_device_that_hides_its_states_is_refused_with_the_remedy():
    """What a point says of it; the identification itself is that of `gfor modes --black-box`."""
    found = park().result
    advice = []
    for kind in (ErrorKind.HIDDEN_STATES, ErrorKind.ANALYSIS):
        failure = Failure(kind, "component 'east': … --black-box …", lasting=True)
        lost = replace(found, records={**found.records, WHOLE: SystemRecord(failure=failure)})
        advice.append(
            any("here too --black-box identifies" in text for text in Interactions(lost).warnings)
        )
    assert advice == [True, False]


@pytest.mark.nightly
@pytest.mark.slow
def test_a_device_that_is_identified_damps_as_with_its_states(fmu_path, tmp_path):
    shown, hidden = fmu_path("gfl_l2ep", native=True), tmp_path / "hidden.fmu"
    with zipfile.ZipFile(shown) as old, zipfile.ZipFile(hidden, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            new.writestr(name, content.replace(b'settable="true"', b'settable="false"'))
    devices = (Device("shown", shown), Device("hidden", hidden))
    found = studied(swap=True, devices=devices, places=("east",), black_box=True)
    systems = found.judgement.systems
    own, same = systems[assigned("shown")], systems[assigned("hidden")]
    assert (own.record.identified, same.record.identified) == ((), ("east",))
    assert same.stable is own.stable is True
    assert same.least_damping == pytest.approx(own.least_damping, abs=0.02)
    assert any("east was identified from outside" in text for text in found.warnings)
    assert found.judgement.whole.record.modes == park().judgement.whole.record.modes


def test_what_was_kept_is_not_computed_again():
    again = studied()
    assert again.result.computed == 0
    assert again.result.stored == 8
    assert again.as_json() == park().as_json()


# -- refusals ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wanted", "text"),
    [
        (
            {"stand_in": "gfro"},
            "stand-in: gfro at east, gfro at north, gfro at west: .*there is no model 'gfro'",
        ),
        (
            {"swap": True, "places": ("eest",)},
            "--place eest: no converter stands there; the places of converters are",
        ),
        (
            {"swap": True, "places": ("east",)},
            "nothing to swap: the only device at east is of B; give others",
        ),
    ],
)
def test_what_cannot_be_studied_is_refused(wanted, text):
    with pytest.raises(InputError, match=text):
        planned(**wanted)


def test_too_many_assignments_are_refused_with_their_number(fmu_path):
    devices = tuple(Device(name, fmu_path("gfl")) for name in "DE")
    with pytest.raises(
        InputError, match="5 devices at 3 places make 125 assignments, more than the 64"
    ):
        planned(swap=True, devices=devices)


def test_a_stand_in_without_a_port_is_refused_with_its_place():
    with pytest.raises(CaseError, match="stand-in: infinite_bus at east"):
        planned(stand_in="infinite_bus")


def test_a_vendor_cannot_be_called_as_a_group_is():
    path = written("group.toml", ('vendor = "A"', 'vendor = "grid"'))
    with pytest.raises(
        InputError, match=r"components\.west: its vendor is 'grid', which is what a group"
    ):
        plan_interactions(load_case(path), InteractionsRequest())


def test_a_case_without_a_converter_or_with_several_scenarios_is_refused():
    case = load_case("two_area")
    with pytest.raises(
        InputError, match="several scenarios, and interactions are those of one; choose it with"
    ):
        plan_interactions(case, InteractionsRequest())
    with pytest.raises(InputError, match="scenario 'base' has no converter"):
        plan_interactions(case, InteractionsRequest("base"))
