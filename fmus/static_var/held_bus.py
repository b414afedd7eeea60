"""The bus whose voltage a compensator holds: its own, or another one, whose voltage the network tells.

PSS/E's CSVGN4, CSVGN5, SVSMO1 and CSTCNT name it as IB. The other bus' voltage goes through two lags that extrapolate
it, as that of the own bus does (`fmus.converter_parts.bus_voltage`): the error is (s·τ)²."""

from dataclasses import dataclass, replace

from fmus.converter_parts.bus_voltage import ExtrapolatedVoltage
from fmus.toolchain.blocks import low_pass
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import DevicePort
from fmus.toolchain.symbols import Expr

ELSEWHERE = "elsewhere"
"""Word beside a record's name that says that it holds the voltage of another bus."""


@dataclass(frozen=True)
class HeldVoltage:
    """Voltage of the bus that is held, now and at the operating point [pu]."""

    now: Expr
    start: Expr


def holds_elsewhere(records: str, names: tuple[str, ...]) -> bool:
    """Return whether ``records``, one of the names, says that another bus is held.

    Raises
    ------
    ValueError
        If it is none of these, with or without the word `ELSEWHERE`.
    """
    name, _, word = records.partition(" ")
    if name not in names or word not in ("", ELSEWHERE):
        known = " or ".join(names)
        raise ValueError(f"records = {records!r}: write {known}, or that with {ELSEWHERE!r}")
    return bool(word)


def held_voltage(
    m: ModelBuilder, port: DevicePort, seen: ExtrapolatedVoltage, *, elsewhere: bool
) -> HeldVoltage:
    """Declare the voltage that is held; ``seen``: that of the own bus."""
    if not elsewhere:
        return HeldVoltage(seen.value.magnitude(), port.v_0.magnitude())
    with m.scope("held"):
        v = m.input("v", "pu", "Voltage magnitude at the bus that is held", base="bus", start=1.0)
        text = "Power flow: voltage at the bus that is held"
        v_0 = m.parameter("v_0", 1.0, "pu", text, base="bus", minimum=0.1, maximum=2)
        once = low_pass(m, "once", v, seen.tau, v_0)
        twice = low_pass(m, "twice", once, seen.tau, v_0)
    return HeldVoltage(2 * once - twice, v_0)


def named_by_bus(model: Model, *, elsewhere: bool) -> Model:
    """Return a model with the word `ELSEWHERE` in its name where another bus is held."""
    if not elsewhere:
        return model
    name = model.name.removesuffix("phasor") + f"{ELSEWHERE}_phasor"
    title = model.title.replace(" (phasor type)", " at another bus (phasor type)")
    return replace(model, name=name, title=title, of_parts=True)
