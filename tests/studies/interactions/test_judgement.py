"""What systems come to: ranks, falls and doubts, on figures that are made up."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from orchestrator.core.errors import ErrorKind
from orchestrator.studies.interactions.following import FollowedMode
from orchestrator.studies.interactions.judgement import JudgedSystem, _with_followed, doubts_of
from orchestrator.studies.interactions.point import SharedMode, SystemRecord
from orchestrator.studies.interactions.systems import NONE, WHOLE, Kind, SystemName
from orchestrator.studies.interactions.view import Interactions, pairs_table, systems_table
from orchestrator.studies.points.failure import Failure
from tests.studies.interactions.park import park, studied, swapped, written

STABLE = {"stable": True, "sentence": "stable: …"}
UNKNOWN = {
    "stable": None,
    "reason": "a limit is close by",
    "sentence": "not known: a limit is close by",
}


def mode(percent, hertz=10.0, **components):
    """A mode of a damping [%]."""
    imag = 62.83185307 * hertz / 10
    share = percent / 100
    return SharedMode(
        -share * imag / (1 - share**2) ** 0.5, imag, components or {"west": 0.5, "east": 0.5}
    )


def failed(text):
    return SystemRecord(failure=Failure(ErrorKind.STEADY_STATE, text, lasting=True))


def system(*modes, stability=STABLE, **more):
    return SystemRecord(tuple(modes), stability=stability, **more)


def judged(**records):
    """The park's study with other results, by ``WHOLE``, ``A`` or ``A_B``."""

    def name(text):
        vendors = tuple(text.split("_"))
        return (
            WHOLE
            if text == "WHOLE"
            else NONE
            if text == "NONE"
            else SystemName(Kind.ALONE if len(vendors) == 1 else Kind.PAIR, vendors)
        )

    result = park().result
    result = replace(
        result, records=result.records | {name(text): one for text, one in records.items()}
    )
    return Interactions(result, by_place(result))


def by_place(result):
    """Modes that are made up have no model; each is the one at the same place of the other list."""

    def follow(eigenvalue, begin, end):
        here, there = (result.records[name].modes for name in (begin, end))
        place = [mode.eigenvalue for mode in here].index(eigenvalue)
        return there[place].eigenvalue if place < len(there) else None

    return follow


ALL = dict.fromkeys(("A", "B", "C"), system(mode(8.0))) | dict.fromkeys(
    ("A_B", "A_C", "B_C"), system(mode(8.0))
)


def test_without_a_fight_the_worst_pair_is_the_one_that_falls_furthest():
    result = judged(
        **ALL | {"A_C": system(mode(7.0)), "B_C": system(mode(5.5)), "B": system(mode(6.0))}
    )
    found = result.judgement
    assert "the least damped pair is B + C, 5.50 % at 10 Hz" in " ".join(result.sentences)
    assert found.worst_pair.vendors == ("A", "C")  # by 1 point; B and C fall by 0.5
    assert found.worst_pair.fall == pytest.approx(1.0, abs=1e-9)


def test_where_no_pair_falls_there_is_no_worst_one():
    found = judged(**ALL | {"A_B": system(mode(8.005)), "A_C": system(mode(7.995))})
    assert found.worst_pair is None
    assert "no worst pair: no mode of 3 pairs is damped less together" in " ".join(found.sentences)


def lost_alone(worst):
    """The pair A and B with 16.79 %, whose mode cannot be followed; the modes of each alone are given."""
    records = ALL | {"A": system(*worst[:1]), "B": system(*worst[1:]), "A_B": system(mode(16.79))}
    result = judged(**records).result

    def follow(eigenvalue, begin, end):
        return None if begin.names == ("A", "B") else by_place(result)(eigenvalue, begin, end)

    return Interactions(result, follow)


def test_a_mode_that_is_lost_alone_leaves_the_fall_of_the_least_damping():
    found = lost_alone((mode(19.63), mode(18.85)))
    pair = next(one for one in found.judgement.pairs if one.vendors == ("A", "B"))
    assert pair.mode.alone_percent == (None, None)
    assert pair.fall == pytest.approx(18.85 - 16.79)
    assert found.worst_pair == ("A", "B")
    told = " ".join(found.sentences)
    assert "worst pair of 3 pairs: A + B: stable, lower together, by the least damping" in told
    assert "cannot be followed to A alone (the least damped vendor's mode there: 19.63 % at" in told
    assert "need not be of one mode, falls by 2.06 points" in told
    assert "none with" not in told
    (row,) = [row for row in found.as_json()["pairs"] if row["vendors"] == ["A", "B"]]
    assert (row["falls_by_least_damping"], row["mode_first_alone_percent"]) == (True, None)
    (cells,) = [
        [column.cell(one) for column in pairs_table(found.judgement).shown_columns]
        for one in found.judgement.pairs
        if one is pair
    ]
    assert cells[3:] == [
        "not followed; least 19.63",
        "not followed; least 18.85",
        "16.79",
        "least +2.06",
    ]


def test_a_pair_without_any_mode_alone_to_compare_is_not_said_to_have_no_fall():
    found = lost_alone(())
    assert found.worst_pair is None
    assert "worst pair: not known: A + B: stable" in " ".join(found.sentences)
    assert found.as_json()["unknown_pairs"] == [["A", "B"]]


def test_a_pair_that_one_of_them_spoils_alone_is_no_fight():
    grows = system(mode(-2.0), stability={"stable": False}, growing=mode(-2.0))
    result = judged(**ALL | {"A": grows, "A_B": grows})
    found = result.judgement
    assert "UNSTABLE without the other vendors: A, -2.00 % at 10 Hz" in result.sentences
    assert (
        "no worst pair: no mode of 3 pairs is damped less together than with one alone; UNSTABLE: A + B"
        in result.sentences
    )
    pair = next(one for one in found.pairs if one.vendors == ("A", "B"))
    assert pair.fights is False
    assert pair.fall == pytest.approx(0.0, abs=1e-9)
    assert "UNSTABLE together, and A alone as well" in pair.sentence()


@pytest.mark.parametrize(
    "lost", [system(mode(5.0), stability=UNKNOWN), failed("no steady state found")]
)
def test_a_pair_without_a_verdict_is_neither_the_worst_nor_forgotten(lost):
    found = judged(**ALL | {"A_B": lost, "A_C": system(mode(7.0))})
    assert found.worst_pair == ("A", "C")
    assert found.judgement.pairs[-1].vendors == ("A", "B")
    assert "worst pair of 2 pairs: A + C" in " ".join(found.sentences)
    assert "; not known: A + B" in " ".join(found.sentences)
    assert found.judgement.stable is None
    alone = judged(**ALL | {"A": lost})
    assert [pair.vendors for pair in alone.judgement.unknown_pairs] == [("A", "B"), ("A", "C")]
    assert "A alone: " in alone.judgement.unknown_pairs[0].sentence()
    assert alone.as_json()["unknown_pairs"] == [["A", "B"], ["A", "C"]]


def test_an_assignment_without_a_verdict_is_not_the_worst():
    result = swapped().result
    worst = SystemName(Kind.ASSIGNMENT, ("B", "B"))
    lost = Interactions(replace(result, records=result.records | {worst: failed("lost")}))
    assert lost.worst_assignment in ({"west": "A", "east": "B"}, {"west": "B", "east": "A"})
    assert lost.judgement.assignments[-1].name == worst
    assert "1 has no verdict" in " ".join(lost.sentences)


def reassigned(threshold, **records):
    """Two devices at two places, with other results or another threshold; ``A_B`` is A west and B east."""
    result = swapped().result
    plan = replace(result.plan, request=replace(result.plan.request, threshold=threshold))
    made = {SystemName(Kind.ASSIGNMENT, tuple(k.split("_"))): one for k, one in records.items()}
    changed = replace(result, plan=plan, records=result.records | made)
    return Interactions(changed, by_place(changed) if made else None)


def test_an_assignment_with_less_share_and_less_damping_is_the_worst():
    """The swing has 6 % and a share of 5.5 % with A and A; it has 3 % and a share of 4.5 % with A and B, where by the
    share the least would be 9 %. The network's own resonance of 1 % counts in none."""

    def found(percent, share):
        network = mode(1.0, 50.0, grid=0.99, west=0.01)
        swing = mode(percent, 1.0, sg1=1 - share, west=share)
        return system(swing, mode(9.0, 5.0), network)

    shares = {"A_A": (6.0, 0.055), "A_B": (3.0, 0.045), "B_A": (7.0, 0.06), "B_B": (8.0, 0.045)}
    result = reassigned(0.05, **{name: found(*figures) for name, figures in shares.items()})
    assert result.worst_assignment == {"west": "A", "east": "B"}
    assert any(
        text.startswith("worst assignment: west: A, east: B: stable, least damping 3.00 %, 1 Hz")
        for text in result.sentences
    )
    least = {one.name.names: one.least_damping for one in result.judgement.assignments}
    assert least == pytest.approx(
        {tuple(name.split("_")): percent for name, (percent, _) in shares.items()}
    )


def test_assignments_are_compared_by_the_same_mode():
    """The park's resonance of 43 Hz: the vendors hold 59.6 % of it with A and A, and 60.1 % elsewhere."""
    usual = {one.name.names: one for one in swapped().judgement.assignments}
    wanted = {names: one.record.modes for names, one in usual.items()}
    resonance = {
        names: next(mode for mode in modes if abs(mode.frequency_hz - 43.27) < 0.05)
        for names, modes in wanted.items()
    }
    shares = {
        names: sum(mode.components.get(place, 0.0) for place in ("west", "east", "north"))
        for names, mode in resonance.items()
    }
    assert shares["A", "A"] < 0.5985 < min(x for names, x in shares.items() if names != ("A", "A"))
    judgement = reassigned(0.5985).judgement
    (both,) = [one for one in judgement.assignments if one.name.names == ("A", "A")]
    assert both.least_damping == resonance["A", "A"].damping_percent  # by the share 12.53 %
    assert both.least_damping == pytest.approx(5.49, abs=0.01)
    assert judgement.unfollowed == {}


def test_a_mode_of_the_network_alone_does_not_count():
    resonance = mode(0.2, 50.0, grid=0.97, west=0.02, east=0.01)
    shared = mode(9.0, 5.0, grid=0.5, west=0.3, east=0.2)
    both = JudgedSystem(WHOLE, system(resonance, shared), frozenset({"west", "east"}), 0.05)
    assert both.critical == shared
    assert replace(both, threshold=0.02).critical == resonance
    assert replace(both, converters=frozenset()).critical is None
    assert replace(both, converters=frozenset()).least_of_all == resonance
    grows = replace(both, record=system(resonance, shared, growing=mode(-1.0, 50.0, grid=1.0)))
    assert grows.least_damping == pytest.approx(-1.0)


def test_a_mode_of_a_pair_counts_in_each_system_to_which_it_was_followed():
    """It is the mode of the pair's least damping; alone, a vendor takes hardly part in it."""
    both, own = SystemName(Kind.PAIR, ("A", "B")), SystemName(Kind.ALONE, ("B",))
    shared, alone, bare = mode(4.0, west=0.3, east=0.3), mode(3.0, sg1=1.0), mode(2.0, sg1=1.0)
    one = FollowedMode(shared, (None, alone.eigenvalue), bare.eigenvalue)
    plain = {
        name: JudgedSystem(name, system(swing), frozenset(converters), 0.05)
        for name, swing, converters in (
            (both, shared, {"west", "east"}),
            (own, alone, {"east"}),
            (NONE, bare, ()),
        )
    }
    assert plain[own].critical is None
    found = {name: _with_followed(of, plain, {both: [one]}) for name, of in plain.items()}
    assert found[both] == plain[both]
    assert found[own].critical == alone
    assert found[NONE].critical == bare
    of_none = {both: [replace(one, together=mode(4.0, sg1=1.0))]}
    assert _with_followed(plain[own], plain, of_none).critical is None


def test_without_any_vendor_the_same_modes_count_as_with_one():
    """The network's own resonance of 0.2 % is neither the pairs' mode nor that of the row without any vendor."""
    resonance = mode(0.2, 50.0, grid=0.99, west=0.01)
    swing, bare = mode(8.0), mode(6.0, 10.0, sg1=1.0)
    with_vendors = {name: system(swing, resonance) for name in ALL}
    found = judged(**with_vendors | {"NONE": system(bare, resonance)})
    table = systems_table(found.judgement)
    names = [table.columns[0].get(row) for row in table.rows]
    pairs = ["A + B", "A + C", "B + C"]
    assert names == ["no vendor", "A alone", "B alone", "C alone", *pairs]
    rows = table.records()
    dampings = [row["least_damping_percent"] for row in rows]
    assert dampings == pytest.approx([6.0] + [8.0] * 6)
    assert [row["least_damping_of_all_percent"] for row in rows] == pytest.approx([0.2] * 7)
    shown = found.as_json()["no_vendor"]
    assert shown["least_damping_percent"] == pytest.approx(6.0)
    assert shown["least_damping_of_all_percent"] == pytest.approx(0.2)


def test_a_mode_belongs_to_those_who_take_part_by_the_threshold():
    record = system(mode(9.0, 5.0, grid=0.43, west=0.5, east=0.05, north=0.02))
    (one,) = judged(WHOLE=record).judgement.modes
    assert (one.vendors, one.is_interaction) == (("A", "B"), True)
    below = system(mode(9.0, 5.0, grid=0.431, west=0.5, east=0.049, north=0.02))
    (other,) = judged(WHOLE=below).judgement.modes
    assert (other.vendors, other.is_interaction) == (("A",), False)


def test_a_network_that_its_stand_ins_do_not_leave_stable_is_named():
    assert not park().warnings
    grows = system(stability={"stable": False, "sentence": "…"}, growing=mode(-2.0))
    for none, words in ((grows, "is UNSTABLE"), (failed("no steady state"), "has no verdict")):
        told = " ".join(judged(NONE=none).warnings)
        assert f"the network with static_generation at all places {words}" in told


def test_a_component_that_was_identified_is_named():
    found = judged(WHOLE=system(mode(9.0), identified=("east",)))
    assert any("east was identified from outside" in text for text in found.warnings)


def test_different_settings_of_one_vendor_are_named():
    assert not swapped().warnings or not any(
        "other settings" in text for text in swapped().warnings
    )
    path = written("same.toml", ('vendor = "B"', 'vendor = "A"'))
    found = studied(path, swap=True, places=("north", "east"))
    assert any(
        "A's converters have other settings at west than at east" in text for text in found.warnings
    )


def test_settings_of_a_vendor_that_differ_are_told_and_equal_ones_are_not():
    def place(name, vendor, **values):
        return SimpleNamespace(name=name, vendor=vendor, plan=SimpleNamespace(parameters=values))

    places = [
        place("west", "A", k=1.0),
        place("east", "A", k=2.0),
        place("north", "A", k=1.0),
        place("south", "B", k=3.0),
    ]
    plan = SimpleNamespace(
        swapped=tuple(p.name for p in places),
        places={p.name: p for p in places},
        stand_in="gfor",
        request=SimpleNamespace(black_box=False),
    )
    result, none = SimpleNamespace(plan=plan, records={}), SimpleNamespace(stable=True)
    (told,) = doubts_of(SimpleNamespace(result=result, none=none, pairs=(), unfollowed={}))
    assert told.startswith("A's converters have other settings at east than at west")


def test_a_record_survives_its_file():
    record = park().judgement.worst_pair.joint.record
    header, arrays = record.stored()
    assert SystemRecord.restored(header, arrays) == record
    assert SystemRecord.restored({"modes": 3}, {}) is None
