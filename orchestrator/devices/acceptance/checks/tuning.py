"""Checks that tunable parameters act where they are set while it runs."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

import numpy as np

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
from orchestrator.devices.acceptance.checks.port import voltage_rows
from orchestrator.devices.acceptance.checks.running import affordable
from orchestrator.devices.acceptance.checks.settings import elsewhere, settings
from orchestrator.devices.acceptance.checks.subject import Subject
from orchestrator.devices.fmi.port_mapping import START

_MOST = 24  # parameters that are tried, drawn at random where there are more
_STEPS = 200
_SHOWN = 4  # idle parameters that are named
_LARGE = 0.2  # duration of larger changes [s]
_LARGE_STEPS = 4000  # the most steps of them
_DEVIATION = 0.01  # of the frequency meanwhile [pu]: a damping controller reaches its limit
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
    looks, acting, idle = _Looks(subject), 0, []
    for name in names:
        value = moved[name]
        look = looks.that_shows(name, value)
        if look is None:
            idle.append(name)
            continue
        acting += 1
        says = f"{name} is declared as tunable; set to {value:g} while it runs{look.words},"
        try:
            during = _run(subject, look, during={name: value})
        except ComponentError as error:
            return failed(
                "tunables",
                "parameter not taken",
                f"{says} it is refused: {error.log or error.status}",
            )
        if during is None:
            return failed("tunables", "parameter not taken", f"{says} it reads as before")
        if difference(looks.plain(look), during)[0] == 0:
            says += " it changes nothing, and set before the run it does"
            return failed("tunables", "parameter not taken", says)
    says = f"{acting} of {len(names)} tunable parameters act on a short run, set before or in it"
    return passed("tunables", f"{says}; not {', '.join(idle[:_SHOWN])}" if idle else says)


@dataclass(frozen=True)
class _Look:
    """A short run: whether with larger changes of the inputs, and with which switches the other way."""

    large: bool = False
    switches: tuple[tuple[str, float | bool], ...] = ()

    @property
    def words(self) -> str:
        return "".join(f" with {name} = {str(value).lower()}" for name, value in self.switches)


class _Looks:
    """Short runs, and those of them that show what a parameter does."""

    def __init__(self, subject: Subject) -> None:
        self._subject, self._plain = subject, dict[_Look, Numbers | None]()

    def plain(self, look: _Look) -> Numbers:
        """Outputs with the parameters as they are."""
        if look not in self._plain:
            self._plain[look] = _run(self._subject, look)
        found = self._plain[look]
        assert found is not None
        return found

    def that_shows(self, name: str, value: float | bool) -> _Look | None:
        """The first look in which a parameter acts that is set before; None if it acts in none."""
        for look in self._in_order(name):
            try:
                before = _run(self._subject, look, before={name: value})
                plain = self.plain(look)
            except ComponentError:
                continue  # the values may not go together
            assert before is not None
            if difference(plain, before)[0] > _ACTS:
                return look
        return None

    def _in_order(self, name: str) -> list[_Look]:
        """The small look first, then larger ones, that with the function on first to which a parameter belongs."""
        scope = name.rpartition(".")[0]
        switched = [
            tuple(setting.items())
            for setting in settings(self._subject)
            if setting and name not in setting
        ]
        belongs = [s for s in switched if scope and scope in (n.rpartition(".")[0] for n, _ in s)]
        others = [s for s in switched if s not in belongs]
        large = [_Look(large=True, switches=s) for s in [*belongs, (), *others]]
        return [_Look(), *(large if self._subject.port else [_Look(switches=s) for s in switched])]


def _run(
    subject: Subject,
    look: _Look,
    before: Mapping[str, float | bool] | None = None,
    during: Mapping[str, float | bool] | None = None,
) -> Numbers | None:
    """Outputs of a short run; None where a parameter that is set in it reads as it was."""
    h = subject.step_size
    with subject.running(parameters={**dict(look.switches), **(before or {})}) as running:
        for name, value in (during or {}).items():
            running.step(h)
            was = running.component.values([name])[name]
            running.component.set({name: value})
            if running.component.values([name])[name] == was != value:
                return None
        running.time = h if during else 0.0
        if not during:
            running.step(h)
        if look.large:
            time = h * np.arange(min(_LARGE_STEPS, max(_STEPS, round(_LARGE / h))))
            rows = voltage_rows(running, 0.97 * np.exp(1j * 100 * pi * _DEVIATION * time))
            return running.hold(rows, len(rows), h)
        return running.record(affordable(subject, _STEPS), h, subject.steps(hold=10 * h))
