"""Where the oscillations of a run or a recording come from."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from orchestrator.cases.form.given import Time
from orchestrator.core.errors import InputError
from orchestrator.face.api.given_recording import open_given
from orchestrator.face.api.results import Run
from orchestrator.face.api.scenario import Scenario
from orchestrator.studies.oscillations.reading import contest_cases, read_contest
from orchestrator.studies.oscillations.verdict import locate
from orchestrator.studies.oscillations.view import Sources, sources_of

if TYPE_CHECKING:
    import xarray as xr


def source(
    run: Run | xr.Dataset | str | Path,
    start: Time | None = None,
    stop: Time | None = None,
    scenario: Scenario | None = None,
) -> Sources:
    """Find the oscillations of a record, whether they are forced, and which place feeds them.

    Parameters
    ----------
    run
        A run, its dataset, the folder of a scenario's results, or a measured recording in CSV or COMTRADE with
        columns ``NAME.vm``, ``NAME.va``, ``NAME.p`` and ``NAME.q``.
    start, stop
        The part of the record that is used [s]; by default all of it.
    scenario
        The grid that was recorded: the place is then the unit that does not do as its own linear model. By default it
        is the run's, or that of a record of a built-in case.

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
    dataset, label = open_given(run, "run")
    if scenario is None:
        prepared = run.result.modes.prepared if isinstance(run, Run) else None
    elif isinstance(scenario, Scenario):
        prepared = scenario.prepared
    else:
        raise InputError(
            f"scenario = {scenario!r}; give a scenario, as Case.scenario makes it, or leave it out"
        )
    return sources_of(dataset, label, start, stop, prepared)


def contest_sources(folder: Path) -> list[Sources]:
    """`source` of each case of a folder, or of folders in it, in the form of the 2021 IEEE-NASPI contest."""
    return [Sources(one, locate(one)) for one in map(read_contest, contest_cases(folder))]
