"""Request of a mode's sensitivities."""

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass

from orchestrator.core.asked import CALLED, FLAG, NAME, NAMES, Names, request_field
from orchestrator.studies.points.points import nobody
from orchestrator.studies.points.request import of_frequencies


@dataclass(frozen=True)
class SensitivitiesRequest:
    """How each parameter of each FMU moves a mode: ∂λ/∂p.

    The derivative is total: the operating point moves with the parameter, as it does with ``--set``.

    Raises
    ------
    InputError
        If there is no such mode or parameter.
    AnalysisError
        If no steady state is found, or the system cannot be linearised.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> scenario = gfor.load("two_area").scenario("pod_p")
    >>> found = scenario.sensitivities(parameters="gfor.pod_p.K")
    >>> round(found.result.rows[0].damping_per_percent, 3)
    -0.046
    """

    mode: str | None = request_field(
        NAME,
        None,
        "a mode that the case names, or 'critical' for the least damped one (default: the first named one)",
    )
    parameters: Names = request_field(
        NAMES,
        (),
        "only this one, tunable or fixed; also a pattern (repeatable; default: all tunable ones)",
        "COMPONENT.PARAMETER",
        option="--parameter",
        python="names ``component.variable``, also with ``*``; by default all tunable ones",
    )
    _: KW_ONLY
    fixed: bool = request_field(
        FLAG, False, "fixed parameters too: the case is started several times for each"
    )
    held: bool = request_field(
        FLAG,
        False,
        "partial derivatives at the held operating point, instead of the total ones; tunable parameters "
        "only",
    )
    frequencies: tuple[float, float] = of_frequencies()
    directional: bool = request_field(
        FLAG,
        False,
        "linearise with the FMUs' own directional derivatives instead of by perturbation (with --native)",
    )
    report: Callable[[int, int], None] = request_field(
        CALLED, nobody, "called with how many parameters are done, of how many", option=None
    )
