"""The kernel of a model in pure Python: the fallback where no compiled kernel fits the platform.

It is written from the same operations in the same order as the C code, so both give the same
results to rounding."""

from fmus.toolchain.elimination import plan_elimination
from fmus.toolchain.kernel import kernel_functions
from fmus.toolchain.model import Model
from fmus.toolchain.nodes import LARGEST_REST
from fmus.toolchain.plan import Plan
from fmus.toolchain.symbols import Function, Op
from fmus.toolchain.symbols.operations import ARITHMETIC, PYTHON

_PYTHON_HEADER = '''"""Pure-Python kernel of {name}: the fallback where no compiled kernel fits the platform."""

{arithmetic}

NP, NC, NU, NX, NY = {np}, {nc}, {nu}, {nx}, {ny}
C = NP
U = C + NC
X = U + NU
Y = X + NX
DX = Y + NY


'''

_PYTHON_FUNCTIONS = """

def _rates(z, x):
    return derivatives_code(x, z[U:X], z[:C], z[C:U])[0]


def initialise(z):
    z[C:U], z[X:Y] = initialise_code(z[:C])


def outputs(z):
    z[Y:DX] = outputs_code(z[X:Y], z[U:X], z[:C], z[C:U])[0]


def derivatives(z):
    z[DX:DX + NX] = _rates(z, z[X:Y])


def requirements(z, r):
    margins = requirements_code(z[:C], z[C:U])[0]
    r[:len(margins)] = margins


def _finish(z, x):
    z[X:Y] = x
    for index, value in enumerate(x):
        if not isfinite(value):
            return index + 1
    outputs(z)
    return 0
"""

_NODAL = """


_nodal_factors = {}


def _factorise_nodes(u, p, c):
    values = nodal_values_code(u, p, c)[0]
    count, buses = len(MCOL), len(PERM)
    lu, inverse = [0j] * len(COL), [0j] * buses
    for i in range(buses):
        row = dict.fromkeys(COL[ROW[i]:ROW[i + 1]], 0j)
        for q in range(MROW[i], MROW[i + 1]):
            row[MCOL[q]] = complex(values[q], values[count + q])
        for q in range(ROW[i], DIAG[i]):
            k = COL[q]
            factor = row[k] * inverse[k]
            row[k] = factor
            for r in range(DIAG[k] + 1, ROW[k + 1]):
                row[COL[r]] -= factor * lu[r]
        for q in range(ROW[i], ROW[i + 1]):
            lu[q] = row[COL[q]]
        inverse[i] = 1 / row[i] if row[i] else complex(nan, nan)
    b = [math.cos(i) for i in range(buses)] + [math.sin(i) for i in range(buses)]
    s = _through_factors(b, lu, inverse)
    for i in range(buses):
        terms = [complex(values[q], values[count + q]) * s[MCOL[q]] for q in range(MROW[i], MROW[i + 1])]
        terms.append(-complex(b[PERM[i]], b[buses + PERM[i]]))
        rest = sum(terms)
        if fabs(rest.real) + fabs(rest.imag) > LARGEST_REST * sum(fabs(t.real) + fabs(t.imag) for t in terms):
            inverse = [complex(nan, nan)] * buses
    return lu, inverse


def _through_factors(b, lu, inverse):
    buses = len(PERM)
    s = [0j] * buses
    for i in range(buses):
        known = complex(b[PERM[i]], b[buses + PERM[i]])
        for q in range(ROW[i], DIAG[i]):
            known -= lu[q] * s[COL[q]]
        s[i] = known
    for i in range(buses - 1, -1, -1):
        known = s[i]
        for q in range(DIAG[i] + 1, ROW[i + 1]):
            known -= lu[q] * s[COL[q]]
        s[i] = known * inverse[i]
    return s


def _voltages(x, u, p, c):
    key = (*p, *c, *(u[k] for k in GIVEN))
    if key not in _nodal_factors:
        _nodal_factors.clear()
        _nodal_factors[key] = _factorise_nodes(u, p, c)
    s, v = _through_factors(nodal_currents_code(x, u, p, c)[0], *_nodal_factors[key]), [0.0] * (2 * len(PERM))
    for i, value in enumerate(s):
        v[PERM[i]], v[len(PERM) + PERM[i]] = value.real, value.imag
    return v


def outputs_code(x, u, p, c):
    return outputs_at_code(x, u, p, c, _voltages(x, u, p, c))


def derivatives_code(x, u, p, c):
    return derivatives_at_code(x, u, p, c, _voltages(x, u, p, c))
"""

_RUNGE_KUTTA = """

def _held_rates(z, x):
    rates = _rates(z, x)
    for index in STEPWISE:
        rates[index] = 0.0
    return rates


def advance(z, h, n, workspace):
    x = z[X:Y]
    moved = []
    if STEPWISE:
        rates = _rates(z, x)
        moved = [n * h * rates[index] for index in STEPWISE]
    for _ in range(n):
        k1 = _held_rates(z, x)
        k2 = _held_rates(z, [a + h / 2 * k for a, k in zip(x, k1)])
        k3 = _held_rates(z, [a + h / 2 * k for a, k in zip(x, k2)])
        k4 = _held_rates(z, [a + h * k for a, k in zip(x, k3)])
        x = [
            a + h / 6 * (b + 2 * c + 2 * d + e)
            for a, b, c, d, e in zip(x, k1, k2, k3, k4)
        ]
    for index, change in zip(STEPWISE, moved):
        x[index] += change
    return _finish(z, x)
"""

_SDIRK = """

G = 0.29289321881345254
_factors = {}


def _factorise(z, gh):
    m = iteration_code(z[:C], z[C:U], [gh])[0]
    lu, inverse = [0.0] * len(COL), [0.0] * NX
    for i in range(NX):
        row = dict.fromkeys(COL[ROW[i]:ROW[i + 1]], 0.0)
        for q in range(MROW[i], MROW[i + 1]):
            row[MCOL[q]] = m[q]
        for q in range(ROW[i], DIAG[i]):
            c = COL[q]
            l = row[c] * inverse[c]
            row[c] = l
            for r in range(DIAG[c] + 1, ROW[c + 1]):
                row[COL[r]] -= l * lu[r]
        for q in range(ROW[i], ROW[i + 1]):
            lu[q] = row[COL[q]]
        inverse[i] = divide(1.0, row[i])
    return lu, inverse


def _solve(b, lu, inverse):
    v, k = [0.0] * NX, [0.0] * NX
    for i in range(NX):
        s = b[PERM[i]]
        for q in range(ROW[i], DIAG[i]):
            s -= lu[q] * v[COL[q]]
        v[i] = s
    for i in range(NX - 1, -1, -1):
        s = v[i]
        for q in range(DIAG[i] + 1, ROW[i + 1]):
            s -= lu[q] * v[COL[q]]
        v[i] = s * inverse[i]
        k[PERM[i]] = v[i]
    return k


def advance(z, h, n, workspace):
    key = (h, *z[:U])
    if key not in _factors:
        _factors.clear()
        _factors[key] = _factorise(z, G * h)
    lu, inverse = _factors[key]
    x = z[X:Y]
    for _ in range(n):
        k1 = _solve(_rates(z, x), lu, inverse)
        k2 = _solve(_rates(z, [a + (1 - G) * h * k for a, k in zip(x, k1)]), lu, inverse)
        x = [a + h * ((1 - G) * b + G * c) for a, b, c in zip(x, k1, k2)]
    return _finish(z, x)
"""


def python_source(model: Model) -> str:
    """The kernel of a model as the text of a Python module that imports nothing but `math`."""
    header = _PYTHON_HEADER.format(
        name=model.name,
        arithmetic=ARITHMETIC,
        np=len(model.parameters),
        nc=len(model.calculated),
        nu=len(model.inputs),
        nx=len(model.states),
        ny=len(model.outputs),
    )
    functions, advance = kernel_functions(model), _RUNGE_KUTTA
    tables = f"STEPWISE = {[index for index, state in enumerate(model.states) if state.stepwise]}\n\n"
    if model.integrator == "sdirk":
        elimination = plan_elimination(model)
        functions["iteration"] = elimination.values
        advance = _SDIRK
        tables = _tables(elimination.plan)
    if model.nodal is not None:
        tables += _tables(model.nodal.plan) + f"GIVEN = {list(model.nodal.given)}\nLARGEST_REST = {LARGEST_REST}\n\n"
    bodies = [_python_function(f"{name}_code", function) for name, function in functions.items()]
    nodal = _NODAL if model.nodal is not None else ""
    return header + tables + "\n\n".join(bodies) + nodal + _PYTHON_FUNCTIONS + advance


def _tables(plan: Plan) -> str:
    return "".join(f"{name} = {values}\n" for name, values in plan.tables().items()) + "\n"


def _python_function(name: str, function: Function) -> str:
    """Write a function as straight-line Python, one line an operation."""
    lines = [f"def {name}({', '.join(f'i{k}' for k in range(len(function.inputs)))}):"]
    lines += [f"    o{k} = [0.0] * {len(vector)}" for k, vector in enumerate(function.outputs)]
    for op, place, a, b, value in function.instructions:
        if op == Op.CONST:
            lines.append(f"    w{place} = {value!r}")
        elif op == Op.INPUT:
            lines.append(f"    w{place} = i{a}[{b}]")
        elif op == Op.OUTPUT:
            lines.append(f"    o{place}[{a}] = w{b}")
        else:
            lines.append(f"    w{place} = " + PYTHON[op].format(f"w{a}", f"w{b}"))
    lines.append(f"    return {', '.join(f'o{k}' for k in range(len(function.outputs)))},")
    return "\n".join(lines)
