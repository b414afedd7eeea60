"""The implicit step's matrix 1 − γh·A of a model, with the plan of its factorisation."""

from dataclasses import dataclass

import casadi as ca

from fmus.toolchain.elimination_plan import plan_pattern
from fmus.toolchain.model import Model
from fmus.toolchain.plan import Plan


@dataclass(frozen=True)
class Elimination:
    """The plan for 1 − γh·A, and a CasADi function (p, c, γh) → values of that matrix."""

    plan: Plan
    values: ca.Function


def plan_elimination(model: Model) -> Elimination:
    """Plan the factorisation of a model whose implicit part is linear in its states."""
    n = len(model.states)
    x, u = ca.SX.sym("x", n), ca.SX.sym("u", len(model.inputs))
    p, c = ca.SX.sym("p", len(model.parameters)), ca.SX.sym("c", len(model.calculated))
    A = ca.jacobian((model.implicit or model.derivatives)(x, u, p, c), x)
    if ca.depends_on(A, ca.vertcat(x, u)):
        raise ValueError(f"model {model.name} is not linear in its states; the implicit integrator needs that")
    gh = ca.SX.sym("gh")
    matrix = ca.SX.eye(n) - gh * A
    rows, columns = matrix.sparsity().get_triplet()
    plan = plan_pattern(n, rows, columns)
    values = ca.vertcat(*[matrix[i, j] for i, j in plan.entries])
    return Elimination(plan, ca.Function("iteration", [p, c, gh], [ca.densify(values)]))
