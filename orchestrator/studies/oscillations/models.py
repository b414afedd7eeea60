"""Comparison of each unit with its own linear model: one whose current does something else drives the oscillation.

Chevalier, Vorobev and Turitsyn, "Using effective generator impedance for forced oscillation source location", IEEE
Trans. Power Systems 33(6), 2018, with the linear models of the case's own components in the place of fitted ones."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Complex, Matrix, Numbers
from orchestrator.core.units import whole_percent
from orchestrator.studies.oscillations.detection import SpectralLine
from orchestrator.studies.oscillations.location import Opinion, block_phasors, jackknife
from orchestrator.studies.oscillations.measurements import Measurements, Site

OWN_MODEL = "own linear models"
# difference of the mean power, beside the apparent one, from which a model is of another point
_OTHER_POINT = 0.05
_CERTAIN = 3.0  # standard errors by which a deviation must exceed zero
_EXPLAINED = 0.4  # part of all voltages' swing that a place may leave unexplained
_OWN_NOISE = 0.01  # power of each voltage's own noise, beside what loads' noise does to them
_SHARE = 0.8  # of the squares of all unexplained currents that one unit must have
_CONTRARY = 0.2  # what the deviation of another unit does, from which on no single place is named
_NOTED = 0.05  # the same, from which on the unit is not alone
# part of the voltages' swing beyond its errors from which on something else drives as well
_UNEXPLAINED = 0.15
_CLEARER = 0.6  # what the best place leaves beside what the second best does

Response = Callable[[complex], Complex]  # of s


@dataclass(frozen=True)
class UnitModel:
    """A unit at its operating point [pu on the system base, network frame]; the current flows out of it."""

    bus: str
    voltage: complex
    current: complex
    admittance: Response  # from its voltage to its current
    # from a current into its bus beside it, to the voltages of all buses in the closed system
    reach: Response


@dataclass(frozen=True)
class UnitModels:
    units: Mapping[str, UnitModel]
    buses: tuple[str, ...]  # with units, in the order of ``reach``
    loads: Mapping[str, Response]  # from a load's size to the same voltages


def turn(z: complex) -> Matrix:
    """The real matrix that multiplies by a complex number."""
    return np.array([[z.real, -z.imag], [z.imag, z.real]])


def own_models(
    models: UnitModels, measured: Measurements, found: SpectralLine, others: Sequence[float]
) -> Opinion:
    """The unit whose current is not what its model makes of its voltage, where that drives what all voltages do.

    Where all that are observed do as their models: the bus that is not, or the load, that explains the voltages."""
    units = {name.casefold(): unit for name, unit in models.units.items()}
    seen = [p for p in measured.places if p.kind == "unit" and p.name.casefold() in units]
    places = [p for p in seen if fits(units[p.name.casefold()], p, measured.base)]
    if not places:
        off = ", ".join(p.name for p in seen)
        why = (
            f"the power of {off} is not what the case has there"
            if off
            else "no unit of the case is in the record"
        )
        return Opinion(OWN_MODEL, None, False, f"{why} (units: {', '.join(models.units)})", ())
    known = [units[place.name.casefold()] for place in places]
    currents = _UnexplainedCurrents(models, places, known, 2j * np.pi * found.frequency)
    currents.measure(measured, found, others)
    rivals = _Rivals(models, currents)
    opinion = _opinion_on_a_unit(currents, rivals) or _opinion_on_a_rival(currents, rivals)
    if opinion is not None:
        return opinion
    both = ", ".join(f"{n} {whole_percent(x)}" for n, x in currents.ranking[:3])
    why = f"no place alone deviates from its model and explains the voltages (deviations: {both})"
    return Opinion(OWN_MODEL, None, True, why, currents.ranking)


class _UnexplainedCurrents:
    """Currents of the observed units that their models do not explain, and the voltages that these bring about.

    ``s``: of the oscillation [rad/s]; ``places`` and ``known``: the units in the record and in the case."""

    def __init__(
        self, models: UnitModels, places: Sequence[Site], known: Sequence[UnitModel], s: complex
    ) -> None:
        self._models = models
        self._places = places
        self._s = s
        self.known = known
        self.names = [place.name for place in places]
        self.rows = [models.buses.index(unit.bus) for unit in known]
        self._size = np.array([abs(unit.voltage) for unit in known])
        self._own = [_frame(u.voltage).T @ u.admittance(s) @ _frame(u.voltage) for u in known]

    def measure(self, measured: Measurements, found: SpectralLine, others: Sequence[float]) -> None:
        """Take the currents and voltages of a record, and judge which currents are beyond their errors."""
        self._base = measured.base
        self._means = np.array(
            [complex(p.p.mean(), p.q.mean()) / measured.base for p in self._places]
        )
        self.swings = block_phasors(self._places, measured.times, found, others)
        whole, errors = jackknife(self.swings, self.split)
        extra, self.voltages = whole[0], whole[1].ravel()
        self._voltage_errors = errors[1].ravel()
        amount = np.linalg.norm(extra, axis=1)
        self.ranking = tuple(
            (self.names[k], float(amount[k] ** 2 / ((amount**2).sum() or 1.0)))
            for k in np.argsort(-amount)
        )
        beyond_errors = amount > _CERTAIN * np.linalg.norm(errors[0], axis=1)
        self.sure = np.where(beyond_errors, amount, 0.0)
        self.effects = [
            self.reach(unit.reach, unit.voltage) @ extra[k] * (self.sure[k] > 0)
            for k, unit in enumerate(self.known)
        ]
        self.parts = [self.part_of_swing(effect) for effect in self.effects]

    def split(self, blocks: Complex) -> Complex:
        """Give of each unit the current that its model does not explain, and the voltage, along the mean and across."""
        p, q, angle, lnv = blocks.reshape(-1, 4).T
        voltage = self._size * np.array([lnv, angle])
        means = self._means
        turned = means.real * np.array([-lnv, angle]) + means.imag * np.array([angle, lnv])
        current = (np.array([p, -q]) / self._base + turned) / self._size
        unlike = [current[:, k] - self._own[k] @ voltage[:, k] for k in range(len(self._places))]
        return np.array([unlike, voltage.T])

    def reach(self, response: Response, frame: complex = 1.0) -> Complex:
        """Give the voltages of the observed units, each in its own frame, for a current in a frame."""
        parts = response(self._s).reshape(len(self._models.buses), 2, -1)
        there = np.concatenate(
            [
                _frame(unit.voltage).T @ parts[b]
                for b, unit in zip(self.rows, self.known, strict=True)
            ]
        )
        return np.asarray(there @ _frame(frame) if there.shape[1] == 2 else there)

    def part_of_swing(self, rest: Complex | Numbers) -> float:
        """Part of all voltages' swing."""
        return float(np.linalg.norm(rest) / (np.linalg.norm(self.voltages) or 1.0))

    def beyond(self, effect: Complex) -> float:
        """Part that an effect leaves unexplained beyond the voltages' errors."""
        beside = np.abs(self.voltages - effect) - _CERTAIN * self._voltage_errors
        return self.part_of_swing(np.maximum(beside, 0.0))

    def fit(self, there: Complex) -> Complex:
        """Give the voltages that a current of any size and phase explains best."""
        return np.asarray(there @ np.linalg.lstsq(there, self.voltages, rcond=None)[0])

    def best(self, there: Complex) -> float:
        """Part that such a current leaves at least."""
        return self.part_of_swing(self.voltages - self.fit(there))


class _Rivals:
    """Places that are not observed, units' buses and loads, with what the best current of each leaves."""

    def __init__(self, models: UnitModels, currents: _UnexplainedCurrents) -> None:
        observed = {name.casefold() for name in currents.names}
        self.units = {n: u for n, u in models.units.items() if n.casefold() not in observed}
        places: dict[str, Response] = {u.bus: u.reach for u in self.units.values()}
        places = {**places, **models.loads} if len(set(currents.rows)) > 1 else {}
        self.swung = {name: currents.reach(response) for name, response in places.items()}
        self.loads = [self.swung[name] for name in models.loads if name in self.swung]
        self.left = {name: currents.best(there) for name, there in self.swung.items()}


def _opinion_on_a_unit(currents: _UnexplainedCurrents, rivals: _Rivals) -> Opinion | None:
    """Name the observed unit that alone deviates from its model, where that explains the voltages."""
    known, names, parts, sure = currents.known, currents.names, currents.parts, currents.sure
    top = int(sure.argmax())
    beside = min((x for name, x in rivals.left.items() if name != known[top].bus), default=1.0)
    rest = currents.part_of_swing(currents.voltages - currents.effects[top])
    most = sure[top] > 0 and sure[top] ** 2 >= _SHARE * (sure**2).sum()
    alone = most and max([*parts[:top], *parts[top + 1 :], 0.0]) < _CONTRARY
    if not alone:
        return None
    if not _follows(currents, rivals, top):
        clear = currents.best(currents.reach(known[top].reach)) <= beside
        if rest >= _EXPLAINED or not clear:
            return None
    noisy = ", the rest being noise" if rest > _EXPLAINED else ""
    why = (
        f"{names[top]} gives a current that its own linear model does not, and that explains "
        f"{whole_percent(1 - rest)} of what the voltages do{noisy}"
    )
    also = [names[k] for k, part in enumerate(parts) if k != top and part > _NOTED]
    sole = not also and currents.beyond(currents.effects[top]) < _UNEXPLAINED
    why += "; less so " + ", ".join(also) if also else ""
    return Opinion(OWN_MODEL, names[top], True, why, currents.ranking, sole)


def _follows(currents: _UnexplainedCurrents, rivals: _Rivals, top: int) -> bool:
    """Tell if the voltages elsewhere have a unit's effect in its size and phase, beside what loads do to them all."""
    effect, size = currents.effects[top], len(currents.voltages)
    away = np.repeat([unit.bus != currents.known[top].bus for unit in currents.known], 2)
    loads = np.column_stack([1e-12 * np.eye(size), *rivals.loads])
    noise = loads @ loads.conj().T
    noise += _OWN_NOISE * np.trace(noise).real / len(noise) * np.eye(len(noise))
    there = np.linalg.solve(noise[np.ix_(away, away)], effect[away])
    there /= np.vdot(effect[away], there).real or 1.0
    factor, error = jackknife(
        currents.swings, lambda mean: np.vdot(there, currents.split(mean)[1].ravel()[away])
    )
    near = abs(factor) > 2 * _CERTAIN * error and abs(factor - 1) < _EXPLAINED
    return bool(near and currents.beyond(effect) < _EXPLAINED)


def _opinion_on_a_rival(currents: _UnexplainedCurrents, rivals: _Rivals) -> Opinion | None:
    """Name the unit or load that is not observed and whose current explains the voltages, where one is clearer."""
    order = sorted(rivals.left, key=rivals.left.__getitem__)
    first, second, *_ = [*(rivals.left[name] for name in order), 1.0, 1.0]
    if first >= min(_EXPLAINED, _CLEARER * second) or max(currents.parts) >= _CONTRARY:
        return None
    name = " or ".join(n for n, u in rivals.units.items() if u.bus == order[0]) or order[0]
    why = (
        f"the units that are observed do as their models, and a current of {name} explains "
        f"{whole_percent(1 - first)} of what the voltages do"
    )
    unexplained = currents.beyond(currents.fit(rivals.swung[order[0]]))
    sole = max(currents.parts) < _NOTED and unexplained < _UNEXPLAINED
    return Opinion(OWN_MODEL, name, True, why, currents.ranking, sole)


def power_there(place: Site, base: float) -> complex:
    """The mean power of a place on 100 MVA; ``base``: what 100 MVA are in the unit of its powers."""
    return complex(place.p.mean(), place.q.mean()) / base


def fits(model: UnitModel, place: Site, base: float) -> bool:
    """Return whether a unit feeds in the record what it does in the case, so that its model is of the same point."""
    wanted = model.voltage * np.conj(model.current)
    return bool(abs(power_there(place, base) - wanted) < _OTHER_POINT * max(abs(wanted), 0.1))


def _frame(voltage: complex) -> Matrix:
    """From a voltage's own frame to that of the network."""
    return turn(voltage / abs(voltage))
