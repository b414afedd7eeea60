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

import casadi as ca

from fmus.toolchain.elimination import plan_elimination
from fmus.toolchain.long_functions import cut
from fmus.toolchain.model import Model

_C = Path(__file__).with_name("c")


def c_source(model: Model, further: Mapping[str, ca.Function] | None = None) -> str:
    """The whole C kernel of a model as one translation unit.

    ``further``: Functions by name whose code is wanted beside the kernel's own; the enumerator ``NWD`` is the room they
    need."""
    functions = {
        "initialise": model.initialise,
        "outputs": model.outputs_function,
        "derivatives": model.derivatives,
        "requirements": model.requirements,
    }
    further = dict(further or {})
    sizes = {
        "NP": len(model.parameters),
        "NC": len(model.calculated),
        "NU": len(model.inputs),
        "NX": len(model.states),
        "NY": len(model.outputs),
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
    sizes["NW"] = max(1, *(f.sz_w() for f in functions.values()))
    if further:
        sizes["NWD"] = max(f.sz_w() for f in further.values())
    generator = ca.CodeGenerator(
        model.name, {"with_header": False, "main": False, "verbose": False, "with_export": False}
    )
    for name, function in (functions | further).items():
        generator.add(scalar_function(function, f"{name}_code"))
    enumeration = "enum { " + ", ".join(f"{name} = {value}" for name, value in sizes.items()) + " };\n"
    parts = [cut(str(generator.dump())), enumeration, tables]
    parts += [(_C / name).read_text(encoding="utf-8") for name in ("kernel.c", f"{model.integrator}.c")]
    kept = "IMPLICIT_SIZE" if model.integrator == "sdirk" else "0"
    return "\n".join([*parts, f"KERNEL int workspace_size(void) {{ return {kept}; }}", ""])


def _tables(lists: Mapping[str, list[int]]) -> str:
    return "\n".join(
        f"static const int {name}[] = {{{', '.join(map(str, values))}}};" for name, values in lists.items()
    )


def scalar_function(function: ca.Function, name: str) -> ca.Function:
    """The same function under another name, in scalar operations, with dense outputs."""
    inputs = [ca.SX.sym("a", function.sparsity_in(k)) for k in range(function.n_in())]
    outputs = [ca.densify(e) for e in function.call(inputs)]
    return ca.Function(name, inputs, outputs)
