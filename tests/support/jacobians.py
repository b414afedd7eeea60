"""Exact Jacobians of models, with which the tests compare the perturbation."""

from functools import lru_cache
from itertools import product

from fmus.toolchain.symbols import Expr, Function, jacobian
from tests.support.written_out import written_out


def jacobians(model):
    """Exact A, B, C, D of the continuous model as a function of (x, u, p, c)."""
    model = written_out(model)
    return _of(model.derivatives, model.outputs_function)


@lru_cache(maxsize=32)
def _of(derivatives, outputs):
    """Those of two functions, which several tests of a model share."""
    known = derivatives.inputs
    blocks, shapes = [], []
    for values in (derivatives.outputs[0], outputs.outputs[0]):
        for by in known[:2]:
            found, shape = jacobian(values, by), (len(values), len(by))
            blocks.append([found.get(place, Expr(0)) for place in product(*map(range, shape))])
            shapes.append(shape)
    function = Function("jacobians", known, blocks)
    return lambda *at: [
        block.reshape(shape) for block, shape in zip(function(*at), shapes, strict=True)
    ]
