"""Where the oscillations of a run or a recording come from."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from orchestrator.api.identification import opened
from orchestrator.api.results import Run, sources_of
from orchestrator.cases.given import Time
from orchestrator.oscillations.reading import contest_cases, read_contest
from orchestrator.oscillations.verdict import locate
from orchestrator.oscillations.view import Sources

if TYPE_CHECKING:
    import xarray as xr


def source(run: Run | xr.Dataset | str | Path, start: Time | None = None, stop: Time | None = None) -> Sources:
    """Find the oscillations of a record, whether they are forced, and which place feeds them.

    Parameters
    ----------
    run
        A run, its dataset, the folder of a scenario's results, or a measured recording in CSV or COMTRADE with
        columns ``NAME.vm``, ``NAME.va``, ``NAME.p`` and ``NAME.q``.
    start, stop
        The part of the record that is used [s]; by default all of it.

    Raises
    ------
    InputError
        If there is no such record, or it lacks voltages and powers.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> scenario = gfor.load("two_area_rms").scenario("gfor", force="sg1 0.8 Hz 2 %")
    >>> (found,) = gfor.source(scenario.run(stop=20.0))
    >>> print(f"{found.found.frequency:.1f} Hz, {found.evidence.kind}: {found.source}")
    0.8 Hz, forced: sg1
    """
    dataset, label = opened(run, "run")
    return sources_of(dataset, label, start, stop)


def contest_sources(folder: Path) -> list[Sources]:
    """`source` of each case of a folder in the form of the 2021 IEEE-NASPI contest.

    Parameters
    ----------
    folder
        A case's folder, or one with the folders of several.
    """
    measured = [read_contest(path) for path in contest_cases(folder)]
    return [Sources(one, locate(one)) for one in measured]
