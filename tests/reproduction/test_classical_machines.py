"""The WSCC system with classical machines: its FMUs against the network reduced to the machines' internal nodes."""

import csv
import tomllib

import numpy as np
import pytest
import tomli_w

from orchestrator.cases.case import BUILT_IN, load_case
from orchestrator.studies.modes.modes import compute_modes
from tests.reference.published import wscc9

pytestmark = pytest.mark.reproduction

STRAY_B = 0.05
COLUMNS = ("bus", "rating_mva", "p_mw", "v_pu", "sg.machine.H", "sg.machine.X_d1")


def reduced_swings(system):
    """Imaginary parts [rad/s] of the swing modes of constant emfs behind X'_d, loads as impedances (Kron)."""
    Y, v = system.admittance(), system.power_flow()
    at = [m.bus - 1 for m in system.machines]
    X1, H = (np.array([getattr(m, name) for m in system.machines]) for name in ("X_d1", "H"))
    E = v[at] + 1j * X1 * (Y @ v)[at]
    for load in system.loads:
        Y[load.bus - 1, load.bus - 1] += complex(load.P, -load.Q) / abs(v[load.bus - 1]) ** 2
    to_network = np.zeros((len(at), len(v)), complex)
    for k, (bus, X) in enumerate(zip(at, X1, strict=True)):
        to_network[k, bus] = -1 / (1j * X)
        Y[bus, bus] += 1 / (1j * X)
    reduced = np.diag(1 / (1j * X1)) - to_network @ np.linalg.solve(Y, to_network.T)
    delta, size = np.angle(E), abs(E)
    K = np.zeros((len(at), len(at)))
    for a in range(len(at)):
        for b in range(len(at)):
            if a != b:
                angle = delta[a] - delta[b]
                slope = (
                    size[a]
                    * size[b]
                    * (reduced[a, b].imag * np.cos(angle) - reduced[a, b].real * np.sin(angle))
                )
                K[a, b], K[a, a] = -slope, K[a, a] + slope
    squares = np.linalg.eigvals(-(np.pi * system.frequency / H)[:, None] * K)
    return list(np.sqrt(sorted(-squares.real)[1:]))


def with_classical_machines(folder):
    """The built-in case with classical machines, which have no exciters and few data."""
    tables = tomllib.loads((BUILT_IN / "wscc9" / "case.toml").read_text(encoding="utf-8"))
    del tables["units"]["exciter"]
    tables["units"]["machine"] = "classical"
    tables["units"]["generator_parameters"] = {"machine": {"S_data": "100 MVA", "R_s": 0.0}}
    (folder / "case.toml").write_text(tomli_w.dumps(tables), encoding="utf-8")
    with (BUILT_IN / "wscc9" / "units.csv").open(encoding="utf-8", newline="") as data:
        rows = list(csv.DictReader(data))
    with (folder / "units.csv").open("w", encoding="utf-8", newline="") as out:
        writer = csv.DictWriter(out, COLUMNS, extrasaction="ignore")
        writer.writeheader()
        writer.writerows(rows)
    return load_case(folder / "case.toml")


def test_the_reduced_network_has_the_books_modes():
    """Anderson and Fouad have 8.69 and 13.36 rad/s."""
    assert reduced_swings(wscc9()) == pytest.approx([8.69, 13.36], rel=2e-3)


@pytest.mark.slow
def test_the_fmus_have_the_modes_of_the_reduced_network(tmp_path):
    (ready,) = with_classical_machines(tmp_path).prepare(["base"])
    found = [
        2 * np.pi * m.frequency_hz
        for m in compute_modes(ready, (0.3, 3.0)).modes
        if m.damping_percent < 20
    ]
    assert sorted(found) == pytest.approx(reduced_swings(wscc9(stray_B=STRAY_B)), rel=5e-4)
