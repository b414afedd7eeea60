"""The figures of a mode as JSON has them, in every file and on every command line."""

import math


def eigenvalue_json(eigenvalue: complex, damping_percent: float) -> dict[str, float]:
    """An eigenvalue [rad/s] with its frequency [Hz] and its damping ratio [%]."""
    return {
        "real": eigenvalue.real,
        "imag": eigenvalue.imag,
        "frequency_hz": eigenvalue.imag / (2 * math.pi),
        "damping_percent": damping_percent,
    }
