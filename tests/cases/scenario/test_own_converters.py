"""Questions about a case's converters in another program's network, on both sides of their thresholds."""

from types import SimpleNamespace

import pytest

from orchestrator.cases.questions import plausible_sources


def questions(monkeypatch, power, left=0.0, beside=None, at_slack=0):
    """Of a converter of 100 MVA with P_0 [pu], where a unit of the file feeds so much less [MW].

    ``beside``: P_0 [pu] of a source of 100 MVA that is no converter; ``at_slack``: units of the file there, of 500 MW
    each."""
    monkeypatch.setattr(plausible_sources, "value_of", lambda plan, name: getattr(plan, name, None))
    monkeypatch.setattr(plausible_sources, "unit_of", lambda plan, name: "pu")
    monkeypatch.setattr(plausible_sources, "place_of", lambda draft, name, key: f"{name}.{key}")
    converter = SimpleNamespace(kind="converter", parameters={"P_0": power}, P_0=power, S_n=100.0)
    generation = {"b1": SimpleNamespace(p_mw=left)}
    parts = {"gfor": converter}
    if beside is not None:
        parts["static"] = SimpleNamespace(kind="source", parameters={}, P_0=beside, S_n=100.0)
    ports = [SimpleNamespace(name=name, bus="b9") for name in parts]
    units = {f"sg{k}": SimpleNamespace(kind="machine", P_0=1.0, S_n=500.0) for k in range(at_slack)}
    ports += [SimpleNamespace(name=name, bus="b2") for name in units]
    generation["b2"] = SimpleNamespace(p_mw=500.0 * at_slack)
    parts |= units
    draft = SimpleNamespace(
        network=SimpleNamespace(ports=ports),
        data=SimpleNamespace(generation=generation, slack="b2"),
        system=SimpleNamespace(components=parts),
        origins=units,
        given=SimpleNamespace(from_outside={}),
    )
    return [str(one) for one in plausible_sources._own_converters(draft)]


@pytest.mark.parametrize(
    ("power", "asked"), [(-0.01, True), (0.0, False), (0.049, True), (0.051, False), (0.09, False)]
)
def test_a_converter_that_feeds_hardly_anything_is_asked_about(monkeypatch, power, asked):
    assert any("is it so?" in text for text in questions(monkeypatch, power, 0.0)) == asked


@pytest.mark.parametrize(
    ("left", "asked"), [(4.9, False), (5.1, True), (94.0, True), (96.0, False), (104.0, False)]
)
def test_a_power_that_the_slack_takes_is_asked_about(monkeypatch, left, asked):
    found = questions(monkeypatch, 1.0, left)
    assert any("the slack takes the difference" in text for text in found) == asked


@pytest.mark.parametrize(("beside", "asked"), [(None, True), (1.0, False)])
def test_a_source_that_stands_in_for_a_converter_feeds_as_well(monkeypatch, beside, asked):
    found = questions(monkeypatch, 1.0, 200.0, beside)
    assert any("the slack takes the difference" in text for text in found) == asked


@pytest.mark.parametrize("at_slack", [1, 2, 6])
@pytest.mark.parametrize(("left", "asked"), [(0.0, False), (2e-12, False), (300.0, True)])
def test_units_at_the_slack_are_not_compared_however_many(monkeypatch, at_slack, left, asked):
    """The slack's power follows from all others': only what a unit elsewhere feeds less is asked about."""
    found = questions(monkeypatch, 0.0, left, at_slack=at_slack)
    assert any("the slack takes the difference" in text for text in found) == asked
    assert all("units 300 MW less than in the file" in text for text in found)
