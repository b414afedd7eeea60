"""A hub that is divided into halves, each of them divided again, with few ties between the two.

A network's answer at one bus to a current at another is a dense matrix, and no two of its elements are alike. But
whatever one half of a network tells the other goes through the few lines between them: between halves the matrix has a
rank of some tens, for thousands of rows. Kept as S₁₁, S₂₂ and such products, halves within halves,

    | S₁₁     U₁·V₁ᵀ |
    | U₂·V₂ᵀ  S₂₂    |

it is factorised and solved with a small part of the dense operations. Ties below a limit are left out, so a solution is
a close one: `HubFactors.solve_exactly` corrects it by the equations themselves."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.linalg import lapack

from orchestrator.core.arrays import Matrix, Vector

LEAST_PART = 128  # equations up to which a part is kept whole
_ROWS = (
    64  # of a large matrix that are looked at together: a copy of all takes longer than the look
)
_NEGLIGIBLE = 1e-9
"""Singular values of ties below this part of the rows' size are left out. Perturbation leaves noise of 1e-11 there, of
full rank: ranks were 24 at 1e-9 and 280 at 1e-11 (510 ports of 2,869 buses)."""

_DIRECTIONS = 64  # random directions that look for the ties of two halves, to begin with
_SPARE = 8  # how many of them must find nothing
_WORTH = 0.5  # a division that keeps more numbers than this part of the dense matrix is none
_TURNS = 60  # of the power iteration for the line along which a part is cut

Places = NDArray[np.int64]


@dataclass(frozen=True)
class _Tie:
    """Ties through which one half takes left·(hub·y + entered·x) of the other, for the other half's y and x."""

    left: Matrix
    hub: Matrix
    entered: Matrix


@dataclass(frozen=True)
class _Part:
    """Some of the hub's equations, which stand together, and the columns of R that belong to them."""

    hub: slice
    entered: slice
    # of a part that is kept whole: T and R among its own
    among: Matrix | None = None
    taken: Matrix | None = None
    halves: "tuple[_Part, _Part] | None" = None
    # first, what the first half takes of the second
    ties: tuple[_Tie, _Tie] | None = None

    @property
    def size(self) -> int:
        """Numbers that are kept."""
        own = [self.among, self.taken]
        for tie in self.ties or ():
            own += [tie.left, tie.hub, tie.entered]
        return sum(m.size for m in own if m is not None) + sum(h.size for h in self.halves or ())


@dataclass(frozen=True)
class DividedHub:
    """R and T of a hub's equations, in parts; they do not depend on σ.

    ``hub``: order of the hub's equations in the parts.
    ``entered``: what the parts take of the entered places, sparse, shape (columns of all parts, entered places).
    ``at_rest``: by equation in that order, whether σ stands in it."""

    hub: Places
    entered: sp.csr_array
    at_rest: NDArray[np.bool_]
    whole: _Part = field(repr=False)

    def at(self, sigma: complex, inside: sp.csc_array) -> "DividedFactors":
        """Factorise T − σ − R·inside; ``inside`` has the entered places as rows, and the hub's equations as columns."""
        ordered = sp.csr_array((self.entered @ inside)[:, self.hub])
        root, _ = _factors(
            self.whole, sigma * self.at_rest, ordered, np.zeros((len(self.hub), 0), dtype=complex)
        )
        return DividedFactors(self, root)


@dataclass(frozen=True)
class DividedFactors:
    hub: DividedHub
    root: "_Whole | _Tied"

    def solve(self, right: Vector, entered: Vector) -> Vector:
        """Solve for right − R·x, with the entered places' x; shapes (h, c) and (k, c)."""
        x = _numbers(times(self.hub.entered, entered))
        return _put_back(self.root.solve(right[self.hub.hub], x), self.hub.hub)

    def solve_adjoint(self, right: Vector) -> tuple[Vector, Vector]:
        """Return y and Rᵀ·y, shapes (h, c) and (k, c)."""
        out = np.zeros((self.hub.entered.shape[0], right.shape[1]), dtype=complex)
        y = self.root.solve_adjoint(right[self.hub.hub], _numbers(out))
        return _put_back(y, self.hub.hub), times(self.hub.entered.T, out)


@dataclass(frozen=True)
class _Whole:
    """A part that is kept whole, inverted: a product with few vectors is faster than two triangular solutions."""

    inverse: Vector
    taken: Matrix  # R

    def solve(self, right: Vector, entered: Matrix) -> Vector:
        """Solve for right − R·x, with the numbers of x (`_numbers`)."""
        return np.asarray(self.inverse @ (right - (self.taken @ entered).view(complex)))

    def solve_adjoint(self, right: Vector, out: Matrix) -> Vector:
        """Solve, and add the numbers of Rᵀ·y to ``out``."""
        y = _adjoint_times(self.inverse, right)
        out += self.taken.T @ _numbers(y)
        return y


@dataclass(frozen=True)
class _Tied:
    """Factors of two halves and of their ties: S⁻¹ = D⁻¹ − X·K⁻¹·Vᵀ·D⁻¹ with X = D⁻¹·U and K = I + Vᵀ·X.

    What goes through the ties is the same of both halves' answers and of what they take in: R has the ties of S."""

    halves: "tuple[_Whole | _Tied, _Whole | _Tied]"
    cut: int  # equations of the first half
    X: tuple[Vector, Vector]
    V: tuple[Vector, Vector]  # transposed; V₁ᵀ takes what is of the second half
    across: Vector  # K⁻¹
    entered: tuple[Matrix, Matrix]  # what the ties take of the other half's entered places
    entered_cut: int  # columns of R that belong to the first half

    def solve(self, right: Vector, entered: Matrix) -> Vector:
        """See `_Whole.solve`."""
        (first, second), cut = self.halves, self.entered_cut
        x = entered[:cut], entered[cut:]
        through = np.concatenate([self.entered[0] @ x[1], self.entered[1] @ x[0]])
        one, other = first.solve(right[: self.cut], x[0]), second.solve(right[self.cut :], x[1])
        return self.beside(one, other, through.view(complex))

    def beside(self, one: Vector, other: Vector, entered: Vector | float = 0.0) -> Vector:
        """Return the solution, given those of both halves alone, and what the ties take of the entered places."""
        through = self.across @ (np.concatenate([self.V[0] @ other, self.V[1] @ one]) + entered)
        ties = len(self.V[0])
        return np.concatenate(
            [one - self.X[0] @ through[:ties], other - self.X[1] @ through[ties:]]
        )

    def solve_adjoint(self, right: Vector, out: Matrix) -> Vector:
        """See `_Whole.solve_adjoint`: Uᵀ·y is known before y."""
        (first, second), cut = self.halves, self.entered_cut
        one, other = right[: self.cut], right[self.cut :]
        through = np.concatenate([_adjoint_times(self.X[0], one), _adjoint_times(self.X[1], other)])
        through = _adjoint_times(self.across, through)
        ties = len(self.V[0])
        out[cut:] += self.entered[0].T @ _numbers(through[:ties])
        out[:cut] += self.entered[1].T @ _numbers(through[ties:])
        one = first.solve_adjoint(one - _adjoint_times(self.V[1], through[ties:]), out[:cut])
        other = second.solve_adjoint(other - _adjoint_times(self.V[0], through[:ties]), out[cut:])
        return np.concatenate([one, other])


def _adjoint_times(matrix: Vector, right: Vector) -> Vector:
    """Aᴴ·b, without a copy of A."""
    return np.asarray((matrix.T @ right.conj()).conj())


def _factors(
    part: _Part, shift: Vector, inside: sp.csr_array, right: Vector
) -> "tuple[_Whole | _Tied, Vector]":
    """Return a part's factors and the solution of some right sides, shape (equations of the part, c).

    The ties of all larger parts are right sides of a smaller one, which is gone through once for all of them."""
    if part.halves is None or part.ties is None:
        assert part.among is not None
        assert part.taken is not None
        schur = part.among - _dense_times(part.taken, _within(inside, part))
        schur[np.diag_indices_from(schur)] -= shift[part.hub]
        whole = _Whole(np.linalg.inv(schur), part.taken)
        return whole, whole.inverse @ right
    halves, ties = part.halves, part.ties
    cut = halves[0].hub.stop - halves[0].hub.start
    (first, one), (second, other) = (
        _factors(half, shift, inside, np.hstack([tie.left, own]))
        for half, tie, own in zip(halves, ties, (right[:cut], right[cut:]), strict=True)
    )
    V = [
        tie.hub - _dense_times(tie.entered, _within(inside, half))
        for tie, half in zip(ties, reversed(halves), strict=True)
    ]
    begin, end = len(V[0]), len(V[1])
    X = np.ascontiguousarray(one[:, :begin]), np.ascontiguousarray(other[:, :end])
    among = np.eye(begin + end, dtype=complex)
    among[:begin, begin:] = V[0] @ X[1]
    among[begin:, :begin] = V[1] @ X[0]
    tied = _Tied(
        (first, second),
        cut,
        X,
        (V[0], V[1]),
        across=np.linalg.inv(among),
        entered=(ties[0].entered, ties[1].entered),
        entered_cut=halves[0].entered.stop - halves[0].entered.start,
    )
    return tied, tied.beside(one[:, begin:], other[:, end:])


def _within(inside: sp.csr_array, part: _Part) -> sp.csr_array:
    """The rows of a part; they have no columns elsewhere, as no group is parted."""
    first, last = part.entered.start, part.entered.stop
    begin, end = inside.indptr[first], inside.indptr[last]
    rows = inside.indptr[first : last + 1] - begin
    columns = inside.indices[begin:end] - part.hub.start
    shape = (last - first, part.hub.stop - part.hub.start)
    return sp.csr_array((inside.data[begin:end], columns, rows), shape=shape)


def _dense_times(dense: Matrix, inside: sp.csr_array) -> Matrix:
    return np.asarray((inside.T @ dense.T).T)


def _put_back(ordered: Vector, order: Places) -> Vector:
    found = np.empty_like(ordered)
    found[order] = ordered
    return found


def _numbers(vectors: Vector) -> Matrix:
    """The real and imaginary parts of vectors beside each other, without a copy where they lie row by row."""
    return np.ascontiguousarray(vectors, dtype=complex).view(float)


def times(real: Matrix | sp.csr_array, vector: Vector) -> Vector:
    """A real matrix times vectors, whose real and imaginary parts are taken together, without a complex copy."""
    if not np.iscomplexobj(vector):
        return np.asarray(real @ vector)
    columns = vector.reshape(len(vector), vector.shape[1] if vector.ndim == 2 else 1)
    if sp.issparse(real) and columns.shape[1] == 1:  # two columns take longer than each by itself
        apart = (
            real @ np.ascontiguousarray(part) for part in (columns[:, 0].real, columns[:, 0].imag)
        )
        found = np.empty(real.shape[0], dtype=complex)
        found.real, found.imag = apart
        return found.reshape(real.shape[0], *vector.shape[1:])
    product = real @ np.ascontiguousarray(columns).view(float)
    return np.ascontiguousarray(product).view(complex).reshape(real.shape[0], *vector.shape[1:])


def through_lu(lu: tuple[Matrix, Places], right: Vector, *, adjoint: bool = False) -> Vector:
    """Solve by the factors of `scipy.linalg.lu_factor`, right sides of shape (n, c).

    SciPy's ``lu_solve`` does the same, but takes longer to look at its arguments than a small part takes to solve."""
    factors, pivots = lu
    if not right.size:
        return np.empty(right.shape, dtype=np.result_type(factors, right))
    is_complex = np.iscomplexobj(factors) or np.iscomplexobj(right)
    solve = lapack.zgetrs if is_complex else lapack.dgetrs
    found, _ = solve(factors, pivots, right, trans=2 if adjoint else 0)
    return np.asarray(found)


class SomeRows(Protocol):
    """A matrix of which some rows at a time are looked at."""

    def __len__(self) -> int: ...

    def __getitem__(self, rows: slice, /) -> Matrix: ...

    def take(self, columns: Places, axis: int, /) -> "SomeRows":
        """Some of its columns, for which ``axis`` is 1."""


def divide(
    T: Matrix, R: SomeRows, scale: Vector, at_rest: NDArray[np.bool_], owner: Places, taker: Places
) -> DividedHub | None:
    """Divide a hub; None where its parts have too many ties.

    Parameters
    ----------
    T, R
        The hub's equations by its own unknowns and by the entered places, shapes (h, h) and (h, k).
    scale
        Size of each equation, without the diagonal of T.
    at_rest
        Equations in which σ stands, shape (h,).
    owner, taker
        Group of each of the hub's unknowns and of each entered place; what is of one group is not parted.
    """
    L, in_common, taker = _in_common(R, scale, taker)
    sizes = np.bincount(owner)
    leaves = _leaves(_nearness(T, L, owner, taker), sizes)
    place = np.empty(len(sizes), dtype=np.int64)
    place[np.concatenate(leaves)] = np.arange(len(sizes))
    hub, entered = (np.argsort(place[of], kind="stable") for of in (owner, taker))
    cuts = np.cumsum([0, *map(len, leaves)])
    edges = [np.searchsorted(place[of][o], cuts) for of, o in ((owner, hub), (taker, entered))]
    T, L = _in_order(T, hub, hub), _in_order(L, hub, entered)
    builder = _Builder(T, L, scale[hub], edges)
    whole = builder.part(0, len(leaves))
    if whole.size > _WORTH * (T.size + L.size):
        return None
    return DividedHub(hub, in_common[entered], at_rest[hub], whole)


def _in_common(R: SomeRows, scale: Vector, taker: Places) -> tuple[Matrix, sp.csr_array, Places]:
    """Return all that the hub takes of each group in as few columns as say it: R = L·C.

    All currents of a bus move the hub as currents of that bus do, whatever device they come from.

    Returns
    -------
    L of shape (h, c), C as sparse rows, shape (c, k), and the group of each column of L.
    """
    if not len(taker):
        return R[:], sp.csr_array((0, 0)), taker
    order = np.argsort(taker, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(taker[order])) + 1)
    tried = max(map(len, groups)) + _SPARE
    weights = np.random.default_rng(0).standard_normal((tried, len(R))) / np.sqrt(tried) / scale
    parts = [slice(begin, begin + _ROWS) for begin in range(0, len(R), _ROWS)]
    answers = sum((weights[:, part] @ R[part] for part in parts), np.zeros((tried, len(taker))))
    found = [_told_by_some(answers[:, group], len(R)) for group in groups]
    L = R.take(
        np.concatenate([group[few] for group, (few, _) in zip(groups, found, strict=True)]), 1
    )
    common = sp.block_diag([parts for _, parts in found], format="csr")[:, np.argsort(order)]
    owners = taker[[group[0] for group in groups]]
    return L[:], common, np.repeat(owners, [len(few) for few, _ in found])


def _told_by_some(answers: Matrix, rows: int) -> tuple[Places, Matrix]:
    """Return a few of some columns, and all of them as sums of these, shape (few, columns).

    What is left over is as small as ties that are left out."""
    _, triangle, order = scipy.linalg.qr(answers, mode="economic", pivoting=True)
    count = int((np.abs(triangle.diagonal()) > _NEGLIGIBLE * np.sqrt(rows)).sum())
    parts = np.empty((count, len(order)))
    parts[:, order[:count]] = np.eye(count)
    parts[:, order[count:]] = scipy.linalg.solve_triangular(
        triangle[:count, :count], triangle[:count, count:]
    )
    return order[:count], parts


def _in_order(matrix: Matrix, rows: Places, columns: Places) -> Matrix:
    """The matrix with its rows and columns in another order."""
    found = np.empty(matrix.shape)
    for begin in range(0, len(rows), _ROWS):
        some = slice(begin, begin + _ROWS)
        np.take(matrix[rows[some]], columns, axis=1, out=found[some], mode="clip")
    return found


@dataclass(frozen=True)
class _Builder:
    T: Matrix
    R: Matrix
    scale: Vector  # size of each row
    edges: list[Places]  # where each leaf begins, among the hub's equations and the entered places

    def part(self, first: int, last: int) -> _Part:
        """Build the part of some neighbouring leaves; it is kept whole where its halves have too many ties."""
        hub, entered = (slice(int(e[first]), int(e[last])) for e in self.edges)
        if last - first > 1:
            middle = (first + last) // 2
            one, other = self.part(first, middle), self.part(middle, last)
            there, back = self._tie(one, other), self._tie(other, one)
            if there is not None and back is not None:
                return _Part(hub, entered, halves=(one, other), ties=(there, back))
        return _Part(hub, entered, self.T[hub, hub].copy(), self.R[hub, entered].copy())

    def _tie(self, taking: _Part, giving: _Part) -> _Tie | None:
        rows = taking.hub
        T, R, scale = self.T[rows, giving.hub], self.R[rows, giving.entered], self.scale[rows, None]
        random, count = np.random.default_rng(0), _DIRECTIONS
        least = _NEGLIGIBLE * np.sqrt(len(self.scale))
        while True:
            count = min(count, *T.shape)
            tried = (random.standard_normal((m.shape[1], count)) for m in (T, R))
            answers = sum(m @ turns for m, turns in zip((T, R), tried, strict=True)) / scale
            basis = np.linalg.qr(answers)[0]
            across = (basis / scale).T
            along = np.hstack([across @ T, across @ R])
            u, sizes = _left_singular(along)
            rank = int((sizes > least).sum())
            if rank <= count - _SPARE:
                break
            if 2 * count >= min(T.shape):
                return None
            count *= 2
        right = u[:, :rank].T @ along
        left = scale * (basis @ u[:, :rank])
        cut = T.shape[1]
        return _Tie(left, right[:, :cut].copy(), right[:, cut:].copy())


def _left_singular(along: Matrix) -> tuple[Matrix, Vector]:
    """Return the left singular vectors and the singular values of a matrix of few rows and many columns."""
    square = scipy.linalg.qr(along.T, mode="r", check_finite=False)[0][: len(along)].T
    u, sizes, _ = scipy.linalg.svd(square, full_matrices=False, check_finite=False)
    return u, sizes


def _nearness(T: Matrix, R: Matrix, owner: Places, taker: Places) -> Matrix:
    """How much each group takes of each other, as parts of what it takes."""
    groups = int(owner.max()) + 1
    size = np.maximum(_largest(T), _largest(R))
    size[size == 0] = 1.0
    into = sp.csr_array((1 / size, (owner, np.arange(len(owner)))), shape=(groups, len(owner)))
    found = np.asarray(into @ (_sums(T, owner, groups) + _sums(R, taker, groups)))
    sums = np.linalg.norm(found, axis=1, keepdims=True)
    return found / np.where(sums > 0, sums, 1.0)


def _largest(matrix: Matrix) -> Vector:
    """Return the largest size in each row."""
    highest, lowest = matrix.max(axis=1, initial=0.0), matrix.min(axis=1, initial=0.0)
    return np.asarray(np.maximum(highest, -lowest))


def _sums(matrix: Matrix, of: Places, groups: int) -> Matrix:
    """Sums of the sizes in each row, by the group of the columns."""
    order = np.argsort(of, kind="stable")
    numbers, first = np.unique(of[order], return_index=True)
    found = np.zeros((len(matrix), groups))
    for begin in range(0, len(matrix) if len(order) else 0, _ROWS):
        rows = slice(begin, begin + _ROWS)
        ordered = np.take(matrix[rows], order, axis=1)
        found[rows, numbers] = np.add.reduceat(np.abs(ordered, out=ordered), first, axis=1)
    return found


def _leaves(near: Matrix, sizes: Places) -> list[Places]:
    """Groups of each leaf; as many leaves as a power of two, so that halves have equal depth."""
    leaves = [np.flatnonzero(sizes > 0)]
    while max(int(sizes[leaf].sum()) for leaf in leaves) > LEAST_PART and all(
        len(leaf) > 1 for leaf in leaves
    ):
        leaves = [half for leaf in leaves for half in _cut(near, leaf, sizes)]
    return leaves


def _cut(near: Matrix, groups: Places, sizes: Places) -> tuple[Places, Places]:
    """Cut where the groups tell each other least: along the second eigenvector of what they tell, by their own sums.

    Far groups tell each other little and not nothing; a fourth root makes them count, and the cut follows the
    network. Six digits are enough for where it runs."""
    tell = near[np.ix_(groups, groups)].astype(np.float32)
    tell = np.sqrt(np.sqrt(tell + tell.T))
    np.fill_diagonal(tell, 0.0)
    sums = tell.sum(axis=1)
    sums[sums == 0] = 1.0
    root = np.sqrt(sums)
    first = root / np.linalg.norm(root)
    tell /= root[:, None] * root
    along = np.random.default_rng(0).standard_normal(len(groups)).astype(np.float32)
    for _ in range(_TURNS):
        along -= first * (first @ along)
        along += tell @ along
        along /= np.linalg.norm(along)
    order = groups[np.argsort(along / root, kind="stable")]
    reached = np.cumsum(sizes[order])
    middle = int(np.searchsorted(reached, reached[-1] / 2)) + 1
    middle = min(max(middle, 1), len(order) - 1)
    return np.sort(order[:middle]), np.sort(order[middle:])
