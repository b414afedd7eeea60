"""Two-terminal DC lines with a record of their control, CDC4T or CDC6T: a station with a model at each end.

The RAW file has the line with its converters and set points, the DYR file its control under the line's name. The line
starts in the state that the power flow's solution has. Taps stay, as in PSS/E's dynamics."""

import cmath
import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from fmus.dc_line.dyr_records import DC_LINE_RECORDS, INVERTER, INVERTERS_FIELDS, RECTIFIER
from fmus.grid.element_data import Load
from orchestrator.cases.form.remedies import without_models
from orchestrator.cases.networks.psse.device_flow import SolvedDevices
from orchestrator.cases.networks.psse.devices import HeldDevice, Voltages
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord
from orchestrator.cases.networks.psse.dyr_values import values_of_record
from orchestrator.cases.networks.psse.refusals import Refusals
from orchestrator.cases.networks.psse.two_terminal import CURRENT, Pole, TwoTerminal
from orchestrator.core.errors import InputError, Problem, QuestionTopic, few, number_of

_SHOWN = 8  # lines that a question names; the others are counted
_KILO = 1000.0
_ANGLES = {"ALFDY": "a firing angle", "GAMDY": "an extinction angle"}
_PER_UNIT = 0.01
"""Part of the start's voltage below which a voltage in kV is no threshold of use, as one in per unit is."""

_BEYOND = math.radians(1e-3)  # by which an angle may be below its least one unasked


@dataclass(frozen=True)
class SolvedLine:
    """A DC line in the solution of the power flow; each pair is of the rectifier's end and the inverter's.

    ``pole``: its state; ``v``: voltages of its buses [pu]; ``fed``: P + jQ into them [MW, Mvar]; ``loads``: what stands
    in its place in the power flow, None at a bus beyond what is studied."""

    device: TwoTerminal
    pole: Pole
    v: tuple[complex, complex]
    fed: tuple[complex, complex]
    loads: tuple[Load | None, Load | None]

    @property
    def name(self) -> str:
        return self.device.name

    def angle(self, end: int) -> float:
        """Firing angle (end 0) or extinction angle (end 1) [rad]."""
        kilovolts = (self.pole.rectifier_kv, self.pole.inverter_kv)[end]
        return self.device.bridges[end].angle(abs(self.v[end]), self.pole.current, kilovolts)


@dataclass(frozen=True)
class StationOfLine:
    """A station: its component's name, its bus, its model and its parameters.

    ``held``: voltage of a bus beyond what is studied [pu], which stays; ``bus`` is None there; ``records``: PSS/E's
    name of the record that a rectifier's control is built of."""

    name: str
    bus: str | None
    model: str
    parameters: dict[str, float | bool]
    held: complex | None = None
    records: str | None = None


@dataclass(frozen=True)
class ModelledLine:
    """A DC line with its record and its stations."""

    line: SolvedLine
    record: DynamicRecord
    rectifier: StationOfLine
    inverter: StationOfLine


def named_lines(records: Sequence[DynamicRecord]) -> frozenset[str]:
    """Return the names of the DC lines of which there are records."""
    return frozenset(
        record.line_of_dc
        for record in records
        if record.name in DC_LINE_RECORDS and record.line_of_dc
    )


def solved_lines(solved: SolvedDevices, names: Collection[str]) -> list[SolvedLine]:
    """Return the DC lines of these names that a model can stand for."""
    own = [(device, loads) for device, loads in solved.standing if device.name in names]
    found = (_solved_line(device, loads, solved.voltages) for device, loads in own)
    return [line for line in found if line is not None]


def _solved_line(
    device: HeldDevice, loads: Sequence[Load], voltages: Voltages
) -> SolvedLine | None:
    """Return a DC line that a model can stand for; None of another device.

    ``loads``: in its place; ``voltages``: of the solution [pu]. Without a current, with capacitors in the valves, or
    with both ends beyond what is studied, a line has no model."""
    if not isinstance(device, TwoTerminal) or not loads:
        return None
    if not all(bridges.is_known and not bridges.capacitor_ohm for bridges in device.bridges):
        return None
    pole = device.pole(voltages)
    if not pole.current > 0:
        return None
    first, second = device.endings(voltages)
    own = iter(loads)  # of the ends within what is studied, in their order; both may be at one bus
    studied = {load.bus for load in loads}
    at_rectifier, at_inverter = (
        next(own) if f"bus_{end.bus}" in studied else None for end in (first, second)
    )
    return SolvedLine(
        device,
        pole,
        v=(voltages[first.bus], voltages[second.bus]),
        fed=(first.fed, second.fed),
        loads=(at_rectifier, at_inverter),
    )


def modelled_lines(
    records: Sequence[DynamicRecord], lines: Sequence[SolvedLine]
) -> list[ModelledLine]:
    """Return the lines with their stations.

    Raises
    ------
    InputError
        If lines have two records, or one with a value that cannot be; with all of them.
    """
    by_name = {line.name: line for line in lines}
    found, refusals = dict[str, ModelledLine](), Refusals()
    for record in records:
        line = by_name.get(record.line_of_dc)
        if record.name not in DC_LINE_RECORDS or line is None:
            continue
        with refusals.keep():
            if line.name in found:
                text = f"a second {record.name} of the DC line {line.name!r}; remove one of them"
                raise InputError.at(record.place, text)
            found[line.name] = _modelled(record, line)
    refusals.tell()
    return [*found.values()]


def _modelled(record: DynamicRecord, line: SolvedLine) -> ModelledLine:
    own: dict[str, float | bool] = dict(values_of_record(record, DC_LINE_RECORDS[record.name]))
    _require_rising_points(record, own)
    device, pole = line.device, line.pole
    at_inverter = {name: own.pop(name) for name in INVERTERS_FIELDS}
    common: dict[str, float | bool] = {"V_dc_0": pole.inverter_kv}
    of_power = 1 if device.setting > 0 else 2
    of_line = {
        "R_dc": device.r_ohm,
        "RCOMP": device.compounding_ohm,
        "DELTI": device.margin,
        "VCMOD": device.least_kv,
        "VSCHD": device.scheduled_kv,
        "mode": 0 if device.mode == CURRENT else of_power,
    }
    second = device.bridges[1]
    holds_angle = second.most_angle <= second.least_angle
    at_rectifier = {**common, **of_line, **own}
    at_inverter |= {**common, "holds_angle": holds_angle}
    return ModelledLine(
        line,
        record,
        replace(_station(line, 0, RECTIFIER, at_rectifier), records=record.name),
        _station(line, 1, INVERTER, at_inverter),
    )


def _require_rising_points(record: DynamicRecord, own: dict[str, float | bool]) -> None:
    for first, second in pairwise(("V1", "V2", "V3")):
        if own[second] <= own[first]:
            text = (
                f"{record.name} of the DC line {record.line_of_dc!r} has {second} = {own[second]:g} kV behind {first} "
                f"= {own[first]:g} kV: {second} must exceed the voltage of the point before it; order the points of "
                "the current's limit by their voltage"
            )
            raise InputError.at(record.place, text)


def _station(
    line: SolvedLine, end: int, model: str, values: dict[str, float | bool]
) -> StationOfLine:
    """Return the station of an end, which starts with the power that it has there in the power flow."""
    bridges, load, v = line.device.bridges[end], line.loads[end], line.v[end]
    fed = line.fed[end] if load is None else -complex(load.p_mw, load.q_mvar)
    own = {
        **values,
        "N": bridges.count,
        "X_c": bridges.x_ohm,
        "E_n": bridges.base_kv * bridges.ratio,
        "S_n": abs(fed),
        "P_0": fed.real / abs(fed),
        "Q_0": fed.imag / abs(fed),
    }
    if load is not None:
        return StationOfLine(load.name, load.bus, model, own)
    own |= {"v_0": abs(v), "theta_0": cmath.phase(v)}
    name = line.device.ending_name("dc", line.device.buses[end])
    return StationOfLine(name, None, model, own, held=v)


def remarks_of_lines(lines: Sequence[ModelledLine]) -> Iterator[Problem]:
    """Tell which lines have a model and what it holds, and ask about limits beyond which a line starts."""
    for name in dict.fromkeys(one.record.name for one in lines):
        own = [one for one in lines if one.record.name == name]
        p_mw = -sum(one.line.fed[0].real for one in own)
        text = (
            f"{name}: {number_of(len(own), 'DC line')} with the model of its record, {p_mw:.4g} MW at the rectifiers "
            f"({few([one.line.name for one in own], _SHOWN)}). Currents and voltages follow at once, without the "
            "line's inductance; the orders and the taps are those of the power flow; a voltage of one or two phases "
            "counts by its positive sequence. To see what the control does to a mode, leave it out, for constant "
            f"powers: {without_models([name])}"
        )
        yield Problem(own[0].record.place, text, topic=QuestionTopic(f"{name} of DC lines"))
    for one in lines:
        held = [end for end in (one.rectifier, one.inverter) if end.held is not None]
        for end in held:
            text = (
                f"{end.name}, an end of the DC line {one.line.name!r}, is beyond the part that is studied: its bus "
                f"keeps {abs(end.held or 0):.4g} pu, the file's voltage"
            )
            kind = "an end of a DC line beyond the part that is studied"
            yield Problem(one.record.place, text, topic=QuestionTopic(kind, one.line.name))
        for kind, text in _doubts(one):
            said = f"{one.record.name} of the DC line {one.line.name!r}: {text}"
            yield Problem(one.record.place, said, topic=QuestionTopic(kind, one.line.name))


def _doubts(one: ModelledLine) -> Iterator[tuple[str, str]]:
    """Yield kinds and texts of what does not fit the state in which a line starts."""
    p, pole = {**one.inverter.parameters, **one.rectifier.parameters}, one.line.pole
    for end, (field, words) in enumerate(_ANGLES.items()):
        angle = one.line.angle(end)
        holds = field == "GAMDY" and p["holds_angle"]
        if angle < math.radians(p[field]) - _BEYOND and not holds:
            text = (
                f"{field} is {p[field]:g} degrees, and the line starts with {words} of {math.degrees(angle):.3g}, "
                "which is then its least one"
            )
            yield f"a DC line that starts below {field}", text
    limit = _limit_of_current(p, pole.inverter_kv)
    if pole.current > limit:
        text = (
            f"the limit of the current is {_KILO * limit:.4g} A at the {pole.inverter_kv:.4g} kV of the start, where "
            f"{_KILO * pole.current:.4g} A flow; it is raised by what lacks. Correct C1 to C3"
        )
        yield "a DC line that starts above its limit of current", text
    first, second = (abs(v) for v in one.line.v)
    for field, value, unit, what in (
        ("VBLOCK", first, "pu", "the rectifier's bus has"),
        ("VRB", first, "pu", "the rectifier's bus has"),
        ("VIB", second, "pu", "the inverter's bus has"),
        ("VIY", second, "pu", "the inverter's bus has"),
        ("VBYPAS", pole.inverter_kv, "kV", "the inverter has"),
        ("VCMOD", pole.inverter_kv, "kV", "the inverter has"),
    ):
        acts = field != "VCMOD" or p["mode"]
        if acts and value < p.get(field, 0.0):
            text = f"{field} is {p[field]:g} {unit}, and {what} {value:.4g} {unit} at the start: it acts at once"
            yield f"a DC line that starts below {field}", text
    if p["VUNBL"] < p["VBLOCK"]:
        text = (
            f"VUNBL is {p['VUNBL']:g} pu, below VBLOCK of {p['VBLOCK']:g} pu: between them the line blocks and comes "
            "back again and again. Correct them"
        )
        yield "a DC line whose VUNBL is below VBLOCK", text
    if 0 < p["VBYPAS"] < _PER_UNIT * pole.inverter_kv:
        text = (
            f"VBYPAS is {p['VBYPAS']:g} kV, and the inverter has {pole.inverter_kv:.4g} kV at the start: it hardly "
            "ever acts. Is it in per unit? Write kV, or 0 for none"
        )
        yield "a DC line whose VBYPAS may be in per unit", text


def _limit_of_current(p: dict[str, float | bool], kilovolts: float) -> float:
    """Return the limit of the current [kA] at a measured voltage [kV]."""
    points = sorted((p[f"V{k}"], p[f"C{k}"] / _KILO) for k in (1, 2, 3))
    for (low, first), (high, second) in pairwise(points):
        if low <= kilovolts < high:
            return first + (second - first) * (kilovolts - low) / (high - low)
    return points[0][1] if kilovolts < points[0][0] else points[-1][1]
