"""A foreign FMU whose variables are mapped to our port, in plain numbers.

The port of a device: inputs ``v_re``, ``v_im`` [pu of the bus] and outputs ``i_re``, ``i_im`` [pu, 100 MVA] in the
network's frame, ``p`` and ``q`` at the bus [pu, S_n]; parameters ``S_n`` [MVA] and the power flow's ``P_0``, ``Q_0``
[pu, S_n], ``v_0`` [pu], ``theta_0`` [rad]."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from enum import IntEnum
from math import pi
from typing import Any, Self

from fmus.toolchain.port_variables import INPUTS, OUTPUTS, S_N, START_VALUES
from fmus.toolchain.variables import Parameter, Variable
from orchestrator.core.units import to_unit
from orchestrator.devices.fmi.description import FmuDescription, VariableInfo

PORT = tuple(variable.name for variable in (*INPUTS, *OUTPUTS))
"""Variables of the port; their places are their value references."""

PHASOR_PORT = ("e_re", "e_im", "y_re", "y_im")
"""What a phasor model gives to a network of phasors: an emf behind an admittance."""

START = tuple(variable.name for variable in START_VALUES)

_SAME = 0.01
"""Part by which the rating of a binding may differ from the FMU's own."""

_NEAR = 1.06
"""Factor from which on a start in volts is another's."""

_OTHER = 2.0
"""Factor from which on any other start is another's."""

_RATED = (("S_n", "s"), ("V_n", "[vu]"), ("f_n", "f"))
_NAMED = {name: re.compile(rf"(?:^|\.){of}_?(?:n|nom|rated)$", re.I) for name, of in _RATED}

Matrix2 = tuple[float, float, float, float]  # A real 2×2 matrix, by rows


class Form(IntEnum):
    """The form of a port's variables; numbers as in port_adapter.c."""

    RECTANGULAR = 0
    POLAR = 1
    ABC = 2
    POWER = 3


@dataclass(frozen=True)
class PhasorMap:
    form: Form
    variables: tuple[str, ...]
    # Voltage: network's frame [pu] to the FMU's axes and unit. Current: the other way, to [pu, 100 MVA] for an FMU of
    # its own rating. Magnitude and angle, phases and powers are taken behind or before it.
    matrix: Matrix2
    angle_factor: float = 1.0  # the FMU's unit of angle per radian
    # current: whether the matrix grows with S_n (several units in parallel, or an output in pu of the rating)
    per_rating: bool = True
    # voltage in phases: the part of a communication step after which they are taken; 0 where the FMU's own frame stands
    # still within a step
    moment: float = 0.5


@dataclass(frozen=True)
class StartMap:
    """Where a start value goes: ``factor·value + offset``, times S_n over the rating where ``per_rating``."""

    variable: str
    factor: float
    offset: float = 0.0
    per_rating: bool = False


@dataclass(frozen=True)
class SignalMap:
    """Another variable under a name and in a unit of ours: ``factor·x + offset``; a Boolean as it is.

    Attributes
    ----------
    per_rating
        If its own unit is a power and ours is per unit of the S_n that it is given: ``factor`` is that at its rating.
    """

    variable: str
    factor: float
    offset: float
    unit: str
    per_rating: bool = False

    def of(self, value: float) -> float:
        """A value of the FMU's own variable, in our unit, at its rating as delivered."""
        return self.factor * value + self.offset

    def factor_at(self, rating: float) -> float:
        """Return the factor where S_n is so many times the rating as delivered."""
        return self.factor / rating if self.per_rating else self.factor


@dataclass(frozen=True)
class PortMap:
    rating: float  # S_n of the FMU as delivered [MVA]
    f_n: float
    voltage: PhasorMap
    current: PhasorMap
    # for each of `START` the variables that take it; none for those that the FMU does not know
    start: Mapping[str, tuple[StartMap, ...]]
    signals: Mapping[str, SignalMap]
    settings: Mapping[str, float | bool]  # values of the FMU's own parameters and inputs
    # largest current that it gives, as somebody declares it [pu, rating]
    current_limit: float | None = None
    # the voltage of one of them, line to line [kV]; None where nothing needs it
    V_n: float | None = None
    # deviation of the frequency up to which its power answers it, as somebody declares it [pu]
    frequency_range: float | None = None

    @classmethod
    def of_dict(cls, values: Mapping[str, Any]) -> Self:
        """From what `dataclasses.asdict` made of one, perhaps through JSON."""

        def phasor(part: Mapping[str, Any]) -> PhasorMap:
            return PhasorMap(
                **{**part, "form": Form(part["form"]), "variables": tuple(part["variables"])}
            )

        starts = {n: tuple(StartMap(**m) for m in maps) for n, maps in values["start"].items()}
        signals = {n: SignalMap(**m) for n, m in values["signals"].items()}
        return cls(
            **{
                **values,
                "voltage": phasor(values["voltage"]),
                "current": phasor(values["current"]),
                "start": starts,
                "signals": signals,
            }
        )

    @property
    def omega(self) -> float:
        return 2 * pi * self.f_n

    @property
    def taken_variables(self) -> frozenset[str]:
        starts = {m.variable for maps in self.start.values() for m in maps}
        signals = {m.variable for m in self.signals.values()}
        return frozenset(
            {*self.voltage.variables, *self.current.variables, *starts, *signals, *self.settings}
        )


@dataclass(frozen=True, kw_only=True)
class BoundDescription(FmuDescription):
    """A foreign FMU, described with the variables of our port and whatever else it has."""

    inner: FmuDescription
    port: PortMap
    # For every variable here that is not the port's: the FMU's own name of it. A variable whose own name is one of the
    # port's is called ``native.<name>`` here.
    inner_names: Mapping[str, str]

    def unlike_delivered(self) -> dict[str, str]:
        """Ratings of the binding, by name, that do not fit to what the FMU starts with by itself, and why."""
        found, port = dict(self._unlike_named()), self.port
        for name in ("S_n", "v_0", "P_0"):
            for target in port.start.get(name, ()):
                info = self.inner.variables[target.variable]
                if (
                    isinstance(info.start, bool | str)
                    or info.start in (None, 0, 1)
                    or not target.factor
                ):
                    continue
                value = abs(float(info.start or 0) - target.offset) / abs(target.factor)
                itself = f"{info.name} is {info.start:g} {info.unit or 'pu'} by itself, {value:.3g} times"
                if (
                    name == "S_n"
                    and info.name not in port.settings
                    and abs(value / port.rating - 1) > _SAME
                ):
                    found["S_n"] = (
                        f"S_n = {port.rating:g} MVA, and the FMU's {info.name} is {value:g} MVA by itself"
                    )
                V_n = None if info.unit in ("pu", "p.u.", "1", "") else port.V_n
                most = _NEAR if V_n else _OTHER
                if name == "v_0" and not 1 / most < value < most:
                    kV = f" ({V_n:g} kV, and {value * V_n:.3g} kV by itself)" if V_n else ""
                    found.setdefault(
                        "V_n",
                        f"another V_n than the FMU starts with: its {itself} what is bound{kV}",
                    )
                if name == "P_0" and value > _OTHER:
                    found.setdefault(
                        "S_n", f"S_n = {port.rating:g} MVA, and the FMU's {itself} as much"
                    )
        return found

    def _unlike_named(self) -> Iterator[tuple[str, str]]:
        """By the FMU's own parameters that are called as a rating is, and say something else."""
        own = [
            v
            for v in self.inner.variables.values()
            if v.causality == "parameter" and v.type == "Real"
        ]
        for name, unit, bound in (
            ("S_n", "MVA", self.port.rating),
            ("V_n", "kV", self.port.V_n),
            ("f_n", "Hz", self.port.f_n),
        ):
            if bound is None:
                continue
            for info in (
                v for v in own if v.unit and v.start and v.name not in self.port.taken_variables
            ):
                with suppress(ValueError):
                    value = (
                        to_unit(f"{info.start_number} {info.unit}", unit)
                        if _NAMED[name].search(info.name)
                        else bound
                    )
                    if abs(value / bound - 1) > _SAME:
                        said = f"{name} = {bound:g} {unit}, and the FMU's {info.name} is {value:g} {unit} by itself"
                        yield name, said

    def bound_names(self, own: str) -> list[str]:
        """Our names of one of the FMU's variables; empty if it has none."""
        port = self.port
        starts = [name for name, maps in port.start.items() if own in {m.variable for m in maps}]
        return starts + [name for name, m in self.inner_names.items() if m == own and name != own]

    def likely_cause(self) -> str:
        """Ratings that do not fit, as the end of a sentence; "" without any."""
        unlike = self.unlike_delivered()
        return (
            f"likely cause: the binding has {'; and '.join(unlike.values())}: check [rating]"
            if unlike
            else ""
        )

    @classmethod
    def of(cls, inner: FmuDescription, port: PortMap) -> Self:
        inner_names = {name: m.variable for name, m in port.signals.items()}
        for name in inner.variables:
            if name not in port.taken_variables:
                inner_names[f"native.{name}" if name in (*PORT, *START, *inner_names) else name] = (
                    name
                )
        variables = _port_variables(port)
        for number, (name, own) in enumerate(inner_names.items()):
            variables[name] = _passed(inner, port, name, own, len(PORT) + number)
        shared = {f.name: getattr(inner, f.name) for f in fields(FmuDescription)}
        renamed = {own: name for name, own in inner_names.items()}

        def under_our_names(own: Sequence[str]) -> tuple[str, ...]:
            return tuple(map(renamed.__getitem__, own)) if set(own) <= set(renamed) else ()

        shared |= {
            "variables": variables,
            "states": under_our_names(inner.states),
            "rates": under_our_names(inner.rates),
            "output_dependencies": _dependencies(inner, port, renamed),
            # they are the FMU's own variables', not the port's
            "gives_directional_derivatives": False,
        }
        return cls(**shared, inner=inner, port=port, inner_names=inner_names)


def _passed(
    inner: FmuDescription, port: PortMap, name: str, own: str, reference: int
) -> VariableInfo:
    info = inner.variables[own]
    signal = port.signals.get(name)
    if signal is None or info.type == "Boolean":
        return replace(
            info, name=name, reference=reference if info.type == "Real" else info.reference
        )
    if info.causality in ("parameter", "input"):
        start = None if info.start is None else signal.of(info.start_number)
        bounds = [None if x is None else signal.of(x) for x in (info.minimum, info.maximum)]
        lowest, highest = bounds if signal.factor > 0 else bounds[::-1]
        return replace(
            info,
            name=name,
            reference=reference,
            unit=signal.unit,
            start=start,
            minimum=lowest,
            maximum=highest,
        )
    return replace(
        info,
        name=name,
        reference=reference,
        causality="output",
        unit=signal.unit,
        start=None,
        minimum=None,
        maximum=None,
        usual=None,
    )


def _port_variables(port: PortMap) -> dict[str, VariableInfo]:
    found = [_info(v, "input", v.start) for v in INPUTS] + [_info(v, "output") for v in OUTPUTS]
    for v in START_VALUES:
        found.append(
            _info(v, "parameter", port.rating if v is S_N else v.start, v.minimum, v.maximum)
        )
    return {info.name: info for info in found}


def _info(
    variable: Variable,
    causality: str,
    start: float | None = None,
    minimum: float | None = None,
    maximum: float | None = None,
) -> VariableInfo:
    reference = PORT.index(variable.name) if variable.name in PORT else 2**32 - 1
    return VariableInfo(
        name=variable.name,
        reference=reference,
        type="Real",
        causality=causality,
        variability="fixed" if causality == "parameter" else "continuous",
        unit=variable.unit,
        start=start,
        minimum=minimum,
        maximum=maximum,
        description=variable.text,
        usual=variable.usual if isinstance(variable, Parameter) else None,
    )


def _dependencies(
    inner: FmuDescription, port: PortMap, renamed: Mapping[str, str]
) -> dict[str, tuple[str, ...] | None]:
    """Direct dependencies of the outputs, in the new names; None where the FMU does not say."""

    def translated(names: tuple[str, ...] | None) -> tuple[str, ...] | None:
        if names is None:
            return None
        seen = dict.fromkeys(renamed[n] for n in names if n in renamed)
        through = ("v_re", "v_im") if set(names) & set(port.voltage.variables) else ()
        return (*through, *seen)

    known = {own: translated(inner.output_dependencies.get(own)) for own in inner.outputs}
    currents = [known.get(own) for own in port.current.variables]
    through: tuple[str, ...] | None = None
    if all(c is not None for c in currents):
        through = tuple(dict.fromkeys(n for c in currents for n in c or ()))
    if port.current.form is Form.POWER and through is not None:
        through = tuple(dict.fromkeys(("v_re", "v_im", *through)))
    power = None if through is None else tuple(dict.fromkeys(("v_re", "v_im", *through)))
    found = {"i_re": through, "i_im": through, "p": power, "q": power}
    return found | {renamed[own]: needs for own, needs in known.items() if own in renamed}


def without_binding(description: FmuDescription) -> FmuDescription:
    return description.inner if isinstance(description, BoundDescription) else description
