"""Long functions of generated C, cut into short ones: compilers take far more than twice as long for twice the lines.

CasADi writes a function as one line an operation, with a branch at each argument and result. Each part here does some
of these lines on an array in place of the local variables, without the branches: the same operations in the same order.
"""

import re

LONGEST = 20_000  # operations of a function that stays as it is
_PART = 300
"""Operations of each part: a tenth as many make calls of them, ten times as many cost twice the time to compile."""

_FUNCTION = re.compile(
    r"^static int (?P<name>\w+)\(const casadi_real\*\* arg, casadi_real\*\* res, casadi_int\* iw, "
    r"casadi_real\* w, int mem\) \{\n(?P<body>.*?)^  return 0;\n\}\n",
    re.DOTALL | re.MULTILINE,
)
_DECLARATION = re.compile(r"  casadi_real a\d+(, a\d+)*;")
_OPERATION = re.compile(r"  (a\d+=.*|if \(res\[\d+\]!=0\) res\[\d+\]\[\d+\]=.*);")
_ARGUMENT = re.compile(r"arg\[(\d+)\]\? arg\[\1\]\[(\d+)\] : 0")
_RESULT = re.compile(r"if \(res\[\d+\]!=0\) (?=res)")
_LOCAL = re.compile(r"\ba(\d+)\b")


def cut(source: str, longest: int = LONGEST, part: int = _PART) -> str:
    """The same C code, its long functions in parts.

    ``source``: As CasADi's code generator writes it. All pointers to arguments and results of a long function must be
    given, and its work array must have room for all its local variables, as its ``sz_w`` says.
    ``longest``, ``part``: Lines of a function that stays as it is, and of each part of others."""

    def in_parts(match: re.Match[str]) -> str:
        lines = [line for line in match["body"].split("\n") if line and not _DECLARATION.fullmatch(line)]
        if len(lines) <= longest:
            return match[0]
        if strange := next((line for line in lines if not _OPERATION.fullmatch(line)), None):
            raise ValueError(f"{match['name']}: {strange.strip()[:80]!r} is no operation that can be put elsewhere")
        name, texts, calls = match["name"], [], []
        for k, first in enumerate(range(0, len(lines), part)):
            body = "\n".join(map(_on_array, lines[first : first + part]))
            texts.append(
                f"static __attribute__((noinline)) void {name}_{k}("
                f"const casadi_real *const *arg, casadi_real *const *res, casadi_real *restrict w) {{\n{body}\n}}\n"
            )
            calls.append(f"  {name}_{k}((const casadi_real *const *)arg, res, w);\n")
        head = match[0].partition("\n")[0]
        return "".join([*texts, head, "\n", *calls, "  return 0;\n}\n"])

    return _FUNCTION.sub(in_parts, source)


def _on_array(line: str) -> str:
    line = _RESULT.sub("", _ARGUMENT.sub(r"arg[\1][\2]", line))
    return _LOCAL.sub(lambda match: f"w[{int(match[1])}]", line)
