"""Records of RAW files of revision 23 to 30 in the form that revision 31 has.

Up to revision 30 fixed shunts are in the records of the buses, up to 23 the loads as well.  Up to 26 transformers are
branches with a ratio, and their controls are adjustments in a section of their own.

Source: the columns that MATPOWER's ``psse_parse`` lists by revision, and GridPACK's files of revision 23."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from orchestrator.cases.networks.psse.raw_records import ADJUSTMENTS, RawFile, Record, is_number
from orchestrator.core.errors import InputError

_FIXED_SHUNTS = 31  # first revision with fixed shunts beside the buses, and REV in the first record
_OLD_FIELDS = 11  # of a bus until revision 30
_LOADS_APART = 24  # first revision with a section of loads
_OLDEST_FIELDS = 12  # of a bus before it
_RATIO = 9  # column of the ratio, before the shift, in such a branch
_ENDS = slice(11, 15)  # columns of GI, BI, GJ and BJ there
_TURNED = ("RATIO", "ANGLE")
_STATUS = 15  # column of ST there
_SHARED = 30  # first revision with RMPCT of a switched shunt
_BEGIN = 5  # column of a switched shunt's BINIT up to revision 27, or of RMIDNT up to 29
_APART = 27  # first revision with transformers apart from branches
_NAMED = 28  # first revision with RMIDNT of a switched shunt
_ANGLES = 2.0  # limits of a transformer's ratio beyond this [pu] are angles [degrees]
_OF_VOLTAGE = 1  # COD of a transformer that holds a voltage, a reactive power and a power
_OF_REACTIVE = 2
_OF_POWER = 3

Sections = dict[str, list[Record]]


def with_later_records(raw: RawFile) -> RawFile:
    """Return a file with the records of revision 31 in the place of older ones.

    Parameters
    ----------
    raw
        Records as they stand in the file.
    """
    sections, remarks = raw.sections, raw.remarks
    if raw.revision < _SHARED or ADJUSTMENTS in sections:
        sections = _as_revision_30(raw.revision, raw.base_mva, sections)
    if raw.revision >= _FIXED_SHUNTS and _are_old_buses(sections.get("bus", [])):
        text = f"REV is {raw.revision}, and the buses hold GL and BL before their areas, as in revision 30: read so"
        remarks = (*remarks, (1, text))
        sections = _later_buses(sections)
    elif raw.revision < _FIXED_SHUNTS:
        sections = _later_buses(sections)
    return replace(raw, sections=sections, remarks=remarks)


def _are_old_buses(buses: Sequence[Record]) -> bool:
    """Return whether buses are as in revision 30: GL and BL, with a decimal point, where later ones have areas."""
    return bool(buses) and all(
        len(x.fields) == _OLD_FIELDS and all("." in text for text in (*x.fields[4:6], x.fields[8]))
        for x in buses
    )


def _later_buses(sections: dict[str, list[Record]]) -> dict[str, list[Record]]:
    """Buses of revisions 29 and 30, which hold GL and BL, as those of later ones, with fixed shunts."""
    buses, shunts = [], []
    for record in sections.get("bus", []):
        padded = [*record.fields, *[""] * (_OLD_FIELDS - len(record.fields))]
        number, name, kilovolts, kind, g, b, area, zone, vm, va, owner = padded[:_OLD_FIELDS]
        buses.append(
            replace(record, fields=[number, name, kilovolts, kind, area, zone, owner, vm, va])
        )
        if any(is_number(text) and float(text) for text in (g, b)):
            shunts.append(replace(record, fields=[number, "1", "1", g, b]))
    return {**sections, "bus": buses, "fixed shunt": [*sections.get("fixed shunt", ()), *shunts]}


def _as_revision_30(revision: int, base_mva: float, sections: Sections) -> Sections:
    """Return the sections of a file of revision 23 to 29 with records as revision 30 has them."""
    found = dict(sections)
    if revision < _LOADS_APART:
        found |= _with_loads(sections.get("bus", []))
    if ADJUSTMENTS in sections or revision < _APART:
        found |= _with_transformers(found, base_mva)
    if "switched shunt" in sections and revision < _SHARED:
        shunts = (_later_shunt(revision, record) for record in sections["switched shunt"])
        found["switched shunt"] = [*shunts]
    return found


def _with_loads(buses: list[Record]) -> Sections:
    """Return buses without their loads, and the loads."""
    later, loads = [], []
    for record in buses:
        padded = [*record.fields, *[""] * (_OLDEST_FIELDS - len(record.fields))]
        number, kind, p, q, g, b, area, vm, va, name, kilovolts, zone = padded[:_OLDEST_FIELDS]
        bus = [number, name, kilovolts, kind, g, b, area, zone, vm, va, "1"]
        later.append(replace(record, fields=bus))
        if record.number(2, "PL", 0.0) or record.number(3, "QL", 0.0):
            loads.append(replace(record, fields=[number, "1", "1", area, zone, p, q]))
    return {"bus": later, "load": loads}


def _with_transformers(sections: Mapping[str, list[Record]], base_mva: float) -> Sections:
    """Return lines without ratio, and the others as transformers of two windings with their controls."""
    controls = {_ends(record): record for record in sections.get(ADJUSTMENTS, [])}
    lines: list[Record] = []
    transformers: list[Record] = []
    shunts = [*sections.get("fixed shunt", ())]
    for record in sections.get("branch", []):
        ratio, shift = (record.number(_RATIO + k, name, 0.0) for k, name in enumerate(_TURNED))
        if ratio or shift:
            control = controls.get(_ends(record))
            transformers += _transformer(record, ratio or 1.0, shift, control, base_mva)
            shunts += _to_earth(record, ratio or 1.0, base_mva)
        else:
            own = [*record.fields[:_RATIO], *record.fields[_RATIO + 2 :]]
            lines.append(replace(record, fields=own))
    found = {"branch": lines, "transformer": [*sections.get("transformer", ()), *transformers]}
    return found | ({"fixed shunt": shunts} if shunts else {})


def _ends(record: Record) -> tuple[frozenset[str], str]:
    """Return the buses and the circuit of a branch, by which its adjustment is found."""
    buses = (record.text(k).removeprefix("-") for k in (0, 1))
    return frozenset(buses), record.text(2, "1").strip()


def _transformer(
    record: Record, ratio: float, shift: float, control: Record | None, base_mva: float
) -> Iterator[Record]:
    """Yield the four lines of a transformer of two windings, its impedance on the system base."""
    start, end = (record.text(k).removeprefix("-") for k in (0, 1))
    status = record.text(_STATUS, "1")
    head = [start, end, "0", record.text(2, "1"), "1", "1", "1", "0", "0", "2", "", status]
    yield replace(record, fields=head)
    impedance = [record.text(3, "0"), record.text(4, "0"), f"{base_mva:.17g}"]
    yield replace(record, fields=impedance)
    winding = [f"{ratio:.17g}", "0", f"{shift:.17g}", *(record.text(k, "0") for k in (6, 7, 8))]
    yield replace(record, fields=[*winding, *_control(control)])
    yield replace(record, fields=["1", "0"])


def _control(record: Record | None) -> list[str]:
    """Return COD, CONT, RMA, RMI, VMA, VMI, NTP, TAB, CR and CX of a winding; nothing without an adjustment."""
    if record is None:
        return []
    most, least = record.number(4, "RMA", 1.5), record.number(5, "RMI", 0.51)
    step = record.number(8, "STEP", 0.00625)
    code = _OF_VOLTAGE if abs(record.number(6, "VMA", 1.5)) < _ANGLES else _OF_REACTIVE
    if max(abs(most), abs(least)) > _ANGLES:
        code = _OF_POWER
    if not record.whole(10, "CNTRL", 1):
        code = -code
    positions = round((most - least) / step) + 1 if step > 0 else 33
    limits = [record.text(k, default) for k, default in ((4, "1.5"), (5, "0.51"), (6, "1.5"))]
    tail = [record.text(k, "0") for k in (9, 11, 12)]
    bus = record.text(3, "0")
    return [str(code), bus, *limits, record.text(7, "0.51"), str(positions), *tail]


def _to_earth(record: Record, ratio: float, base_mva: float) -> Iterator[Record]:
    """Yield shunts in the place of a transformer's charging, half at each end behind the ratio, and its ends' own."""
    charging = record.number(5, "B", 0.0) / 2
    names = ("GI", "BI", "GJ", "BJ")
    columns = range(_ENDS.start, _ENDS.stop)
    g_i, b_i, g_j, b_j = (record.number(k, n, 0.0) for k, n in zip(columns, names, strict=True))
    if not record.whole(_STATUS, "ST", 1):
        return
    ends = ((0, g_i, b_i + charging / ratio**2), (1, g_j, b_j + charging))
    for column, g, b in ends:
        if g or b:
            power = [f"{base_mva * part:.17g}" for part in (g, b)]
            bus = record.text(column).removeprefix("-")
            own = f"T{record.line}"  # no shunt of the file has such a name
            yield replace(record, fields=[bus, own, "1", *power])


def _later_shunt(revision: int, record: Record) -> Record:
    """Return a switched shunt with RMPCT and RMIDNT before its BINIT, as from revision 30."""
    before, behind = [*record.fields[:_BEGIN]], [*record.fields[_BEGIN:]]
    if revision < _NAMED:
        return replace(record, fields=[*before, "100", "", *behind])
    has_share = _is_share(record)
    return record if has_share else replace(record, fields=[*before, "100", *behind])


def _is_share(record: Record) -> bool:
    """Return whether RMPCT stands before RMIDNT: the steps then begin in the ninth column."""
    try:
        record.number(_BEGIN, "RMPCT")
        record.number(_BEGIN + 2, "BINIT")
        record.whole(_BEGIN + 3, "N1")
    except InputError:
        return False
    return True
