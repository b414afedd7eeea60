"""The C source of a native FMU: kernel, exact derivatives, the data of the model, and the functions of FMI.

One translation unit per version of FMI, with nothing in it but the C library."""

from itertools import chain, islice
from pathlib import Path

from fmus.toolchain.c_text import c_number, c_string
from fmus.toolchain.kernel import c_source
from fmus.toolchain.model import FmiVersion, Model
from fmus.toolchain.symbols import Expr, Function, jtimes, jtimes_transposed, symbols

_C = Path(__file__).with_name("c")
_SHORTEST_TEXT = 640  # room for a message [bytes] beside the longest rule or name it may quote


def native_source(model: Model, version: FmiVersion) -> str:
    """Source of the FMU's binary without its identity, which is a hash of this text."""
    parts = [
        "#define KERNEL static",
        c_source(model, derivative_functions(model)),
        _data(model),
        (_C / "instance.c").read_text(encoding="utf-8"),
        (_C / f"fmi{version[0]}.c").read_text(encoding="utf-8"),
    ]
    return "\n".join(parts)


def derivative_functions(model: Model) -> dict[str, Function]:
    """Products of the exact Jacobians with a direction, and of their transposes with a seed.

    ``direction`` and ``adjoint`` are of (ẋ, y) by (x, u, p, c); ``start_direction`` and ``start_adjoint`` of the
    initialisation (c, x) by p."""
    x, u, p, c = (
        symbols(name, len(group))
        for name, group in (("x", model.states), ("u", model.inputs), ("p", model.parameters), ("c", model.calculated))
    )
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
    return Function(name, [*known, *directions], [jtimes(values, point, along) for values in follows])


def _adjoint(name: str, known: list[list[Expr]], follows: list[list[Expr]]) -> Function:
    seeds = [symbols("a", len(vector)) for vector in follows]
    total = iter(jtimes_transposed(list(chain(*follows)), list(chain(*known)), list(chain(*seeds))))
    return Function(name, [*known, *seeds], [list(islice(total, len(vector))) for vector in known])


def _data(model: Model) -> str:
    parameters, rules = model.parameters, model.requirement_texts
    texts = [*rules, *model.value_references]
    start = [p.start for p in parameters] + [u.start for u in model.inputs]
    rows = [
        f"{{{p.type.upper()}, {c_number(p.minimum, '-INFINITY')}, {c_number(p.maximum, 'INFINITY')}, {int(p.tunable)}}}"
        for p in parameters
    ]
    lines = [
        f"enum {{ NR = {len(rules)}, TEXT = {_SHORTEST_TEXT + max(len(t.encode()) for t in texts)}, "
        f"INTERNAL_STEP = {model.value_references['internal_step']} }};",
        "enum kind { REAL, INTEGER, BOOLEAN };",
        'static const char *const KIND[] = {"Real", "Integer", "Boolean"};',
        "struct parameter { int kind; double minimum, maximum; int tunable; };",
        f"static const char *const NAME[] = {{{', '.join(map(c_string, model.value_references))}}};",
        f"static const double START[] = {{{', '.join(map(c_number, start))}}};",
        f"static const struct parameter PARAMETER[] = {{{', '.join(rows)}}};",
        f"static const char *const RULE[] = {{{', '.join(map(c_string, rules)) or '0'}}};",
    ]
    return "\n".join(lines)
