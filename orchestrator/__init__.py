"""Co-simulation of grid-forming converters: ``import orchestrator as gfor``.

A name is imported where it is first used, so that ``import orchestrator`` takes no time.

Examples
--------
>>> import orchestrator as gfor
>>> scenario = gfor.load("two_area").scenario("pod_p", {"grid.X_L": 0.2})
>>> axes = scenario.modes().plot()
"""

from difflib import get_close_matches
from importlib import import_module

from orchestrator.former_paths import install

_NAMES = {
    "cases.scenario.short_circuit": "BusStrength",
    "core.errors": "CosimError",
    "face.api.acceptance": "Acceptance check",
    "face.api.admittance": "Admittance admittance",
    "face.api.binding": "bind",
    "face.api.case": "Case built_in_cases load",
    "face.api.certification": "IssuedCertificate certify verify",
    "face.api.comparison": "compare",
    "face.api.comtrade": "export_comtrade",
    "face.api.exploration": "Exploration",
    "face.api.export": "export",
    "face.api.fmu": "Fmu FmuInfo info open_fmu",
    "face.api.identification": "ambient identify",
    "face.api.linear": "LinearSystem read_linear_model",
    "face.api.models": "build",
    "face.api.nyquist": "nyquist",
    "face.api.results": "Modes Run",
    "face.api.saved": "Saved open",
    "face.api.scenario": "CheckpointWarning RunEndedWarning Scenario UnusualDataWarning",
    "face.api.source": "source",
    "face.api.validation": "validate",
    "face.api.voltage_source": "VoltageSource voltage_source",
    "linear.spectra.modes": "Mode",
    "linear.spectra.stability": "Stability",
    "studies.certification.compared": "Verification",
    "studies.coordinated_design.view": "CoordinatedDesign",
    "studies.immittance.view": "Nyquist",
    "studies.interactions.view": "Interactions",
    "studies.modes.step_choice": "StepChoice",
    "studies.oscillations.view": "Sources",
    "studies.pod_design.view": "ControllerDesign",
    "studies.screening.view": "Screening",
    "studies.sensitivities.view": "Sensitivities",
    "studies.signals.signal_modes": "RunComparison SignalModes",
    "studies.siting.view": "Siting",
    "studies.sweep.view": "ParameterSweep",
    "studies.validation.view": "Validation",
}
"""Module of this package → the public names that it defines; ``__init__.pyi`` says the same to type checkers."""

_HOMES = {name: home for home, names in _NAMES.items() for name in names.split()}
"""Public name → module that defines it."""

__all__ = [*_HOMES]  # noqa: PLE0604 - names all the same


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        if name.startswith("_"):
            raise AttributeError(_absence(name))
        errors = import_module(f"{__name__}.core.attributes")  # a notebook shows its sentence alone
        raise errors.NoSuchAttributeError(_absence(name))
    value: object = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def _absence(name: str) -> str:
    """Return why there is no such name: it may be that of a command or of a method of a case."""
    absent, known = f"module {__name__!r} has no attribute {name!r}", ", ".join(_HOMES)
    if name.startswith("_"):
        return absent
    ways = [f"`gfor {name}` at the terminal"] * (
        name in import_module(f"{__name__}.face.cli").COMMANDS
    )
    if hasattr(__getattr__("Case"), name):
        ways.insert(0, f"gfor.load('two_area').{name}(…)")
    if not ways:
        near = get_close_matches(name, _HOMES, 1)
        meant = f"; did you mean {near[0]}?" if near else ""
        return f"{absent}; it has: {known}{meant}"
    return f"{absent}: use {', or '.join(ways)}; functions: {known}"


def __dir__() -> list[str]:
    return sorted(_HOMES)


install()
