"""Relays by their records: which they protect, what they watch, and the records that cannot be."""

from math import inf

import pytest

from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.networks.psse.load_relay_records import load_relays
from orchestrator.cases.networks.psse.raw_network import FileLoad
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
        "2 'FRQDCAT' 0 112 '1 ' 57 62 1.5 0.1",
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
    assert old.record.name == "VTGTPAT"


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
