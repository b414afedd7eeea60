"""Devices that cheat on the test bench: whatever they show, no verdict becomes better."""

from types import SimpleNamespace

import pytest

from orchestrator.studies.certification.codes import rows_again
from orchestrator.studies.certification.codes.certificate import certify_code
from orchestrator.studies.certification.codes.ercot import ERCOT
from orchestrator.studies.certification.request import CertificationRequest
from orchestrator.studies.points.executor import Serial
from tests.studies.certification.codes.reactance_source import write_source

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def jumped(tmp_path_factory):
    """What a device gives at ERCOT's jumps at 1 s and 6 s, with other values."""
    folder = tmp_path_factory.mktemp("cheat")
    fmu = write_source(folder)

    def run(**values):
        given = {"follow": 5.0} | {name.replace("__", "."): value for name, value in values.items()}
        (verdict,) = certify_code(
            CertificationRequest(fmu, None, given), ERCOT, Serial(), folder, ("phase_jumps",)
        ).verdicts
        return verdict

    return run


def test_powers_that_are_outputs_of_the_device_count_for_nothing(jumped):
    """The bench takes its own, of voltage and current: the same to the last digit with outputs that never move."""
    honest, lying = jumped(), jumped(cheat__lies=True)
    assert honest.accepted
    assert honest.findings == lying.findings


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"cheat__trips": True, "cheat__at": 10.7}, "it feeds in nothing from t = 10.7"),
        ({"cheat__turns": 5.0, "cheat__at": 2.0}, "it slips after t = 1 s"),
        ({"cheat__turns": -1.0, "cheat__at": 7.0}, "it slips after t = 6 s"),
        ({"cheat__nan": True, "cheat__at": 10.9}, "no longer finite after t = 10.9 s"),
    ],
    ids=["trips", "turns five times", "turns back once", "gives no numbers"],
)
def test_what_goes_wrong_without_a_word_is_told_and_nothing_reads_as_accepted(
    jumped, values, words
):
    """No output shows its angle, and power and voltage are settled again where criteria look."""
    verdict = jumped(**values)
    assert verdict.accepted is False
    assert not any(finding.accepted for finding in verdict.findings)
    assert words in verdict.failed[0].text


def test_a_current_that_is_held_opposes_no_jump(jumped):
    assert [f.criterion for f in jumped(cheat__holds=True, cheat__at=0.5).failed] == [
        "opposes the jump at 1 s",
        "opposes the jump at 6 s",
    ]


def test_a_row_is_compared_with_its_own_entry():
    content = {
        "rows": [{"row": "b", "findings": [{"kind": "growth"}]}, {"row": "a", "findings": []}]
    }
    again = SimpleNamespace(failure="", findings=[{"kind": "growth"}])
    row = SimpleNamespace(name="a")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rows_again, "UNSTABLE", frozenset({"growth"}))
        told = rows_again._fault_of_row(content, row, again, None, 1.0)
        assert told == "the watch finds growth, and nothing was certified"
