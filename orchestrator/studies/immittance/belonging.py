"""Checks that two sides belong together, or a scan to its place in a case."""

from dataclasses import replace

import numpy as np

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.studies.immittance.cut import Cut
from orchestrator.studies.immittance.judgement import CutJudgement, NyquistVerdict
from orchestrator.studies.immittance.loop import CutLoop
from orchestrator.studies.immittance.scan import PortPoint, Scan
from orchestrator.studies.immittance.sides import NEAR_ZERO, Known

# median size of the loop beyond which one scan is rather in per unit than so weak or strong
_UNLIKE = (0.003, 30.0)

_OTHER_POINT = 0.01
"""Relative difference of the voltage, and of the power over the larger one, from which on an operating point is another
one."""

# frequencies [Hz] of a comparison with the eigenvalues, and its tolerance
_COMPARED, _SAME = (0.05, 1000.0), 0.01
# real part of an eigenvalue that grows [1/s], as in `orchestrator.linear.spectra.stability`
_GROWS = 1e-6


def check_size(loop: CutLoop, low: float, high: float) -> None:
    """Refuse two sides whose loop is so large or small that one is in other units."""
    sizes = np.linalg.norm(
        loop.values(2j * np.pi * np.geomspace(low, high, 50)), ord=2, axis=(1, 2)
    )
    ratio = float(np.median(sizes))
    if not _UNLIKE[0] < ratio < _UNLIKE[1]:
        raise InputError(
            f"{loop.device.name} times the impedance of {loop.network.name} is {ratio:.2g} at most frequencies: is one "
            "of them in per unit where the other is in siemens? Then give "
            + Option.PER_UNIT
            + " device or network, and "
            + Option.VOLTAGE
            + "; if the units are right, give "
            + Option.UNITS_CHECKED
        )


def check_pair(device: Scan, network: Scan) -> None:
    """Refuse a device and a network that do not belong together: ports, frequencies, operating points."""
    if len(device.ports) != len(network.ports):
        raise InputError(
            f"{device.source} has the ports {', '.join(device.ports)}, {network.source} has "
            f"{', '.join(network.ports)}; they must be the same"
        )
    low, high = (f(s.frequencies[k] for s in (device, network)) for f, k in ((max, 0), (min, -1)))
    if low * 1.5 >= high:
        raise InputError(
            f"{device.source} and {network.source} have no common range of frequencies"
        )
    for one, other in zip(device.ports, network.ports, strict=True):
        if one in device.points and other in network.points:
            _check_point(
                f"port {one}: {device.source}",
                device.points[one],
                network.source,
                network.points[other],
            )


def _check_point(what: str, a: PortPoint, other: str, b: PortPoint) -> None:
    """Refuse two operating points that differ; signs of powers are anybody's."""
    power = max(abs(complex(p.megawatt or 0, p.megavar or 0)) for p in (a, b))
    for name, x, y, size in (
        ("voltage [kV]", a.kilovolt, b.kilovolt, a.kilovolt),
        ("active power [MW]", a.megawatt, b.megawatt, power),
        ("reactive power [Mvar]", a.megavar, b.megavar, power),
    ):
        if x is not None and y is not None and abs(abs(x) - abs(y)) > _OTHER_POINT * (size or 1):
            raise InputError(
                f"{what} was scanned at another operating point than {other}: {name} {x:g} and {y:g}; scan both at one"
            )


def check_place(scan: Scan, cut: Cut, name: str, kilovolt: float | None) -> None:
    """Refuse a scan of several ports, or at another operating point than a component's in the case."""
    if len(scan.ports) > 1:
        raise InputError(
            f"{scan.source}: it has the ports {', '.join(scan.ports)}, and {name} stands at one bus"
        )
    power = cut.voltages[name] * cut.currents[name].conjugate() * SYSTEM_BASE_MVA
    here = PortPoint(
        abs(cut.voltages[name]) * kilovolt if kilovolt else None, power.real, power.imag
    )
    for point in scan.points.values():
        _check_point(scan.source, point, f"{name} in the case", here)


def beside_modes(judgement: CutJudgement, cut: Cut) -> CutJudgement:
    """Where the modes of the closed system say otherwise, nothing is known."""
    said = {
        True: NyquistVerdict.STABLE,
        False: NyquistVerdict.UNSTABLE,
        None: NyquistVerdict.NOT_KNOWN,
    }
    values = cut.eigenvalues
    growing = int(
        (
            (values.real > np.maximum(_GROWS, 1e-8 * np.abs(values))) & (np.abs(values) > NEAR_ZERO)
        ).sum()
    )
    alike = not len(values) or growing == judgement.growing
    if judgement.reasons or (
        said[cut.modes_stable] is judgement.verdict and alike and _is_of(judgement, cut)
    ):
        return judgement
    reason = (
        f"the eigenvalues of the closed system say {said[cut.modes_stable]} ({growing} grow), the encirclements "
        f"{judgement.verdict} ({judgement.growing}); or det(1 + L) is not that of the eigenvalues and poles"
    )
    return replace(judgement, verdict=NyquistVerdict.NOT_KNOWN, reasons=(reason,), growing=None)


def _is_of(judgement: CutJudgement, cut: Cut) -> bool:
    """Return whether det(1 + L) is ∏(s − eigenvalues)/∏(s − poles) but for a constant; clocks are eigenvalues alone."""
    path = judgement.path
    k = np.flatnonzero(
        (path.s.real == 0) & (path.hertz > _COMPARED[0]) & (path.hertz < _COMPARED[1])
    )[:: len(path.s) // 20]
    s, poles = (
        path.s[k][:, None],
        np.concatenate([x.poles for x in (cut.device, cut.network) if isinstance(x, Known)]),
    )
    clocks = len(cut.eigenvalues) - len(poles)
    said = (
        np.log(s - cut.eigenvalues).sum(axis=1)
        - np.log(s - poles).sum(axis=1)
        - clocks * np.log(s[:, 0])
    )
    apart = np.exp(said - np.log(path.det[k]) - (said - np.log(path.det[k]))[0])
    return not len(cut.eigenvalues) or bool(np.abs(apart - 1).max() < _SAME)
