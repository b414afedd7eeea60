"""Zero-sequence impedances of transformers by their vector group, beside answers by hand."""

import math

import pytest

from fmus.grid.element_data import Line
from fmus.grid.network import Network, Port
from orchestrator.cases.events.zero_sequence_transformers import (
    add_transformer,
    has_delta_at_network,
    usual_leg,
    usual_transformer,
)
from orchestrator.cases.flow.balance import FlowLine
from orchestrator.cases.flow.sequence_impedances import SequenceNetwork
from orchestrator.cases.form.schema import SequencesTable
from orchestrator.cases.networks.sequence_data import ZeroTransformer

Z = 0.01 + 0.1j  # [pu, 100 MVA]
Z_N = 0.02  # from each neutral to earth [pu, 100 MVA]
TAP = 1.1  # at the first bus
BEHIND = 0.3j  # from the far bus to earth [pu, 100 MVA]


def impedance_seen(windings, bus, earthed=""):
    """Zero-sequence impedance of a transformer from one of its buses to earth, with `BEHIND` at another one."""
    network = SequenceNetwork(["a", "b"])
    branch = FlowLine("line_a_b", "a", "b", Z.real, Z.imag, 0.0, TAP)
    earthing = tuple(Z_N * (winding == "yn") for winding in windings)
    add_transformer(network, branch, ZeroTransformer(windings, Z, earthing))
    if earthed:
        network.add_to_earth(earthed, 1 / BEHIND)
    return network.impedance(bus)


@pytest.mark.parametrize(
    ("windings", "bus", "earthed", "expected"),
    [
        (("yn", "d"), "a", "", TAP**2 * Z + 3 * Z_N),
        (("d", "yn"), "b", "", Z + 3 * Z_N),
        (("yn", "yn"), "a", "b", TAP**2 * (Z + 3 * Z_N + BEHIND) + 3 * Z_N),
        (("yn", "yn"), "b", "a", Z + 3 * Z_N + (3 * Z_N + BEHIND) / TAP**2),
        (("yn",), "a", "b", TAP**2 * (Z + BEHIND) + 3 * Z_N),  # a leg; b is the star point
        (("d",), "b", "", Z),
    ],
)
def test_an_earthed_star_lets_the_zero_sequence_through_or_to_earth(
    windings, bus, earthed, expected
):
    found = impedance_seen(windings, bus, earthed)
    assert found == pytest.approx(expected)


@pytest.mark.parametrize(
    ("windings", "bus", "earthed"),
    [
        (("yn", "d"), "b", ""),  # the delta's side
        (("d", "yn"), "a", ""),
        (("y", "yn"), "b", "a"),
        (("yn", "y"), "a", "b"),
        (("y", "d"), "a", ""),
        (("d", "d"), "a", "b"),
        (("y",), "a", "b"),
        (("d",), "a", ""),
    ],
)
def test_other_groups_have_no_path(windings, bus, earthed):
    assert math.isinf(abs(impedance_seen(windings, bus, earthed)))


LINE = Line("line_1_2", "bus_1", "bus_2", X=0.1)


def at_unit(*buses):
    """The network of one transformer, with a unit at each of some buses."""
    ports = tuple(Port(f"sg{k}", bus) for k, bus in enumerate(buses))
    return Network("one_transformer", ("bus_1", "bus_2"), (LINE,), (), ports, phasors=True)


@pytest.mark.parametrize(
    ("table", "units", "windings", "missing"),
    [
        ({}, (), ("yn", "yn"), "transformers"),
        ({"transformers": "Dyn11"}, (), ("d", "yn"), ""),
        ({}, ("bus_2",), ("yn", "d"), "step_up"),
        ({}, ("bus_1",), ("d", "yn"), "step_up"),
        ({"step_up": "YNyn"}, ("bus_1",), ("yn", "yn"), ""),
        ({"groups": {"line_1_2": "Yd5"}}, ("bus_1",), ("y", "d"), ""),
    ],
)
def test_the_case_names_a_group_before_the_usual_one(table, units, windings, missing):
    rules = SequencesTable(transformer_x0=0.9, **table)
    known, asked = usual_transformer(at_unit(*units), LINE, Z, rules)
    assert (known.windings, asked) == (windings, missing)
    assert known.z == pytest.approx(0.9 * Z)


def test_legs_take_their_own_letter_of_the_group():
    table = SequencesTable(groups={"transformer_7": "YNdyn"})
    letters = [usual_leg("transformer_7", leg, Z, table)[0].windings[0] for leg in (1, 2, 3)]
    assert letters == ["yn", "d", "yn"]
    assert usual_leg("transformer_8", 3, Z, table) == (ZeroTransformer(("d",), Z), "groups")


def test_a_delta_at_the_network_is_noticed():
    turned, usual = ZeroTransformer(("d", "yn"), Z), ZeroTransformer(("yn", "d"), Z)
    assert has_delta_at_network(at_unit("bus_2"), LINE, turned)
    assert not has_delta_at_network(at_unit("bus_2"), LINE, usual)
    assert not has_delta_at_network(at_unit(), LINE, turned)
