"""Relays by their records: which they protect, what they watch, and the records that cannot be."""

from math import inf

import pytest

from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.networks.psse.load_relay_records import load_relays
from orchestrator.cases.networks.psse.raw_network import FileLoad
from orchestrator.cases.networks.psse.relay_doubts import doubts_of_settings, idle_load_relays
from orchestrator.cases.networks.psse.relay_records import unit_relays
from orchestrator.core.errors import InputError
from orchestrator.systems.coupling.relay_limits import RelayLimits

LOADS = [
    FileLoad("load_1", 1, "1", 10, 5, 7, 80.0, 20.0, 80 + 20j),
    FileLoad("load_2", 2, "1", 20, 5, 7, 60.0, 10.0, 60 + 10j),
    FileLoad("load_3", 3, "1", 20, 6, 8, -10.0, 2.0, -10 + 2j),
]
STAGES = "0.9 5 0.1 0.85 1 0.2 0 0 0 0.05"


def records(tmp_path, *texts):
    path = tmp_path / "relays.dyr"
    path.write_text("".join(f"{text} /\n" for text in texts))
    return read_dyr(path)


def units(tmp_path, *texts):
    return [*unit_relays(records(tmp_path, *texts))]


def stages(tmp_path, *texts):
    return [*load_relays(records(tmp_path, *texts), LOADS)]


def test_a_relay_of_a_generator_watches_one_bus_and_protects_another(tmp_path):
    """The record's own number, here 1, is no bus: at bus 1 there may be a machine '5'."""
    voltage, frequency = units(
        tmp_path,
        "1 'VTGTPAT' 5 111 'A' 0.75 5.0 10.0 0.08",
        "2 'FRQDCA' 0 112 '1 ' 57 62 1.5 0.1",
    )
    assert (voltage.record.bus, voltage.watched, voltage.machine) == (0, 5, (111, "A"))
    assert (voltage.quantity, voltage.limits) == ("voltage", RelayLimits(0.75, 5.0, 10.0, 0.08))
    assert not voltage.is_of_bus
    assert (frequency.watched, frequency.machine) == (112, (112, "1"))
    assert (frequency.quantity, frequency.limits) == ("frequency", RelayLimits(57, 62, 1.5, 0.1))
    assert frequency.is_of_bus


def test_a_relay_written_as_a_users_model_is_the_same(tmp_path):
    """IC, IT, NI, NC, NS, NV, then NI whole values, of which PSS/E itself uses three more, and the limits."""
    (old,) = units(tmp_path, "0 'USRMDL' 0 'VTGTPA' 8 0 6 4 0 1 5 111 'A' 0 0 0 0.75 5 10 0.08")
    (new,) = units(tmp_path, "1 'VTGTPAT' 5 111 'A' 0.75 5.0 10.0 0.08")
    assert (old.machine, old.watched, old.limits) == (new.machine, new.watched, new.limits)
    assert old.record.name == "VTGTPA"


def test_each_stage_of_a_load_relay_is_one_and_an_empty_one_is_none(tmp_path):
    first, second = stages(tmp_path, f"1 'LVSHBL' 1 2 {STAGES}")
    assert (first.load.load, first.watched, first.share) == ("load_1", 2, 0.1)
    assert first.limits == RelayLimits(0.9, inf, 5.0, 0.05)
    assert (second.share, second.limits) == (0.2, RelayLimits(0.85, inf, 1.0, 0.05))
    own, _ = stages(tmp_path, f"1 'LVSHBL' 1 {STAGES}")
    assert own.watched == 1
    (slow,) = stages(tmp_path, "2 'LDSHBL' 1 59.3 0.2 0.3 0 0 0 0 0 0 0.1")
    assert (slow.quantity, slow.limits.low, slow.share) == ("frequency", 59.3, 0.3)


FIVE = "59.47 0.031 0.019 0.23 58.5 0.1 0.02 0.3 0 0 0 0 0 0 0 0 0 0 0 0"


def test_five_stages_have_breakers_of_their_own_and_take_a_machine_off(tmp_path):
    """Whole values as InterPSS's test of PSS/E's own relay has them: bus and identifier, and if shunts go as well."""
    found = stages(tmp_path, f"1 'LDS3BL' 1 3 'G1' 1 {FIVE} 0.023")
    first, second = (one for one in found if one.transfer is None)
    assert (first.share, first.limits) == (0.23, RelayLimits(59.47, inf, 0.031, 0.019))
    assert (second.share, second.limits) == (0.3, RelayLimits(58.5, inf, 0.1, 0.02))
    assert first.sheds_shunts
    assert first.quantity == "frequency"
    transfers = [(one.transfer.machine, one.limits) for one in found if one.transfer]
    assert transfers == [
        ((3, "G1"), RelayLimits(59.47, inf, 0.031, 0.023)),
        ((3, "G1"), RelayLimits(58.5, inf, 0.1, 0.023)),
    ]
    only = stages(tmp_path, f"1 'LDS3BL' 1 0 '0' 0 {FIVE} 0.023")
    assert [one.transfer for one in only] == [None, None]


def test_five_stages_of_voltage_open_two_branches(tmp_path):
    found = stages(tmp_path, f"1 'LVS3BL' 1 1 2 '1' 0 0 '0' 0 {FIVE} 0.021 0.03")
    branches = [(one.transfer.branch, one.limits.opening) for one in found if one.transfer]
    assert branches == [((1, 2, "1"), 0.021)] * 2
    with pytest.raises(InputError, match="has 25 values, and needs 29: two branches"):
        stages(tmp_path, f"1 'LVS3BL' 1 0 0 '0' {FIVE} 0.021 0.03")


def test_the_narrower_record_counts_and_what_feeds_sheds_nothing(tmp_path):
    found = stages(tmp_path, f"0 'LVSHAL' * {STAGES}", "1 'LVSHBL' 1 0.7 1 0.5 0 0 0 0 0 0 0")
    by_load = {
        name: [r.share for r in found if r.load.load == name] for name in ("load_1", "load_2")
    }
    assert by_load == {"load_1": [0.5], "load_2": [0.1, 0.2]}
    assert {relay.load.load for relay in found} == {"load_1", "load_2"}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1 'VTGTPAT' 5 111 'A' 0.75 5.0 10.0", "has 6 values behind its name, and needs 7"),
        ("1 'VTGTPAT' 5 111 'A' 1.2 0.8 1 0", "lower limit 1.2 above the upper 0.8"),
        ("1 'FRQTPAT' 5 111 'A' 57 62 -1 0", "delay of -1 s"),
        ("1 'FRQTPAT' 5 111 'A' 57 x 1 0", "the value 'x'; it must be a number"),
    ],
)
def test_a_record_that_cannot_be_is_refused_at_its_line(tmp_path, text, said):
    with pytest.raises(InputError, match=r"relays\.dyr, line 1") as refused:
        units(tmp_path, text)
    assert said in str(refused.value)


def test_a_share_beyond_the_whole_load_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"share 1\.5"):
        stages(tmp_path, "1 'LVSHBL' 1 0.9 1 1.5 0 0 0 0 0 0 0")


def idle(tmp_path, *texts, motors=(), buses=(1, 2, 3)):
    """Why relays of loads never trip, and whether that is asked, by the line of the record."""
    own = records(tmp_path, *texts)
    found = idle_load_relays(
        own,
        LOADS,
        load_relays(own, [load for load in LOADS if load.load not in motors]),
        is_motor=lambda load: load.load in motors,
        is_bus=lambda number: number in buses,
    )
    return {one.record.line: (one.why, bool(one.remedy)) for one in found}


@pytest.mark.parametrize(
    ("record", "why"),
    [
        ("1 'LVSHBL' 2 ", "the load '2' at bus 1, which the RAW file does not have in service"),
        ("7 'LDSHBL' * ", "the load '*' at bus 7, which the RAW file does not have in service"),
        ("9 'LVSHZN' * ", "loads, which the RAW file does not have in service"),
        ("1 'LVSHBL' 1 99 ", "the load '1' at bus 1 that watches bus 99, which is no bus here"),
        ("3 'LVSHBL' 1 ", "the load '1' at bus 3, which draws no active power"),
    ],
)
def test_a_relay_of_nothing_is_told_with_its_reason(tmp_path, record, why):
    assert idle(tmp_path, f"{record}{STAGES}") == {1: (f"a relay of {why}", True)}
    assert idle(tmp_path, f"1 'LVSHBL' 1 {STAGES}", f"5 'LDSHZN' * {STAGES}") == {}


def test_a_relay_beside_another_never_trips(tmp_path):
    """A second of one load is a slip; where narrower records go before, the file may be meant so."""
    own = f"1 'LVSHBL' 1 {STAGES}"
    second = "a second relay of the load '1' at bus 1; the first is in line 1"
    assert idle(tmp_path, own, own) == {2: (second, True)}
    others = f"2 'LVSHBL' 1 {STAGES}", f"3 'LVSHBL' 1 {STAGES}"
    ((line, (why, asked)),) = (
        (k, x) for k, x in idle(tmp_path, own, *others, f"0 'LVSHAL' * {STAGES}").items() if k > 3
    )
    assert (line, asked) == (4, False)
    assert "narrower records go before it" in why


def test_a_relay_whose_load_is_motors_or_that_sheds_nothing_never_trips(tmp_path):
    own = f"1 'LVSHBL' 1 {STAGES}"
    ((why, asked),) = idle(tmp_path, own, motors=("load_1",)).values()
    assert "in whose place induction motors stand" in why
    ((of_none, also),) = idle(tmp_path, "1 'LVSHBL' 1 0.9 1 0 0.8 1 0 0.7 1 0 0.1").values()
    assert "no stage has a limit and a share" in of_none
    assert asked
    assert also


@pytest.mark.parametrize(
    ("stages_of_record", "said"),
    [
        ("0.9 1 0.5 0.88 1 0.5 0.85 1 0.5 0.1", "the shares 0.5, 0.5, 0.5 of its load, 1.5 in all"),
        ("0.9 1 0.5 0.88 1 0.3 0.85 1 0.2 0.1", ""),
        ("0.7 1 0.2 0.8 1 0.2 0.9 1 0.2 0.1", "at 0.8 with a delay of 1 s behind one at 0.7"),
        ("0.7 1 0.2 0.7 2 0.2 0.9 9 0.2 0.1", ""),
        ("0.9 30 0.2 0.8 30 0.2 0.7 30 0.2 6", "a breaker that takes 6 s"),
    ],
)
def test_settings_of_a_load_relay_that_make_no_sense_are_asked_about(
    tmp_path, stages_of_record, said
):
    found = doubts_of_settings([], stages(tmp_path, f"0 'LVSHAL' * {stages_of_record}"))
    assert [said in one.text for one in found] == [True] * bool(said)


def test_times_of_a_units_relay_in_milliseconds_are_asked_about(tmp_path):
    own = units(tmp_path, "1 'VTGTPAT' 1 1 '1' 0.8 1.2 100 80", "2 'VTGTPAT' 1 1 '1' 0.8 1.2 100 1")
    (asked,) = doubts_of_settings(own, [])
    assert "a breaker that takes 80 s" in asked.text
    assert "are its times in cycles or milliseconds?" in asked.text
