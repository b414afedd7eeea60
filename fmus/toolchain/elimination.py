"""The implicit step's matrix 1 − γh·A of a model, with the plan of its factorisation."""

from dataclasses import dataclass

from fmus.toolchain.elimination_plan import plan_pattern
from fmus.toolchain.model import Model
from fmus.toolchain.plan import Plan
from fmus.toolchain.symbols import Expr, Function, depends_on, jacobian, symbol, symbols


@dataclass(frozen=True)
class Elimination:
    """The plan for 1 − γh·A, and a function (p, c, γh) → values of that matrix."""

    plan: Plan
    values: Function


def plan_elimination(model: Model) -> Elimination:
    """Plan the factorisation of a model whose implicit part is linear in its states."""
    n = len(model.states)
    x, u = symbols("x", n), symbols("u", len(model.inputs))
    p, c = symbols("p", len(model.parameters)), symbols("c", len(model.calculated))
    (rates,) = (model.implicit or model.derivatives).of(x, u, p, c)
    A = jacobian(rates, x)
    if depends_on(list(A.values()), [*x, *u]):
        raise ValueError(f"model {model.name} is not linear in its states; the implicit integrator needs that")
    gh = symbol("gh")
    matrix = {(i, i): Expr(1) for i in range(n)}
    for place, element in A.items():
        matrix[place] = matrix.get(place, Expr(0)) - gh * element
    plan = plan_pattern(n, *zip(*matrix, strict=True))
    return Elimination(plan, Function("iteration", [p, c, [gh]], [[matrix[place] for place in plan.entries]]))
