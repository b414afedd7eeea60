"""A power flow beside the voltages that its network's file holds: how far they are apart, and the likeliest cause.

At the file's voltages, the file's own data must balance every bus without a unit that holds its voltage, and every unit
must hold what the file has.  Where one of the two fails, the power flow is another than the file's."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.sparse.linalg import spsolve

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.flow.equations import FlowEquations
from orchestrator.cases.flow.power_flow import PowerFlow

CLOSE = 1e-4  # difference of a voltage that needs no cause, beyond what the file's digits leave open [pu]
_PART = 0.2  # part of the largest cause's effect from which another one is told as well
_ROUNDS = 20  # to voltages that the file lacks


@dataclass(frozen=True)
class FileVoltages:
    """Voltages of a network's file [pu] by bus, and what the digits that it gives leave open [pu]."""

    at: Mapping[str, complex] = field(default_factory=dict)
    rounding: float = 0.0


@dataclass(frozen=True)
class BesideFile:
    """Largest difference of a voltage from the file's, angles counted from the slack's [pu], its bus, and the cause."""

    difference: float
    bus: str
    cause: str = ""

    @property
    def in_words(self) -> str:
        """Return the line that tells it, with the bus' identifier."""
        if self.difference <= CLOSE:
            return f"within {self.difference:.1g} pu of the file's voltages"
        why = f": {self.cause}" if self.cause else ", which its digits leave open"
        return f"up to {self.difference:.2g} pu ({self.bus}) beside the file's voltages{why}"

    def as_json(self) -> dict[str, Any]:
        """Return the entry ``power_flow`` of ``gfor new --json``."""
        return {"beside_file_pu": self.difference, "bus": self.bus, "cause": self.cause}


def complete_voltages(equations: FlowEquations, known: Mapping[str, complex]) -> np.ndarray:
    """Return the voltages of all buses [pu], of which those that are not known are such that nothing is left there."""
    v = np.array([known.get(bus, 1 + 0j) for bus in equations.buses])
    is_known = np.array([bus in known for bus in equations.buses])
    inner, outer = np.flatnonzero(~is_known), np.flatnonzero(is_known)
    if inner.size:
        inside = equations.matrix[inner]
        for _ in range(_ROUNDS if equations.fed[inner].any() else 1):  # boundaries have loads
            drawn = (equations.fed / v).conj()[inner] - inside[:, outer] @ v[outer]
            v[inner] = np.atleast_1d(spsolve(inside[:, inner].tocsc(), drawn))
    return v


def compare_with_file(
    flow: PowerFlow, file: FileVoltages, held_devices: Iterable[str] = ()
) -> BesideFile | None:
    """Compare a power flow with its file's voltages; None where the file has none at the slack.

    Parameters
    ----------
    flow
        Power flow whose loads are constant powers.
    file
        Voltages of the file; empty if it is not solved.
    held_devices
        Buses at which DC lines, FACTS devices and the like feed.

    Returns
    -------
    BesideFile
        With a cause if the difference exceeds `CLOSE` beyond the file's digits: the bus at which the file's voltages
        leave most apparent power, or whose unit holds another voltage, or the stray capacitance of EMT models.  Which
        of them moves the voltages how far is known from the linear power flow at the file's voltages."""
    common = [bus for bus in flow.voltages if bus in file.at]
    if flow.slack not in common:
        return None
    turn = flow.voltages[flow.slack] / file.at[flow.slack]
    turn /= abs(turn)
    difference, bus = max((abs(flow.voltages[x] - turn * file.at[x]), x) for x in common)
    if difference <= CLOSE + file.rounding:
        return BesideFile(difference, bus)
    theirs = {x: turn * file.at[x] for x in common}
    return BesideFile(difference, bus, _tell(flow, theirs, {*held_devices}))


def _tell(flow: PowerFlow, theirs: Mapping[str, complex], devices: set[str]) -> str:
    """Return the causes that move the voltages most, in words."""
    equations = _equations(flow)
    stated = complete_voltages(equations, theirs)
    ours = np.array([flow.voltages[bus] for bus in equations.buses])
    # what the file's data feed beyond what the network takes away [pu]
    left = equations.powers(ours) - equations.powers(stated)
    place = {bus: k for k, bus in enumerate(equations.buses)}
    stray = np.zeros_like(left)
    for shunt in (x for x in flow.shunts if x.stray):
        stray[place[shunt.bus]] += 1j * shunt.b * abs(stated[place[shunt.bus]]) ** 2
    free = np.ones(len(left), dtype=bool)
    free[equations.held] = False
    left = np.where(free, left, left.real) - np.where(free, stray, 0)
    left[equations.slack] = 0
    beyond = abs(ours) - abs(stated)
    beyond[free] = 0
    moved = {
        _tell_left(equations, left, devices): _moved_by(equations, stated, left),
        _tell_held(flow, equations, beyond): _moved_by_holding(equations, stated, beyond),
        "stray_B of EMT models, which the file does not have": _moved_by(equations, stated, stray),
    }
    most = max(moved.values())
    causes = sorted((x for x in moved if moved[x] >= _PART * most), key=lambda x: -moved[x])
    return "; and ".join(causes)


def _equations(flow: PowerFlow) -> FlowEquations:
    held = {bus: abs(flow.voltages[bus]) for bus in flow.holding}
    return FlowEquations.of(
        [*flow.voltages],
        flow.lines,
        flow.loads,
        shunts=flow.shunts,
        active={},
        held=held,
        slack_bus=flow.slack,
    )


def _tell_left(equations: FlowEquations, left: np.ndarray, devices: set[str]) -> str:
    k = int(np.argmax(np.abs(left)))
    active, reactive = (
        round(float(SYSTEM_BASE_MVA * x), 3) + 0.0 for x in (left[k].real, left[k].imag)
    )
    size = f"{active:+.4g} MW" + ("" if equations.held[k] else f" {reactive:+.4g} Mvar")
    bus = equations.buses[k]
    at = f"{size} at {bus}"
    if bus in devices:
        return f"a DC line, FACTS device or the like feeds another power than in the file's solution: {at} beyond it"
    return f"the file's voltages do not fulfil its own data, which leave {at} and less elsewhere"


def _tell_held(flow: PowerFlow, equations: FlowEquations, beyond: np.ndarray) -> str:
    k = int(np.argmax(abs(beyond)))
    bus = equations.buses[k]
    here = abs(flow.voltages[bus])
    why = (
        "which keeps a limit of reactive power, has"
        if bus in {x.bus for x in flow.at_limits}
        else "whose unit holds its voltage, has"
    )
    return f"{bus}, {why} {here:.5g} pu for {here - beyond[k]:.5g} in the file"


def _moved_by(equations: FlowEquations, stated: np.ndarray, power: np.ndarray) -> float:
    """Return how far power that is fed in moves a voltage at most [pu]."""
    fed = np.concatenate([power.real[equations.angle_buses], power.imag[equations.free_buses]])
    if not fed.any():
        return 0.0
    step = np.atleast_1d(spsolve(equations.jacobian(stated), fed))
    return float(np.abs(step).max())


def _moved_by_holding(equations: FlowEquations, stated: np.ndarray, beyond: np.ndarray) -> float:
    """Return how far other held magnitudes move a voltage at most [pu]."""
    if not beyond.any():
        return 0.0
    held = stated * (1 + beyond / abs(stated))
    change = equations.powers(stated) - equations.powers(held)
    return max(float(np.abs(beyond).max()), _moved_by(equations, stated, change))
