"""All eigenvalues of a real matrix, and eigenvectors of only those that are asked for.

LAPACK's driver for eigenvectors computes all of them, on both sides, which in a large system takes two fifths of its
time. Here its steps are taken one by one: balancing, Hessenberg form, real Schur form A = Q·T·Qᵀ. They are those of the
driver, so that the eigenvalues are the same to the last bit. Then only the wanted vectors are computed from T. What
a few vectors have of every mode comes from T's own eigenvectors, without A's.

Other threads of Python run meanwhile, which they do not during SciPy's `eig`."""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from orchestrator.core.arrays import Matrix, Vector

_ROUTINES = {"dgebal": 5, "dgehrd": 6, "dorghr": 6, "dhseqr": 7, "dtrevc": 8, "dgebak": 6}
"""How many arguments of each routine are integers of 32 bits, or logical values."""
# matrices whose largest element lies outside are scaled by LAPACK's driver, and left to it
_SIZES = (1e-120, 1e120)


class RealSchur:
    """The Schur form of a balanced matrix.

    ``A``: Real, shape (n, n), n > 0.

    ``values``: All eigenvalues, shape (n,): the same as those of `scipy.linalg.eig`, in the same order."""

    def __init__(self, A: Matrix) -> None:
        A = np.asarray_chkfinite(A, dtype=float)
        self._all: tuple[Vector, Vector] | None = None
        if lapack() is None or not _SIZES[0] < np.abs(A).max() < _SIZES[1] or not self._reduced(A):
            self.values, *both = scipy.linalg.eig(A, left=True, right=True)
            self._all = both[0], both[1]

    def vectors(self, chosen: Sequence[int]) -> tuple[Vector, Vector]:
        """Left and right eigenvectors, each of shape (n, m), of any length: lᴴ·A = λ·lᴴ and A·r = λ·r.

        ``chosen``: places of m eigenvalues in ``values``."""
        places = np.asarray(chosen, dtype=np.int64)
        if self._all is not None:
            left, right = self._all
            return left[:, places], right[:, places]
        if not len(places):
            empty = np.zeros((len(self.values), 0), dtype=complex)
            return empty, empty
        # a pair stands in two columns, for its upper half
        first = places - (self.values.imag[places] < 0)
        wanted = np.zeros(len(self.values), dtype=np.int32)
        wanted[first] = 1
        paired = self.values.imag != 0
        columns = np.cumsum(wanted * np.where(paired, 2, 1)) - np.where(paired, 2, 1)
        left, right = self._columns(wanted, int(columns[np.flatnonzero(wanted)[-1]] + 2))
        values = self.values[places]
        return _as_complex(left, columns[first], values), _as_complex(right, columns[first], values)

    def coordinates(self) -> "ModalCoordinates":
        """Every mode as a coordinate; where A is defective, or nearly so, its numbers are large and cancel."""
        if self._all is not None:
            return ModalCoordinates(self.values.astype(complex), self._all[1])
        n = len(self.values)
        vectors, found, call = np.zeros((n, n), order="F"), ctypes.c_int(), _Call()
        call(
            "dtrevc",
            side=b"R",
            howmny=b"A",
            select=np.ones(n, dtype=np.int32),
            n=n,
            t=self._T,
            ldt=n,
            vl=np.zeros((1, 1)),
            ldvl=1,
            vr=vectors,
            ldvr=n,
            mm=n,
            m=found,
            work=np.zeros(3 * n),
        )
        scale = self._unbalanced(np.ones((n, 1)), b"S")[:, 0]
        # places are exact in floating point
        order = self._unbalanced(np.arange(n, dtype=float)[:, None], b"P")[:, 0].astype(np.int64)
        if not call.succeeded:
            raise np.linalg.LinAlgError("LAPACK refuses to compute eigenvectors from a Schur form")
        return ModalCoordinates(self.values, vectors, Turned(self._Q, order, scale[order]))

    def _unbalanced(self, vectors: Matrix, job: bytes) -> Matrix:
        """Vectors of the balanced matrix as those of A: scaled (S), put into A's order (P), or both (B)."""
        n = len(self.values)
        turned, call = np.array(vectors, order="F"), _Call()
        call(
            "dgebak",
            job=job,
            side=b"R",
            n=n,
            ilo=ctypes.c_int(self._low),
            ihi=ctypes.c_int(self._high),
            scale=self._scale,
            m=turned.shape[1],
            v=turned,
            ldv=n,
        )
        return turned

    def _reduced(self, A: Matrix) -> bool:
        """Bring A to its Schur form; False if LAPACK does not succeed."""
        n = len(A)
        self._T = T = np.array(A, order="F")
        self._scale, tau = np.zeros(n), np.zeros(n)
        real, imaginary = np.zeros(n), np.zeros(n)
        low, high = ctypes.c_int(), ctypes.c_int()
        call = _Call()
        call("dgebal", job=b"B", n=n, a=T, lda=n, ilo=low, ihi=high, scale=self._scale)
        self._low, self._high = low.value, high.value
        between: dict[str, Any] = {"n": n, "ilo": self._low, "ihi": self._high}
        call.with_room(n, "dgehrd", **between, a=T, lda=n, tau=tau)
        self._Q = Q = T.copy(order="F")
        call.with_room(n, "dorghr", **between, a=Q, lda=n, tau=tau)
        schur: dict[str, Any] = {"h": T, "ldh": n, "wr": real, "wi": imaginary, "z": Q, "ldz": n}
        call.with_room(n, "dhseqr", job=b"S", compz=b"V", **between, **schur)
        self.values = real + 1j * imaginary
        return call.succeeded

    def _columns(self, wanted: NDArray[np.int32], room: int) -> tuple[Matrix, Matrix]:
        """Vectors of both sides as LAPACK lays them out: one column for a real one, two for a pair."""
        n = len(self.values)
        left, right = (np.zeros((n, room), order="F") for _ in range(2))
        found, call = ctypes.c_int(), _Call()
        call(
            "dtrevc",
            side=b"B",
            howmny=b"S",
            select=wanted.copy(),
            n=n,
            t=self._T,
            ldt=n,
            vl=left,
            ldvl=n,
            vr=right,
            ldvr=n,
            mm=room,
            m=found,
            work=np.zeros(3 * n),
        )
        whole = []
        for side, vectors in ((b"L", left), (b"R", right)):
            turned = np.asfortranarray(self._Q @ vectors)
            call(
                "dgebak",
                job=b"B",
                side=side,
                n=n,
                ilo=self._low,
                ihi=self._high,
                scale=self._scale,
                m=room,
                v=turned,
                ldv=n,
            )
            whole.append(turned)
        if not call.succeeded:
            raise np.linalg.LinAlgError("LAPACK refuses to compute eigenvectors from a Schur form")
        return whole[0], whole[1]


@dataclass(frozen=True)
class Turned:
    """Basis of a Schur form in the coordinates of the matrix: row i is ``scale[i]`` times row ``order[i]`` of Q."""

    Q: Matrix
    order: NDArray[np.int64]
    scale: Vector

    def rows(self, C: Matrix) -> Matrix:
        """C, shape (m, n), applied to the basis."""
        balanced = np.zeros_like(C)
        balanced[:, self.order] = C * self.scale
        return np.asarray(balanced @ self.Q)

    def columns(self, B: Matrix) -> Matrix:
        """B, shape (n, m), in the basis."""
        balanced = np.zeros_like(B)
        balanced[self.order] = B / self.scale[:, None]
        return np.asarray(self.Q.T @ balanced)


class ModalCoordinates:
    """Coordinates in which a real matrix A is the diagonal matrix of its eigenvalues.

    ``vectors``: Right eigenvectors as columns: those of A, complex; or, with ``basis``, those of the Schur form as
    LAPACK lays them out, real, two columns for a pair."""

    def __init__(
        self, values: NDArray[np.complex128], vectors: Vector, basis: Turned | None = None
    ) -> None:
        self.values, self._vectors, self._basis = values, vectors, basis
        self._upper = np.flatnonzero(values.imag > 0)

    def rows(self, C: Matrix) -> Vector:
        """The modes as C, shape (m, n), sees them, shape (m, n)."""
        if self._basis is None:
            return np.asarray(C @ self._vectors)
        found = (self._basis.rows(C) @ self._vectors).astype(complex)
        first, second = found[:, self._upper], found[:, self._upper + 1]
        found[:, self._upper], found[:, self._upper + 1] = first + 1j * second, first - 1j * second
        return found

    def columns(self, B: Matrix) -> Vector:
        """How B, shape (n, m), drives each mode, shape (n, m). Raises NumPy's `LinAlgError` where A is defective."""
        if self._basis is None:
            return np.asarray(np.linalg.solve(self._vectors, B))
        found = np.linalg.solve(self._vectors, self._basis.columns(B)).astype(complex)
        first, second = found[self._upper] / 2, found[self._upper + 1] / 2
        found[self._upper], found[self._upper + 1] = first - 1j * second, first + 1j * second
        return np.asarray(found)


@cache
def lapack() -> dict[str, Any] | None:
    """LAPACK's routines as SciPy offers them to compiled code; None where it has others than those known here."""
    try:
        from scipy.linalg import cython_lapack  # noqa: PLC0415 - only large systems need it

        capsules = {name: cython_lapack.__pyx_capi__[name] for name in _ROUTINES}
    except (ImportError, AttributeError, KeyError):
        return None
    python = ctypes.pythonapi
    python.PyCapsule_GetName.restype, python.PyCapsule_GetName.argtypes = (
        ctypes.c_char_p,
        [ctypes.py_object],
    )
    python.PyCapsule_GetPointer.restype = ctypes.c_void_p
    python.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    routines = {}
    for name, capsule in capsules.items():
        signature = python.PyCapsule_GetName(capsule)
        if signature.count(b"int *") != _ROUTINES[name] or b"long" in signature:
            return None  # integers of 64 bits
        routines[name] = ctypes.CFUNCTYPE(None)(python.PyCapsule_GetPointer(capsule, signature))
    return routines


class _Call:
    """Calls of LAPACK's routines, and whether all succeeded so far.

    Arguments have the names of LAPACK's manual and stand in its order, in which Fortran takes them."""

    def __init__(self) -> None:
        self.succeeded = True

    def __call__(self, name: str, /, **arguments: Any) -> None:
        """Call a routine; the last argument, its success, is added."""
        routines, success = lapack(), ctypes.c_int()
        assert routines is not None
        routines[name](
            *(_passed(argument) for argument in arguments.values()), ctypes.byref(success)
        )
        self.succeeded &= success.value == 0

    def with_room(self, least: int, name: str, /, **arguments: Any) -> None:
        """Call a routine that says how much room it needs for its work, and which refuses less than the least."""
        needed = np.zeros(1)
        self(name, **arguments, work=needed, lwork=-1)
        room = max(int(needed[0]), least)
        self(name, **arguments, work=np.zeros(room), lwork=room)


def _passed(argument: Any) -> Any:
    """An argument as Fortran takes it: by its address."""
    if isinstance(argument, np.ndarray):
        return argument.ctypes.data_as(ctypes.c_void_p)
    if isinstance(argument, bytes):
        return ctypes.c_char_p(argument)
    return ctypes.byref(argument if isinstance(argument, ctypes.c_int) else ctypes.c_int(argument))


def _as_complex(columns: Matrix, places: NDArray[np.int64], values: Vector) -> Vector:
    """Vectors from their real and imaginary columns, shape (n, m)."""
    vectors = columns[:, places].astype(complex)
    swings = values.imag != 0
    vectors[:, swings] += 1j * np.sign(values.imag[swings]) * columns[:, places[swings] + 1]
    return vectors
