"""Unstable poles in what was measured over frequency: rational functions with common poles (AAA) through the values."""

from itertools import pairwise

import numpy as np

from orchestrator.core.arrays import Complex, Numbers, Vector

_TOLERANCES = (3e-2, 1e-2, 3e-3)
"""Relative errors at which the fit stops. A pole of the system is found at two of them in one place; one that stands
for noise moves."""

_MOST = 20  # support points of the fit, at most
_ENOUGH = 500  # frequencies that are fitted; of more, each second, third, …
_SAME = 0.2  # distance of two findings of one pole, in its real part plus a thousandth of its size
_STRONG = 0.05  # least size of what a pole adds at its frequency, relative to the whole there


def unstable_poles(frequencies: Numbers, values: Vector) -> tuple[complex, ...]:
    """Poles of positive real part [rad/s] that the values show, one of each pair.

    ``frequencies``: [Hz], shape (f,).
    ``values``: Shape (f, n, n)."""
    every = -(-len(frequencies) // _ENOUGH)
    frequencies, values = frequencies[::every], values[::every]
    size = np.linalg.norm(values, ord=2, axis=(1, 2))
    size = size / size.max()
    fitted = fits(2j * np.pi * frequencies, (values / np.abs(values).max()).reshape(len(size), -1))
    found = [_growing(frequencies, size, *fit) for fit in fitted]
    kept: list[complex] = []
    for coarse, fine in pairwise(found):
        for p in fine:
            near = any(abs(p - q) < _SAME * p.real + 1e-3 * abs(p) for q in coarse)
            if near and not any(abs(p - q) < p.real for q in kept):
                kept.append(p)
    return tuple(kept)


def _growing(f: Numbers, size: Numbers, poles: Vector, residues: Vector) -> list[complex]:
    lowest, highest = 2 * np.pi * f[0], 2 * np.pi * f[-1]
    found = []
    for p, residue in zip(poles.tolist(), residues, strict=True):
        inside = p.imag >= -1e-6 * abs(p) and 0.3 * lowest <= abs(p) <= highest
        mirrored = np.abs(poles - np.conj(p)).min() < _SAME * abs(p.real) + 1e-3 * abs(p)
        if p.real > 0 and inside and mirrored:
            there = np.interp(abs(p.imag) / (2 * np.pi), f, size)
            if np.linalg.norm(residue) / p.real > _STRONG * there:
                found.append(p)
    return found


def fits(s: Vector, G: Vector) -> list[tuple[Complex, Complex]]:
    """Poles and residues of rational functions through the values, at each of the tolerances."""
    support: list[int] = []
    error = np.abs(G - G.mean(axis=0)).max(axis=1)
    found: list[tuple[Complex, Complex]] = []
    while len(support) < min(_MOST, len(s) // 2) and len(found) < len(_TOLERANCES):
        support.append(int(np.argmax(error)))
        points = np.concatenate([s[support], -s[support]])
        data = np.concatenate([G[support], G[support].conj()])
        others = np.setdiff1d(np.arange(len(s)), support)
        cauchy = 1 / (s[others, None] - points[None, :])
        loewner = np.concatenate(
            [(G[others, c][:, None] - data[None, :, c]) * cauchy for c in range(G.shape[1])]
        )
        # the rows of −s, whose support is the other half
        mirror = np.roll(loewner.conj(), len(support), axis=1)
        loewner = np.concatenate([loewner, mirror])
        # The smallest right singular vector, through the small square matrix of the QR factors.
        weights = np.linalg.svd(np.linalg.qr(loewner, mode="r"))[2][-1].conj()
        fitted = (cauchy @ (weights[:, None] * data)) / (cauchy @ weights)[:, None]
        error = np.zeros(len(s))
        error[others] = np.abs(fitted - G[others]).max(axis=1)
        while len(found) < len(_TOLERANCES) and error.max() < _TOLERANCES[len(found)]:
            found.append(_poles(points, weights, data))
    return found + [_poles(points, weights, data)] * (len(found) < len(_TOLERANCES))


def _poles(z: Vector, weights: Vector, values: Vector) -> tuple[Complex, Complex]:
    """Zeros of Σ w/(s − z), and the residues there."""
    # With Σw ≠ 0 they are the eigenvalues of diag(z) − w·1ᵀ·diag(z)…, found by deflating one infinite direction.
    total = weights.sum()
    if abs(total) < 1e-12 * np.abs(weights).max():
        total = 1e-12 * np.abs(weights).max()
    matrix = np.diag(z) - np.outer(weights * z, np.ones(len(z))) / total
    found = np.linalg.eigvals(matrix)
    found = found[np.abs(found) > 1e-9 * np.abs(z).max()]
    cauchy = 1 / (found[:, None] - z[None, :])
    slope = -(cauchy**2) @ weights
    return found, (cauchy @ (weights[:, None] * values)) / slope[:, None]
