"""ESST2A, EXST2, ESST3A, EXST3 and IEEET3: exciters fed by the terminal's voltage, and compounded by its current.

ESST2A has an exciter of first order between the regulator and the field:

    V_ref + V_S − v_m − V_F → K_A/(1+sT_A) = V_A, held within V_RMIN and V_RMAX
    T_E·dE_fd/dt = V_A·V_B − K_E·E_fd, 0 ≤ E_fd ≤ E_FDMAX,  V_F = s·K_F/(1+sT_F)·E_fd

EXST2, of 1979, adds its source to the regulator's voltage, V_A + V_B, and does not multiply both.

ESST3A has an inner regulator of the field voltage:

    V_IMIN ≤ V_ref + V_S − v_m ≤ V_IMAX → (1+sT_C)/(1+sT_B) → K_A/(1+sT_A) = V_R, held within V_RMIN and V_RMAX
    → − min(K_G·E_fd, V_GMAX) → K_M/(1+sT_M) = V_M, held within V_MMIN and V_MMAX,  E_fd = V_M·V_B

EXST3, of 1979, has one amplifier, behind the lead and lag, and a limit of the field voltage:

    V_IMIN ≤ V_ref + V_S − v_m ≤ V_IMAX → K_J·(1+sT_C)/(1+sT_B) → − min(K_G·E_fd, V_GMAX)
    → K_A/(1+sT_A) = V_R, held within V_RMIN and V_RMAX,  E_fd = V_R·V_B ≤ E_FDMAX

IEEET3 adds the regulator's voltage to that of the source, behind a commutating reactance:

    V_ref + V_S − v_m − V_F → K_A/(1+sT_A) = V_R, held within V_RMIN and V_RMAX
    V_B = V_R + √(V_E² − (0.78·I_FD)²) within 0 and V_BMAX; 0 while 0.78·I_FD exceeds V_E
    T_E·dE_fd/dt = V_B − K_E·E_fd,  V_F = s·K_F/(1+sT_F)·E_fd

V_E and V_B are those of `sources`. Sources: OpenIPSL at 2be0558a (ESST2A), ANDES 2.0.0 (ESST3A, IEEET3), Opal-RT's
library of phasor models at 6dc8ca5 (ESST3A, IEEET3) and cba975b8 (EXST3), InterPSS' `Exst2Exciter`, IEEE 421.5."""

from functools import partial

from fmus.synchronous_generator.data_lines import Given, declared, pu, seconds
from fmus.synchronous_generator.excitation.common import (
    BEFORE,
    SOURCE,
    Measurement,
    Regulated,
    lead_lag_stage,
    rate_feedback,
    require_within,
)
from fmus.synchronous_generator.excitation.sources import (
    COMPOUND,
    LOADED,
    Source,
    compound_source,
)
from fmus.toolchain.blocks import (
    clamp,
    close_limited_low_pass,
    held_at_limits,
    limited_low_pass,
)
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmax, fmin, if_else, sqrt

_COMMUTATION = 0.78  # of the field current, which IEEET3 takes off its source as a square

REGULATOR = (
    pu("K_A", 120.0, "Gain", 1e-3),
    seconds("T_A", 0.15, "Amplifier; 0 leaves the lag out"),
    pu("V_RMAX", 1.2, "Upper limit of V_R"),
    pu("V_RMIN", -1.2, "Lower limit of V_R"),
)
EXCITER = (
    pu("K_E", 1.0, "Exciter constant", 1e-3),
    seconds("T_E", 0.5, "Exciter's field", 1e-3),
)
EXST3 = (
    pu("V_IMAX", 0.2, "Upper limit of the error"),
    pu("V_IMIN", -0.2, "Lower limit of the error"),
    pu("K_J", 200.0, "Gain of the first stage", 1e-3),
    pu("K_A", 7.93, "Gain", 1e-3),
    seconds("T_A", 0.4, "Amplifier", 1e-3),
    pu("V_RMAX", 1.0, "Upper limit of V_R"),
    pu("V_RMIN", 0.0, "Lower limit of V_R"),
    pu("K_G", 1.0, "Feedback of the field voltage", 0),
    pu("V_GMAX", 5.8, "Upper limit of that feedback"),
    pu("E_FDMAX", 6.9, "Upper limit of the field voltage"),
)
ESST3A = (
    pu("V_IMAX", 0.2, "Upper limit of the error"),
    pu("V_IMIN", -0.2, "Lower limit of the error"),
    pu("K_M", 7.93, "Gain of the inner regulator", 1e-3),
    seconds("T_M", 0.4, "Lag of the inner regulator", 1e-3),
    pu("V_MMAX", 1.0, "Upper limit of V_M"),
    pu("V_MMIN", 0.0, "Lower limit of V_M"),
    pu("K_G", 1.0, "Feedback of E_fd", 0),
    pu("V_GMAX", 5.8, "Upper limit of that feedback"),
)


def _amplifier(m: ModelBuilder, p: Given, error: Expr, initial: Expr) -> Expr:
    """Declare the amplifier with its lag and limits, and return what it gives [pu]."""
    signal = p.K_A * error
    return limited_low_pass(m, "amplifier", signal, p.T_A, p.V_RMIN, p.V_RMAX, initial=initial)


def esst2a(m: ModelBuilder, seen: Regulated, *, adds: bool = False) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu].

    ``adds``: whether it is EXST2, which adds its source to the regulator's voltage."""
    with m.scope("exciter"):
        p = declared(m, (*REGULATOR, *EXCITER), SOURCE)
        lines = (*(COMPOUND[:2] if adds else COMPOUND), LOADED[0])
        source = Source(
            declared(m, lines, SOURCE, {"K_P": 2.0 if adds else 4.88, "K_C": 0.3}), seen
        )
        high = declared(m, (pu("E_FDMAX", 5.0, "Highest field voltage"),), SOURCE).E_FDMAX
        E_0 = seen.start.E_fd
        drive_0, V_B0 = p.K_E * E_0, source.at_start
        V_A0 = drive_0 - V_B0 if adds else drive_0 / V_B0
        require_within(m, V_A0, p.V_RMIN, p.V_RMAX, ("exciter.V_RMIN", "exciter.V_RMAX"))
        require_within(m, E_0, 0.0, high, ("exciter.E_FDMAX", "exciter.E_FDMAX"))
        x = m.state("E", E_0, "pu", "Field voltage", base="E_fd")
        E_fd = clamp(x, 0, high)
        V_F, _ = rate_feedback(m, E_fd, E_0, 0.05, 1.0)
        measured = Measurement(m, seen)
        error = seen.lifted(measured.error(V_A0 / p.K_A) - V_F, BEFORE, V_A0 / p.K_A)
        V_A = _amplifier(m, p, error, V_A0)
        V_B = source.available(seen.terminal(E_fd))
        drive = V_A + V_B if adds else V_A * V_B
        rate = (drive - p.K_E * E_fd) / p.T_E
        m.derivative(x, held_at_limits(x, rate, 0, high))
        return measured.close(E_fd)


exst2 = partial(esst2a, adds=True)


def esst3a(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        wide = {"K_A": 200.0, "T_A": 0.0, "V_RMAX": 10.0, "V_RMIN": -10.0}
        p, inner = declared(m, REGULATOR, SOURCE, wide), declared(m, ESST3A, SOURCE)
        source, E_0 = compound_source(m, seen, 6.15, 0.2), seen.start.E_fd
        V_M0 = E_0 / source.at_start
        V_R0 = V_M0 / inner.K_M + fmin(inner.K_G * E_0, inner.V_GMAX)
        V_I0 = V_R0 / p.K_A
        require_within(m, V_I0, inner.V_IMIN, inner.V_IMAX, ("exciter.V_IMIN", "exciter.V_IMAX"))
        require_within(m, V_R0, p.V_RMIN, p.V_RMAX, ("exciter.V_RMIN", "exciter.V_RMAX"))
        require_within(m, V_M0, inner.V_MMIN, inner.V_MMAX, ("exciter.V_MMIN", "exciter.V_MMAX"))
        measured = Measurement(m, seen)
        error = clamp(measured.error(V_I0), inner.V_IMIN, inner.V_IMAX)
        compensated = lead_lag_stage(m, error, V_I0, lead=1.0)
        V_R = _amplifier(m, p, compensated, V_R0)
        x = m.state("inner", V_M0, "pu", "first-order lag with limits", base="E_fd")
        V_M = clamp(x, inner.V_MMIN, inner.V_MMAX)
        # v_t depends on E_fd, and E_fd on v_t, weakly: two rounds from I_fd, the value of E_fd at rest
        first = V_M * source.available(seen.terminal(seen.I_fd))
        E_fd = V_M * source.available(seen.terminal(first))
        rest = V_R - fmin(inner.K_G * E_fd, inner.V_GMAX)
        close_limited_low_pass(m, x, inner.K_M * rest, inner.T_M, inner.V_MMIN, inner.V_MMAX)
        return measured.close(E_fd)


def exst3(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        p, E_0 = declared(m, EXST3, SOURCE), seen.start.E_fd
        fed = declared(m, (*COMPOUND, LOADED[0]), SOURCE, {"K_P": 6.15, "K_C": 0.2})
        source = Source(fed, seen)
        V_R0 = E_0 / source.at_start
        V_I0 = (V_R0 / p.K_A + fmin(p.K_G * E_0, p.V_GMAX)) / p.K_J
        require_within(m, V_I0, p.V_IMIN, p.V_IMAX, ("exciter.V_IMIN", "exciter.V_IMAX"))
        require_within(m, V_R0, p.V_RMIN, p.V_RMAX, ("exciter.V_RMIN", "exciter.V_RMAX"))
        m.require(p.E_FDMAX - E_0, "exciter.E_FDMAX must exceed the field voltage at the start")
        measured = Measurement(m, seen)
        error = clamp(measured.error(V_I0), p.V_IMIN, p.V_IMAX)
        V_A = p.K_J * lead_lag_stage(m, error, V_I0, lead=1.0)
        x = m.state("amplifier", V_R0, "pu", "first-order lag with limits", base="E_fd")
        V_R = clamp(x, p.V_RMIN, p.V_RMAX)

        def driven(v_t: Phasor) -> Expr:
            return fmin(V_R * source.available(v_t), p.E_FDMAX)

        # v_t depends on E_fd, and E_fd on v_t, weakly: two rounds from I_fd, the value of E_fd at rest
        E_fd = driven(seen.terminal(driven(seen.terminal(seen.I_fd))))
        rest = V_A - fmin(p.K_G * E_fd, p.V_GMAX)
        close_limited_low_pass(m, x, p.K_A * rest, p.T_A, p.V_RMIN, p.V_RMAX)
        return measured.close(E_fd)


def ieeet3(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        p = declared(m, (*REGULATOR, *EXCITER), SOURCE, {"V_RMAX": 6.0, "V_RMIN": -6.0})
        source = Source(declared(m, COMPOUND[:2], SOURCE, {"K_P": 2.5, "K_I": 1.2}), seen)
        V_BMAX = declared(m, (pu("V_BMAX", 8.0, "Upper limit of V_B"),), SOURCE).V_BMAX
        E_0 = seen.start.E_fd

        def behind_commutation(V_E: Expr, I_fd: Expr) -> Expr:
            return sqrt(fmax(V_E**2 - (_COMMUTATION * I_fd) ** 2, 0))

        V_E0 = source.voltage(seen.v_0, seen.start.i)
        V_R0 = p.K_E * E_0 - behind_commutation(V_E0, E_0)
        m.require(
            V_E0 - _COMMUTATION * E_0,
            "exciter.K_P: the source of the operating point does not carry the field current; raise K_P or K_I",
        )
        require_within(m, V_R0, p.V_RMIN, p.V_RMAX, ("exciter.V_RMIN", "exciter.V_RMAX"))
        require_within(m, p.K_E * E_0, 0.0, V_BMAX, ("exciter.V_BMAX", "exciter.V_BMAX"))
        E_fd = m.state("E", E_0, "pu", "Field voltage", base="E_fd")
        V_F, _ = rate_feedback(m, E_fd, E_0, 0.05, 1.0)
        measured = Measurement(m, seen)
        V_R = _amplifier(m, p, measured.error(V_R0 / p.K_A) - V_F, V_R0)
        V_E = source.voltage(seen.terminal(E_fd), seen.i)
        added = clamp(V_R + behind_commutation(V_E, seen.I_fd), 0, V_BMAX)
        drawn = _COMMUTATION * seen.I_fd
        V_B = if_else(drawn < V_E, added, 0)
        m.derivative(E_fd, (V_B - p.K_E * E_fd) / p.T_E)
        return measured.close(E_fd)
