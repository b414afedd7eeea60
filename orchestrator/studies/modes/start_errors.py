"""Messages of a component that cannot start, in the words of the case: its place, its operating point, the remedy."""

from orchestrator.cases.flow.sharing import power_limits
from orchestrator.cases.scenario.feeding_loads import feeding_loads
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import ComponentError, ErrorKind, Problem, StartError
from orchestrator.devices.fmi.instance import is_ours
from orchestrator.devices.fmi.refused_calls import refuses_to_start

_PREFACE = "parameters cannot be used: "
"""Begins what our models log of values that do not fit together, and is said by "cannot start" already. By FMI a model
can give its reason as a text only; a text of another's FMU stays as it is."""

_FULL = 1.0  # apparent power [pu] beyond which a unit is asked for more than its rating


def start_error(prepared: PreparedScenario, error: ComponentError) -> StartError | None:
    """The error of a component that refused to initialise; None for any other call, and where its process died."""
    if not refuses_to_start(error) or error.component not in prepared.places:
        return None
    name, plan = error.component, prepared.system.components[error.component]
    ours = is_ours(plan.description.path)
    said = error.log.removeprefix(f"{name}: ")
    said = said.removeprefix(_PREFACE) if ours else said
    said = said or "the FMU says no more than that its initialisation failed"
    given = {
        v: plan.number(v) for v in ("P_0", "Q_0", "S_n", "v_0") if v in plan.description.variables
    }
    most = power_limits(plan, given["Q_0"])[1] if {"P_0", "Q_0"} <= set(given) else float("inf")
    share = given["P_0"] / most if "P_0" in given and most > 0 else 0.0
    need = f"would need {100 * share:.0f} % of what its limits allow, and " if share > 1 else ""
    text = f"scenario {prepared.name!r}: {name} {need}cannot start: {said}"
    if {"P_0", "Q_0", "S_n"} <= set(given):
        computed = prepared.power_flow is not None and name in prepared.power_flow.powers
        by = "the power flow asks it for" if computed else "it is to start at"
        voltage = f" at v = {given['v_0']:.4g} pu" if "v_0" in given else ""
        powers = f"P_0 = {given['P_0']:.4g} and Q_0 = {given['Q_0']:.4g} pu"
        text += f"; {by} {powers} of S_n = {given['S_n']:g} MVA{voltage}"
        if computed and (need or abs(complex(given["P_0"], given["Q_0"])) > _FULL):
            text += (
                ". Give others more of the power (P_0 of units; a screening of outages shares it by itself), lower the "
                "loads or the reactive power around it, or correct a limit that is wrong in its data"
            )
        grid = prepared.system.components.get(prepared.grid) if computed else None
        fed = feeding_loads(prepared.network, grid, given["S_n"])
        text += f"; {fed}" if fed else ""
    # The same values are refused again by a model of ours; an FMU of others may lack a licence today.
    kind = ErrorKind.START if ours else ErrorKind.FMU
    return StartError(
        prepared.case.source,
        Problem(prepared.places[name], text, kind),
        name,
    )
