"""What each unit of a case does by its own linear model: one whose current does something else drives the oscillation.

Chevalier, Vorobev and Turitsyn, "Using effective generator impedance for forced oscillation source location", IEEE
Trans. Power Systems 33(6), 2018, with the linear models of the case's own components in the place of fitted ones."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Complex, Matrix, Numbers
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
    names = [p.name for p in places]
    s, known = 2j * np.pi * found.frequency, [units[name.casefold()] for name in names]
    means = np.array([complex(p.p.mean(), p.q.mean()) / measured.base for p in places])
    own = [_frame(u.voltage).T @ u.admittance(s) @ _frame(u.voltage) for u in known]
    size = np.array([abs(unit.voltage) for unit in known])

    def driven(blocks: Complex) -> Complex:
        """Of each unit the current that its model does not explain, and the voltage, along the mean one and across."""
        p, q, angle, lnv = blocks.reshape(-1, 4).T
        voltage = size * np.array([lnv, angle])
        turned = means.real * np.array([-lnv, angle]) + means.imag * np.array([angle, lnv])
        current = (np.array([p, -q]) / measured.base + turned) / size
        unlike = [current[:, k] - own[k] @ voltage[:, k] for k in range(len(places))]
        return np.array([unlike, voltage.T])

    swings = block_phasors(places, measured.times, found, others)
    whole, errors = jackknife(swings, driven)
    extra, voltages = whole[0], whole[1].ravel()
    rows = [models.buses.index(unit.bus) for unit in known]

    def reach(response: Response, frame: complex = 1.0) -> Complex:
        """To the voltages of the observed units, each in its own frame, from a current in a frame."""
        parts = response(s).reshape(len(models.buses), 2, -1)
        there = np.concatenate(
            [_frame(unit.voltage).T @ parts[b] for b, unit in zip(rows, known, strict=True)]
        )
        return np.asarray(there @ _frame(frame) if there.shape[1] == 2 else there)

    def left(rest: Complex | Numbers) -> float:
        return float(np.linalg.norm(rest) / (np.linalg.norm(voltages) or 1.0))

    def beyond(effect: Complex) -> float:
        return left(np.maximum(np.abs(voltages - effect) - _CERTAIN * errors[1].ravel(), 0.0))

    amount = np.linalg.norm(extra, axis=1)
    ranking = tuple(
        (names[k], float(amount[k] ** 2 / ((amount**2).sum() or 1.0))) for k in np.argsort(-amount)
    )
    sure = np.where(amount > _CERTAIN * np.linalg.norm(errors[0], axis=1), amount, 0.0)
    effects = [
        reach(unit.reach, unit.voltage) @ extra[k] * (sure[k] > 0) for k, unit in enumerate(known)
    ]
    top = int(sure.argmax())

    def fitted(there: Complex) -> Complex:
        return np.asarray(there @ np.linalg.lstsq(there, voltages, rcond=None)[0])

    def best(there: Complex) -> float:
        return left(voltages - fitted(there))

    unseen = {
        n: u
        for n, u in models.units.items()
        if n.casefold() not in {name.casefold() for name in names}
    }
    further = (
        {**{u.bus: u.reach for u in unseen.values()}, **models.loads} if len(set(rows)) > 1 else {}
    )
    swung = {name: reach(response) for name, response in further.items()}
    rivals = {name: best(there) for name, there in swung.items()}
    beside = min((x for name, x in rivals.items() if name != known[top].bus), default=1.0)
    rest, parts = left(voltages - effects[top]), [left(effect) for effect in effects]
    most = sure[top] > 0 and sure[top] ** 2 >= _SHARE * (sure**2).sum()
    alone = most and max([*parts[:top], *parts[top + 1 :], 0.0]) < _CONTRARY
    away = np.repeat([unit.bus != known[top].bus for unit in known], 2)

    def follows(effect: Complex) -> bool:
        """Whether the voltages elsewhere have an effect in its size and phase, beside what loads do to them all."""
        loads = np.column_stack(
            [1e-12 * np.eye(len(voltages)), *(swung[x] for x in models.loads if x in swung)]
        )
        noise = loads @ loads.conj().T
        noise += _OWN_NOISE * np.trace(noise).real / len(noise) * np.eye(len(noise))
        there = np.linalg.solve(noise[np.ix_(away, away)], effect[away])
        there /= np.vdot(effect[away], there).real or 1.0
        factor, error = jackknife(
            swings, lambda mean: np.vdot(there, driven(mean)[1].ravel()[away])
        )
        near = abs(factor) > 2 * _CERTAIN * error and abs(factor - 1) < _EXPLAINED
        return bool(near and beyond(effect) < _EXPLAINED)

    if alone and (
        follows(effects[top]) or (rest < _EXPLAINED and best(reach(known[top].reach)) <= beside)
    ):
        noisy = ", the rest being noise" if rest > _EXPLAINED else ""
        why = (
            f"{names[top]} gives a current that its own linear model does not, and that explains "
            f"{100 * (1 - rest):.0f} % of what the voltages do{noisy}"
        )
        also = [names[k] for k, part in enumerate(parts) if k != top and part > _NOTED]
        sole = not also and beyond(effects[top]) < _UNEXPLAINED
        why += "; less so " + ", ".join(also) if also else ""
        return Opinion(OWN_MODEL, names[top], True, why, ranking, sole)
    order = sorted(rivals, key=rivals.__getitem__)
    first, second, *_ = [*(rivals[name] for name in order), 1.0, 1.0]
    if first < min(_EXPLAINED, _CLEARER * second) and max(parts) < _CONTRARY:
        name = " or ".join(n for n, u in unseen.items() if u.bus == order[0]) or order[0]
        why = (
            f"the units that are observed do as their models, and a current of {name} explains "
            f"{100 * (1 - first):.0f} % of what the voltages do"
        )
        sole = max(parts) < _NOTED and beyond(fitted(swung[order[0]])) < _UNEXPLAINED
        return Opinion(OWN_MODEL, name, True, why, ranking, sole)
    both = ", ".join(f"{n} {100 * x:.0f} %" for n, x in ranking[:3])
    why = f"no place alone deviates from its model and explains the voltages (deviations: {both})"
    return Opinion(OWN_MODEL, None, True, why, ranking)


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
