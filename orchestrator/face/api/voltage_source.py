"""Voltage source behaviour of a device, from its admittance."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from orchestrator.cases.form.given import binding_path, plain
from orchestrator.core.asked import path as path_of
from orchestrator.core.late import pd
from orchestrator.core.safe_files import made_folder
from orchestrator.core.truth import NoTruth
from orchestrator.output.report.notebook import headline, page
from orchestrator.output.results.lock import hold_folder
from orchestrator.studies.certification.codes.frequency import files, measurement
from orchestrator.studies.certification.codes.frequency.point import AtPoint
from orchestrator.studies.certification.kinds import bench_request
from orchestrator.studies.certification.request import rated_frequency


class VoltageSource(NoTruth, ask=".verdict, which is True, False, or None where it is not known"):
    """A device's behaviour as a voltage source, at several operating points. `voltage_source` makes it.

    Attributes
    ----------
    content
        The figures, as ``frequency.json`` has them.
    """

    def __init__(self, points: list[AtPoint], content: dict[str, Any]) -> None:
        self._points, self.content = points, content

    @property
    def verdict(self) -> bool | None:
        """True if it is a voltage source at each point; None where one was not measured, or stands in no network."""
        found: bool | None = self.content["verdict"]
        return found

    @property
    def sentence(self) -> str:
        """The verdict as a sentence, with its least figures."""
        return str(self.content["sentence"])

    def table(self) -> pd.DataFrame:
        """A row for each operating point, with P, Q and V [pu].

        ``angle`` [pu/rad] and ``magnitude`` [pu/pu] are the least parts that oppose a change of each; ``scr_limit`` is
        the short-circuit ratio down to which it is stable, 0 where any is enough."""
        return pd.DataFrame([_row(one) for one in self.content["points"]])

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor certify --code frequency --json`` prints, as JSON's types."""
        return self.content

    def save(self, folder: str | Path) -> list[Path]:
        """Write figures, impedances and their picture into a folder; returns their paths."""
        place = made_folder(path_of(folder, "folder", "folder"), "folder")
        with hold_folder(place):
            return files.save(self._points, self.content, place)

    def _repr_html_(self) -> str:
        top = headline(self.sentence, self.verdict)
        return page(repr(self)[1:-1], table=self.table(), verdict=top)

    def __repr__(self) -> str:
        is_one = {True: "is one", False: "is none", None: "not judged"}[self.verdict]
        return f"<VoltageSource {self.content['model']}: {is_one}>"


def _row(one: Mapping[str, Any]) -> dict[str, Any]:
    """Return a point's row; where it was not measured, all but the point is None."""
    row = dict.fromkeys(("P", "Q", "V", "met", "angle", "magnitude", "scr_limit"))
    row |= {name: one[name] for name in ("P", "Q", "V")}
    if "springs" in one:
        row |= {"met": one["met"], "scr_limit": one["strength"]["scr_limit"]}
        row |= {name: one["springs"][name]["value"] for name in ("angle", "magnitude")}
    return row


def voltage_source(
    fmu: str | Path,
    *,
    binding: str | Path | None = None,
    values: Mapping[str, Any] | None = None,
    report: Callable[[str], None] = lambda text: None,
) -> VoltageSource:
    """Judge from its admittance, measured at five operating points, if a device behaves as a voltage source.

    Parameters
    ----------
    fmu
        The device, as FMU, DLL or file of a device.
    binding
        File that says what its variables mean at our port.
    values
        Of the FMU, such as ``{"droop.R_f": 0.05}``.
    report
        Called with a sentence before each part of the work.

    Returns
    -------
    VoltageSource
        Verdict, and figures of each point.

    Raises
    ------
    InputError
        If the file cannot be used, has no port, or has no such variable.
    MissingLibraryError
        If the extra that fits models is not installed.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> gfor.voltage_source(gfor.build("gfor")).verdict  # doctest: +SKIP
    True
    >>> try:
    ...     gfor.voltage_source("nowhere.fmu")
    ... except gfor.CosimError as error:
    ...     print(type(error).__name__)
    InputError
    """
    request = bench_request(path_of(fmu, "fmu"), binding_path(binding), plain(values))
    f_n = rated_frequency(request, 50.0)
    points = measurement.measure_points(request, f_n, report)
    return VoltageSource(points, files.figures_of(points, request.fmu.stem, f_n))
