"""A tape executed in pure Python, where no library for it fits the platform.

The FMU takes this file along as a module of its own, so it needs a Python and nothing else. Operations and their order
are those of ``c/tape.c``, so both give the same results to rounding."""

import math
import struct
import zlib
from array import array
from functools import lru_cache
from math import copysign, fabs, inf, isfinite, isnan, nan

VERSION = 1
G = 0.29289321881345254
FIXED, INITIALISE, REQUIREMENTS, OUTPUTS, DERIVATIVES, MATRIX, CURRENTS = SECTIONS = range(7)
SIZES = (
    "np",
    "nc",
    "nu",
    "nx",
    "ny",
    "implicit",
    "held",
    "given",
    "buses",
    "rank",
    "nm",
    "nlu",
    "numbers",
    "fixed",
    "slots",
)

# Arithmetic as in C: what is undefined becomes inf or nan and is found by its name after the step.


def divide(a, b):
    try:
        return a / b
    except ZeroDivisionError:
        return copysign(inf, a) * copysign(1.0, b) if a and not isnan(a) else nan


def power(a, b):
    try:
        return math.pow(a, b)
    except (ValueError, OverflowError):
        return nan if a < 0.0 else inf


def log(a):
    return -inf if a == 0.0 else _log(a)


def as_in_c(function, undefined):
    """Let a function give ``undefined`` where Python's own raises an error."""

    def evaluate(a):
        try:
            return function(a)
        except (ValueError, OverflowError):
            return undefined

    return evaluate


_log = as_in_c(math.log, nan)
NAMES = {
    "divide": divide,
    "power": power,
    "sqrt": as_in_c(math.sqrt, nan),
    "log": log,
    "exp": as_in_c(math.exp, inf),
    "sin": as_in_c(math.sin, nan),
    "cos": as_in_c(math.cos, nan),
    "tan": as_in_c(math.tan, nan),
    "atan2": math.atan2,
    "copysign": math.copysign,
    "fabs": math.fabs,
    "floor": math.floor,
}
FORMS = (
    *(
        "{0} + {1}",
        "{0} - {1}",
        "{0} * {1}",
        "divide({0}, {1})",
        "power({0}, {1})",
        "atan2({0}, {1})",
    ),
    *("copysign({0}, {1})", "min({0}, {1})", "max({0}, {1})"),
    *(
        f"1.0 if {{0}} {compared} {{1}} else 0.0"
        for compared in ("<", "<=", "==", "!=", "and", "or")
    ),
    *("{1} if {0} else 0.0", "-{0}", "divide(1.0, {0})", "{0} * {0}", "2.0 * {0}"),
    *(f"{name}({{0}})" for name in ("sqrt", "sin", "cos", "tan", "exp", "log", "fabs", "floor")),
    "0.0 if {0} else 1.0",
    *(
        "{0} * {1} + {2}",
        "{0} * {1} - {2}",
        "{2} - {0} * {1}",
        "{0} * {1} + {2} * {3}",
        "{0} * {1} - {2} * {3}",
    ),
)
"""By code of an operation."""
TAKES = [sum(f"{{{k}}}" in form for k in range(4)) for form in FORMS]


class Tape:
    """Content of a tape: sizes, lists, and a function of the slots before its own for each section."""

    def __init__(self, content):
        head = struct.calcsize("<8s4I")
        if len(content) < head or content[:8] != b"gfortape":
            raise ValueError("it is no tape")
        _, version, size, checksum, _ = struct.unpack_from("<8s4I", content)
        if version != VERSION:
            raise ValueError("it is of another version")
        if size != len(content) or checksum != zlib.crc32(content[head:]):
            raise ValueError("its checksum differs")
        self._rest = memoryview(content)[head:]
        (self.largest_rest,) = self._take("d", 1)
        for name, value in zip(SIZES, self._take("i", len(SIZES))):
            setattr(self, name, value)
        lengths = self._take("i", 3 * len(SECTIONS))
        self.values = self._take("d", self.numbers)
        self.stepwise, self.given_at = self._take("i", self.held), self._take("i", self.given)
        self.perm, self.row, self.col = (
            self._take("i", n) for n in (self.rank, self.rank + 1, self.nlu)
        )
        self.diag, self.mrow, self.mcol = (
            self._take("i", n) for n in (self.rank, self.rank + 1, self.nm)
        )
        first = self.np + self.nc + self.nu + self.nx + 2 * self.buses + 1 + self.numbers
        self.section = []
        for which in SECTIONS:
            runs, results, operands = lengths[3 * which : 3 * which + 3]
            lists = self._take("i", 2 * runs), self._take("i", results), self._take("i", operands)
            self.section.append(
                _function(first if which == FIXED else first + self.fixed, which == FIXED, *lists)
            )

    def _take(self, kind, count):
        taken = array(kind)
        size = count * taken.itemsize
        taken.frombytes(self._rest[:size])
        self._rest = self._rest[size:]
        return taken.tolist()


def _function(first, keeps_all, runs, results, operands):
    """A section as straight-line Python, one line an operation."""
    lines, taken, place = [], iter(operands), first
    for code, count in zip(runs[::2], runs[1::2]):
        for _ in range(count):
            sides = [f"w{next(taken)}" for _ in range(TAKES[code])]
            lines.append(f"    w{place} = " + FORMS[code].format(*sides))
            place += 1
    given = sorted({slot for slot in (*operands, *results) if slot < first})
    named = range(first, place) if keeps_all else results
    head = ["def section(slots):", *(f"    w{slot} = slots[{slot}]" for slot in given)]
    scope = dict(NAMES)
    exec(
        "\n".join([*head, *lines, f"    return [{', '.join(f'w{slot}' for slot in named)}]"]), scope
    )
    return scope["section"]


@lru_cache(maxsize=1)
def read(content):
    return Tape(content)


class Kernel:
    """The functions of a kernel for one instance."""

    def __init__(self, content, variables):
        self._tape = t = read(content)
        self._c, self._u = t.np, t.np + t.nc
        self._x = self._u + t.nu
        self._y = self._x + t.nx
        self._dx = self._y + t.ny
        if self._dx + t.nx != variables:
            raise ValueError("it is of another model")
        self._blank = [0.0] * (2 * t.buses)
        self._made_of = self._fixed = self._key = self._factors = None

    def _slots(self, z, x, gh=0.0):
        t, known = self._tape, struct.pack(f"{self._u}d", *z[: self._u])  # by their bits
        if known != self._made_of:
            slots = z[: self._y] + self._blank + [0.0] + t.values
            self._fixed, self._made_of = t.section[FIXED](slots), known
        return z[: self._x] + x + self._blank + [gh] + t.values + self._fixed

    def _at_states(self, which, z, x):
        if which == DERIVATIVES and not x:
            return []
        slots = self._slots(z, x)
        if self._tape.buses:
            slots[self._y : self._y + 2 * self._tape.buses] = self._voltages(slots)
        return self._tape.section[which](slots)

    def initialise(self, z):
        t = self._tape
        slots = z[: self._y] + self._blank + [0.0] + t.values + [0.0] * t.fixed
        found = t.section[INITIALISE](slots)
        z[self._c : self._u], z[self._x : self._y] = found[: t.nc], found[t.nc :]

    def outputs(self, z):
        z[self._y : self._dx] = self._at_states(OUTPUTS, z, z[self._x : self._y])

    def derivatives(self, z):
        z[self._dx : self._dx + self._tape.nx] = self._at_states(
            DERIVATIVES, z, z[self._x : self._y]
        )

    def requirements(self, z, margins):
        found = self._tape.section[REQUIREMENTS](self._slots(z, z[self._x : self._y]))
        margins[: len(found)] = found

    def advance(self, z, h, n, workspace=None):
        x = z[self._x : self._y]
        z[self._x : self._y] = x = (
            self._implicitly(z, x, h, n) if self._tape.implicit else self._explicitly(z, x, h, n)
        )
        for index, value in enumerate(x):
            if not isfinite(value):
                return index + 1
        self.outputs(z)
        return 0

    def _explicitly(self, z, x, h, n):
        held = self._tape.stepwise

        def rates(x):
            found = self._at_states(DERIVATIVES, z, x)
            for index in held:
                found[index] = 0.0
            return found

        first = self._at_states(DERIVATIVES, z, x) if held else []
        for _ in range(n):
            k1 = rates(x)
            k2 = rates([a + h / 2 * k for a, k in zip(x, k1)])
            k3 = rates([a + h / 2 * k for a, k in zip(x, k2)])
            k4 = rates([a + h * k for a, k in zip(x, k3)])
            x = [a + h / 6 * (b + 2 * c + 2 * d + e) for a, b, c, d, e in zip(x, k1, k2, k3, k4)]
        for index in held:
            x[index] += n * h * first[index]
        return x

    def _implicitly(self, z, x, h, n):
        key = struct.pack(f"{self._u + 1}d", h, *z[: self._u])
        if key != self._key:
            elements = self._tape.section[MATRIX](self._slots(z, x, G * h))
            self._factors, self._key = (
                self._factorise(elements, 0.0, lambda pivot: divide(1.0, pivot)),
                key,
            )
        for _ in range(n):
            k1 = self._solve(self._at_states(DERIVATIVES, z, x))
            k2 = self._solve(
                self._at_states(DERIVATIVES, z, [a + (1 - G) * h * k for a, k in zip(x, k1)])
            )
            x = [a + h * ((1 - G) * b + G * c) for a, b, c in zip(x, k1, k2)]
        return x

    def _factorise(self, elements, zero, inverted):
        t = self._tape
        lu, inverse = [zero] * t.nlu, [zero] * t.rank
        for i in range(t.rank):
            row = dict.fromkeys(t.col[t.row[i] : t.row[i + 1]], zero)
            for q in range(t.mrow[i], t.mrow[i + 1]):
                row[t.mcol[q]] = elements[q]
            for q in range(t.row[i], t.diag[i]):
                k = t.col[q]
                row[k] = factor = row[k] * inverse[k]
                for r in range(t.diag[k] + 1, t.row[k + 1]):
                    row[t.col[r]] -= factor * lu[r]
            for q in range(t.row[i], t.row[i + 1]):
                lu[q] = row[t.col[q]]
            inverse[i] = inverted(row[i])
        return lu, inverse

    def _solve(self, b):
        found = [0.0] * self._tape.rank
        for place, value in zip(
            self._tape.perm, self._through_factors([b[place] for place in self._tape.perm])
        ):
            found[place] = value
        return found

    def _through_factors(self, b):
        """The solution from the right side, both in the order of elimination."""
        t, (lu, inverse), v = self._tape, self._factors, []
        for i in range(t.rank):
            known = b[i]
            for q in range(t.row[i], t.diag[i]):
                known -= lu[q] * v[t.col[q]]
            v.append(known)
        for i in range(t.rank - 1, -1, -1):
            known = v[i]
            for q in range(t.diag[i] + 1, t.row[i + 1]):
                known -= lu[q] * v[t.col[q]]
            v[i] = known * inverse[i]
        return v

    def _voltages(self, slots):
        """Return the voltages of a network that is solved as data: real parts, then imaginary parts."""
        t, u = self._tape, self._u
        key = struct.pack(f"{u + t.given}d", *slots[:u], *(slots[u + k] for k in t.given_at))
        if key != self._key:
            self._factorise_nodes(_complex(t.section[MATRIX](slots)))
            self._key = key
        v = self._solve(_complex(t.section[CURRENTS](slots)))
        return [value.real for value in v] + [value.imag for value in v]

    def _factorise_nodes(self, elements):
        t, unknown = self._tape, complex(nan, nan)
        self._factors = self._factorise(elements, 0j, lambda pivot: 1 / pivot if pivot else unknown)
        b = [complex(math.cos(place), math.sin(place)) for place in t.perm]
        s = self._through_factors(b)
        for i in range(
            t.rank
        ):  # a trial solution leaves hardly anything over, or no voltage is finite
            terms = [elements[q] * s[t.mcol[q]] for q in range(t.mrow[i], t.mrow[i + 1])] + [-b[i]]
            rest = sum(terms)
            if fabs(rest.real) + fabs(rest.imag) > t.largest_rest * sum(
                fabs(a.real) + fabs(a.imag) for a in terms
            ):
                self._factors = self._factors[0], [unknown] * t.rank


def _complex(parts):
    return [complex(re, im) for re, im in zip(parts[: len(parts) // 2], parts[len(parts) // 2 :])]
