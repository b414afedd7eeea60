"""Lines between the sections of a RAW file that say nothing, while others do."""

import pytest

from orchestrator.core.errors import InputError
from tests.cases.networks.psse import raw
from tests.cases.networks.psse import read_text as read


def silent(text, section, following, line="0"):
    whole = f"0 / END OF {section} DATA, BEGIN {following} DATA"
    assert whole in text
    return text.replace(whole, line)


@pytest.mark.parametrize("revision", [33, 34, 35])
def test_a_section_that_only_the_order_gives_is_said(tmp_path, revision):
    text = raw(revision)
    assert not read(tmp_path, text).changes
    found = read(tmp_path, silent(text, "LOAD", "FIXED SHUNT"))
    (said,) = found.changes
    number = text.splitlines().index("0 / END OF LOAD DATA, BEGIN FIXED SHUNT DATA") + 1
    assert said.place == f"{tmp_path / 'grid.raw'}, line {number}"
    assert said.text.startswith(
        "does not say which data begin, as other lines do: taken as fixed shunt data"
    )
    assert (found.tables.bus == read(tmp_path, text).tables.bus).all()


def test_nothing_is_said_where_the_order_is_all_there_is(tmp_path):
    """Neither where no line names its section, nor where each names the one that it ends."""
    assert not read(tmp_path, raw(33, named=False)).changes
    ends = "\n".join(
        line.split(", BEGIN")[0] if line.startswith("0 /") else line
        for line in raw(33).splitlines()
    )
    assert "BEGIN" not in ends
    found = read(tmp_path, ends)
    assert not found.changes
    assert len(found.tables.branch) == 9  # before, what follows such a line was no data of any kind


@pytest.mark.parametrize("zero", ["'0'", '"0"', "'0 '"])
def test_a_zero_in_quotes_ends_a_section(tmp_path, zero):
    """DC lines and FACTS devices begin with a name in quotes, and STEPS writes their end so as well."""
    text = raw(33)
    lines = [
        zero + line[1:] if "END OF TWO-TERMINAL DC" in line or "END OF FACTS" in line else line
        for line in text.splitlines()
    ]
    assert lines != text.splitlines()
    found = read(tmp_path, "\n".join(lines))
    assert (found.tables.bus == read(tmp_path, text).tables.bus).all()
    assert not found.changes


def test_an_end_that_contradicts_the_order_is_an_error(tmp_path):
    """A section is missing before a silent line: all that follows would be taken for something else."""
    lines = silent(raw(33), "LOAD", "FIXED SHUNT").splitlines()
    lines.remove("0 / END OF FIXED SHUNT DATA, BEGIN GENERATOR DATA")
    with pytest.raises(
        InputError, match=r"line 21: it ends the generator data, and .* are fixed shunt data by the"
    ):
        read(tmp_path, "\n".join(lines))


def test_data_behind_a_silent_line_of_unknown_order_are_an_error(tmp_path):
    text = silent(raw(36), "LOAD", "FIXED SHUNT", "0 / END OF LOAD DATA")
    text = silent(text, "FIXED SHUNT", "GENERATOR", "1,'1 ',1,0,5")
    with pytest.raises(
        InputError, match=r"the line before these data does not say which begin .* as revision 35"
    ):
        read(tmp_path, text)
