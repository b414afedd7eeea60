"""A device that is known through FMI alone, measured at its port."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from orchestrator.cases.form.given import Time, binding_path, in_seconds, plain
from orchestrator.core.asked import frequency_range
from orchestrator.core.asked import path as path_of
from orchestrator.core.errors import InputError
from orchestrator.core.safe_files import made_folder
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.output.report.notebook import page
from orchestrator.output.results.staging import new_run_id, staged
from orchestrator.studies.black_box.files import identification_json, save_identification
from orchestrator.studies.black_box.fitting import fit, passivity, require_fitting
from orchestrator.studies.black_box.frequency_response import METHODS, Excitation, measure
from orchestrator.studies.black_box.port import bench_at, start_of


class Admittance:
    """A device's admittance, and the model that was fitted to it. `admittance` makes it.

    Attributes
    ----------
    response
        Measured lines, each with its bound.
    model
        The rational model that was fitted.
    passivity
        Where the device can feed an oscillation.
    rest
        Voltage at the port around which it was measured [pu].
    rated_hz
        Rated frequency of the device [Hz].
    """

    def __init__(self, response: Any, rest: complex, rated_hz: float = 50.0) -> None:
        self.response, self.rest, self.rated_hz = response, rest, rated_hz
        self.model, self.passivity = fit(response), passivity(response)

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor fmu admittance --json`` prints, as JSON's types."""
        return identification_json(self.response, self.model, self.passivity)

    def save(self, folder: str | Path) -> list[Path]:
        """Write lines, model and plots into a folder; returns their paths."""
        place = made_folder(path_of(folder, "folder", "folder"), "folder")
        with staged(place, new_run_id()) as staging:
            files = save_identification(self.response, self.model, self.passivity, staging)
        return [place / file.name for file in files]

    def _repr_html_(self) -> str:
        bands = ", ".join(f"{low:.4g}–{high:.4g} Hz" for low, high in self.passivity.ranges())
        accuracy = (
            f"Largest bound of a line: {self.response.largest_bound:.2g} of it; "
            f"error of the model: {self.model.error:.2g}"
        )
        told = [f"Can feed an oscillation: {bands or 'nowhere'}", accuracy, *self.response.warnings]
        return page(repr(self)[1:-1], told)

    def __repr__(self) -> str:
        content = self.as_json()
        return (
            f"<Admittance of {content['lines']} lines, model of order {content['model']['order']}>"
        )


def admittance(
    fmu: str | Path,
    *,
    binding: str | Path | None = None,
    values: Mapping[str, Any] | None = None,
    step: Time = 1e-4,
    method: str = "multisine",
    amplitude: float | None = None,
    frequencies: tuple[float, float] = (0.05, 1000.0),
    use_state: bool = True,
    report: Callable[[str], None] = lambda text: None,
) -> Admittance:
    """Measure a device's admittance at an ideal bus, and fit a model to it.

    Parameters
    ----------
    fmu
        The device, as FMU, DLL or file of a device.
    binding
        File that says what its variables mean at our port.
    values
        Of the FMU, such as ``{"P_0": 0.9}``.
    step
        Communication step [s].
    method
        Of excitation: ``"multisine"``, or another that ``gfor fmu admittance --method`` names.
    amplitude
        Largest deviation of the voltage [pu].
    frequencies
        Lowest and highest [Hz].
    use_state
        Whether the FMU's state may be saved and restored, where it can.
    report
        Called with a sentence before each part of the work.

    Raises
    ------
    InputError
        If the file cannot be used, has no port, or has no such variable.
    MissingLibraryError
        If the extra that fits models is not installed.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> gfor.admittance(gfor.build("gfor"), frequencies=(5.0, 200.0)).as_json()["method"]  # doctest: +SKIP
    'multisine'
    >>> gfor.admittance("vendor.fmu", method="noise")
    Traceback (most recent call last):
        ...
    orchestrator.core.errors.InputError: method = 'noise'; choose from multisine, pulse
    """
    if method not in METHODS:
        raise InputError(f"method = {method!r}; choose from {', '.join(METHODS)}")
    low, high = frequency_range(frequencies)
    if not low:
        raise InputError(
            f"frequencies = {frequencies!r}; the lowest must be above 0 Hz, such as 0.05"
        )
    require_fitting()
    description = bound_fmu(path_of(fmu, "fmu"), binding_path(binding))
    bench = bench_at(
        description,
        plain(values),
        in_seconds(step, "step") or 1e-4,
        restore=None if use_state else False,
    )
    excited = Excitation(method, low, high)
    excited = excited if amplitude is None else replace(excited, amplitude=amplitude)
    rated = float(bench.parameters.get("f_n", start_of(description, "f_n"))) or 50.0
    return Admittance(measure(bench, excited, report), complex(*bench.rest), rated)
