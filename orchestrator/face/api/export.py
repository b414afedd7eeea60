"""Models and signals for other tools."""

from pathlib import Path
from typing import Any

from fmus.toolchain.archive import write_archive
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.scenario.protection_relays import require_no_relays
from orchestrator.core.asked import path as path_of
from orchestrator.core.asked import require_known
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.core.safe_files import made_folder
from orchestrator.face.api.comtrade import export_comtrade
from orchestrator.face.api.dll import export_dll
from orchestrator.face.api.scenario import Scenario
from orchestrator.output.results.staging import new_run_id, staged
from orchestrator.systems.ssp.study import study_of
from orchestrator.systems.ssp.writing import ssp_members

KINDS = ("linear", "ssp", "comtrade", "dll")

_TABLES: dict[str, Any] = {
    "source": True,
    "analysis": True,
    "plots": True,
    "reference": True,
    "solver": {"record_interval", "record", "record_filter"},
}
"""Tables of a case file that go into our annotation as they are, as SSP has no place for them."""


_KEYWORDS: dict[str, tuple[str, ...]] = {
    "linear": ("inputs", "outputs", "continuous", "black_box"),
    "ssp": (),
    "comtrade": ("signals", "form", "frequency"),
    "dll": ("platforms", "sample_time", "values"),
}
"""Further keywords of each kind."""


def export(what: Any, kind: str, out: str | Path | None = None, **how: Any) -> list[Path]:
    """Write a model or signals for other tools; returns the files.

    Parameters
    ----------
    what
        A scenario for ``"linear"`` (A, B, C, D as MAT and CSV) and ``"ssp"``, a run or its folder for ``"comtrade"``,
        the name of a converter for ``"dll"``.
    kind
        One of these four.
    out
        Folder, or the ``.ssp``, or the ``.cfg``.
    how
        Further keywords of `Scenario.linearize`, `export_comtrade` and, for a DLL, of ``gfor export dll``:
        ``platforms``, ``sample_time``, ``values``.

    Raises
    ------
    InputError
        If there is no such kind, or it cannot be written.

    Examples
    --------
    >>> import tempfile, orchestrator as gfor
    >>> scenario = gfor.load("infinite_bus").scenario("dip")
    >>> folder = tempfile.TemporaryDirectory()
    >>> [file.name for file in gfor.export(scenario, "ssp", f"{folder.name}/dip.ssp")]
    ['dip.ssp']
    """
    if kind not in KINDS:
        raise InputError(f"kind = {kind!r}; choose from {', '.join(KINDS)}")
    require_known(how, _KEYWORDS[kind], f"an export of kind {kind!r}")
    if kind == "comtrade":
        return list(export_comtrade(what, path=out, **how))
    if kind == "dll":
        written = export_dll(what, Path() if out is None else out, **how)
        return [*written.libraries.values(), written.sheet]
    if not isinstance(what, Scenario):
        raise InputError(
            f"what = {what!r}; give a scenario, such as load('two_area').scenario('gfor')"
        )
    place = path_of("." if out is None else out, "out", "path")
    if kind == "ssp":
        target = (
            place
            if place.suffix.lower() == ".ssp"
            else place / f"{what.prepared.case.name}_{what.name}.ssp"
        )
        write_ssp(what.prepared, target)
        return [target]
    from orchestrator.studies.modes.linear_model_files import save_linear_model  # noqa: PLC0415 - only here

    model = what.linearize(**how)
    made_folder(place, "out")
    with staged(place, new_run_id()) as staging:
        files = save_linear_model(
            model, model.operating_point, model.stability, what.prepared, staging
        )
    return [place / file.name for file in files]


def write_ssp(prepared: PreparedScenario, target: Path) -> None:
    """Write a scenario as SSP archive.

    Raises
    ------
    InputError
        If it has what an SSP cannot hold, such as relays, or the file cannot be written.
    """
    require_no_relays(prepared.relays, "an SSP cannot hold")
    case = prepared.case
    tables: dict[str, Any] = case.table.model_dump(
        mode="json", by_alias=True, exclude_none=True, exclude_unset=True, include=_TABLES
    )
    filled = {name: table for name, table in tables.items() if table}
    study = study_of(
        prepared.name,
        prepared.title,
        prepared.step_size,
        prepared.schedule,
        prepared.events,
        filled,
    )
    members = ssp_members(case.name, case.table.title, prepared.system, prepared.stop_time, study)
    try:
        write_archive(target, members)
    except OSError as error:
        raise InputError(
            Option.OUT + f" {target}: it cannot be written: {error.strerror}; choose another place"
        ) from error
