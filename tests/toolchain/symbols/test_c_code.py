"""A long function in parts does the same operations in the same order: equal to the last bit."""

import ctypes

import numpy as np
import pytest

from fmus.toolchain import kernel
from fmus.toolchain.catalogue import build_model
from fmus.toolchain.compiler import compile_library, host_platform
from fmus.toolchain.symbols import Function, symbol


def _after(source, model):
    """All variables after the initialisation and a few steps."""
    library = ctypes.CDLL(str(compile_library(source, host_platform())))
    library.advance.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_int, ctypes.c_void_p]
    workspace = (ctypes.c_double * max(1, library.workspace_size()))()
    z = (ctypes.c_double * len(model.value_references))()
    for variable in (*model.parameters, *model.inputs):
        z[model.value_references[variable.name]] = variable.start
    for number, variable in enumerate(model.inputs):
        z[model.value_references[variable.name]] = variable.start + 0.3 + 0.1 * number
    library.initialise(z)
    assert library.advance(z, 1e-4, 3, workspace) == 0
    library.derivatives(z)
    return np.array(z)


@pytest.mark.parametrize("name", ["synchronous_generator_ac4a", "two_area_phasor_grid", "gfor"])
def test_parts_compute_the_same_to_the_last_bit(name, monkeypatch):
    model = build_model(name).written_out
    source = kernel.c_source(model)
    assert "noinline" not in source
    monkeypatch.setattr(kernel, "LONGEST", 20)
    monkeypatch.setattr(kernel, "PART", 7)
    parts = kernel.c_source(model)
    assert parts.count("noinline") > 20
    whole = _after(source, model)
    assert np.isfinite(whole).all()
    assert np.count_nonzero(whole) > len(model.outputs)
    assert whole.tobytes() == _after(parts, model).tobytes()


def test_constants_keep_their_last_bit_and_may_be_infinite():
    x = symbol("x")
    values = [1 / 3, -1e-300, 5e22, float("inf"), float("-inf")]
    text = kernel.c_function(Function("f", [[x]], [[x + value for value in values]]), "f", 100)
    literals = "0.3333333333333333", "-1e-300", "5e+22", "INFINITY", "-INFINITY"
    assert all(f"={literal};" in text for literal in literals)
