"""Functions of symbols as text of C: one line an operation.

Compilers take far more than twice as long for twice the lines of one function. A long one is therefore written in
parts, which work on an array in place of local variables: the same operations in the same order."""

from collections.abc import Iterable, Iterator

from fmus.toolchain.symbols.function import Function, Instruction
from fmus.toolchain.symbols.operations import C, Op

PART = 300
"""Instructions of each part: a tenth as many make calls of them, ten times as many cost twice the time to compile."""

_ON_LOCALS = {op: "  a{2}=" + form.replace("{", "a{") + ";\n" for op, form in C.items()}
_ON_ARRAY = {op: "  w[{2}]=" + form.replace("{0}", "w[{0}]").replace("{1}", "w[{1}]") + ";\n" for op, form in C.items()}


def c_function(function: Function, name: str, longest: int) -> str:
    """Text of ``static void name(const double **arg, double **res, double *w)``.

    ``w`` has room for ``function.room`` numbers; ``longest``: instructions of a function that is not in parts."""
    head, instructions = f"static void {name}(const double **arg, double **res, double *w) {{\n", function.instructions
    if len(instructions) <= longest:
        places = ", ".join(f"a{k}" for k in range(function.room))
        local = f"  double {places};\n" if places else ""
        return "".join([head, "  (void)arg, (void)w;\n", local, *_lines(instructions, _ON_LOCALS, "a{}"), "}\n"])
    texts, calls = [], []
    for first in range(0, len(instructions), PART):
        part = f"{name}_{first // PART}"
        lines = _lines(instructions[first : first + PART], _ON_ARRAY, "w[{}]")
        types = "const double *const *arg, double *const *res, double *restrict w"
        texts.append("".join([f"static __attribute__((noinline)) void {part}({types}) {{\n", *lines, "}\n"]))
        calls.append(f"  {part}((const double *const *)arg, res, w);\n")
    return "".join([*texts, head, *calls, "}\n"])


def _lines(instructions: Iterable[Instruction], forms: dict[int, str], place: str) -> Iterator[str]:
    for op, result, a, b, value in instructions:
        if op == Op.INPUT:
            yield f"  {place.format(result)}=arg[{a}][{b}];\n"
        elif op == Op.OUTPUT:
            yield f"  res[{result}][{a}]={place.format(b)};\n"
        elif op == Op.CONST:
            yield f"  {place.format(result)}={repr(value).replace('inf', 'INFINITY').replace('nan', 'NAN')};\n"
        else:
            yield forms[op].format(a, b, result)
