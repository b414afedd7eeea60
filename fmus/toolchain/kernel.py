"""From a model to a compiled kernel: functions in C that a slave calls.

Every quantity of a model instance lives in one vector z, indexed by FMI value reference:
z = [p | c | u | x | y | ẋ]. A kernel is these functions on it:

- ``initialise(z, w)``: c and x from p;
- ``outputs(z, w)``: y from x, u;
- ``derivatives(z, w)``: ẋ from x, u;
- ``advance(z, h, n, w)``: n steps of h seconds at constant u, then y; returns 0, or 1 + the
  index of the first state that is no longer finite;
- ``requirements(z, w, r)``: the model may run where every r > 0.

``workspace_size()`` tells how many numbers of its own, w, an instance needs between calls; they are 0 at first.

`tape` writes the same functions as data."""

from collections.abc import Mapping
from itertools import chain, islice
from pathlib import Path

from fmus.toolchain.elimination_plan import plan_elimination
from fmus.toolchain.fixed_values import with_fixed_apart
from fmus.toolchain.model import Model
from fmus.toolchain.symbols import Expr, Function, jtimes, jtimes_transposed, symbols
from fmus.toolchain.symbols.operations import LANES, C, Op


def c_function(function: Function, name: str) -> str:
    """Text of ``static void name(const double **arg, double **res)``."""
    head = f"static void {name}(const double **arg, double **res)"
    return _text(function, head, "double", C)


def lanes_function(function: Function, name: str) -> str:
    """The same of ``lanes``, which ``c/lanes.h`` declares."""
    head = f"IN_PLACE void {name}(const lanes **arg, lanes **res)"
    return _text(function, head, "lanes", LANES, _angles(function))


def _angles(function: Function) -> dict[int, int]:
    """Sines and cosines of one angle, as numbers of instructions; each with the first of its angle."""
    source: dict[int, tuple[int, ...]] = {}
    taken: dict[tuple[int, ...], dict[int, int]] = {}
    for k, (op, place, a, b, _) in enumerate(function.instructions):
        if op in (Op.SIN, Op.COS):
            taken.setdefault(source[a], {})[k] = op
        if op != Op.OUTPUT:
            source[place] = (a, b) if op == Op.INPUT else (k,)
    both = [by for by in taken.values() if len(set(by.values())) > 1]
    return {k: min(by) for by in both for k in by}


def _text(
    function: Function,
    head: str,
    kind: str,
    forms: Mapping[int, str],
    angles: Mapping[int, int] = {},
) -> str:
    lines = [f"{head} {{\n  (void)arg, (void)res;\n"]
    number = "{}" if kind == "double" else "NUMBER({})"
    held: dict[int, str] = {}  # what holds the value of each place
    for k, (op, place, a, b, value) in enumerate(function.instructions):
        if op == Op.OUTPUT:
            lines.append(f"  res[{place}][{a}]={held[b]};\n")
            continue
        if op == Op.INPUT:
            text = f"arg[{a}][{b}]"
        elif op == Op.CONST:
            text = number.format(repr(value).replace("inf", "INFINITY").replace("nan", "NAN"))
        elif k in angles:
            first = angles[k]
            if k == first:
                lines.append(f"  lanes sin{k}, cos{k}; OF_ANGLE({held[a]}, sin{k}, cos{k})\n")
            text = f"sin{first}" if op == Op.SIN else f"cos{first}"
        else:
            text = forms[op].format(held[a], held[b])
        held[place] = f"v{k}"
        lines.append(f"  {kind} v{k}={text};\n")
    return "".join([*lines, "}\n"])


_C = Path(__file__).with_name("c")


def c_source(model: Model, further: Mapping[str, Function] | None = None) -> str:
    """The whole C kernel of a model as one translation unit.

    ``further``: Functions by name whose code is wanted beside the kernel's own."""
    apart = with_fixed_apart(model)
    functions = {
        "initialise": model.initialise,
        "fixed": apart.fixed,
        "outputs": apart.outputs,
        "derivatives": apart.derivatives,
        "requirements": model.requirements,
    }
    sizes = {
        "NP": len(model.parameters),
        "NC": len(model.calculated),
        "NU": len(model.inputs),
        "NX": len(model.states),
        "NY": len(model.outputs),
        "NH": apart.count,
    }
    tables = ""
    if model.integrator == "sdirk":
        elimination = plan_elimination(model)
        functions["iteration"] = elimination.values
        sizes |= {"NM": len(elimination.plan.matrix_column), "NLU": len(elimination.plan.column)}
        tables = "#define IMPLICIT\n" + _tables(elimination.plan.tables())
    else:
        held = [index for index, state in enumerate(model.states) if state.stepwise]
        sizes["NS"] = len(held)
        tables = f"static const int STEPWISE[] = {{{', '.join(map(str, held or [-1]))}}};"
    code = [
        c_function(function, f"{name}_code")
        for name, function in {**functions, **(further or {})}.items()
    ]
    enumeration = (
        "enum { " + ", ".join(f"{name} = {value}" for name, value in sizes.items()) + " };\n"
    )
    parts = ["#include <math.h>", *code, enumeration, tables]
    parts += [
        (_C / name).read_text(encoding="utf-8") for name in ("kernel.c", f"{model.integrator}.c")
    ]
    size = "OWN + IMPLICIT_SIZE" if model.integrator == "sdirk" else "OWN"
    parts += [
        f"enum {{ WORKSPACE = {size} }};",
        "KERNEL int workspace_size(void) { return WORKSPACE; }",
    ]
    return "\n".join([*parts, ""])


def lanes_source(model: Model) -> str:
    """Return what a native FMU needs beside its kernel to step instances side by side; for explicit steps."""
    apart = with_fixed_apart(model)
    parts = [
        "#ifdef STACKED",
        lanes_function(apart.derivatives, "derivatives_lanes"),
        lanes_function(apart.outputs, "outputs_lanes"),
        "#endif",
    ]
    headers = [(_C / name).read_text(encoding="utf-8") for name in ("registers.h", "lanes.h")]
    return "\n".join([*headers, *parts])


def _tables(lists: Mapping[str, list[int]]) -> str:
    return "\n".join(
        f"static const int {name}[] = {{{', '.join(map(str, values))}}};"
        for name, values in lists.items()
    )


def kernel_functions(model: Model) -> dict[str, Function]:
    """The functions of a kernel by name."""
    return {
        "initialise": model.initialise,
        "outputs": model.outputs_function,
        "derivatives": model.derivatives,
        "requirements": model.requirements,
    }


def derivative_functions(model: Model) -> dict[str, Function]:
    """Products of the exact Jacobians with a direction, and of their transposes with a seed.

    ``direction`` and ``adjoint`` are of (ẋ, y) by (x, u, p, c); ``start_direction`` and ``start_adjoint`` of the
    initialisation (c, x) by p."""
    groups = {"x": model.states, "u": model.inputs, "p": model.parameters, "c": model.calculated}
    x, u, p, c = (symbols(name, len(group)) for name, group in groups.items())
    known = [x, u, p, c]
    follows = [*model.derivatives.of(*known), *model.outputs_function.of(*known)]
    start = model.initialise.of(p)
    return {
        "direction": _direction("direction", known, follows),
        "adjoint": _adjoint("adjoint", known, follows),
        "start_direction": _direction("start_direction", [p], start),
        "start_adjoint": _adjoint("start_adjoint", [p], start),
    }


def _direction(name: str, known: list[list[Expr]], follows: list[list[Expr]]) -> Function:
    directions = [symbols("d", len(vector)) for vector in known]
    point, along = list(chain(*known)), list(chain(*directions))
    return Function(
        name, [*known, *directions], [jtimes(values, point, along) for values in follows]
    )


def _adjoint(name: str, known: list[list[Expr]], follows: list[list[Expr]]) -> Function:
    seeds = [symbols("a", len(vector)) for vector in follows]
    total = iter(jtimes_transposed(list(chain(*follows)), list(chain(*known)), list(chain(*seeds))))
    return Function(name, [*known, *seeds], [list(islice(total, len(vector))) for vector in known])
