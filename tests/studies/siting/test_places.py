"""Places in networks: every bus of ieee39 against the coupled FMUs, an exhaustive search, outages, a vendor's FMU."""

import re
from dataclasses import replace

import pytest

from orchestrator.cases.case import load_case
from orchestrator.linear.models.linearization import Blocks, compose
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.continuation import Eigenpair, pairs_near
from orchestrator.studies.modes.modes import running
from orchestrator.studies.siting.confirmation import same_mode
from orchestrator.studies.siting.placing import converter, name_at, response_of, with_devices
from orchestrator.studies.siting.study import DEVICE, SiteRequest, find_sites
from orchestrator.studies.siting.view import answer, open_points, ranking_table, remarks

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("controller", ["pod_p", "pod_q"])
def test_every_bus_of_ieee39_agrees_with_the_coupled_fmus(controller):
    """Small converters stand at all buses; one after the other gets a POD, and the coupled mode moves as predicted."""
    case = load_case("ieee39")
    found = find_sites(case, SiteRequest(controller, scenario="base", confirm=0))
    seen, buses = found.intact.modes[0], found.ranking
    device = converter(found.prepared, 1.0, controller)
    (prepared,) = with_devices(case, device, buses).prepare(["base"])
    with running(prepared) as master:
        find_operating_point(master)
        off = Blocks(master)
        pair = same_mode(seen.mode, compose(off, master.schedule))
        errors = {}
        for bus in buses:
            name = name_at(bus)
            master.components[name].set({f"{controller}.enabled": True, f"{controller}.K": 100.0})
            on = off.with_component(master, name)
            master.components[name].set({f"{controller}.enabled": False})
            change = [
                response_of(master, blocks.components[name], seen.mode.eigenvalue)
                for blocks in (on, off)
            ]
            predicted = seen.shift(bus, change[0] - change[1])
            model = compose(on, master.schedule)
            coupled = nearest(pairs_near(model, pair.eigenvalue), pair) - pair.eigenvalue
            if abs(coupled) > 1e-7:  # below, the eigenvalues' own rounding counts
                errors[bus] = abs(predicted - coupled) / abs(coupled)
    assert len(errors) > 25, sorted(errors)
    assert max(errors.values()) < 0.05, errors


def nearest(pairs: list[Eigenpair], pair: Eigenpair) -> complex:
    return min((one.eigenvalue for one in pairs), key=lambda value: abs(value - pair.eigenvalue))


def test_an_exhaustive_search_finds_the_same_best_place():
    """Kundur's system: a converter with a tuned POD at each bus in turn."""
    found = find_sites(load_case("kundur"), SiteRequest("pod_p", confirm=11, buses=("bus_*",)))
    assert len(found.confirmations) == len(found.ranking) == 11
    assert found.agrees
    damping = {one.bus: one.damping for one in found.confirmations}
    assert [one.bus for one in found.confirmations] == list(found.ranking)
    by_support = sorted(found.ranking, key=lambda bus: -found.least(bus)[0])
    ranked = [damping[bus] for bus in by_support]
    assert ranked[0] == max(ranked)
    assert ranked[0] > ranked[3] > ranked[8]


def test_many_modes_are_counted_and_a_terminal_shows_the_least_damped_of_them():
    found = find_sites(
        load_case("ieee39"),
        SiteRequest(
            "droop", scenario="base", confirm=0, below=0.5, buses=("bus_1",), frequencies=(1.17, 2)
        ),
    )
    modes = found.intact.modes
    assert len(modes) > 6
    assert len(ranking_table(found).headings) == 1 + 6
    (counted,) = (text for text in remarks(found) if "not controllable" in text)
    assert counted.startswith("6 modes are not controllable at bus_1")
    assert f"{modes[0].mode.frequency_hz:.3f} Hz" in counted
    beyond = open_points(found)
    assert len(beyond) >= 2
    least = [float(re.search(r"Hz, (.*) %", text)[1]) for text in beyond]
    assert least == sorted(least)
    assert answer(found).startswith("bus_1 is no place for a droop: it does not help the mode")


def test_a_bus_asked_for_that_hardly_moves_the_mode_is_not_called_the_best_place():
    request = SiteRequest("pod_p", scenario="base", confirm=0, buses=("bus_1",))
    found = find_sites(load_case("ieee39"), replace(request, frequencies=(0.9, 2.0)))
    seen = found.intact.modes[0]
    shifts = found.shifts[DEVICE]["intact"][seen.label]
    part = shifts["bus_1"].part
    assert part == pytest.approx(
        abs(shifts["bus_1"].change) / max(abs(one.change) for one in shifts.values())
    )
    assert part < 0.02
    assert answer(found).startswith(
        f"bus_1 is hardly a place for POD-P, with {100 * part:.1g} % of what the strongest place does"
    )


def test_outages_are_ranked_and_what_a_bus_does_not_reach_is_said():
    found = find_sites(
        load_case("ieee39"),
        SiteRequest("pod_p", scenario="base", confirm=1, outages="line_16_17,sg36,line_19_20"),
    )
    assert {at.name for at in found.situations} >= {"intact", "line_16_17", "sg36"}
    assert any(f"not controllable at {found.ranking[0]}" in text for text in remarks(found))
    least = [found.least(bus)[0] for bus in found.ranking]
    assert least == sorted(least, reverse=True)
    assert found.agrees


def test_a_foreign_fmu_is_linearised_and_confirmed(gfor, tmp_path, in_process):
    code, _, err = gfor("fmu", "build", "gfor", "--dest", str(tmp_path))
    assert code == 0, err
    request = SiteRequest(str(tmp_path / "gfor.fmu"), scenario="gfor", confirm=1)
    found = find_sites(load_case("two_area"), request)
    assert set(found.ranking) == {"bus_2", "bus_3"}
    (one,) = found.confirmations  # a second place is confirmed alike
    assert one.bus == found.ranking[0]
    assert not one.failure
    # 1500 MVA beside 1500 MVA
    assert one.coupled.real == pytest.approx(one.predicted.real, rel=0.3)
