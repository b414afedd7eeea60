"""Words of a record are compared where the program that wrote it is the one that verifies."""

import copy

import pytest

from orchestrator.studies.certification.compared import faults_of

RECORD = {
    "source": "ENTSO-E's text",
    "readings": ["a reading"],
    "date": "2024",
    "rows": [{"row": "dip_0", "title": "0 pu"}],
    "environment": {"gfor-cosim": "0.3", "Commit": "abc"},
}


@pytest.mark.parametrize(
    ("change", "place"),
    [
        (lambda r: r.update(source="ERCOT's own text"), "'source'"),
        (lambda r: r.update(readings=[]), "'readings'"),
        (lambda r: r.update(date="2025"), "'date'"),
        (lambda r: r["rows"][0].update(title="0.9 pu"), "row dip_0"),
    ],
)
def test_edited_words_are_seen_unless_another_version_wrote_them(change, place):
    stated = copy.deepcopy(RECORD)
    assert not list(faults_of(stated, RECORD))
    change(stated)
    (fault,) = faults_of(stated, RECORD)
    assert place in fault
    stated["environment"]["Commit"] = "def"
    assert not list(faults_of(stated, RECORD))
