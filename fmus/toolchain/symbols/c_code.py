"""Functions of symbols as text of C: one line an operation.

Compilers take far more than twice as long for twice the lines of one function. A long one is therefore written in
parts: the same operations in the same order, with an array for what one part leaves to later ones."""

from fmus.toolchain.symbols.function import Function
from fmus.toolchain.symbols.operations import C, Op

PART = 300
"""Instructions of each part: a tenth as many make calls of them, ten times as many cost twice the time to compile."""


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
