"""Questions about records of a DYR file that are of no machine: models of loads, of SVCs, of DC lines, and strays."""

import tomllib
from collections.abc import Iterator, Mapping, Sequence

from fmus.dc_line.dyr_records import DC_LINE_RECORDS
from orchestrator.cases.form.schema import LoadModelTable
from orchestrator.cases.networks.psse.composite_loads import COMPOSITE_NAMES
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord
from orchestrator.cases.networks.psse.limiter_records import UNHEARD
from orchestrator.cases.networks.psse.missing_models import (
    DEVICE,
    OF_MACHINES,
    RESTS,
    kind_of,
    limiter_in_place,
    owner_of,
    reason_of_device,
    reason_of_limiter,
)
from orchestrator.cases.networks.psse.motor_loads import MOTOR_NAMES
from orchestrator.cases.networks.record_use import RecordUse, UseOfRecord
from orchestrator.cases.networks.source_changes import Changes, Remark
from orchestrator.core.errors import Problem, few, number_of
from orchestrator.core.options import Option

_MATTER = {
    "load": "loads follow [network] load_model",
    "device": "what it feeds in the power flow is constant",
    "plants": "the references of the units that it sets are constant",
    "unknown": "gfor does not know what it is",
}
"""What stands for a model of no machine, by its kind; relays act on events only, and are not asked about."""

_EXPONENTIAL = ("IEELAL", "IEELBL", "IEELAR", "IEELOW", "IEELZN")
_VALUES = 14
_LAWS = {0.0: "p", 1.0: "i", 2.0: "z"}
_SUM = 1e-3  # by which shares may miss 1
_MOST_BUSES = 8
_PHASORS = '; induction motors stand for it, which are phasor models: write models = "phasor" at the top of the case'
_PHASOR_LINE = '; its model is one of phasors: write models = "phasor" at the top of the case'
_NO_LINE = "; the RAW file has no DC line of this name in service with a current, through bridges without capacitors"
_NO_LOAD = "; the file has no load in service that it names and that draws active power"


def unused_models(
    records: Sequence[DynamicRecord],
    uses: Sequence[RecordUse],
    said: LoadModelTable | None = None,
    *,
    among_phasors: bool = False,
    labels: Mapping[tuple[int, str], str] | None = None,
) -> list[Problem]:
    """One question for each model that matters, with the lines of all its records.

    ``said``: how the case's loads follow the voltage; records that say the same are not asked about.
    ``among_phasors``: whether the case's models are phasor models, which motors are alone. ``labels``: of the machines'
    units, by bus and identifier; without them a unit has its bus' number."""
    if not records:
        return []
    changes = Changes(records[0].file)
    unused = [
        record
        for record, use in zip(records, uses, strict=True)
        if use.use is UseOfRecord.NOT_USED and use.of_no_machine
    ]
    for name in dict.fromkeys(record.name for record in unused):
        own = [record for record in unused if record.name == name]
        kind = DEVICE if own[0].line_of_dc else kind_of(name)
        law = _law(own)
        is_said = bool(law) and said == LoadModelTable.model_validate(
            tomllib.loads(law)["load_model"]
        )
        if kind in _MATTER and not is_said:
            remedy = f"; to take it for all loads, write {law} in [network]" if law else ""
            reason = reason_of_device(name)
            remedy = f" ({reason})" if reason else remedy
            if name in MOTOR_NAMES or name in COMPOSITE_NAMES:
                remedy = _NO_LOAD if among_phasors else _PHASORS
            if name in DC_LINE_RECORDS:
                remedy = _NO_LINE if among_phasors else _PHASOR_LINE
            places = few(
                dict.fromkeys(record.line_of_dc or str(record.bus) for record in own), _MOST_BUSES
            )
            where = owner_of(own[0])
            text = f"{name} ({where} {places}) is of no machine and not used: {_MATTER[kind]}"
            remark = Remark(text + remedy, f"{name} of no machine")
            for record in own:
                changes.note(record.line, remark)
    for record in _named_in(records, uses, RESTS):
        unit = (labels or {}).get((record.bus, record.machine), str(record.bus))
        text = (
            f"{record.name} is {RESTS}: {reason_of_limiter(record.name)}. It acts at limits only; does the machine "
            f"start within them? One of ours in its place: {limiter_in_place(record.name, unit)}"
        )
        changes.note(record.line, Remark(text, RESTS))
    for record in _named_in(records, uses, UNHEARD):
        text = (
            f"{record.name} is not used: it is {UNHEARD}. It acts at limits only. "
            "Does the machine start within them?"
        )
        changes.note(record.line, Remark(text, UNHEARD))
    return [*_strays(records, unused), *changes.as_problems()]


def _named_in(
    records: Sequence[DynamicRecord], uses: Sequence[RecordUse], why: str
) -> Iterator[DynamicRecord]:
    """Yield the records that are not used for a reason."""
    pairs = zip(records, uses, strict=True)
    yield from (record for record, use in pairs if use.why == why)


def _strays(records: Sequence[DynamicRecord], unused: Sequence[DynamicRecord]) -> Iterator[Problem]:
    """Yield one question about all records of machines that the RAW file lacks, which PSS/E passes over too.

    ``unused``: the records of no machine, among ``records``."""
    strays = [r for r in unused if kind_of(r.name) in OF_MACHINES and not r.line_of_dc]
    if not strays:
        return
    apart = {(record.bus, record.machine) for record in unused}
    ids: dict[int, set[str]] = {}
    for bus, machine in {(record.bus, record.machine) for record in records} - apart:
        ids.setdefault(bus, set()).add(machine)
    places = dict.fromkeys((record.bus, record.machine) for record in strays)
    named = [
        f"{bus} {machine!r}"
        + (f", whose bus has {', '.join(map(repr, sorted(ids[bus])))}" if bus in ids else "")
        for bus, machine in places
    ]
    yield Problem(
        strays[0].place,
        (
            f"{number_of(len(strays), 'record')} of {number_of(len(places), 'machine')} that "
            f"the RAW file does not have ({few(named, _MOST_BUSES, '; ')}; first "
            f"{strays[0].name}) are passed over, as PSS/E does; "
            + Option.DETAILS
            + " lists them; if one is meant for a machine of the RAW file, correct its bus "
            "or identifier"
        ),
    )


def _law(records: Sequence[DynamicRecord]) -> str:
    """Return what to write in the case, as TOML, so that loads follow the records; empty where that is not exact."""
    if records[0].name not in _EXPONENTIAL or len({record.values for record in records}) > 1:
        return ""
    try:
        values = [float(text) for text in records[0].values]
    except ValueError:
        return ""
    if len(values) != _VALUES:
        return ""
    shares, (k_pf, k_qf), powers = values[:6], values[6:8], values[8:]
    laws = [*_laws(shares[:3], powers[:3]), *_laws(shares[3:], powers[3:])]
    if len(laws) < 2:
        return ""
    active, reactive = laws
    return f"load_model = {{ active = {active}, reactive = {reactive}, k_pf = {k_pf:g}, k_qf = {k_qf:g} }}"


def _laws(shares: Sequence[float], powers: Sequence[float]) -> Iterator[str]:
    """A law of shares and powers of the voltage as the case writes it; none where it is no mixture of Z, I and P."""
    found = dict.fromkeys("zip", 0.0)
    for share, power in zip(shares, powers, strict=True):
        if share and power not in _LAWS:
            return
        if share:
            found[_LAWS[power]] += share
    if abs(sum(found.values()) - 1) < _SUM:
        yield f"{{ {', '.join(f'{letter} = {share:g}' for letter, share in found.items() if share)} }}"
