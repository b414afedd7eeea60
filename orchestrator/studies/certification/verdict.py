"""The words of a verdict, and the exit codes that go with them."""

from collections.abc import Sequence

from orchestrator.studies.certification.request import REACTANCES

PASSES = "passes"
FAILS = "fails"
INCOMPLETE = "incomplete"

EXIT_CODES = {PASSES: 0, FAILS: 1, INCOMPLETE: 3}
NOT_TRUSTED = 4  # exit code if the damping test is passed but an acceptance test of the FMU failed
DOES_NOT_HOLD = 5  # exit code for a certificate with a contradiction, whose verdict is worthless

NOT_ACCEPTED = " Not accepted:"
REFUSED = " Acceptance tests failed:"
"""Begins of the parts of a certificate's sentence that its page shows in a table and in a line of its own."""


def verdicts_on_page(sentence: str) -> list[str]:
    """Return what of a certificate's sentence stands on top of its page: failed acceptance tests, and the verdict."""
    said, _, failed = sentence.partition(REFUSED)
    refusal = [f"ACCEPTANCE TESTS FAILED:{failed}"] if failed else []
    return [*refusal, said.partition(NOT_ACCEPTED)[0]]


def verdict_of(accepted: Sequence[bool], missing: int) -> str:
    if not all(accepted):
        return FAILS
    return INCOMPLETE if missing or not accepted else PASSES


def exit_code(verdict: str, *, refused: bool) -> int:
    """The exit code of a verdict; ``refused`` says that an acceptance test failed."""
    return NOT_TRUSTED if verdict == PASSES and refused else EXIT_CODES[verdict]


def incomplete_because(missing: Sequence[float], departures: Sequence[str]) -> str:
    reasons = []
    if missing:
        done = len(REACTANCES) - len(missing)
        places = ", ".join(f"{X:g}" for X in missing)
        reasons.append(
            f"{done} of {len(REACTANCES)} line reactances of the norm were judged (missing: {places} pu)"
        )
    if departures:
        reasons.append(f"the study is not the norm's, it was changed by {', '.join(departures)}")
    return "; ".join(reasons)
