"""Lines, switching devices and transformers of a PSS/E RAW file."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import count

from orchestrator.cases.networks.branch_keys import BranchKey
from orchestrator.cases.networks.element_names import BranchName
from orchestrator.cases.networks.psse.raw_buses import SWITCH_STATE, reactance_of_switch
from orchestrator.cases.networks.psse.raw_records import (
    SWITCHING_DEVICES,
    Record,
)
from orchestrator.cases.networks.psse.raw_tables import BUS_COLUMNS, RawTables, is_in_service
from orchestrator.cases.networks.psse.transformers import Transformer, star, transformers
from orchestrator.cases.networks.source_changes import Remark
from orchestrator.core.errors import few

_SBASE = 100.0  # usual base [MVA]
_FAR = 20.0
"""Times the middle one of all reactances of lines from which one is questioned, where its ohms would be usual."""

_STEP = math.pi / 6  # of usual shifts [rad]
_ROUNDED = 0.005  # by which a shift of two decimals is beside the one that is meant
_SPREAD = 3.0  # standard deviations by which more shifts than by chance are multiples of a step
_ANGLES_SHOWN = 3  # shifts that a question names; the others are counted
_SAME_VOLTAGE = 0.1  # part by which the nominal voltages at a line's ends may differ


def read_lines(net: RawTables) -> None:
    """Add the branches and the switching devices that are in service, and ask about data that look wrong."""
    ends = net.column_of_ends
    for record in net.raw.of("branch"):
        if record.line not in net.merged and is_in_service(record, ends + 4, "ST"):
            _add_line(net, record)
    for record in net.raw.of("system switching device"):
        if record.line not in net.merged and is_in_service(record, SWITCH_STATE, "STAT"):
            start, end = net.bus(record), net.bus(record, 1)
            net.changes.note(record.line, "switching device: a branch of its reactance")
            net.add_branch(start, end, complex(0.0, reactance_of_switch(record)), 1)
    if net.raw.base_mva != _SBASE:
        text = f"SBASE is {net.raw.base_mva:g} MVA, on which all impedances count; nearly all files have"
        net.changes.note(1, f"{text} {_SBASE:g} MVA: is it meant?")
    _question_ohms(net)
    _question_short_records(net)


def _add_line(net: RawTables, record: Record) -> None:
    ends = net.column_of_ends
    start, end = net.bus(record), net.bus(record, 1)
    pair = frozenset((net.own_bus(record), net.own_bus(record, 1)))
    if len(pair) == 1:
        text = "a line from a bus to itself: not used, as the file's own solution has it"
        net.changes.note(record.line, text)
        return
    circuit = _circuit(net, record, pair)
    z = complex(record.number(3, "R", 0.0), record.number(4, "X"))
    z = 1j * net.least_reactance if record.line in net.lossless else z
    charging = 0.5j * record.number(5, "B", 0.0)
    gi, bi, gj, bj = (
        record.number(ends + k, n, 0.0) for k, n in enumerate(("GI", "BI", "GJ", "BJ"))
    )
    state = record.whole(ends + 4, "ST", 1)
    one, other = net.kilovolts[start], net.kilovolts[end]
    if state and one and other and abs(one - other) > _SAME_VOLTAGE * max(one, other):
        text = f"line between buses of BASKV = {one:g} and {other:g} kV: is one wrong, or a transformer meant?"
        net.changes.note(record.line, text)
    net.ohms.append((record.line, z.imag, one))
    to_earth = (charging + complex(gi, bi), charging + complex(gj, bj))
    # a name stands before the ratings from revision 34 on
    column = 6 if net.raw.revision < SWITCHING_DEVICES else 7
    rating = record.number(column, "RATEA [MVA]", 0.0)
    name = BranchName(record.text(6, "").strip() if column == 7 else "", circuit)
    own = net.own_bus(record), net.own_bus(record, 1)
    key = BranchKey(own, circuit, kilovolts=(one, other))
    net.add_branch(start, end, z, state, to_earth, rating=rating, name=name, key=key)


def _question_ohms(net: RawTables) -> None:
    """Ask about reactances of lines that are far above the others, and usual if they are read in ohms."""
    usual = sorted(abs(x) for _, x, _ in net.ohms)
    for line, x, kilovolts in net.ohms:
        middle = usual[len(usual) // 2]
        ohms = x * net.raw.base_mva / kilovolts**2 if kilovolts else 0.0
        if x > _FAR * middle and middle / _FAR < ohms < _FAR * middle:
            text = f"X is {x:g} pu, {x / middle:.3g} times the middle one of all lines; is it in ohms? On "
            net.changes.note(line, f"{text}{kilovolts:g} kV these are {ohms:.3g} pu")


def _question_short_records(net: RawTables) -> None:
    """Ask about branches that are shorter than all ordinary ones, and join two buses or are out of service.

    Where values are missing in the middle of a record, those behind them stand for others."""
    state = net.column_of_ends + 4
    joining = net.merged | net.lossless
    records = net.raw.of("branch")
    ordinary = [
        len(record.fields)
        for record in records
        if record.line not in joining and record.whole(state, "ST", 1)
    ]
    least = min(ordinary, default=0)
    for record in (record for record in records if len(record.fields) < least):
        x = record.text(4)
        effect = f"taken as a zero impedance line ({f'X = {x} pu' if x else 'it has no X'})"
        if record.line not in joining:
            effect = "taken as out of service (ST = 0)"
        text = (
            f"the record is short, of {len(record.fields)} values, where the other branches have {least} or more, and "
            f"{effect}: are values missing?"
        )
        net.changes.note(record.line, Remark(text, "a short record of a branch"))


def _circuit(net: RawTables, record: Record, pair: frozenset[int]) -> str:
    """Return a line's identifier, or another one where a line before has the same, from the same end."""
    own, start = record.text(2, "1").strip(), net.own_bus(record)
    first, its = net.circuits.setdefault((pair, own), (record.line, start))
    if first == record.line or its != start:
        net.refuse_second(record, "branch", pair, own)
        return own
    given = {
        other.text(2, "1").strip()
        for other in net.raw.of("branch")
        if {net.own_bus(other), net.own_bus(other, 1)} == pair
    }
    free = next(
        name
        for name in map(str, count(2))
        if name not in given and (pair, name) not in net.circuits
    )
    net.circuits[pair, free] = (record.line, start)
    text = (
        f"the branch {sorted(pair)} {own} stands in line {first} as well: a parallel circuit, {free}, is taken. "
        "PSS/E keeps one of both; if one is meant, remove the other"
    )
    net.changes.note(record.line, text)
    return free


def read_transformers(net: RawTables) -> None:
    found = list(transformers(net.raw, net.kilovolts))
    _question_radians(net, found)
    for t in found:
        moved = tuple(replace(w, bus=net.same.get(w.bus, w.bus)) for w in t.windings)
        _add_transformer(net, replace(t, windings=moved))


def _question_radians(net: RawTables, found: Sequence[Transformer]) -> None:
    """Ask, once, about shifts that would be usual ones in radians, if more are than by chance."""
    small = [
        (t.record.line, winding.shift)
        for t in found
        for winding in t.windings
        if _ROUNDED < abs(winding.shift) < 2 * math.pi
    ]
    usual = {line: shift for line, shift in small if abs(math.remainder(shift, _STEP)) <= _ROUNDED}
    chance = 2 * _ROUNDED / _STEP
    expected = len(small) * chance
    if len(usual) <= expected + _SPREAD * math.sqrt(expected * (1 - chance)):
        return
    shown = few([f"{shift:g}" for shift in dict.fromkeys(usual.values())], _ANGLES_SHOWN)
    turns = dict.fromkeys(30 * round(shift / _STEP) for shift in usual.values())
    degrees = few(map(str, turns), _ANGLES_SHOWN)
    for line in usual:
        text = f"ANG is {shown} degrees: is it in radians? {degrees} degrees are usual"
        net.changes.note(line, text)


def _add_transformer(net: RawTables, t: Transformer) -> None:
    windings, name = t.windings, BranchName(t.name, t.circuit.strip())
    if t.controlled:
        net.changes.note(t.record.line, "tap changer or phase-shift control: held at its position")
    if not all(w.has_ratio for w in windings):
        text = "WINDV is 0, which MATPOWER writes where a ratio is not given: the nominal ratio is taken"
        net.changes.note(t.record.line, text)
    if t.small_loss:
        text = "R below 1 is a load loss in W by CZ = 3, as good as none: is it in pu, so that CZ = 2 is right?"
        net.changes.note(t.record.line, text)
    if t.large_resistance:
        text = "R is more than 1000 times X: is it a load loss in W, so that CZ = 3 is right?"
        net.changes.note(t.record.line, text)
    if t.off == (0, 1, 2):
        return
    factors = _corrections_of(net, t)
    if 0 not in t.off:
        net.add(windings[0].bus, 4, t.magnetisation * net.raw.base_mva)
    if len(windings) == 2:
        first, second = windings
        net.add_branch(
            first.bus,
            second.bus,
            t.impedances[0] * second.ratio**2 * factors[0],
            1,
            tap=first.ratio / second.ratio,
            shift=first.shift - second.shift,
            rating=first.rating_mva,
            name=name,
            key=_key_of(net, t, 0, second.ratio**2),
        )
        seen = net.standing(t.tap.bus) if t.tap else None
        if t.tap and seen is not None and first.bus != second.bus:
            net.taps[len(net.branches) - 1] = replace(t.tap, bus=seen)
        return
    inner = max(net.rows) + 1
    net.rows[inner] = [inner, 1, *[0.0] * (BUS_COLUMNS - 2)]
    net.labels[inner] = "_".join(
        map(str, (*(w.bus for w in windings), t.circuit.strip() or "1", "star"))
    )
    net.titles[inner] = f"{t.name} star" if t.name else ""
    for k, (winding, z) in enumerate(zip(windings, star(t.impedances), strict=True)):
        net.add_branch(
            winding.bus,
            inner,
            z * factors[k],
            k not in t.off,
            tap=winding.ratio,
            shift=winding.shift,
            rating=winding.rating_mva,
            name=name,
            key=_key_of(net, t, k + 1),
        )


def _key_of(net: RawTables, t: Transformer, winding: int, square: float = 1.0) -> BranchKey:
    return BranchKey(
        t.buses,
        t.circuit.strip(),
        is_transformer=True,
        winding=winding,
        on_system=t.on_system[max(winding - 1, 0)],
        square=square,
        kilovolts=tuple(net.kilovolts.get(w.bus, 0.0) for w in t.windings),
    )


def _corrections_of(net: RawTables, t: Transformer) -> tuple[complex, ...]:
    """Return the factor of each winding's impedance by its correction table; 1 where it has none."""
    if t.corrects_pairs and any(winding.table for winding in t.windings):
        text = (
            "impedance correction tables of the impedances between windings (ZCOD = 1): not applied"
        )
        net.changes.note(t.record.line, text)
        return (1.0 + 0j,) * len(t.windings)
    for number in dict.fromkeys(w.table for w in t.windings if w.table):
        if number not in net.corrections:
            text = f"TAB is {number}, and the file has no such impedance correction table: not corrected"
            net.changes.note(t.record.line, text)
    return tuple(
        net.corrections[w.table].factor(w.ratio, w.shift)
        if w.table in net.corrections
        else 1.0 + 0j
        for w in t.windings
    )
