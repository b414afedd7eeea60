"""From a model to a compiled kernel: functions in C that a slave calls.

Every quantity of a model instance lives in one vector z, indexed by FMI value reference:
z = [p | c | u | x | y | ẋ]. A kernel is these functions on it:

- ``initialise(z)``: c and x from p;
- ``outputs(z)``: y from x, u;
- ``derivatives(z)``: ẋ from x, u;
- ``advance(z, h, n, workspace)``: n steps of h seconds at constant u, then y; returns 0, or 1 + the
  index of the first state that is no longer finite. ``workspace_size()`` tells how many numbers of
  its own it needs between calls;
- ``requirements(z, r)``: the model may run where every r > 0.

`tape` writes the same functions as data."""

from collections.abc import Mapping
from pathlib import Path

from fmus.toolchain.elimination_plan import plan_elimination
from fmus.toolchain.model import Model
from fmus.toolchain.symbols import Function
from fmus.toolchain.symbols.operations import C, Op

PART = 300
"""Instructions of each part of a long function, with an array for what one part leaves to later ones. Compilers take
far more than twice as long for twice the lines: a tenth as many make calls of them, ten times as many cost twice the
time to compile."""


def c_function(function: Function, name: str, longest: int) -> str:
    """Text of ``static void name(const double **arg, double **res, double *w)``.

    ``w`` has room for ``function.room`` numbers; ``longest``: instructions of a function that is not in parts."""
    types = "(const double *const *arg, double *const *res, double *restrict w) {\n"
    instructions = function.instructions
    part = PART if len(instructions) > longest else max(1, len(instructions))
    apart = "__attribute__((noinline)) " if len(instructions) > part else ""
    left = _left_to_later(function, part)
    held: dict[int, str] = {}  # what holds the value of each place
    texts, calls = [], []
    for first in range(0, len(instructions), part):
        texts.append(f"static {apart}void {name}_{first // part}{types}  (void)arg, (void)w;\n")
        for k, (op, place, a, b, value) in enumerate(instructions[first : first + part], first):
            if op == Op.OUTPUT:
                texts.append(f"  res[{place}][{a}]={held[b]};\n")
                continue
            if op == Op.INPUT:
                text = f"arg[{a}][{b}]"
            elif op == Op.CONST:
                text = repr(value).replace("inf", "INFINITY").replace("nan", "NAN")
            else:
                text = C[op].format(held[a], held[b])
            held[place] = f"w[{place}]" if k in left else f"v{k}"
            texts.append(f"  {'' if k in left else 'double '}{held[place]}={text};\n")
        texts.append("}\n")
        calls.append(f"  {name}_{first // part}((const double *const *)arg, res, w);\n")
    head = f"static void {name}(const double **arg, double **res, double *w) {{\n  (void)arg, (void)res, (void)w;\n"
    return "".join([*texts, head, *calls, "}\n"])


def _left_to_later(function: Function, part: int) -> set[int]:
    """Numbers of the instructions whose value a later part reads."""
    found = set[int]()
    written: dict[int, int] = {}
    for k, (op, place, a, b, _) in enumerate(function.instructions):
        for read in (a, b) if op < Op.CONST else (b,) if op == Op.OUTPUT else ():
            if written[read] // part != k // part:
                found.add(written[read])
        if op != Op.OUTPUT:
            written[place] = k
    return found


LONGEST = 2_000  # instructions of a function that is not written in parts

_C = Path(__file__).with_name("c")


def c_source(model: Model, further: Mapping[str, Function] | None = None) -> str:
    """The whole C kernel of a model as one translation unit.

    ``further``: Functions by name whose code is wanted beside the kernel's own; the enumerator ``NWD`` is the room they
    need."""
    functions = kernel_functions(model)
    further = dict(further or {})
    sizes = {
        "NP": len(model.parameters), "NC": len(model.calculated), "NU": len(model.inputs), "NX": len(model.states),
        "NY": len(model.outputs),
    }  # fmt: skip
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
    sizes["NW"] = max(1, *(f.room for f in functions.values()))
    if further:
        sizes["NWD"] = max(1, *(f.room for f in further.values()))
    code = [c_function(function, f"{name}_code", LONGEST) for name, function in (functions | further).items()]
    enumeration = "enum { " + ", ".join(f"{name} = {value}" for name, value in sizes.items()) + " };\n"
    parts = ["#include <math.h>", *code, enumeration, tables]
    parts += [(_C / name).read_text(encoding="utf-8") for name in ("kernel.c", f"{model.integrator}.c")]
    kept = "IMPLICIT_SIZE" if model.integrator == "sdirk" else "0"
    return "\n".join([*parts, f"KERNEL int workspace_size(void) {{ return {kept}; }}", ""])


def _tables(lists: Mapping[str, list[int]]) -> str:
    return "\n".join(
        f"static const int {name}[] = {{{', '.join(map(str, values))}}};" for name, values in lists.items()
    )


def kernel_functions(model: Model) -> dict[str, Function]:
    """The functions of a kernel by name."""
    return {
        "initialise": model.initialise,
        "outputs": model.outputs_function,
        "derivatives": model.derivatives,
        "requirements": model.requirements,
    }
