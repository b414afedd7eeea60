"""Transformers of a RAW file as branches: units of data (CW, CZ, CM) to pu of the system, three windings to a star.

Sources: the descriptions of the data format that PowerWorld, MATPOWER (``psse2mpc``) and PowSyBl publish."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from orchestrator.cases.networks.psse.controls import TapRecord, tap_record
from orchestrator.cases.networks.psse.raw_records import NODES, SWITCHING_DEVICES, RawFile, Record

_NAME = 10  # column of NAME in the first line
_ZCOD = 21  # of ZCOD there, from revision 35 on
_LOSSES = 3  # CZ by which R is a load loss [W]
_CONTROL = {33: 6}
_TABLE = {33: 13, 34: 22}
_OPEN = {0: (0, 1, 2), 1: (), 2: (1,), 3: (2,), 4: (0,)}  # STAT → windings that are off


@dataclass(frozen=True)
class Winding:
    """One winding: bus, ratio [pu of the bus' base voltage], shift [degrees], nominal voltage by that of its bus, RATA,
    0 where the file has none [MVA], and TAB, the impedance correction table, 0 where there is none."""

    bus: int
    ratio: float
    shift: float
    nominal: float
    rating_mva: float = 0.0
    table: int = 0
    has_ratio: bool = True  # whether WINDV is not 0


_FAR = 1000.0
"""Times its reactance from which a transformer's resistance may be its load loss in W."""


@dataclass(frozen=True)
class Transformer:
    record: Record  # its first line
    circuit: str
    windings: tuple[Winding, ...]
    impedances: tuple[complex, ...]  # between windings 1-2, or 1-2, 2-3 and 3-1 [pu of the system]
    magnetisation: complex  # at the bus of winding 1 [pu of the system]
    off: tuple[int, ...]  # windings that are out of service
    controlled: bool  # whether a tap changer acts on it
    # whether a load loss, which CZ = 3 gives in W, is so small that pu may be meant
    small_loss: bool = False
    # whether a resistance is so large that a load loss in W may be meant
    large_resistance: bool = False
    name: str = ""  # NAME, which is 40 characters at most
    # whether correction tables act on the impedances between windings, and not on those to the star point (ZCOD = 1)
    corrects_pairs: bool = False
    tap: TapRecord | None = None  # a ratio that holds a voltage in a band, at winding 1 of two
    buses: tuple[int, ...] = ()  # as the file has them
    # factors from impedances on the windings' own bases to the system's, in the order of the impedances
    on_system: tuple[float, ...] = ()


def transformers(raw: RawFile, voltages: Mapping[int, float]) -> Iterator[Transformer]:
    """The transformers of a file.

    ``voltages``: bus → base voltage [kV]; 0 where the file leaves it open."""
    lines = iter(raw.of("transformer"))
    for first in lines:
        count = 3 if first.whole(2, "K", 0) else 2
        rest = [line for _, line in zip(range(count + 1), lines, strict=False)]
        if len(rest) < count + 1:
            raise first.error(
                "the transformer's record is cut short: it needs four lines, or five with three windings"
            )
        yield _transformer(raw, first, rest, voltages, count)


def _transformer(
    raw: RawFile, first: Record, rest: Sequence[Record], voltages: Mapping[int, float], count: int
) -> Transformer:
    codes = {name: first.whole(index, name, 1) for name, index in (("CW", 4), ("CZ", 5), ("CM", 6))}
    for name, most in (("CW", 3), ("CZ", 3), ("CM", 2)):
        if not 1 <= codes[name] <= most:
            raise first.error(f"{name} is {codes[name]}; known are 1 to {most}")
    state = first.whole(11, "STAT", 1)
    if state not in _OPEN or (count == 2 and state > 1):
        raise first.error(f"STAT is {state}, which a transformer of {count} windings does not have")
    buses = [abs(first.whole(k, "IJK"[k])) for k in range(count)]
    for bus in buses:
        if bus not in voltages:
            raise first.error(f"there is no bus {bus}")
    control, table = (
        (_CONTROL[33], _TABLE[33])
        if raw.revision < SWITCHING_DEVICES
        else (15, _TABLE[34] + (raw.revision > 34))
    )
    windings = tuple(
        _winding(line, bus, voltages[bus], codes["CW"], table)
        for line, bus in zip(rest[1:], buses, strict=True)
    )
    pairs = ((0, 1), (1, 2), (2, 0))[: 1 if count == 2 else 3]
    impedances = tuple(
        _impedance(raw, rest[0], 3 * k, codes["CZ"], windings[a].nominal)
        for k, (a, _) in enumerate(pairs)
    )
    on_system = tuple(
        _on_system(raw, rest[0], 3 * k, windings[a].nominal) for k, (a, _) in enumerate(pairs)
    )
    windings_lines = [line for line in rest[1:] if len(line.fields) > 3]
    return Transformer(
        first,
        first.text(3, "1"),
        windings=windings,
        impedances=impedances,
        magnetisation=_magnetisation(raw, first, rest[0], codes["CM"], windings[0]),
        off=_OPEN[state],
        controlled=any(line.whole(control, "COD", 0) for line in windings_lines),
        small_loss=codes["CZ"] == _LOSSES and _has_tiny_losses(rest[0], len(pairs)),
        large_resistance=codes["CZ"] != _LOSSES and _has_large_resistance(impedances),
        name=first.text(_NAME, "").strip(),
        corrects_pairs=bool(count > 2 and first.whole(_ZCOD, "ZCOD", 0)),
        tap=tap_record(
            rest[1],
            control,
            (buses[0], buses[1]),
            _by_base(codes["CW"], voltages[buses[0]], windings[0].nominal) / windings[1].ratio,
            has_node=raw.revision >= NODES,
        )
        if count == 2
        else None,
        buses=tuple(buses),
        on_system=on_system,
    )


def _has_tiny_losses(line: Record, pairs: int) -> bool:
    """Return whether a load loss between two windings is below 1 W, so that R was perhaps meant in pu."""
    return any(0 < line.number(3 * k, "R", 0.0) < 1 for k in range(pairs))


def _has_large_resistance(impedances: Sequence[complex]) -> bool:
    return any(z.real > _FAR * abs(z.imag) for z in impedances)


def _winding(line: Record, bus: int, base: float, code: int, table: int) -> Winding:
    """A winding by its line; ``table``: column of TAB."""
    nominal = line.number(1, "NOMV [kV]", 0.0)
    ratio = line.number(0, "WINDV", base if code == 2 else 1.0)
    if code != 1 and not base > 0 and (code == 2 or nominal):
        raise line.error(
            f"WINDV is given by voltages (CW = {code}), and bus {bus} has no base voltage"
        )
    by_base = nominal / base if nominal and base else 1.0
    is_given = ratio != 0
    if not is_given:
        ratio = base if code == 2 else 1.0
    ratio *= _by_base(code, base, by_base)
    if not ratio > 0:
        raise line.error(f"WINDV comes to {ratio:g} pu of the bus' base voltage; it must exceed 0")
    shift, rating = line.number(2, "ANG [degrees]", 0.0), line.number(3, "RATA [MVA]", 0.0)
    number = line.whole(table, "TAB", 0)
    return Winding(bus, ratio, shift, by_base, rating_mva=rating, table=number, has_ratio=is_given)


def _by_base(code: int, base: float, nominal: float) -> float:
    """Return the factor from a ratio as CW has it to one of the bus' base voltage."""
    return {1: 1.0, 2: 1 / base if base else 0.0, 3: nominal}[code]


def _on_system(raw: RawFile, line: Record, index: int, nominal: float) -> float:
    """Return the factor from an impedance on a pair of windings' own base to the system's; 1 without a base."""
    base = line.number(index + 2, "SBASE [MVA]", raw.base_mva)
    return raw.base_mva / base * nominal**2 if base > 0 else 1.0


def _impedance(raw: RawFile, line: Record, index: int, code: int, nominal: float) -> complex:
    """An impedance between two windings [pu of the system]; codes 2 and 3 are on the windings' own bases."""
    resistance = line.number(index, "R", 0.0)
    reactance = line.number(index + 1, "X")
    base = line.number(index + 2, "SBASE [MVA]", raw.base_mva)
    if code == 1:
        return complex(resistance, reactance)
    if not base > 0:
        raise line.error(f"a winding's SBASE is {base:g} MVA; it must exceed 0")
    if code == _LOSSES:  # load loss [W], and the magnitude of the impedance
        resistance *= 1e-6 / base
        if abs(resistance) > abs(reactance):
            raise line.error(
                f"the load loss gives R = {resistance:g} pu, more than the impedance of {reactance:g} pu"
            )
        reactance = math.copysign(math.sqrt(reactance**2 - resistance**2), reactance)
    return complex(resistance, reactance) * raw.base_mva / base * nominal**2


def _magnetisation(
    raw: RawFile, first: Record, second: Record, code: int, winding: Winding
) -> complex:
    """Admittance at the bus of winding 1 [pu of the system]."""
    g, b = first.number(7, "MAG1", 0.0), first.number(8, "MAG2", 0.0)
    if code == 1:
        return complex(g, b)
    base = second.number(2, "SBASE1-2 [MVA]", raw.base_mva)
    conductance, admittance = 1e-6 * g / raw.base_mva, abs(b) * base / raw.base_mva
    susceptance = -math.sqrt(max(0.0, admittance**2 - conductance**2))
    return complex(conductance, susceptance) / winding.nominal**2


def star(impedances: Sequence[complex]) -> tuple[complex, complex, complex]:
    """Impedances from three windings to the star point, from those between windings 1-2, 2-3 and 3-1."""
    z_12, z_23, z_31 = impedances
    return (z_12 + z_31 - z_23) / 2, (z_12 + z_23 - z_31) / 2, (z_23 + z_31 - z_12) / 2
