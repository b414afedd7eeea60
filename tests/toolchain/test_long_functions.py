"""A long function in parts does the same operations in the same order: equal to the last bit."""

import ctypes

import numpy as np
import pytest

from fmus.toolchain.catalogue import build_model
from fmus.toolchain.compiler import compile_library, host_platform
from fmus.toolchain.kernel import c_source
from fmus.toolchain.long_functions import cut


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
def test_parts_compute_the_same_to_the_last_bit(name):
    model = build_model(name)
    source = c_source(model)
    parts = cut(source, longest=20, part=7)
    assert parts.count("noinline") > 20
    assert "noinline" not in source  # short as it is, it stays as CasADi writes it
    whole = _after(source, model)
    assert np.isfinite(whole).all()
    assert np.count_nonzero(whole) > len(model.outputs)
    assert whole.tobytes() == _after(parts, model).tobytes()


def test_a_line_that_is_no_operation_is_refused():
    """A statement that CasADi may come to write could mean something else elsewhere."""
    source = (
        "static int casadi_f0(const casadi_real** arg, casadi_real** res, casadi_int* iw, casadi_real* w, int mem) {\n"
        "  casadi_real a0;\n  a0=arg[0]? arg[0][0] : 0;\n  if (a0<0) return 1;\n  return 0;\n}\n"
    )
    assert cut(source) == source
    with pytest.raises(ValueError, match="if \\(a0<0\\) return 1"):
        cut(source, longest=1)
