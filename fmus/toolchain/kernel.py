"""From a model to code that a slave can call: a compiled C kernel, and the same in pure Python.

Every quantity of a model instance lives in one vector z, indexed by FMI value reference:
z = [p | c | u | x | y | ẋ]. A kernel is four functions on it:

- ``initialise(z)``: c and x from p;
- ``outputs(z)``: y from x, u;
- ``derivatives(z)``: ẋ from x, u;
- ``advance(z, h, n)``: n classical Runge-Kutta steps of h seconds at constant u, then y; returns 0,
  or 1 + the index of the first state that is no longer finite;
- ``requirements(z, r)``: the model may run where every r > 0.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import casadi as ca

from fmus.toolchain.cache import cache_directory
from fmus.toolchain.model import Model

TARGETS = {
    # FMI platform -> (zig target, file name of the shared library)
    "linux64": ("x86_64-linux-gnu.2.17", "kernel.so"),
    "win64": ("x86_64-windows-gnu", "kernel.dll"),
    "darwin64": ("x86_64-macos", "kernel.dylib"),
}

COMPILER_FLAGS = ("-O2", "-shared", "-fPIC", "-ffp-contract=off", "-fno-sanitize=undefined", "-g0")
"""No fast-math and no fused operations: the compiled kernel and the Python fallback agree to rounding."""

_FUNCTIONS = """
#include <math.h>
#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif
enum {{ NP = {np}, NC = {nc}, NU = {nu}, NX = {nx}, NY = {ny}, NW = {nw},
       C = NP, U = C + NC, X = U + NU, Y = X + NX, DX = Y + NY }};

static void rates(const double *z, const double *x, double *rate) {{
    double w[NW];
    const double *arg[] = {{x, z + U, z, z + C}};
    double *res[] = {{rate}};
    derivatives_code(arg, res, 0, w, 0);
}}

EXPORT void initialise(double *z) {{
    double w[NW];
    const double *arg[] = {{z}};
    double *res[] = {{z + C, z + X}};
    initialise_code(arg, res, 0, w, 0);
}}

EXPORT void outputs(double *z) {{
    double w[NW];
    const double *arg[] = {{z + X, z + U, z, z + C}};
    double *res[] = {{z + Y}};
    outputs_code(arg, res, 0, w, 0);
}}

EXPORT void derivatives(double *z) {{ rates(z, z + X, z + DX); }}

EXPORT void requirements(const double *z, double *r) {{
    double w[NW];
    const double *arg[] = {{z, z + C}};
    double *res[] = {{r}};
    requirements_code(arg, res, 0, w, 0);
}}

EXPORT int advance(double *z, double h, int n) {{
    double k1[NX], k2[NX], k3[NX], k4[NX], t[NX], *x = z + X;
    for (int step = 0; step < n; ++step) {{
        rates(z, x, k1);
        for (int i = 0; i < NX; ++i) t[i] = x[i] + h / 2 * k1[i];
        rates(z, t, k2);
        for (int i = 0; i < NX; ++i) t[i] = x[i] + h / 2 * k2[i];
        rates(z, t, k3);
        for (int i = 0; i < NX; ++i) t[i] = x[i] + h * k3[i];
        rates(z, t, k4);
        for (int i = 0; i < NX; ++i) x[i] += h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
    }}
    for (int i = 0; i < NX; ++i) if (!isfinite(x[i])) return i + 1;
    outputs(z);
    return 0;
}}
"""


def c_source(model: Model) -> str:
    """The whole C kernel of a model as one translation unit."""
    functions = _kernel_functions(model)
    generator = ca.CodeGenerator(model.name, {"with_header": False, "main": False, "verbose": False})
    for name, function in functions.items():
        generator.add(_renamed(function, f"{name}_code"))
    sizes = {
        "np": len(model.parameters),
        "nc": len(model.calculated),
        "nu": len(model.inputs),
        "nx": len(model.states),
        "ny": len(model.outputs),
        "nw": max(1, *(f.sz_w() for f in functions.values())),
    }
    return str(generator.dump()) + _FUNCTIONS.format(**sizes)


def _kernel_functions(model: Model) -> dict[str, ca.Function]:
    return {
        "initialise": model.initialise,
        "outputs": model.outputs_function,
        "derivatives": model.derivatives,
        "requirements": model.requirements,
    }


def _renamed(function: ca.Function, name: str) -> ca.Function:
    inputs = [ca.SX.sym("a", function.sparsity_in(k)) for k in range(function.n_in())]
    outputs = [ca.densify(e) for e in function.call(inputs)]
    return ca.Function(name, inputs, outputs)


def compile_kernel(source: str, platform: str, key: str) -> Path:
    """Compile C source for one FMI platform, or return what was compiled before.

    Parameters
    ----------
    source
        C code, as `c_source` gives it.
    platform
        A key of `TARGETS`.
    key
        Hash of everything that determines the result.

    Raises
    ------
    ValueError
        If the platform is unknown.
    RuntimeError
        If the compiler fails; its own text is in the message.
    """
    if platform not in TARGETS:
        raise ValueError(f"no kernel target for platform {platform!r}; choose from {', '.join(TARGETS)}")
    target, file_name = TARGETS[platform]
    library = cache_directory("kernels") / f"{key}-{platform}" / file_name
    if library.exists():
        return library
    with tempfile.TemporaryDirectory(prefix="gfor_kernel_") as folder:
        c_file = Path(folder) / "kernel.c"
        c_file.write_text(source)
        built = Path(folder) / file_name
        command = [sys.executable, "-m", "ziglang", "cc", "-target", target, *COMPILER_FLAGS]
        result = subprocess.run(
            [*command, str(c_file), "-o", str(built), "-lm"], capture_output=True, text=True, check=False, cwd=folder
        )
        if result.returncode:
            raise RuntimeError(f"the C compiler (ziglang) failed for {platform}:\n{result.stderr.strip()}")
        library.parent.mkdir(parents=True, exist_ok=True)
        partial = library.with_suffix(f".{os.getpid()}")
        shutil.copy(built, partial)
        partial.replace(library)  # atomic: another process may be building the same kernel
    return library


# -- the same functions in pure Python -----------------------------------------------------------

_PYTHON_HEADER = '''"""Pure-Python kernel of {name}: the fallback where no compiled kernel fits the platform."""

from math import atan2, copysign, cos, exp, fabs, floor, isfinite, log, sin, sqrt, tan

NP, NC, NU, NX, NY = {np}, {nc}, {nu}, {nx}, {ny}
C = NP
U = C + NC
X = U + NU
Y = X + NX
DX = Y + NY

'''

_PYTHON_FUNCTIONS = '''

def _rates(z, x):
    return derivatives_code(x, z[U:X], z[:C], z[C:U])[0]


def initialise(z):
    z[C:U], z[X:Y] = initialise_code(z[:C])


def outputs(z):
    z[Y:DX] = outputs_code(z[X:Y], z[U:X], z[:C], z[C:U])[0]


def derivatives(z):
    z[DX:DX + NX] = _rates(z, z[X:Y])


def requirements(z, r):
    r[:] = requirements_code(z[:C], z[C:U])[0]


def advance(z, h, n):
    x = z[X:Y]
    for _ in range(n):
        k1 = _rates(z, x)
        k2 = _rates(z, [a + h / 2 * k for a, k in zip(x, k1)])
        k3 = _rates(z, [a + h / 2 * k for a, k in zip(x, k2)])
        k4 = _rates(z, [a + h * k for a, k in zip(x, k3)])
        x = [
            a + h / 6 * (b + 2 * c + 2 * d + e)
            for a, b, c, d, e in zip(x, k1, k2, k3, k4)
        ]
    z[X:Y] = x
    for index, value in enumerate(x):
        if not isfinite(value):
            return index + 1
    outputs(z)
    return 0
'''

_BINARY = {
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "{0} / {1}",
    ca.OP_POW: "{0} ** {1}",
    ca.OP_CONSTPOW: "{0} ** {1}",
    ca.OP_LT: "1.0 if {0} < {1} else 0.0",
    ca.OP_LE: "1.0 if {0} <= {1} else 0.0",
    ca.OP_EQ: "1.0 if {0} == {1} else 0.0",
    ca.OP_NE: "1.0 if {0} != {1} else 0.0",
    ca.OP_AND: "1.0 if {0} and {1} else 0.0",
    ca.OP_OR: "1.0 if {0} or {1} else 0.0",
    ca.OP_FMIN: "min({0}, {1})",
    ca.OP_FMAX: "max({0}, {1})",
    ca.OP_IF_ELSE_ZERO: "{1} if {0} else 0.0",
    ca.OP_ATAN2: "atan2({0}, {1})",
    ca.OP_COPYSIGN: "copysign({0}, {1})",
}
_UNARY = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_NEG: "-{0}",
    ca.OP_INV: "1.0 / {0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "2.0 * {0}",
    ca.OP_SQRT: "sqrt({0})",
    ca.OP_SIN: "sin({0})",
    ca.OP_COS: "cos({0})",
    ca.OP_TAN: "tan({0})",
    ca.OP_EXP: "exp({0})",
    ca.OP_LOG: "log({0})",
    ca.OP_FABS: "fabs({0})",
    ca.OP_FLOOR: "floor({0})",
    ca.OP_NOT: "0.0 if {0} else 1.0",
}


def python_source(model: Model) -> str:
    """The kernel of a model as the text of a Python module that imports nothing but `math`."""
    header = _PYTHON_HEADER.format(
        name=model.name,
        np=len(model.parameters),
        nc=len(model.calculated),
        nu=len(model.inputs),
        nx=len(model.states),
        ny=len(model.outputs),
    )
    bodies = [_python_function(f"{name}_code", function) for name, function in _kernel_functions(model).items()]
    return header + "\n\n".join(bodies) + _PYTHON_FUNCTIONS


def _python_function(name: str, function: ca.Function) -> str:
    """Write an SX function as straight-line Python, one line an operation."""
    function = _renamed(function, name)
    arguments = [f"i{k}" for k in range(function.n_in())]
    lines = [f"def {name}({', '.join(arguments)}):"]
    lines += [f"    o{k} = [0.0] * {function.numel_out(k)}" for k in range(function.n_out())]
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_CONST:
            lines.append(f"    w{target[0]} = {function.instruction_constant(k)!r}")
        elif operation == ca.OP_INPUT:
            lines.append(f"    w{target[0]} = i{source[0]}[{source[1]}]")
        elif operation == ca.OP_OUTPUT:
            lines.append(f"    o{target[0]}[{target[1]}] = w{source[0]}")
        else:
            template = _UNARY.get(operation) or _BINARY.get(operation)
            if template is None:
                raise ValueError(
                    f"{name}: operation {operation} of CasADi has no Python form yet; add it to kernel.py"
                )
            lines.append(f"    w{target[0]} = " + template.format(*[f"w{s}" for s in source]))
    lines.append(f"    return {', '.join(f'o{k}' for k in range(function.n_out()))},")
    return "\n".join(lines)
