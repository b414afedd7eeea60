"""Two-terminal DC lines of a PSS/E file, in the state that their controls give."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from orchestrator.cases.form.remedies import without_kinds
from orchestrator.cases.networks.psse.bridges import Bridges
from orchestrator.cases.networks.psse.devices import DeviceEnd, HeldDevice, Voltages
from orchestrator.cases.networks.source_changes import Remark
from orchestrator.core.errors import InputError

CURRENT = 2  # MDC of a line that holds its current
_ROUNDS = 500
_ACCURATE = 1e-12  # change of the current in a round [kA]
_HALVINGS = 60  # of the range of currents in which both angles are at their least
_SHORT = 1e-3  # part of its order by which a line may carry less unasked
_BEYOND = math.radians(0.5)  # by which an angle may exceed its band unasked


@dataclass(frozen=True, slots=True)
class Pole:
    """Currents [kA] and voltages [kV] of a DC line."""

    current: float
    rectifier_kv: float
    inverter_kv: float


@dataclass(frozen=True)
class TwoTerminal(HeldDevice):
    """A DC line: the rectifier's firing angle holds the current or the power, the inverter's the voltage.

    Taps stay where the file has them."""

    place: str
    mode: int  # MDC
    r_ohm: float
    setting: float  # SETVL: power [MW] of the rectifier, or below zero of the inverter; current [A]
    scheduled_kv: float  # VSCHD
    least_kv: float  # VCMOD: inverter voltage below which a power control holds the current instead
    compounding_ohm: float  # RCOMP
    margin: float  # DELTI
    buses: tuple[int, int]  # of rectifier and inverter
    bridges: tuple[Bridges, Bridges]

    @property
    def places(self) -> tuple[int, ...]:
        return self.buses

    def endings(self, voltages: Voltages) -> tuple[DeviceEnd, ...]:
        pole = self.pole(voltages)
        found = []
        for bus, bridges, kilovolts, sign in self._ends(pole):
            q = bridges.reactive(abs(voltages[bus]), pole.current, kilovolts)
            fed = complex(sign * kilovolts * pole.current, -q)
            found.append(DeviceEnd(self.ending_name("dc", bus), bus, fed))
        return tuple(found)

    def doubts(self, voltages: Voltages) -> tuple[str, ...]:
        pole = self.pole(voltages)
        found = [*self._shortfall(pole)]
        names = ("the rectifier's firing angle", "the inverter's extinction angle")
        for name, (bus, bridges, kilovolts, _) in zip(names, self._ends(pole), strict=True):
            if not bridges.is_known:
                text = f"a converter without bridges (NB or EBAS is 0) at bus {bus}: it draws no reactive power"
                found.append(Remark(text, "a converter without bridges"))
                continue
            angle = bridges.angle(abs(voltages[bus]), pole.current, kilovolts)
            if angle > bridges.most_angle + _BEYOND and pole.current:
                text = (
                    f"{name} is {math.degrees(angle):.3g} degrees, beyond its band of "
                    f"{math.degrees(bridges.least_angle):g} to {math.degrees(bridges.most_angle):g}: its tap is held, "
                    "where PSS/E moves it"
                )
                found.append(Remark(text, f"{name} beyond its band"))
        return tuple(found)

    def _shortfall(self, pole: Pole) -> Iterator[str]:
        """Yield how much less than its order a line carries."""
        order = self._order(pole.rectifier_kv, pole.inverter_kv)
        if pole.current < (1 - _SHORT) * order:
            megawatts, part = pole.rectifier_kv * pole.current, 100 * pole.current / order
            text = (
                f"it carries {megawatts:.4g} MW, {part:.1f} % of its order: "
                "firing angle at its least; its taps are held, where PSS/E moves them"
            )
            yield Remark(text, "a DC line that carries less than its order")

    def pole(self, voltages: Voltages) -> Pole:
        """Return the line's state at voltages of its buses.

        Raises an `InputError` where the line cannot carry what it is set to."""
        rectifier, inverter = (abs(voltages[bus]) for bus in self.buses)
        order = abs(self.setting)
        current = order / 1000 if self.mode == CURRENT else order / max(self.scheduled_kv, 1e-3)
        for _ in range(_ROUNDS):
            inverter_kv = self._inverter_kv(inverter, current)
            rectifier_kv = inverter_kv + self.r_ohm * current
            most = self.bridges[0].most_voltage(rectifier, current)
            is_at_limit = rectifier_kv > most
            if is_at_limit:
                rectifier_kv, inverter_kv = most, most - self.r_ohm * current
            if min(rectifier_kv, inverter_kv) <= 0:
                break
            wanted = self._order(rectifier_kv, inverter_kv)
            wanted *= 1 - self.margin if is_at_limit else 1.0
            if abs(wanted - current) <= _ACCURATE * max(1.0, current):
                return Pole(current, rectifier_kv, inverter_kv)
            current = (current + wanted) / 2
        between = self._with_least_angles(rectifier, inverter)
        if between is not None:
            return between
        raise InputError.at(
            f"{self.place}, line {self.line}",
            f"the DC line {self.name!r} cannot carry SETVL = {self.setting:g} with VSCHD "
            f"= {self.scheduled_kv:g} kV and RDC = {self.r_ohm:g} ohm at its buses' "
            f"voltages; mend the record, or write {without_kinds([self.section])}",
        )

    def _inverter_kv(self, v_pu: float, current: float) -> float:
        """Return the DC voltage that the inverter holds [kV]."""
        scheduled = self.scheduled_kv - self.compounding_ohm * current
        return min(scheduled, self.bridges[1].most_voltage(v_pu, current))

    def _with_least_angles(self, rectifier: float, inverter: float) -> Pole | None:
        """Return the state between the whole order and that without the margin, if there is one.

        The rectifier, at its least angle, cannot drive the whole order, and could drive more than the order less the
        margin. Neither end controls the current then: it is where both ends' voltages meet along the line.

        ``rectifier``, ``inverter``: voltages of their buses [pu]."""

        def excess(current: float) -> float:
            needed = self._inverter_kv(inverter, current) + self.r_ohm * current
            return needed - self.bridges[0].most_voltage(rectifier, current)

        least = 0.0
        most = abs(self.setting) / (1000 if self.mode == CURRENT else self.scheduled_kv / 2)
        if not excess(least) < 0 < excess(most):
            return None
        for _ in range(_HALVINGS):
            middle = (least + most) / 2
            least, most = (middle, most) if excess(middle) < 0 else (least, middle)
        at_rectifier = self.bridges[0].most_voltage(rectifier, most)
        at_inverter = at_rectifier - self.r_ohm * most
        if at_inverter <= 0:
            return None
        order = self._order(at_rectifier, at_inverter)
        is_between = (1 - self.margin) * order <= most <= order
        return Pole(most, at_rectifier, at_inverter) if is_between else None

    def _order(self, rectifier_kv: float, inverter_kv: float) -> float:
        """Return the current that is ordered [kA]."""
        if self.mode == CURRENT:
            return abs(self.setting) / 1000
        if inverter_kv < self.least_kv:
            return abs(self.setting) / self.scheduled_kv
        return abs(self.setting) / (rectifier_kv if self.setting > 0 else inverter_kv)

    def _ends(self, pole: Pole) -> tuple[tuple[int, Bridges, float, int], ...]:
        kilovolts = (pole.rectifier_kv, pole.inverter_kv)
        return tuple(zip(self.buses, self.bridges, kilovolts, (-1, 1), strict=True))
