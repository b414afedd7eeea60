"""Ratings and voltage bands of a RAW file beside the power flow after an outage."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.networks.branch_limits import loadings, outliers
from orchestrator.studies.operating_points.item import Item, Status
from orchestrator.studies.operating_points.preparation import ItemPreparation
from orchestrator.studies.screening.limits import limits_json, limits_sentence, limits_table
from orchestrator.studies.screening.record import ItemRecord
from tests.cases.networks.psse import LINES, MACHINES, TRANSFORMERS, raw, records
from tests.studies.screening.test_following_loads import CASE
from tests.support.scenarios import bare_scenario

LINE_MVA, TRANSFORMER_MVA = 80.0, 150.0
LOST = (5, 7)


def rated(revision):
    """The nine buses with ratings, in the fields that a revision has."""
    found = records(revision)
    column = 6 if revision < 34 else 7
    for k, text in enumerate(found["BRANCH"]):
        fields = text.split(",")
        fields[column] = str(LINE_MVA)
        found["BRANCH"][k] = ",".join(fields)
    for k in range(2, len(found["TRANSFORMER"]), 4):
        fields = found["TRANSFORMER"][k].split(",")
        fields[3] = str(TRANSFORMER_MVA)
        found["TRANSFORMER"][k] = ",".join(fields)
    fields = found["BUS"][4].split(",")
    fields[9:11] = ["1.05", "0.99"]  # bus 5, which is low without the line to bus 7
    found["BUS"][4] = ",".join(fields)
    return raw(revision, found)


def prepared(folder, revision):
    """The power flow and the file's limits, intact and without a line."""
    (folder / "wscc.raw").write_text(rated(revision))
    units = [f"{n},{v},{base},{p}" for n, (p, v, base) in MACHINES.items()]
    (folder / "units.csv").write_text("\n".join(["bus,v_pu,rating_mva,p_mw", *units]))
    (folder / "case.toml").write_text(CASE.format(keys=""))
    preparation = ItemPreparation(load_case(folder / "case.toml"), "base", ())
    line = next(name for name in preparation.elements.lines if name.startswith("line_5_7"))
    return preparation.base, preparation.prepared(Item(0, 1, {}, (line,), (line,))).scenario


def independent_loadings(voltages, lost=None):
    """Parts of the ratings by the file's own impedances, from the bus voltages: by current, and by power."""
    found = {}
    for i, j, r, x, b in LINES:
        if (i, j) != lost:
            v = np.array([voltages[i], voltages[j]])
            series = (v - v[::-1]) / complex(r, x)
            current = np.abs(series + 0.5j * b * v)
            found[f"line_{i}_{j}"] = 100 * current.max() / LINE_MVA
    for i, j, x in TRANSFORMERS:
        v = np.array([voltages[i], voltages[j]])
        power = np.abs(v * ((v - v[::-1]) / complex(0, x)).conj())
        found[f"line_{i}_{j}"] = 100 * power.max() / TRANSFORMER_MVA
    return found


@pytest.mark.parametrize("revision", [33, 34, 35])
def test_loadings_are_those_of_an_independent_calculation(tmp_path, revision):
    for scenario, lost in zip(prepared(tmp_path, revision), (None, LOST), strict=True):
        voltages = {n: scenario.power_flow.voltages[f"bus_{n}"] for n in range(1, 10)}
        wanted = independent_loadings(voltages, lost)
        found = loadings(scenario.power_flow, scenario.file_limits)
        assert found[0].branch == max(wanted, key=wanted.get)
        assert {x.branch for x in found if x.beyond} == {n for n, x in wanted.items() if x > 1}
        assert [x.part for x in found] == pytest.approx([wanted[x.branch] for x in found], rel=1e-6)


def test_a_bus_outside_of_its_band_is_named(tmp_path):
    intact, without = prepared(tmp_path, 33)
    assert not outliers(intact.power_flow, intact.file_limits)
    (one,) = outliers(without.power_flow, without.file_limits)
    assert (one.bus, one.limit) == ("bus_5", 0.99)
    assert one.voltage == abs(without.power_flow.voltages["bus_5"])
    assert not outliers(without.power_flow, without.file_limits, dead=["bus_5"])


def screened(folder):
    """A summary of the intact network and of the outage."""
    both = prepared(folder, 33)
    items = []
    for scenario, name in zip(both, ("intact", "line_5_7"), strict=True):
        flow, limits = scenario.power_flow, scenario.file_limits
        record = ItemRecord(
            Status.COMPUTED,
            loadings=loadings(flow, limits),
            outliers=outliers(flow, limits),
            has_flow=True,
        )
        outage = SimpleNamespace(name=name, elements=() if name == "intact" else (name,))
        point = SimpleNamespace(name="base")
        items.append(SimpleNamespace(point=point, outage=outage, record=record))
    plan = SimpleNamespace(prepared=both[0], points=(point,))
    return SimpleNamespace(result=SimpleNamespace(items=items, plan=plan))


def test_a_screening_says_what_is_beyond_and_what_was_before(tmp_path):
    summary = screened(tmp_path)
    said = limits_sentence(summary)
    assert said.startswith("At 2 of 2 points and outages a branch is beyond its rating, most line_")
    assert "Beyond it without an outage already: line_" in said
    assert (
        "At 1 of 2 points and outages a bus voltage is outside of its band, furthest bus_5" in said
    )
    assert limits_table(summary) is not None
    after = limits_json(summary)["items"][1]
    before = {one["branch"]: one["beyond_in_intact_network"] for one in after["branches"]}
    assert set(before.values()) == {True, False}


@pytest.mark.parametrize(("times", "asked"), [(1.0, False), (0.25, True)])
def test_ratings_that_the_intact_network_exceeds_many_times_are_asked_about(times, asked, tmp_path):
    """A quarter of the first rating of one line: 4 times what it carried by the independent calculation."""
    summary = screened(tmp_path)
    intact = summary.result.items[0]
    voltages = summary.result.plan.prepared.power_flow.voltages
    wanted = independent_loadings({n: voltages[f"bus_{n}"] for n in range(1, 10)})
    worst = max(wanted, key=wanted.get)
    limits = summary.result.plan.prepared.file_limits
    small = replace(limits.ratings[worst], mva=times * limits.ratings[worst].mva)
    limits = replace(limits, ratings={**limits.ratings, worst: small})
    flow = summary.result.plan.prepared.power_flow
    intact.record = replace(intact.record, loadings=loadings(flow, limits))
    summary.result.plan.prepared = SimpleNamespace(file_limits=limits)
    said = limits_sentence(summary)
    figure = f"The file gives {worst} {small.mva:g} MVA, and the intact network takes "
    figure += f"{100 * wanted[worst] / times:.4g} % of it."
    assert (figure in said) == asked
    assert ("Are its ratings meant?" in said) == asked


def test_nothing_is_said_to_hold_where_there_is_no_power_flow(tmp_path):
    summary = screened(tmp_path)
    for item in summary.result.items:
        item.record = ItemRecord(Status.POWER_FLOW)
    assert limits_sentence(summary) == ""
    summary.result.items[0].record = ItemRecord(Status.COMPUTED, has_flow=True)
    said = "All bus voltages are within their bands, except for 1 item not judged."
    assert limits_sentence(summary) == said


def test_items_without_a_power_flow_are_not_counted(tmp_path):
    summary = screened(tmp_path)
    lost = SimpleNamespace(
        record=ItemRecord(Status.STEADY_STATE),
        outage=SimpleNamespace(name="lost", elements=("lost",)),
        point=SimpleNamespace(name="base"),
    )
    summary.result.items.append(lost)
    assert limits_sentence(summary).startswith(
        "At 2 of 2 points and outages a branch is beyond its rating"
    )


def test_a_file_without_ratings_and_bands_has_nothing_said(tmp_path):
    summary = screened(tmp_path)
    summary.result.plan = SimpleNamespace(prepared=bare_scenario(), points=())
    for item in summary.result.items:
        item.record = ItemRecord(Status.COMPUTED)
    assert limits_sentence(summary) == ""
    assert limits_json(summary) is None
    assert limits_table(summary) is None
