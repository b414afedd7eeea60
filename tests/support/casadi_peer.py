"""The models of this package written by CasADi: its SX in place of our symbols, and what its functions give.

Run in a process of its own, with a file for the answers: modules that took our symbols would keep them."""

# ruff: noqa: PLC0415 - what takes the symbols is imported once CasADi stands in their place

import pickle
import sys
import types
from importlib.util import find_spec

import casadi as ca
import numpy as np

NETWORK = "a network with capacitances"


def _column(values):
    return ca.SX(ca.vertcat(*values)) if len(values) else ca.SX(0, 1)


class _Function:
    def __init__(self, name, inputs, outputs):
        self.name, self.inputs, self.outputs = name, inputs, outputs
        self._function = ca.Function(
            name, [_column(v) for v in inputs], [_column(v) for v in outputs]
        )
        self.instructions = range(self._function.n_instructions())

    def of(self, *arguments):
        return [
            ca.vertsplit(value) for value in self._function.call([_column(a) for a in arguments])
        ]

    def __call__(self, *arguments):
        return tuple(
            np.array(value).ravel() for value in self._function.call([ca.DM(a) for a in arguments])
        )


def _jacobian(values, by):
    found = ca.jacobian(_column(values), _column(by))
    return {(i, j): found[i, j] for i, j in zip(*found.sparsity().get_triplet(), strict=True)}


def _times(values, by, along, transposed=False):
    return ca.vertsplit(ca.jtimes(_column(values), _column(by), _column(along), transposed))


def _install():
    """Put CasADi in the place of our symbols."""
    name = "fmus.toolchain.symbols"
    peer = types.ModuleType(name)
    peer.__path__ = (find_spec("fmus.toolchain").submodule_search_locations[0] + "/symbols",)
    taken = "atan atan2 copysign cos exp fabs floor fmax fmin if_else log logic_and logic_not logic_or sin sqrt tan"
    vars(peer).update({operation: getattr(ca, operation) for operation in taken.split()})
    vars(peer).update(
        Expr=ca.SX,
        Scalar=ca.SX | float,
        Vector=list,
        Function=_Function,
        symbol=ca.SX.sym,
        symbols=lambda name, count: [ca.SX.sym(f"{name}_{k}") for k in range(count)],
        substitute=lambda values, old, new: ca.vertsplit(
            ca.substitute(_column(values), _column(old), _column(new))
        ),
        symbols_in=lambda values: ca.symvar(_column(values)),
        depends_on=lambda values, on: len(on) > 0 and ca.depends_on(_column(values), _column(on)),
        jacobian=_jacobian,
        jtimes=_times,
        jtimes_transposed=lambda values, by, seeds: _times(values, by, seeds, True),
    )
    sys.modules[name] = peer


def made():
    """All models of the catalogue that need no data, and a network, by name."""
    from fmus.grid.grid import grid
    from fmus.grid.network import Line, Load, Network, Port, Zip
    from fmus.grid.phasor_grid import phasor_grid
    from fmus.grid.two_area import TWO_AREA_PHASOR
    from fmus.toolchain.catalogue import build_model, model_names, needs_arguments
    from tests.support.written_out import written_out

    lines = (
        Line("l1", "a", "b", X=0.1, R=0.01, B=0.02),
        Line("l2", "b", "c", X=0.2, tap=1.05, shift=0.1, B=0.04, X_C=0.05),
    )
    loads = (
        Load("power", "c", 50.0, 10.0, active=Zip(p=0.5, i=0.5), k_pf=1.0),
        Load("plain", "b", 20.0, 5.0),
    )
    network = Network("chain", ("a", "b", "c"), lines, loads, (Port("unit", "a"),), faults=("b",))
    peers = {
        NETWORK: grid(network),
        "two_area_phasor_grid": written_out(phasor_grid(TWO_AREA_PHASOR)),
    }
    names = {name for name in model_names() if not needs_arguments(name)} - {*peers}
    return {name: build_model(name) for name in sorted(names)} | peers


def functions(model):
    """All functions of a model from which code is written, by name."""
    from fmus.toolchain.elimination_plan import plan_elimination
    from fmus.toolchain.kernel import derivative_functions, kernel_functions

    found = kernel_functions(model) | derivative_functions(model)
    return found | (
        {"iteration": plan_elimination(model).values} if model.integrator == "sdirk" else {}
    )


def answers(models):
    """Instructions of each function, and its values at points of both signs, by model and function."""
    found = {}
    for name, model in models.items():
        for of, function in functions(model).items():
            chance = np.random.default_rng(27)
            points = [
                [chance.uniform(low, 2.0, len(v)) for v in function.inputs]
                for low in (0.1, 0.1, -2.0, -2.0)
            ]
            values = [np.concatenate(function(*point)) for point in points]
            found[name, of] = len(function.instructions), np.array(values)
    return found


if __name__ == "__main__":
    _install()
    with open(sys.argv[1], "wb") as file:
        pickle.dump(answers(made()), file)
