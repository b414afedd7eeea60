"""Whether tunable parameters act where they are set while it runs."""

from collections.abc import Mapping

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import ComponentError
from orchestrator.devices.acceptance.checks.base import (
    SAME,
    CheckResult,
    check,
    failed,
    not_applicable,
    passed,
)
from orchestrator.devices.acceptance.checks.comparing import difference
from orchestrator.devices.acceptance.checks.running import affordable
from orchestrator.devices.acceptance.checks.settings import elsewhere
from orchestrator.devices.acceptance.checks.subject import Subject
from orchestrator.devices.fmi.port import START

_MOST = 24  # parameters that are tried, drawn at random where there are more
_STEPS = 200
# part of an output's range by which a parameter that is set before the run changes it, if it acts
# at all
_ACTS = 1e-6


@check(
    "tunables",
    "Do its tunable parameters act where they are set while it runs?",
    needs=(*SAME, "reading"),
)
def tunables(subject: Subject) -> CheckResult:
    """Set one after another in the run, and compare with runs where it was set before and not at all."""
    moved = {name: value for name, value in elsewhere(subject).items() if name not in START}
    if not moved:
        return not_applicable(
            "tunables", "because it has no tunable parameter with a start value that can be moved"
        )
    names = sorted(subject.random("tunables").permutation(list(moved))[:_MOST])
    plain, acting = _run(subject), 0
    for name in names:
        value = moved[name]
        try:
            before = _run(subject, before={name: value})
        except ComponentError:
            continue  # the value may not go with the others
        says = f"{name} is declared as tunable; set to {value:g} while it runs,"
        try:
            during = _run(subject, during={name: value})
        except ComponentError as error:
            return failed(
                "tunables",
                "parameter not taken",
                f"{says} it is refused: {error.log or error.status}",
            )
        if during is None:
            return failed("tunables", "parameter not taken", f"{says} it reads as before")
        assert plain is not None
        assert before is not None
        acts = difference(plain, before)[0] > _ACTS
        acting += acts
        if acts and difference(plain, during)[0] == 0:
            says += " it changes nothing, and set before the run it does"
            return failed("tunables", "parameter not taken", says)
    return passed(
        "tunables",
        f"{acting} of {len(names)} tunable parameters act on a short run, set before or in it",
    )


def _run(
    subject: Subject,
    before: Mapping[str, float | bool] | None = None,
    during: Mapping[str, float | bool] | None = None,
) -> Numbers | None:
    """Outputs of a short run; None where a parameter that is set in it reads as it was."""
    h = subject.step_size
    with subject.running(parameters=before) as running:
        for name, value in (during or {}).items():
            running.step(h)
            was = running.component.values([name])[name]
            running.component.set({name: value})
            if running.component.values([name])[name] == was != value:
                return None
        running.time = h if during else 0.0
        if not during:
            running.step(h)
        return running.record(affordable(subject, _STEPS), h, subject.steps(hold=10 * h))
