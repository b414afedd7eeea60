"""An admittance in dq in other forms: by sequences (αβ), one sequence alone, and powers over changes of the voltage."""

import numpy as np

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.core.arrays import Complex, Numbers, Vector
from orchestrator.core.errors import InputError
from orchestrator.studies.immittance.scan import SIEMENS, PortPoint, Scan

FORMS = ("alphabeta", "siso", "jacobian")
"""``alphabeta`` has the sequences as rows and columns, at the frequency of the positive one; the mirrored one is two
rated frequencies lower. ``siso`` is the positive one alone, with what flows in the mirrored one at an ideal bus."""

_SEQUENCES = np.array([[1, 1j], [1, -1j]]) / np.sqrt(2)


def from_sequences(values: Vector) -> Complex:
    return np.asarray(_SEQUENCES.conj().T @ values @ _SEQUENCES)


def powers_over(
    f: Numbers, Y: Vector, voltage: complex, current: complex, rated_hz: float
) -> dict[str, Complex]:
    """P and Q that a device feeds in, over frequency [pu], angle [rad] and relative magnitude of the voltage.

    With S = v·i* and i = Y·v in real and imaginary parts, a change dv gives dS = dv·i* + v·(Y·dv)*. A change of the
    angle is dv = j·v·dθ, one of the magnitude dv = v·dV/V.

    ``Y``: From voltage to current out of the device, shape (f, 2, 2)."""
    by_voltage = np.array([[current.real, current.imag], [-current.imag, current.real]])
    by_current = np.array([[voltage.real, voltage.imag], [voltage.imag, -voltage.real]])
    changes = np.array([[-voltage.imag, voltage.real], [voltage.real, voltage.imag]])
    J = (by_voltage + by_current @ Y) @ changes
    return {
        "P/omega": J[:, 0, 0] * rated_hz / (1j * f),
        "P/theta": J[:, 0, 0],
        "Q/V": J[:, 1, 1],
        "P/V": J[:, 0, 1],
        "Q/theta": J[:, 1, 0],
    }


def rows_in(scan: Scan, form: str, rated_hz: float) -> list[dict[str, float]]:
    """A row for each frequency [Hz], of real and imaginary parts; currents count into the device, powers out of it."""
    if len(scan.ports) > 1:
        raise InputError(
            f"{scan.source} has the ports {', '.join(scan.ports)}; other forms are of a scan of one port"
        )
    if form == "jacobian":
        return rows_of(scan.frequencies, _powers_of(scan, rated_hz))
    f, Y = scan.frequencies + rated_hz, _SEQUENCES @ scan.values @ _SEQUENCES.conj().T
    if form == "alphabeta":
        return rows_of(
            f, {f"Y_{i + 1}{j + 1} [{scan.unit}]": Y[:, i, j] for i, j in np.ndindex(2, 2)}
        )
    # there it is the conjugate of the mirrored one of a frequency above
    below = scan.frequencies < rated_hz
    whole = np.concatenate([Y[below, 1, 1].conj()[::-1], Y[:, 0, 0]])
    return rows_of(
        np.concatenate([rated_hz - scan.frequencies[below][::-1], f]), {f"Y_1 [{scan.unit}]": whole}
    )


def _powers_of(scan: Scan, rated_hz: float) -> dict[str, Complex]:
    """In MW and Mvar, at the operating point that the scan states; d lies along the voltage."""
    point = scan.points.get(scan.ports[0], PortPoint())
    if point.kilovolt is None or point.megawatt is None or point.megavar is None:
        raise InputError(
            f"{scan.source} states no operating point, and powers change with it: put kV, MW and Mvar of its port into "
            "_power_flow.txt beside it"
        )
    base = 1.0 if scan.unit == SIEMENS else SYSTEM_BASE_MVA
    current = complex(point.megawatt, -point.megavar) / base / point.kilovolt
    found = powers_over(scan.frequencies, -scan.values, complex(point.kilovolt), current, rated_hz)
    return {
        f"{name} [{'MW' if name[0] == 'P' else 'Mvar'}]": base * values
        for name, values in found.items()
    }


def rows_of(f: Numbers, columns: dict[str, Complex]) -> list[dict[str, float]]:
    parts = {"frequency [Hz]": f}
    for key, values in columns.items():
        parts |= {f"re {key}": values.real, f"im {key}": values.imag}
    return [dict(zip(parts, row, strict=True)) for row in np.array(list(parts.values())).T.tolist()]
