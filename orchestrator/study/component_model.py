"""The linear model of one component at the steady state of a scenario, to be packed into its FMU."""

from orchestrator.analysis.linearization import linearize_within
from orchestrator.analysis.perturbation import PERTURBATIONS
from orchestrator.analysis.steady_state import find_operating_point
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.coupling.step_awareness import STEP_PARAMETER, knows_step
from orchestrator.errors import AnalysisError
from orchestrator.fmi.linear_model import EmbeddedModel
from orchestrator.study.modes import running


def component_model(prepared: PreparedScenario, name: str) -> EmbeddedModel:
    """The continuous linear model of one component at the scenario's steady state.

    It is made of the FMU's own directional derivatives where it gives them, else by perturbation. Its inputs and
    outputs are all that the FMU has of type Real."""
    plan = prepared.system.components[name]
    info = plan.description.variables
    inputs, outputs = (
        [v for v in names if info[v].type == "Real"] for names in (plan.description.inputs, plan.description.outputs)
    )
    with running(prepared) as master:
        point = find_operating_point(master)
        open_inputs = [v for v in inputs if v not in master.exchanges[name].inputs.names]
        exact = plan.description.gives_directional_derivatives
        c = linearize_within(
            master, name, prepared.step_size, open_inputs, outputs,
            derivatives=True, without_step=True, directional=exact,
        )  # fmt: skip
        if c.A_c is None or c.B_c is None:
            raise AnalysisError(
                f"component {name!r}: its FMU does not give its derivatives, so no continuous model can be made"
            )
        values = master.components[name].get([*c.states, *inputs, *outputs])
        given = {STEP_PARAMETER} if knows_step(master, name) else set()
    columns = [c.inputs.index(v) for v in inputs]
    parameters = {v: x for v, x in plan.parameters.items() if x != info[v].start and v not in given}
    return EmbeddedModel(
        A=c.A_c,
        B=c.B_c[:, columns],
        C=c.C_o,
        D=c.D_o[:, columns],
        states={v: values[v] for v in c.states},
        inputs={v: values[v] for v in inputs},
        outputs={v: values[v] for v in outputs},
        parameters=parameters,
        units={v: info[v].unit for v in (*c.states, *inputs, *outputs, *parameters)},
        origin={
            "case": prepared.case.name, "scenario": prepared.name, "component": name, "step_size_s": prepared.step_size,
            "residual_per_step": point.residual,
            "derivatives": "directional derivatives" if exact else f"central differences of {PERTURBATIONS[0]:g}",
            "fmu_guid": plan.description.guid,
        },
    )  # fmt: skip
