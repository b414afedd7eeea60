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
from fmus.toolchain.symbols.c_code import c_function

LONGEST = 2_000
"""Instructions of a function that is not written in parts."""

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
