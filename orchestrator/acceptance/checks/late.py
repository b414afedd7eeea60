"""Whether a device at its port is the same at any time and angle, and shows the power that it gives."""

import re

import numpy as np

from orchestrator.acceptance.checks.base import SAME, CheckResult, check, failed, not_applicable, passed
from orchestrator.acceptance.checks.comparing import difference, scales
from orchestrator.acceptance.checks.events import scale
from orchestrator.acceptance.checks.port import ANSWER, IMPORTING, POINTS, WHY, followed, present_current, rating_of
from orchestrator.acceptance.checks.running import affordable
from orchestrator.acceptance.checks.subject import OperatingAt, Subject
from orchestrator.errors import ComponentError, EndedError
from orchestrator.units import to_unit

_LATE = 20_000.0  # A start [s] at which single precision has no milliseconds left; a day has more seconds

_SAME, _STILL = 1e-4, 100.0
"""Difference of two answers, in parts of their range, up to which they are alike; and in parts of a rest's motion."""

_FASTER, _LASTS = 0.012, 9.0  # frequency [pu] by which it is turned forth, and back for twice as long; in all [s]
_TURNED = 5e-5  # difference of the currents that two angles bring [pu, S_n]: a jump of some hundredths of a milliradian

_POWER = re.compile(r"^[pq](?![a-z])|power", re.IGNORECASE)
_NEAR = 0.02


@check("later_times", "Does it answer alike at later times?", needs=(*SAME, "steady_state"))
def later_times(subject: Subject) -> CheckResult:
    """The answer to a small step at once, after a long rest, and where it starts at another time."""
    if not subject.port:
        return not_applicable("later_times", WHY["no port"])
    steps, h, said, found = affordable(subject, ANSWER), subject.step_size, [], 0.0
    if (rested := subject.memory.get("rested")) is not None:
        point, rest, late = rested
        first = subject.trajectory(steps, h, subject.one_step(), point=point)
        apart, output = difference(first, late)
        found = apart if apart * scales(first, late)[output] >= _STILL * rest.moved else 0.0
        said.append(f"after {rest.time:.3g} s at rest it is {found:.2g} of its range away")
    first = subject.trajectory(steps, h, subject.one_step())
    try:
        subject.start_time = _LATE
        apart, _ = difference(first, subject.trajectory(steps, h, subject.one_step()))
        said.append(f"started at {_LATE:g} s it is {apart:.2g} of its range away")
        found = max(found, apart)
    except (ComponentError, EndedError) as error:
        said.append(f"not judged where it starts at {_LATE:g} s: {error}")
    finally:
        subject.start_time = 0.0
    says = f"the answer to a small step: {', '.join(said)}"
    return (failed("later_times", "counts time", says, apart=found) if found > _SAME
            else passed("later_times", says, apart=found))  # fmt: skip


@check("angles", "Is it the same wherever its angle begins?", needs=(*SAME, "steady_state"))
def angles(subject: Subject) -> CheckResult:
    """The network turns it by two turns either way, from two angles; the second run is the first, turned."""
    if not subject.starts:
        return not_applicable("angles", WHY["no start" if subject.port else "no port"])
    h, found = subject.step_size, []
    steps = max(3, round(scale(subject, _LASTS) * _LASTS / h))
    rates = np.where(np.arange(steps) < steps / 3, _FASTER, -_FASTER)
    turned = np.exp(100j * np.pi * h * np.cumsum(rates))
    for theta in subject.random("angles").uniform(2.0, 3.1) * np.array([1.0, -1.0]):
        with subject.running(point=OperatingAt(1.0, theta, 0.3, 0.05)) as running:
            found.append(followed(running, turned) * np.exp(-1j * theta) / turned)
    apart = np.abs(found[1] - found[0])
    at = int(np.argmax(apart > _TURNED))
    if not apart.max() <= _TURNED:
        says = f"turned by {100 * _FASTER:g} % of frequency, its current from theta_0 = {theta:.3g} rad differs from "
        says += f"that from {-theta:.3g} rad by {apart.max():.2g} pu, first at t = {at * h:.3g} s"
        return failed("angles", "jumps with its angle", says, apart=float(apart.max()))
    says = f"turned by {100 * np.pi * _FASTER * h * steps / 3:.3g} rad forth and back, from two angles, it differs by "
    return passed("angles", f"{says}{apart.max():.2g} pu")


@check("shown_power", "Do its outputs of power show what it gives?", needs=(*SAME, "power_balance"))
def shown_power(subject: Subject) -> CheckResult:
    """Only factors that a wrong unit or base brings are told: what is measured elsewhere differs by losses."""
    variables = subject.description.variables
    units = {n: unit for n in subject.outputs if (unit := _megawatts(n, variables[n].unit)) is not None}
    if not subject.starts or not units:
        return not_applicable("shown_power", "because it shows no power besides its current")
    powers, shown = [], []
    for point in (*POINTS[:3], IMPORTING[0]):
        try:
            with subject.running(point=point) as running:
                rating, values = rating_of(running), dict(zip(subject.watched, running.read(), strict=True))
                powers.append(point.voltage * present_current(running).conjugate())
        except ComponentError:
            continue
        shown.append([values[n] * (unit or rating) / rating for n, unit in units.items()])
    if len(powers) < 3:
        return not_applicable("shown_power", f"because it starts at {len(powers)} points only")
    known = {1e3: "1000", 1e-3: "1/1000", rating: "S_n", 1 / rating: "1/S_n", 1e3 * rating: "1000·S_n"}
    for name, row in zip(units, np.array(shown).T, strict=True):
        for word, flows in (("P", np.real(powers)), ("Q", np.imag(powers))):
            ratio = float(row @ flows / (flows @ flows))
            fits = np.abs(row - ratio * flows).max() <= _NEAR * np.abs(row).max()
            factor = next((t for f, t in known.items() if abs(abs(ratio) / f - 1) < _NEAR and abs(f - 1) > 0.5), "")
            if fits and factor:
                says = f"{name} is declared in {variables[name].unit} and shows {abs(ratio):.4g} times the {word}"
                return failed("shown_power", "wrong units", f"{says} that flows ({factor})", ratio=ratio)
    return passed("shown_power", f"{', '.join(units)}: no wrong unit is seen")


def _megawatts(name: str, unit: str) -> float | None:
    """Megawatts in one of its unit, 0 for the rating; None where it is no power."""
    if unit in ("pu", "p.u.", ""):
        return 0.0 if unit and _POWER.search(name.rpartition(".")[2]) else None
    for mega in ("MW", "Mvar", "MVA"):
        try:
            return to_unit(f"1 {unit}", mega)
        except ValueError:
            continue
    return None
