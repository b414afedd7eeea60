"""Functions as text of C."""

from fmus.toolchain import kernel
from fmus.toolchain.symbols import Function, symbol


def test_constants_keep_their_last_bit_and_may_be_infinite():
    x = symbol("x")
    values = [1 / 3, -1e-300, 5e22, float("inf"), float("-inf")]
    text = kernel.c_function(Function("f", [[x]], [[x + value for value in values]]), "f")
    literals = "0.3333333333333333", "-1e-300", "5e+22", "INFINITY", "-INFINITY"
    assert all(f"={literal};" in text for literal in literals)
