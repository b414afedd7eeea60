"""A model's kernel in each of its forms, for one instance: compiled, its tape in C, its tape in Python."""

import ctypes
from functools import partial
from types import SimpleNamespace

from fmus.toolchain.compiler import compile_here, compile_library, host_platform
from fmus.toolchain.kernel import c_source
from fmus.toolchain.tape import LIBRARY, tape_of
from fmus.toolchain.tape_kernel import Kernel

_FUNCTIONS = ("initialise", "outputs", "derivatives", "requirements")


def compiled(model):
    library = ctypes.CDLL(str(compile_library(c_source(model), host_platform())))
    library.advance.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_int, ctypes.c_void_p]
    return _bound(library, (ctypes.c_double * max(1, library.workspace_size()))())


def _bound(library, workspace, **more):
    return SimpleNamespace(
        initialise=lambda z: library.initialise(z, workspace),
        outputs=lambda z: library.outputs(z, workspace),
        derivatives=lambda z: library.derivatives(z, workspace),
        requirements=lambda z, margins: library.requirements(z, workspace, margins),
        advance=lambda z, h, n: library.advance(z, h, n, workspace),
        **more,
    )


def tape_library():
    library = ctypes.CDLL(str(compile_here(*LIBRARY)))
    library.tape_fault.restype, library.workspace_size.restype = ctypes.c_char_p, ctypes.c_int64
    library.tape_fault.argtypes = [ctypes.c_char_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_int]
    library.advance.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_int, ctypes.c_void_p]
    return library


def taped(model, content=None):
    library, tape = tape_library(), content or tape_of(model)
    fault = library.tape_fault(
        tape, len(tape), len(model.value_references), len(model.requirement_texts)
    )
    assert fault is None, fault
    workspace = (ctypes.c_double * library.workspace_size(tape))()

    def begin():
        library.begin(tape, workspace)

    begin()
    return _bound(library, workspace, begin=begin)  # which holds the tape


def in_python(model):
    kernel = Kernel(tape_of(model), len(model.value_references))
    return SimpleNamespace(
        **{name: partial(getattr(kernel, name)) for name in (*_FUNCTIONS, "advance")}
    )


KERNELS = {"compiled": compiled, "tape": taped, "python": in_python}


def vector(model, **values):
    """z with the start values of parameters and inputs, and the values given by name."""
    z = (ctypes.c_double * len(model.value_references))()
    for variable in (*model.parameters, *model.inputs):
        z[model.value_references[variable.name]] = variable.start
    for name, value in values.items():
        z[model.value_references[name]] = value
    return z
