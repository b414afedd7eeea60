"""What an outage takes is shared as by hand, nobody beyond his limit; what hangs on a line is lost with it."""

import csv
import json
import re
from types import SimpleNamespace

import pytest

import orchestrator.face.api.case as gfor_face
from orchestrator.cases.case import load_case
from orchestrator.cases.flow.sharing import Reserve, SharingRule, droop_gain, power_limits, shares
from orchestrator.core.errors import ErrorKind, InputError
from orchestrator.linear.spectra.modes import find_modes
from orchestrator.studies.modes.modes import compute_modes
from orchestrator.studies.operating_points.item import Item, Status
from orchestrator.studies.operating_points.outages import what_remains
from orchestrator.studies.operating_points.point_columns import Elements
from orchestrator.studies.operating_points.preparation import ItemPreparation
from orchestrator.studies.points.executor import Serial
from orchestrator.studies.points.points import Work
from orchestrator.studies.points.store import PointStore
from orchestrator.studies.screening.request import ScreeningRequest
from orchestrator.studies.screening.study import plan_screening, run_screening
from orchestrator.studies.screening.summary import Summary
from orchestrator.studies.screening.view import as_json, overview, remarks
from orchestrator.studies.screening.words import verdict_sentence
from tests.cases.new.test_widened_limits import new_case
from tests.studies.screening.five_machines import DROOPS, POWERS, RATINGS, five_machines


@pytest.fixture
def five(tmp_path):
    return five_machines(tmp_path)


def screened(case, folder, outages, text="name\nonly\n", sharing=None):
    path = folder / "points.csv"
    path.write_text(text)
    plan = plan_screening(case, ScreeningRequest(path, outages, "base", sharing=sharing))
    return run_screening(plan, Work(Serial(), PointStore(folder / "points"))).items


def critical(item):
    return item.record.eigenvalues[list(item.record.critical)]


def test_what_little_the_shares_leave_is_the_slacks(five, tmp_path):
    """Nothing else makes up for it where no machine has a governor: a steady state would never be found."""
    item = Item(0, 1, {}, ("load_12",), ("load_12",))
    found = ItemPreparation(five, "base", ()).prepared(item).scenario.power_flow
    alone = five.prepare(
        ["base"],
        {f"sg{n}.P_0": found.powers[f"sg{n}"].real for n in (1, 2, 3, 4)}
        | {"grid.load_12.scale": 0.0},
    )[0].power_flow
    assert found.powers["sg5"].real == pytest.approx(alone.powers["sg5"].real, abs=1e-12)


def at(case, lost, sharing=None):
    """The prepared item of an outage: powers [MW] by unit."""
    item = Item(0, 1, {}, tuple(lost), tuple(lost))
    found = ItemPreparation(case, "base", (), None, sharing).prepared(item).scenario
    flow = found.power_flow
    return {
        name: flow.powers[name].real * RATINGS[int(name[2:])]
        for name in found.system.components
        if name != "grid"
    }


def test_shares_follow_the_gains_until_a_limit():
    units = [
        Reserve("a", 50, 2, 0, 100),
        Reserve("b", 50, 1, 0, 60),
        Reserve("c", 50, 1, 0, 100),
        Reserve("d", 9, 0, 9, 9),
    ]
    assert shares(units, 20) == pytest.approx({"a": 60, "b": 55, "c": 55, "d": 9})
    assert shares(units, 60) == pytest.approx(
        {"a": 50 + 50 * 2 / 3, "b": 60, "c": 50 + 50 / 3, "d": 9}
    )
    assert shares(units, -20) == pytest.approx({"a": 40, "b": 45, "c": 45, "d": 9})
    assert shares(units, 110) == pytest.approx({"a": 100, "b": 60, "c": 100, "d": 9})
    for change, words in (
        (111, "b would need 130 % of its 60 MW: 111 MW more"),
        (-160, "MW less cannot be shared"),
    ):
        with pytest.raises(InputError, match=re.escape(words)) as caught:
            shares(units, change)
        assert caught.value.kind is ErrorKind.START


def test_units_without_room_are_told_in_megawatts():
    """A file with PT = 0 of all machines: no share of 0 MW is told, and who feeds what is lost all the same."""
    words = "a would need 56.67 MW, where its most is 0 MW: 20 MW more cannot be shared, 20 MW are"
    with pytest.raises(InputError, match=re.escape(words)) as caught:
        shares([Reserve("a", 50, 1, 0, 0), Reserve("b", 9, 2, 0, 0)], 20)
    assert "let the slack alone feed what is lost (--sharing slack)" in str(caught.value)


def test_what_cannot_be_shared_is_told_as_a_deficit_or_a_surplus():
    """Of 60 MW more than 50 + 50 MW, 20 MW are short; of 120 MW less than those 100 MW, 20 MW are too much."""
    units = [Reserve(name, 50, 1, 0, 70) for name in "ab"]
    for change, words in ((60, "20 MW are short when all"), (-120, "20 MW are too much when all")):
        with pytest.raises(InputError, match=words) as caught:
            shares(units, change)
        assert "--sharing" not in str(caught.value)


def test_a_units_droop_and_limits_are_those_of_its_model(five):
    (prepared,) = five.prepare(["base"])
    plans = prepared.system.components
    assert {n: droop_gain(plans[f"sg{n}"]) for n in RATINGS} == pytest.approx(
        {n: 1 / DROOPS[n] if n in DROOPS else 0 for n in RATINGS}
    )
    assert power_limits(plans["sg1"]) == pytest.approx((0.001, 1.199))
    assert power_limits(plans["sg4"])[1] > 1.1  # without a governor nothing but the port limits it


def plan_of(**values):
    values = {name.replace("__", "."): value for name, value in values.items()}
    return SimpleNamespace(
        description=SimpleNamespace(variables=values), number=lambda name: float(values[name])
    )


def test_a_droop_counts_where_it_acts():
    """A grid-following converter has a droop that is off by default; a valve's power goes through its fractions."""
    assert droop_gain(plan_of(frequency_droop__R_f=0.05, frequency_droop__enabled=False)) == 0
    assert droop_gain(plan_of(frequency_droop__R_f=0.05, frequency_droop__enabled=True)) == 20
    assert droop_gain(plan_of(governor__K=20, governor__K_1=0.3, governor__K_3=0.7)) == 20
    assert droop_gain(plan_of(governor__R=0.05, governor__A_t=1.2)) == pytest.approx(24)
    assert droop_gain(plan_of(governor__inverse_R=25)) == 25
    assert droop_gain(plan_of(droop__R_f=0)) > 1e5
    assert droop_gain(plan_of(S_n=100)) == 0


@pytest.mark.parametrize("lost", [("sg1",), ("sg5",), ("line_15_5",)])
def test_an_outage_has_the_modes_of_the_dispatch_by_hand(five, tmp_path, lost):
    """By hand: each unit adds power by its rating and droop; another unit is the reference."""
    unit = lost[0] if lost[0].startswith("sg") else "sg5"
    found = at(five, lost)
    intact = {f"sg{n}": power for n, power in POWERS.items()}
    (base,) = five.prepare(["base"])
    intact["sg5"] = base.power_flow.powers["sg5"].real * RATINGS[5]
    left = [name for name in intact if name != unit]
    gain = {
        name: RATINGS[int(name[2:])] / DROOPS[int(name[2:])] if int(name[2:]) in DROOPS else 0.0
        for name in left
    }
    added = {name: found[name] - intact[name] for name in left}
    step = sum(added.values()) / sum(gain.values())
    assert added == pytest.approx({name: step * gain[name] for name in left}, abs=1e-5)
    # the rest is the change of the losses
    assert sum(added.values()) == pytest.approx(intact[unit], rel=0.1)
    other = next(name for name in left if gain[name])
    values = {f"{name}.P_0": found[name] / RATINGS[int(name[2:])] for name in left}
    values |= {f"grid.{unit}.connected": False, f"{unit}.governor.V_MIN": -0.1}
    folder = tmp_path / "hand"
    folder.mkdir()
    (hand,) = five_machines(folder, flow=f'slack = "{other}"').prepare(["base"], values)
    assert hand.power_flow.powers[other].real * RATINGS[int(other[2:])] == pytest.approx(
        found[other], abs=1e-5
    )
    expected = [
        m.eigenvalue
        for m in find_modes(compute_modes(hand).system, 0.1, 2.0)
        if m.damping_ratio <= 0.2
    ]
    item = screened(five, tmp_path, lost[0])[-1]
    assert item.record.status is Status.COMPUTED
    assert item.record.text.startswith(f"{unit} is lost, which fed {intact[unit]:.4g} MW; shared: ")
    assert critical(item) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("rule", list(SharingRule))
def test_switching_a_unit_off_shares_as_its_outage_does_and_as_by_hand(five, tmp_path, rule):
    """By hand: powers by rating and droop are given, with a factor for which sg5, which feeds the rest, feeds its own
    share. The screening's item, the case with the unit switched off and the case by hand have the same modes."""
    weights = (
        {2: 200 / 0.04, 3: 220 / 0.05, 4: 0.0, 5: 260 / 0.06}
        if rule == "droop"
        else {2: 200.0, 3: 220.0, 4: 150.0, 5: 260.0}
    )
    weights = weights if rule != "slack" else {2: 0.0, 3: 0.0, 4: 0.0, 5: 1.0}
    off = {"sg1.connected": False, "sg1.governor.V_MIN": -0.1, "sg5.governor.V_MAX": 1.5}
    (intact,) = five.prepare(["base"])
    before = {**POWERS, 5: intact.power_flow.powers["sg5"].real * 260}

    def by_hand(factor):
        fed = {n: before[n] + factor * weight for n, weight in weights.items()}
        (prepared,) = five.prepare(
            ["base"], off | {f"sg{n}.P_0": fed[n] / RATINGS[n] for n in (2, 3, 4)}
        )
        return prepared, prepared.power_flow.powers["sg5"].real * 260 - fed[5]

    factor = before[1] / sum(weights.values())
    for _ in range(4):
        hand, missing = by_hand(factor)
        factor += missing / sum(weights.values())
    assert abs(missing) < 1e-5
    scenario = gfor_face.Case(five).scenario("base", off, sharing=str(rule))
    (told,) = (text for text in scenario.questions if "sharing" in text)
    assert f"sg1 is lost, which fed 190 MW; shared: sg{'5' if rule == 'slack' else ''}" in told
    assert f"by {rule}; the rules are droop, rating, slack" in told
    for name in ("sg2", "sg3", "sg4", "sg5"):
        assert scenario.prepared.power_flow.powers[name].real == pytest.approx(
            hand.power_flow.powers[name].real, abs=1e-6
        )
    expected = [
        m.eigenvalue
        for m in find_modes(compute_modes(hand).system, 0.1, 2.0)
        if m.damping_ratio <= 0.2
    ]
    found = find_modes(compute_modes(scenario.prepared).system, 0.1, 2.0)
    assert [m.eigenvalue for m in found if m.damping_ratio <= 0.2] == pytest.approx(
        expected, rel=1e-6
    )
    item = screened(five, tmp_path, "sg1", "name,sg5.governor.V_MAX\nonly,1.5\n", sharing=rule)[-1]
    assert critical(item) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("key", ["grid.load_12.scale", "gr*.load_12.scale"])
def test_load_that_values_take_at_once_is_shared_with_the_unit(five, tmp_path, key):
    """As the outage of both is: the load that goes is no business of the slack alone."""
    scenario = gfor_face.Case(five).scenario("base", {"sg1.connected": False, key: 0.0})
    (told,) = (text for text in scenario.questions if "sharing" in text)
    assert "sg1 is lost, which fed 190 MW; 150 MW of load lost; shared: " in told
    expected = at(five, ("sg1", "load_12"))
    powers = scenario.prepared.power_flow.powers
    assert {n: powers[n].real * RATINGS[int(n[2:])] for n in expected} == pytest.approx(
        expected, abs=1e-4
    )
    before = at(five, ())
    more = gfor_face.Case(five).scenario(
        "base", {"sg1.connected": False, "grid.load_12.scale": 1.1}
    )
    assert "15 MW of load more" in " ".join(more.questions)
    added = {
        n: more.prepared.power_flow.powers[n].real * RATINGS[int(n[2:])] - before[n]
        for n in ("sg2", "sg3")
    }
    assert added["sg2"] / added["sg3"] == pytest.approx((200 / 0.04) / (220 / 0.05), rel=1e-5)


def test_what_is_switched_off_is_shared_as_the_case_says_unless_powers_are_given(five, tmp_path):
    def powers(case, values, **how):
        scenario = gfor_face.Case(case).scenario("base", values, **how)
        return scenario.prepared.power_flow.powers, [
            q for q in scenario.questions if "sharing" in q
        ]

    off = {"sg2.connected": False}
    shared, (told,) = powers(five, off)
    assert (
        shared
        == powers(five, {"grid.sg2.connected": False})[0]
        == powers(five, {"sg[2].connected": False})[0]
    )
    assert "by droop" in told
    folder = tmp_path / "slack"
    folder.mkdir()
    left, (told,) = powers(five_machines(folder, flow='sharing = "slack"'), off)
    assert (left["sg1"].real * 250, "by slack" in told) == (pytest.approx(190), True)
    # a dispatch by hand
    assert powers(five, {**off, "sg1.P_0": 0.8})[0]["sg3"].real * 220 == pytest.approx(160)
    assert powers(five, {"grid.line_11_13.connected": False})[1] == []
    with pytest.raises(InputError, match="give one of droop, rating, slack"):
        powers(five, off, sharing="governor")


def test_ratings_or_the_slack_share_where_they_are_asked_for(five, tmp_path):
    before, by_rating = at(five, ()), at(five, ("sg1",), SharingRule.RATING)
    added = {name: (by_rating[name] - before[name]) / RATINGS[int(name[2:])] for name in by_rating}
    assert set(added) == {"sg2", "sg3", "sg4", "sg5"}
    assert max(added.values()) == pytest.approx(min(added.values()), abs=1e-7)
    alone = at(five, ("sg1",), SharingRule.SLACK)
    assert [name for name in alone if abs(alone[name] - before[name]) > 1e-6] == ["sg5"]
    folder = tmp_path / "case"
    folder.mkdir()
    assert at(five_machines(folder, flow='sharing = "slack"'), ("sg1",)) == alone


def test_nobody_is_beyond_a_limit_while_others_have_room(tmp_path):
    """sg1 has 0.76 of 0.9 pu before; its share alone would be 1.0 pu."""
    found = at(five_machines(tmp_path, highest=0.9), ("sg3",))
    loading = {name: power / RATINGS[int(name[2:])] for name, power in found.items()}
    assert loading["sg1"] == pytest.approx(0.899)
    assert all(value <= 0.899 + 1e-9 for name, value in loading.items() if name != "sg4")
    (_, item) = screened(five_machines(tmp_path, highest=0.9), tmp_path, "sg3")
    assert item.record.status is Status.COMPUTED


def test_the_files_most_power_is_a_limit_of_sharing(tmp_path):
    """PT of the RAW file: sg1 feeds 190 MW before, and takes no more than 200; a PT below what is fed takes nothing."""
    free = at(five_machines(tmp_path), ("sg3",))
    found = at(five_machines(tmp_path, most={1: 200.0, 2: 100.0}), ("sg3",))
    assert free["sg1"] > 210
    assert (found["sg1"], found["sg2"]) == (pytest.approx(200), pytest.approx(130))
    assert found["sg5"] > free["sg5"] + 10
    (_, item) = screened(
        five_machines(tmp_path, most=dict.fromkeys(RATINGS, 195.0)), tmp_path, "sg3"
    )
    assert item.record.status is Status.STEADY_STATE
    limit = r"sg\d would need \d+ % of its 195 MW \(the network file's most, PT in a RAW file, where governor.V_MAX "
    assert re.search(limit + r"allows \d{3}\.?\d* MW\)", item.record.text)


def test_the_table_says_why_and_the_outage_that_is_named_can_be_typed(tmp_path):
    """All machines end at 165 MW, or at what they feed: of sg3's 160 MW too few can be shared."""
    case = five_machines(tmp_path, most=dict.fromkeys(RATINGS, 165.0))
    work = Work(Serial(), PointStore(tmp_path / "points"))
    found = Summary(
        run_screening(plan_screening(case, ScreeningRequest(None, "sg3", "base")), work)
    )
    table = overview(found)
    (why,) = (column for column in table.shown_columns if column.heading == "Why not")
    (said,) = (why.cell(row) for row in table.rows if row.name == "sg3")
    assert "no steady state: sg" in said
    assert "PT in a RAW file" in said
    (lost,) = found.failures()
    (typed,) = re.findall(r"--outages ([\w+]+)", lost.record.text)
    assert typed.startswith("sg3+load_")
    (_, item) = screened(case, tmp_path, typed)
    assert item.record.status is Status.COMPUTED


def test_all_that_cannot_be_shared_is_named(tmp_path):
    """15 items of one kind are one line with all their outages and points; JSON has each item's own reason."""
    case = five_machines(tmp_path, most={1: 200, 2: 140, 3: 170, 4: 112, 5: 155})
    (tmp_path / "points.csv").write_text(
        "name,load,generation\nlow,0.9,0.9\nhigh,1.1,1.1\nhigher,1.2,1.2\n"
    )
    outages = ",".join(f"sg{n}" for n in RATINGS)
    plan = plan_screening(case, ScreeningRequest(tmp_path / "points.csv", outages, "base"))
    found = Summary(run_screening(plan, Work(Serial(), PointStore(tmp_path / "points"))))
    head, *lines = (line for line in remarks(found) if "would need" in line or "of 18:" in line)
    assert head == "no steady state: 15 of 18:"
    # one line a kind: sg2 would need most, or sg5 where sg2 is out
    assert [line.partition(", first")[0] for line in lines] == [
        "  12 items (sg1, sg3, sg4, sg5 at low, high, higher)",
        "  3 items (sg2 at low, high, higher)",
    ]
    assert "sg2 would need 128 % of its 140 MW" in lines[0]
    assert not any(word in "".join(lines) for word in ("…", "questioned besides"))
    failures = as_json(found)["failures"]
    assert len(failures) == 15
    assert all("would need" in one["why"] for one in failures)


def test_an_item_beyond_a_limit_is_computed_with_the_limit_widened_and_told(tmp_path):
    """PSS/E warns and goes on. The modes are those of the same limits typed; the question names them once for all."""
    case = load_case(new_case(tmp_path, exciter="0.05 -5.0 0.9 /"))
    outages = "sg1,sg2,sg3,line_14_15"

    def summary_with(values):
        plan = plan_screening(case, ScreeningRequest(None, outages, "base", values))
        return Summary(run_screening(plan, Work(Serial(), PointStore(tmp_path / "points"))))

    found = summary_with({})
    assert not list(found.failures())
    beyond = found.widened
    assert 1 < len(beyond) < len(found.result.items)
    assert len({item.record.widenings for item in beyond}) > 1
    assert all(0.9 <= one.given < one.taken for item in beyond for one in item.record.widenings)
    assert f"at {len(beyond)} of 5 points and outages a limit is widened" in verdict_sentence(found)
    (question,) = (line for line in remarks(found) if line.startswith("question: at"))
    typed = {name: float(value) for name, value in re.findall(r"--set (\S+)=([\d.]+)", question)}
    widest = {one.name: one.taken for item in beyond for one in item.record.widenings}
    assert set(typed) == set(widest)
    again = summary_with(typed)
    assert not again.widened
    assert not any(line.startswith("question: at") for line in remarks(again))
    for one, other in zip(found.result.items, again.result.items, strict=True):
        assert critical(one) == pytest.approx(critical(other), rel=1e-6)
    shown = {item["outage"] for item in as_json(found)["widened_limits"]}
    assert shown == {item.outage.name for item in beyond}


def test_what_cannot_be_shared_says_who_would_need_how_much(five, tmp_path):
    (_, lost, fine) = screened(five, tmp_path, "sg1+sg2,sg2")
    assert (lost.record.status, fine.record.status) == (Status.STEADY_STATE, Status.COMPUTED)
    assert re.search(
        r"sg3 would need 122 % of its 263.8 MW \(governor.V_MAX\): 320 MW more cannot be shared",
        lost.record.text,
    )
    assert "slack" not in lost.record.text, "it alone cannot do what all together cannot"


def test_what_hangs_on_a_branch_is_lost_with_it(five, tmp_path):
    items = {
        item.outage.name: item
        for item in screened(five, tmp_path, "sg5,line_15_5,load_16,line_13_16,line_11_12")
    }
    assert all(item.record.status is Status.COMPUTED for item in items.values())
    assert critical(items["line_15_5"]) == pytest.approx(critical(items["sg5"]), rel=1e-6)
    # Beside its load, the charging of the dead line, 2 Mvar, is gone too.
    assert critical(items["line_13_16"]) == pytest.approx(critical(items["load_16"]), rel=1e-3)
    assert items["line_13_16"].record.text.startswith("30 MW of load lost; shared: ")
    assert not items["line_11_12"].record.text


def test_a_power_that_sharing_replaces_is_not_scolded_where_the_slack_is_lost(five, tmp_path):
    (_, item) = screened(five, tmp_path, "sg5", "name,generation\nonly,1.0\n")
    assert item.record.status is Status.COMPUTED
    assert not any("cannot act" in text for text in item.record.warnings)


def test_nothing_remains_without_a_unit(five):
    (prepared,) = five.prepare(["base"])
    elements = Elements.of(prepared)
    assert what_remains(prepared, elements, list(elements.units)).why_none
    both = what_remains(prepared, elements, ["line_15_11", "line_14_15"])
    # The slack's unit may feed 120 MW alone: an island, and the smaller side is what is cut off.
    assert (
        both.why_none
        == "bus_5, bus_15 cut off, with 120 MW of load and the units sg5, which may go on alone"
    )
    plant = what_remains(prepared, elements, ["line_15_5"])
    assert (plant.units, plant.loads, plant.ties, plant.dead) == (
        ("sg5",),
        (),
        ("line_15_5",),
        ("bus_5",),
    )


def test_a_question_besides_does_not_change_the_kind(five, tmp_path):
    """Loads that no line can carry have no power flow, whatever else is questioned."""
    text = "name,load,sg1.machine.H,sg1.machine.X_d\nheavy,9,,\nasked,9,500,\n"
    heavy, asked = screened(five, tmp_path, None, text)
    assert heavy.record.status is asked.record.status is Status.POWER_FLOW
    assert "questioned besides" in asked.record.text


def test_without_points_the_case_itself_is_the_only_one(gfor, five, tmp_path):
    plan = plan_screening(five, ScreeningRequest(None, "sg2", "base"))
    assert [(point.name, point.values, point.out) for point in plan.points] == [("case", {}, ())]
    code, _, error = gfor(
        "screen", five.path, "--outages", "sg2", "--damping", "0.2", "--out", tmp_path / "out"
    )
    assert code == 2
    assert "'0.2' is read in percent; write 20" in error
    code, out, _ = gfor(
        "screen",
        five.path,
        "--outages",
        "sg2",
        "--sharing",
        "slack",
        "--out",
        tmp_path / "out",
        "--json",
    )
    assert code == 0
    found = json.loads(out)
    assert (found["points"], found["outages"], found["counts"]) == (1, 1, {"computed": 2})
    assert any("the load model is open" in text for text in found["questions"])
    with (tmp_path / "out" / "items.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == [
        "point",
        "outage",
        "hours",
        "status",
        "stable",
        "counted",
        "least_damping_percent",
        "frequency_hz",
        "why",
        "branch",
        "loading_percent",
        "branches_beyond",
        "bus_outside",
        "voltage_pu",
        "buses_outside",
    ]
    assert rows[1]["why"].startswith("sg2 is lost, which fed 130 MW; shared: sg5 +")
