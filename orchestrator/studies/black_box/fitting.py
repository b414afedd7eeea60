"""A state-space model over one communication step, fitted to a measured response by vector fitting (scikit-rf).

With the bilinear transform w = (2/H)·(z − 1)/(z + 1) the unit circle becomes the imaginary axis, and a response that
is rational in z is rational in w, with as many poles: nothing is lost to the hold or to sampling. What vector fitting
gives is poles p and residue matrices R. At a simple pole of a device R has rank one, so each pole takes as many states
as R has singular values that matter, and the model is no larger than what was seen of the device."""

import warnings
from dataclasses import dataclass

import numpy as np

from fmus.toolchain.extras import require
from orchestrator.core.arrays import Complex, Matrix, Numbers, Vector
from orchestrator.core.errors import AnalysisError
from orchestrator.studies.black_box.frequency_response import FrequencyResponse

ORDERS = ((2, 2), (2, 4), (3, 5), (4, 6), (4, 8), (5, 9), (6, 10), (8, 14))
"""Numbers of real poles and of complex pairs that are tried, in turn."""

# relative error of a fit with which no larger one is tried; the measurement's bound where more
_WANTED = 1e-5

_MOST_ITERATIONS = 30
"""Largest number of iterations of the pole relocation. A fit that has not converged by then has more poles than the
response."""

_COUNTS = 1e-7  # A residue's singular value counts from this part of the largest response on


def require_fitting() -> None:
    """Refuse a measurement whose response cannot be fitted, before the measurement begins."""
    require("fitting a model to a measured response", "skrf")


@dataclass(frozen=True)
class IdentifiedModel:
    """x⁺ = A·x + B·u, y = C·x + D·u over a communication step, u held.

    ``poles``: As eigenvalues λ = ln μ/H [rad/s], shape (n,)."""

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    step_size: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    # largest difference from the measured response at any frequency, relative to it (2-norms)
    error: float

    @property
    def poles(self) -> Complex:
        """Poles as eigenvalues λ = ln μ/H [rad/s]."""
        return np.asarray(np.log(np.linalg.eigvals(self.A).astype(complex)) / self.step_size)

    def response(self, z: Complex) -> Complex:
        """C·(z − A)⁻¹·B, shape (f, p, m)."""
        values, vectors = np.linalg.eig(self.A)
        left, right = self.C @ vectors, np.linalg.solve(vectors, self.B)
        return np.asarray(
            np.einsum("pk,fk,km->fpm", left, 1 / (z[:, None] - values[None, :]), right)
        )


def fit(response: FrequencyResponse, largest_error: float = 0.01) -> IdentifiedModel:
    """Fit the smallest model that is as close as the measurement is certain."""
    wanted = max(_WANTED, response.largest_bound)
    best: IdentifiedModel | None = None
    for real, pairs in ORDERS:
        if real + 2 * pairs > len(response.frequencies):
            break
        model = _fit_with(response, real, pairs)
        if model is not None and (best is None or model.error < best.error):
            best = model
        if best is not None and best.error <= wanted:
            break
    if best is None or best.error > largest_error:
        why = (
            "none is stable"
            if best is None
            else f"the best has an error above {largest_error:g}: {best.error:.2g}"
        )
        raise AnalysisError(
            f"no rational model fits the measured response: {why}; measure more lines, "
            "or take a smaller amplitude if the bounds are wide"
        )
    return best


def _fit_with(response: FrequencyResponse, real: int, pairs: int) -> IdentifiedModel | None:
    """Model with the given number of poles; None where the fit breaks down or is unstable."""
    require_fitting()
    from skrf import Network  # noqa: PLC0415 - of the extra `black-box`
    from skrf.vectorFitting import VectorFitting  # noqa: PLC0415 - as above

    H = response.step_size
    warped = np.tan(np.pi * response.frequencies * H) / (np.pi * H)
    data = response.strictly_proper
    p, m = data.shape[1:]
    # scikit-rf takes square ports only: missing rows or columns are filled with zeros, and removed from the result.
    ports = max(p, m)
    square = np.zeros((len(warped), ports, ports), dtype=complex)
    square[:, :p, :m] = data
    fitting = VectorFitting(Network(f=warped, f_unit="Hz", s=square))
    fitting.max_iterations = _MOST_ITERATIONS
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            fitting.vector_fit(
                real, pairs, "log", "s", fit_constant=True, fit_proportional=False, enforce_dc=False
            )
    except (np.linalg.LinAlgError, ValueError):
        return None
    residues = np.asarray(fitting.residues).reshape(ports, ports, -1)[:p, :m]
    blocks = _realisation(np.asarray(fitting.poles), residues, float(np.abs(data).max()))
    A, B, C = _over_a_step(*blocks, H)
    if not len(A) or not np.isfinite(A).all() or np.abs(np.linalg.eigvals(A)).max() >= 1:
        return None
    model = IdentifiedModel(
        A,
        B,
        C=C,
        D=response.feedthrough,
        step_size=H,
        inputs=response.inputs,
        outputs=response.outputs,
        error=np.nan,
    )
    difference = np.linalg.norm(model.response(response.z) - data, ord=2, axis=(1, 2))
    error = float((difference / np.linalg.norm(response.values, ord=2, axis=(1, 2))).max())
    return IdentifiedModel(
        A,
        B,
        C=C,
        D=response.feedthrough,
        step_size=H,
        inputs=response.inputs,
        outputs=response.outputs,
        error=error,
    )


def _over_a_step(A: Matrix, B: Matrix, C: Matrix, H: float) -> tuple[Matrix, Matrix, Matrix]:
    """Return the model over a step by the bilinear transform.

    It is what `scipy.signal.cont2discrete` computes, which takes a second to import."""
    from scipy.linalg import solve  # noqa: PLC0415 - only where something is fitted

    unit = np.eye(len(A))
    ahead = unit - 0.5 * H * A
    return (
        solve(ahead, unit + 0.5 * H * A),
        solve(ahead, H * B),
        solve(ahead.transpose(), C.transpose()).transpose(),
    )


def _realisation(
    poles: Complex, residues: Complex, largest: float
) -> tuple[Matrix, Matrix, Matrix]:
    """Real A, B, C with Σ R/(w − p); complex poles stand for their conjugates as well."""
    parts: list[tuple[Matrix, Matrix, Matrix]] = []
    for k, pole in enumerate(poles.tolist()):
        u, s, v = np.linalg.svd(residues[:, :, k])
        for j in range(len(s)):
            if s[j] / abs(pole) < _COUNTS * largest:
                continue
            c, b = u[:, j] * np.sqrt(s[j]), v[j] * np.sqrt(s[j])
            if pole.imag == 0:
                parts.append((np.array([[pole.real]]), b.real[None, :], c.real[:, None]))
            else:
                a = np.array([[pole.real, pole.imag], [-pole.imag, pole.real]])
                parts.append(
                    (a, np.array([2 * b.real, -2 * b.imag]), np.stack([c.real, c.imag], axis=1))
                )
    n = sum(len(a) for a, _, _ in parts)
    A = np.zeros((n, n))
    first = 0
    for a, _, _ in parts:
        A[first : first + len(a), first : first + len(a)] = a
        first += len(a)
    if not parts:
        return A, np.zeros((0, residues.shape[1])), np.zeros((residues.shape[0], 0))
    return (
        A,
        np.concatenate([b for _, b, _ in parts]),
        np.concatenate([c for _, _, c in parts], axis=1),
    )


def bands_of(f: Numbers, inside: Vector) -> list[tuple[float, float]]:
    """First and last frequency of each stretch that lies inside."""
    edges = np.flatnonzero(np.diff(np.r_[False, inside, False].astype(int)))
    return [(float(f[a]), float(f[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


@dataclass(frozen=True)
class Passivity:
    """Passivity of a device with the admittance Y = −i/v, currents counted into it: if it can drive an oscillation.

    It is passive at a frequency where Y + Yᴴ has no negative eigenvalue: it then takes power from every oscillation
    there. A negative index names the frequencies at which it could drive one, together with a grid that lets it."""

    frequencies: Numbers
    index: Numbers  # smallest eigenvalue of (Y + Yᴴ)/2 [unit of Y], shape (f,)
    # ``index`` over the largest singular value of Y: from −1, where the device only delivers power, to 1
    relative: Numbers
    bounds: Numbers  # bounds of ``index``, from the bounds of Y

    def ranges(self) -> list[tuple[float, float]]:
        """Ranges of measured frequencies [Hz] in which the index is negative beyond its bound."""
        return bands_of(self.frequencies, self.index < -self.bounds)


def passivity(response: FrequencyResponse) -> Passivity:
    """Passivity of the device itself, without the communication's hold; its response must be a square admittance."""
    Y = -response.continuous()
    index = np.asarray(np.linalg.eigvalsh((Y + Y.conj().transpose(0, 2, 1)) / 2)[:, 0], dtype=float)
    size = np.linalg.norm(Y, ord=2, axis=(1, 2))
    bounds = np.asarray(np.linalg.norm(response.bounds, axis=(1, 2)), dtype=float)
    return Passivity(response.frequencies, index, index / size, bounds)
