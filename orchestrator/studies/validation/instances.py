"""An instance of a device between its runs: unpacking and loading an FMU takes as long as seconds of a recording."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, Protocol, Self, TypeVar

import numpy as np

from fmus.toolchain.removal import remove_tree
from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import CosimError
from orchestrator.devices.fmi.archive import extract
from orchestrator.devices.fmi.component import Component
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.devices.fmi.instance import is_ours, open_component


class RunFigures(Protocol):
    """The outcome of a run, which another run may give again."""

    def same_as(self, other: Self) -> bool:
        """Return whether both are the same to the last bit."""


Outcome = TypeVar("Outcome", bound=RunFigures)


@dataclass(frozen=True)
class InstanceRun(Generic[Outcome]):
    """Work on an instance at its start; ``isolated``: as in `open_component`; ``values``: those that it gets.

    ``probe``: a short run with these values, which shows whether a process still gives what it gave."""

    description: FmuDescription
    isolated: bool | None
    values: Mapping[str, float | bool]
    work: Callable[[Component], Outcome]
    probe: Callable[[Component], Numbers]


@dataclass
class _Kept:
    """An instance that waits for its next run.

    ``last``: values with which its process ran last; ``probe``: that of its first run; ``probed``: what it gave."""

    component: Component
    last: Mapping[str, float | bool]
    probe: Callable[[Component], Numbers]
    probed: Numbers | None = None

    def is_as_before(self) -> bool:
        """Return whether a new instance in the process gives the same to the probe as the first that was asked."""
        self.component.renew()
        found = self.probe(self.component)
        if self.probed is None:
            self.probed = found
        return np.array_equal(found, self.probed)


@dataclass
class _Trust:
    """How far it is shown that earlier runs of a stranger's process leave nothing to the next one.

    ``shown``: after a run with the same values, after one with others; ``lost``: it was shown not to be so."""

    shown: set[bool] = field(default_factory=set)
    lost: bool = False


@dataclass
class _Team:
    """Instances of one library that step side by side and wait for their next run, all in one folder."""

    description: FmuDescription
    directory: Path
    components: list[Component] = field(default_factory=list)

    @staticmethod
    def of(description: FmuDescription) -> _Team | None:
        """A team of one of our own FMUs; None where its instances do not step side by side."""
        if not is_ours(description.path):
            return None
        team = _Team(description, extract(description.path))
        try:
            team.components.append(team.open_another())
        except BaseException:
            team.close()
            raise
        if team.components[0].step_stack is not None:
            return team
        team.close()
        return None

    def open_another(self) -> Component:
        return open_component("device", self.description, self.directory, isolated=False)

    def take(self, count: int) -> list[Component]:
        """Take so many of them, at their start."""
        while len(self.components) < count:
            self.components.append(self.open_another())
        for one in self.components[:count]:
            one.reset()
        found, self.components = self.components[:count], self.components[count:]
        return found

    def close(self) -> None:
        while self.components:
            self.components.pop().close()
        remove_tree(self.directory)


class InstanceShelf:
    """Instances that are used again instead of being opened anew, between `keeping` and its end.

    One of our own FMUs goes back to its start: that `fmi2Reset` leaves nothing of a run behind is tested for these
    alone. A stranger's process gets a new instance. What the FMU's library or files keep beyond it would be wrong in
    silence: so a run in a used process is made in a new one as well, until both were the same to the last bit after a
    run with the same values and after one with others, and a probe before each run must give what it gave before. Once
    something is not the same, every run has a new process."""

    def __init__(self) -> None:
        self._free: dict[int, _Kept] = {}
        self._trust: dict[int, _Trust] = {}
        self._teams: dict[int, _Team | None] = {}
        self._keeps = 0

    @contextmanager
    def keeping(self) -> Iterator[None]:
        """Inside ``with``, instances are kept; at the end of the outermost one they are closed."""
        self._keeps += 1
        try:
            yield
        finally:
            self._keeps -= 1
            if not self._keeps:
                while self._free:
                    self._free.popitem()[1].component.close()
                for team in filter(None, self._teams.values()):
                    team.close()
                self._teams.clear()

    @contextmanager
    def side_by_side(self, description: FmuDescription, count: int) -> Iterator[list[Component]]:
        """So many instances at their start that step side by side; none where they do not, or are not kept.

        Whoever takes one out of the list has to close it: one that failed is not used again."""
        team = self._team_of(description)
        taken = [] if team is None else team.take(count)
        try:
            yield taken
        except BaseException:
            for one in taken:
                one.close()
            raise
        if team is not None:
            team.components += taken

    def _team_of(self, description: FmuDescription) -> _Team | None:
        if not self._keeps:
            return None
        if id(description) not in self._teams:
            self._teams[id(description)] = _Team.of(description)
        return self._teams[id(description)]

    def run(self, one: InstanceRun[Outcome]) -> Outcome:
        """The outcome of a run; an instance that failed is not used again."""
        kept = self._free.pop(id(one.description), None)
        if kept is None:
            return self._run_anew(one)
        if kept.component.renewable:
            return self._run_in_used(one, kept)
        kept.component.reset()
        return self._finish(one, kept.component)

    def _run_in_used(self, one: InstanceRun[Outcome], kept: _Kept) -> Outcome:
        """In a stranger's process that ran before; what fails there is told as a new process tells it."""
        try:
            found = self._found_in(one, kept)
        except CosimError:
            found = None
        except BaseException:
            kept.component.close()
            raise
        if found is None:
            kept.component.close()
            anew = self._run_anew(one)
            self._lose_trust(one)
            return anew
        kept.last = one.values
        self._free[id(one.description)] = kept
        return found

    def _found_in(self, one: InstanceRun[Outcome], kept: _Kept) -> Outcome | None:
        """The outcome in a used process; None where it is not what a new one gives."""
        if not kept.is_as_before():
            return None
        kept.component.renew()
        found = one.work(kept.component)
        shown, same_values = self._trust_in(one).shown, kept.last == one.values
        if same_values not in shown:
            with open_component("device", one.description, isolated=one.isolated) as new:
                if not one.work(new).same_as(found):
                    return None
            shown.add(same_values)
        return found

    def _run_anew(self, one: InstanceRun[Outcome]) -> Outcome:
        component = open_component("device", one.description, isolated=one.isolated)
        return self._finish(one, component)

    def _finish(self, one: InstanceRun[Outcome], component: Component) -> Outcome:
        try:
            found = one.work(component)
        except BaseException:
            component.close()
            raise
        ours = not one.isolated and is_ours(one.description.path)
        usable = ours or (component.renewable and not self._trust_in(one).lost)
        if self._keeps and usable:
            self._free[id(one.description)] = _Kept(component, one.values, one.probe)
        else:
            component.close()
        return found

    def _trust_in(self, one: InstanceRun[Outcome]) -> _Trust:
        return self._trust.setdefault(id(one.description), _Trust())

    def _lose_trust(self, one: InstanceRun[Outcome]) -> None:
        self._trust_in(one).lost = True
        kept = self._free.pop(id(one.description), None)
        if kept is not None:
            kept.component.close()
