"""Interactions of several vendors' converters. `Case.interactions` makes them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypedDict

from orchestrator.api.show import page
from orchestrator.api.values import binding_path
from orchestrator.api.values import path as path_of
from orchestrator.asked import Names, checked, require_known
from orchestrator.errors import InputError
from orchestrator.fmi.devices import as_device
from orchestrator.interactions.judgement import JudgedInteractions
from orchestrator.interactions.point import SystemTask
from orchestrator.interactions.request import GivenDevice, InteractionsRequest
from orchestrator.interactions.study import InteractionsResult, run_interactions
from orchestrator.interactions.tables import as_json, assignment_rows, mode_rows, pair_rows, warnings_of
from orchestrator.interactions.words import sentences
from orchestrator.late import pd
from orchestrator.points.study import PointStudy
from orchestrator.safe_files import made_folder


class WantedInteractions(TypedDict, total=False):
    """What may be asked of a study of interactions; `InteractionsRequest` says what each means.

    ``devices`` and ``bindings`` are files by the name of a device that is tried beside the case's, at ``places``.
    """

    threshold: float
    frequencies: tuple[float, float]
    stand_in: str
    swap: bool
    devices: Mapping[str, str | Path]
    bindings: Mapping[str, str | Path]
    places: Names
    black_box: bool


def request_of(wanted: WantedInteractions) -> InteractionsRequest:
    """A request of checked wishes.

    Raises
    ------
    InputError
        If one of the wishes is unknown, not of its kind or outside of its range; it is named.
    """
    require_known(wanted, WantedInteractions.__annotations__, "interactions")
    bindings, files = wanted.get("bindings", {}), wanted.get("devices", {})
    if lonely := [name for name in bindings if name not in files]:
        raise InputError(f"bindings: there is no device {lonely[0]!r}; the devices are: {', '.join(files) or 'none'}")
    given = {name: (path_of(file, "devices"), binding_path(bindings.get(name))) for name, file in files.items()}
    devices = tuple(GivenDevice(name, as_device(*of), of[1]) for name, of in given.items())
    request = InteractionsRequest(**checked(InteractionsRequest, wanted), devices=devices)
    return replace(request, swap=request.swap or bool(devices))


class Interactions:
    """Who takes part in which mode, and which vendors' converters do not agree. `Case.interactions` makes it.

    Attributes
    ----------
    result
        All systems.
    judgement
        What they come to.
    """

    def __init__(self, result: InteractionsResult) -> None:
        self.result = result
        self.judgement = JudgedInteractions(result)

    @property
    def stable(self) -> bool | None:
        """Whether nothing grows in the system as it is; None where that is not known."""
        return self.judgement.whole.stable

    @property
    def worst_pair(self) -> tuple[str, str] | None:
        """The vendors whose joint damping falls most below that of each alone; None where none falls."""
        worst = self.judgement.worst_pair
        return None if worst is None else worst.vendors

    @property
    def worst_assignment(self) -> dict[str, str] | None:
        """The device at each place where the system is damped least; None without a swap, or without a verdict."""
        worst = self.judgement.worst_assignment
        return None if worst is None else dict(zip(self.result.plan.swapped, worst.name.names, strict=True))

    @property
    def sentences(self) -> list[str]:
        """What was found, the verdict on the system as it is first."""
        return sentences(self.judgement)

    @property
    def warnings(self) -> list[str]:
        """What is to be borne in mind, with the systems that it is of."""
        return warnings_of(self.judgement)

    def modes(self) -> pd.DataFrame:
        """One row for each mode of the system as it is: figures, participation of each group, who shares it."""
        return pd.DataFrame(mode_rows(self.judgement))

    def pairs(self) -> pd.DataFrame:
        """One row for each pair of vendors, the worst first."""
        return pd.DataFrame(pair_rows(self.judgement))

    def assignments(self) -> pd.DataFrame:
        """One row for each assignment of devices to places, the worst first; empty without a swap."""
        return pd.DataFrame(assignment_rows(self.judgement))

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor interactions --json`` prints, as JSON's types."""
        return as_json(self.judgement)

    def save(self, folder: str | Path) -> list[Path]:
        """Write tables, ``interactions.json`` and the page ``interactions.html`` into a folder; give their paths."""
        from orchestrator.interactions.files import save  # noqa: PLC0415 - imports what only pages need

        return save(self.judgement, made_folder(Path(folder)))

    def __repr__(self) -> str:
        plan = self.result.plan
        return f"<Interactions of {', '.join(plan.vendors)} in {plan.case.name}>"

    def _repr_html_(self) -> str:
        return page(repr(self).strip("<>"), self.sentences, self.pairs())


STUDY = PointStudy(run_interactions, Interactions, SystemTask)
