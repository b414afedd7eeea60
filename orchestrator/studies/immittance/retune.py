"""Parameters to retune: margin, least damped mode and admissible weakening of the network over each of a device.

From a few scans the loop is a rational function of the parameter at every frequency. Each further scan stands where two
such functions differ most, and checks what was predicted there before it is used."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import CosimError
from orchestrator.studies.immittance.family import Family, LoopFigures, kept_points
from orchestrator.studies.immittance.judgement import NyquistVerdict
from orchestrator.studies.immittance.study import CutResult

# a parameter is followed from its value divided by this to its value times this, within its bounds
REACH = 4.0
GRID = 41  # values at which the distance from −1 is given
_FIRST = 4  # scans before the first check
_MOST = 10  # scans at most
_CLOSE = 0.01  # error of the distance from −1 below which two checks in a row end the scanning
# relative change of the loop over the whole range below which a parameter does nothing
_SAME = 1e-7
_INSIDE = (
    0.01  # part by which a needed value goes beyond the goal, so that rounding does not miss it
)
_TRIES = 3  # scans that may confirm a needed value


@dataclass(frozen=True)
class Tunable:
    """A parameter, its value now, and the range over which it is followed."""

    name: str
    unit: str
    now: float
    low: float
    high: float

    @property
    def grid(self) -> Numbers:
        """Values over the range, equally spaced by their logarithm where it has one sign."""
        spaced = np.geomspace if self.low * self.high > 0 else np.linspace
        return np.unique(np.append(spaced(self.low, self.high, GRID), self.now))


@dataclass(frozen=True)
class Foretold:
    """A scan that was predicted before it was made: distances from −1, and the error that was expected."""

    value: float
    predicted: float
    expected_error: float
    found: float


@dataclass
class Retuned:
    """Effect of one parameter on the loop: scans, and figures over its values."""

    setting: Tunable
    scans: dict[float, CutResult] = field(default_factory=dict)
    checks: list[Foretold] = field(default_factory=list)
    values: Numbers = field(default_factory=lambda: np.zeros(0))
    figures: list[LoopFigures] = field(default_factory=list)  # at ``values``
    remark: str = ""  # why it cannot be followed, or what was left out
    # least change that meets the goal; None where it is met now, or nowhere
    needed: float | None = None
    predicted: LoopFigures | None = None  # at ``needed``, before the scan that confirms it

    @property
    def distances(self) -> Numbers:
        return np.array([x.distance for x in self.figures])

    @property
    def confirmed(self) -> CutResult | None:
        return None if self.needed is None else self.scans[self.needed]

    @property
    def error(self) -> float:
        """Largest error of the last two checks; 1 where nothing could be predicted."""
        return float(
            np.nan_to_num(
                [abs(c.found - c.predicted) for c in self.checks[-2:]] or [1.0], nan=1.0
            ).max()
        )

    @property
    def effort(self) -> float:
        """Relative change that is needed; infinite where none is enough."""
        now = self.setting.now
        return (
            math.inf
            if self.needed is None
            else abs(self.needed - now) / max(abs(now), abs(self.needed))
        )

    def met(self, goal: float) -> bool:
        return bool(self.distances[np.searchsorted(self.values, self.setting.now)] >= goal)


Study = Callable[[Mapping[str, float]], CutResult]


def retune(
    study: Study,
    setting: Tunable,
    base: CutResult,
    goal: float,
    report: Callable[[str], None] = lambda text: None,
) -> Retuned:
    """Follow one parameter.

    ``study``: Makes and judges the loop with other values of parameters.
    ``base``: The loop as it is.
    ``goal``: Least distance from −1 that is wanted."""
    out = Retuned(setting, {setting.now: base})
    try:
        low, high = (_end(study, out, end, report) for end in (setting.low, setting.high))
        setting = out.setting = replace(setting, low=low, high=high)
        ends = _family(out, [low, high])
        if np.abs(ends.loops[-1] - ends.loops[0]).max() < _SAME * np.abs(ends.loops[0]).max():
            out.remark = "changes nothing at the cut"
            return out
        for value in setting.grid[[GRID // 2, GRID // 4]].tolist():
            if len(out.scans) < _FIRST:
                _scan(study, out, value, report)
        family = _family(out)
        while len(out.scans) < _MOST and not _has_converged(out):
            family = _check(study, out, family, report)
        try:
            _meet(study, out, family, goal, report)
        finally:
            _tell(out)
    except CosimError as error:
        out.remark = f"cannot be followed: {error}"
    return out


def _family(out: Retuned, values: list[float] | None = None) -> Family:
    nodes = sorted(values or out.scans)
    results = [out.scans[value] for value in nodes]
    s = np.concatenate([kept_points(result.judgement.path) for result in results])
    s = s[np.unique(s.imag, return_index=True)[1]]
    low, high = (f(r.judgement.path.s.imag[k] for r in results) for f, k in ((max, 0), (min, -1)))
    s = s[(s.imag >= low) & (s.imag <= high)]
    loops = np.array([result.loop.values(s) for result in results])
    poles = tuple(len(result.judgement.open_loop) for result in results)
    rated, loop = 2 * np.pi * results[0].request.frequency, results[0].loop
    return Family(
        np.array(nodes),
        s,
        loops=loops,
        poles=poles,
        exact=loop.is_exact,
        rated=rated,
        lead=loop.lead,
    )


def _end(study: Study, out: Retuned, end: float, report: Callable[[str], None]) -> float:
    """The end of the range, or as near to it as the device can be scanned."""
    for _ in range(_TRIES):
        try:
            _scan(study, out, end, report)
        except CosimError as error:
            out.remark = f"not scanned at {end:.4g}: {error}"
            end = (end + out.setting.now) / 2
        else:
            return end
    return out.setting.now


def _scan(study: Study, out: Retuned, value: float, report: Callable[[str], None]) -> CutResult:
    if value not in out.scans:
        report(f"{out.setting.name} = {value:.4g}: scan {len(out.scans) + 1}")
        out.scans[value] = study({out.setting.name: value})
    return out.scans[value]


def _has_converged(out: Retuned) -> bool:
    last = out.checks[-2:]
    return len(last) == 2 and all(
        max(abs(c.found - c.predicted), c.expected_error) < _CLOSE for c in last
    )


def _check(study: Study, out: Retuned, family: Family, report: Callable[[str], None]) -> Family:
    """Scan where all scans and all but one of them say most different things; return the loops with that scan."""
    nodes = family.nodes[1:-1]
    fewer = [family.without(value) for value in nodes.tolist() if value != out.setting.now][-2:]
    apart = np.abs(
        np.searchsorted(out.setting.grid, family.nodes)[:, None] - np.arange(len(out.setting.grid))
    ).min(0)
    open_ = out.setting.grid[apart > 1][::2] if (apart > 1).any() else out.setting.grid[apart > 0]
    said = np.array([family.distance(value) for value in open_.tolist()])
    other = np.array([[f.distance(value) for value in open_.tolist()] for f in fewer])
    errors = np.nan_to_num(np.abs(other - said).max(axis=0), nan=1.0)
    k = int(np.argmax(errors + 1e-6 * apart[np.searchsorted(out.setting.grid, open_)]))
    value = float(open_[k])
    _scan(study, out, value, report)
    family = _family(out)
    found = family.distance(value)
    out.checks.append(Foretold(value, float(said[k]), float(errors[k]), found))
    return family


def _values(out: Retuned, family: Family) -> Numbers:
    return np.unique(np.r_[out.setting.grid, family.nodes])


def _tell(out: Retuned) -> None:
    family = _family(out)
    out.values = _values(out, family)
    out.figures = [family.figures(value) for value in out.values.tolist()]
    open_ = {
        f"{value:.4g}": r.judgement.reasons
        for value, r in sorted(out.scans.items())
        if r.judgement.reasons
    }
    if open_:
        why = next(iter(open_.values()))[0]
        out.remark = f"scans at {', '.join(open_)} give no verdict by themselves, and none of these is taken: {why}"


def _meet(
    study: Study, out: Retuned, family: Family, goal: float, report: Callable[[str], None]
) -> None:
    """Find the least change that meets the goal, and scan there.

    ``family``: The loops of all scans until now."""
    for _ in range(_TRIES):
        values = _values(out, family)
        distances = np.array([family.distance(value) for value in values.tolist()])
        k, meets = int(np.searchsorted(values, out.setting.now)), distances >= goal
        if meets[k] or not meets.any():
            return
        near = int(min(np.flatnonzero(meets), key=lambda i: abs(i - k)))
        back = near + (1 if near < k else -1)
        d = distances[[back, near]]
        part = 1.0 if math.isnan(d[0]) else min(1.0, float((goal - d[0]) / (d[1] - d[0])) + _INSIDE)
        value = float(values[back] + part * (values[near] - values[back]))
        predicted = family.figures(value)
        result = _scan(study, out, value, report)
        family = _family(out)
        found = family.distance(value)
        out.checks.append(
            Foretold(value, predicted.distance, abs(predicted.distance - goal), found)
        )
        if found >= goal and result.verdict is NyquistVerdict.STABLE:
            out.needed, out.predicted = value, predicted
            return
