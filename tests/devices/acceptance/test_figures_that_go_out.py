"""Every figure of `gfor fmu check --json` is one that a check measured, and its sentence tells the same."""

import json

import pytest

from orchestrator.face.cli import check as command
from orchestrator.face.cli import main
from tests.support.figures import SLIPS, foreign_in_json, foreign_in_text, unseen_slips

ASKED = ("signs", "internal_step", "state_size", "rated_frequency")
OF_THE_CHECKS = {
    "signs": [{"percent": [2.0, 0.1]}, 3.0, 0.7, 0.1],
    "internal_step": [13.0, 10.0, 1e-4],
}
"""What the checks do: voltage, frequency [%], time [s], power [pu]; step, 13/10 of which is taken [s]."""


@pytest.fixture(scope="module")
def checked(gallery):
    """The report of four checks, and what the command prints of it."""
    fmu, binding = gallery("converter_power_si")
    found, printed = [], []
    with pytest.MonkeyPatch.context() as patch:
        check = command.check
        patch.setattr(command, "check", lambda *a, **k: found.append(check(*a, **k)) or found[0])
        patch.setattr(command, "print_json", lambda said: printed.append(json.dumps(said)))
        words = [fmu, "--binding", binding, "--json"]
        words += [word for name in ASKED for word in ("--only", name)]
        assert main(["fmu", "check", *map(str, words)]) == 0
    return found[0].report, json.loads(printed[0])


def test_of_the_json(checked):
    report, said = checked
    source = [[result.figures for result in report.results], report.seed]
    assert foreign_in_json(said, source) == []
    assert unseen_slips(said, source) == []


def test_of_the_sentences(checked):
    """A factor or a sign in a figure for programs is another figure than the sentence has."""
    _, said = checked
    for one in said["checks"]:
        source = [one["figures"], OF_THE_CHECKS.get(one["check"], [])]
        assert foreign_in_text(one["evidence"], source) == [], one["check"]
    (signs,) = (one for one in said["checks"] if one["check"] == "signs")
    for name in ("Q_of_lower_voltage", "P_of_lower_frequency"):
        for slip, factor in SLIPS.items():
            wrong = signs["figures"] | {name: factor * signs["figures"][name]}
            assert foreign_in_text(signs["evidence"], [wrong, OF_THE_CHECKS["signs"]]), slip
