"""What is told of the records of a network's files."""

from orchestrator.cases.networks.record_use import RecordUse, UseOfRecord, in_full

USED = RecordUse("net.raw", 3, "bus", UseOfRecord.USED)
OTHER = RecordUse("net.dyr", 7, "IEELAL", UseOfRecord.NOT_USED, "no such model")


def test_a_heading_stands_only_over_records():
    heading, line = in_full([USED, OTHER])
    assert heading.endswith("as they stand:")
    assert line == "net.dyr, line 7: IEELAL: not used: no such model"
    assert in_full([USED]) == ["Every record of the files is used as it stands."]
    assert in_full([]) == ["gfor lists no records of files of this format."]
