"""Functions of symbols, evaluated."""

from itertools import product

import numpy as np

from fmus.toolchain.symbols import Function, Op, symbols
from fmus.toolchain.symbols.expression import node
from fmus.toolchain.symbols.function import OFTEN
from fmus.toolchain.symbols.operations import PYTHON

POINTS = [-np.inf, -2.5, -0.0, 0.0, 1 / 3, 1.0, 800.0, np.inf, np.nan]


def test_a_function_that_is_called_often_gives_the_same_bits():
    """Every operation, wherever it is not defined as well; later calls are of compiled code."""
    a, b = given = symbols("z", 2)
    every = [node(op, a, b) for op in PYTHON if op != Op.FLOOR]  # whose value has to be finite
    function = Function("all", [given], [every, [*given, a + float("inf"), a * 1e-300]])
    points = list(product(POINTS, POINTS))
    assert len(points) > OFTEN
    first = [Function("all", function.inputs, function.outputs)([x, y]) for x, y in points]
    for _ in range(2):
        for point, expected in zip(points, first, strict=True):
            for found, wanted in zip(function(point), expected, strict=True):
                assert found.tobytes() == wanted.tobytes()
