"""An admittance in other forms, on branches and powers whose forms are known by their equations."""

import numpy as np
import pytest

from orchestrator.core.errors import InputError
from orchestrator.studies.immittance.forms import rows_in
from orchestrator.studies.immittance.scan import PER_UNIT, PortPoint, Scan
from tests.studies.immittance.plants import OMEGA, Line

F = np.geomspace(0.5, 600, 90)
R, L = 0.5, 0.02


def table_of(scan, form):
    """Complex columns by name, as they are written at 50 Hz."""
    rows = rows_in(scan, form, 50.0)
    found = {"f": np.array([row["frequency [Hz]"] for row in rows])}
    for name in rows[0]:
        if name.startswith("re "):
            found[name[3:]] = np.array([complex(row[name], row[f"im {name[3:]}"]) for row in rows])
    return found


def branch(f=F, **more):
    return Scan("branch", f, np.linalg.inv(Line(R, L).impedance(f)), ("P",), **more)


def constant(P, Q, V, unit="S"):
    """A device that takes P + jQ whatever the voltage: di = −S*/V²·dv*."""
    k = -complex(P, -Q) / V**2
    Y = np.broadcast_to(np.array([[k.real, k.imag], [k.imag, -k.real]]), (len(F), 2, 2))
    return Scan("load", F, Y, ("P",), unit, points={"P": PortPoint(V, -P, -Q, 0.0)})


def test_sequences_of_a_branch_are_decoupled_and_of_a_constant_power_nothing_else_but_coupled():
    found = table_of(branch(), "alphabeta")
    f = found["f"]
    assert f == pytest.approx(F + 50)
    assert found["Y_11 [S]"] == pytest.approx(1 / (R + 2j * np.pi * f * L))
    assert found["Y_22 [S]"] == pytest.approx(1 / (R + 2j * np.pi * (f - 100) * L))
    assert np.abs([found["Y_12 [S]"], found["Y_21 [S]"]]).max() < 1e-12
    load = table_of(constant(3.0, 1.0, 10.0), "alphabeta")
    assert np.abs([load["Y_11 [S]"], load["Y_22 [S]"]]).max() < 1e-12
    assert load["Y_12 [S]"] == pytest.approx(np.full(len(F), -complex(3, -1) / 100))


def test_one_sequence_alone_goes_through_the_rated_frequency():
    found = table_of(branch(), "siso")
    f = found["f"]
    assert (np.diff(f) > 0).all()
    assert (f < 50).sum() == (F < 50).sum() > 30
    assert found["Y_1 [S]"] == pytest.approx(1 / (R + 2j * np.pi * f * L))


def test_powers_of_a_constant_power_follow_nothing():
    for unit, P, V in (("S", 3.0, 10.0), (PER_UNIT, 300.0, 1.0)):
        load = constant(P, 0.3 * P, V, unit)
        load = load.scaled(0.01, PER_UNIT) if unit == PER_UNIT else load
        found = table_of(load, "jacobian")
        del found["f"], found["P/omega [MW]"]
        assert np.abs(list(found.values())).max() < 1e-9 * P


def test_powers_of_a_source_behind_a_branch_are_their_derivatives():
    E, V, X = 12.0, 10.0, OMEGA * L

    def fed(angle, size):
        """Complex power into a bus whose angle runs ahead and whose magnitude grows."""
        v = V * size * np.exp(1j * angle)
        return v * np.conj((E * np.exp(0.4j) - v) / complex(R, X))

    S, h, f = fed(0, 1), 1e-6, np.geomspace(1e-4, 600, 90)
    found = table_of(branch(f, points={"P": PortPoint(V, S.real, S.imag, 0.4)}), "jacobian")
    slow = {key: values[0] for key, values in found.items()}
    by_angle, by_size = (
        (fed(h, 1) - fed(-h, 1)) / (2 * h),
        (fed(0, 1 + h) - fed(0, 1 - h)) / (2 * h),
    )
    for key, value in (
        ("P/theta [MW]", by_angle.real),
        ("Q/theta [Mvar]", by_angle.imag),
        ("P/V [MW]", by_size.real),
        ("Q/V [Mvar]", by_size.imag),
    ):
        assert slow[key] == pytest.approx(value, rel=1e-4)
    assert found["P/omega [MW]"] == pytest.approx(found["P/theta [MW]"] * OMEGA / (2j * np.pi * f))
    with pytest.raises(InputError, match="states no operating point, and powers change with it"):
        table_of(branch(), "jacobian")


def test_several_ports_are_refused():
    two = Scan("two", F, np.zeros((len(F), 4, 4)), ("A", "B"))
    with pytest.raises(
        InputError, match="has the ports A, B; other forms are of a scan of one port"
    ):
        rows_in(two, "siso", 50.0)
