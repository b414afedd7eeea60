"""What a file holds and our network does not, or holds in another form: listed, and refused without the user's word."""

from collections.abc import Sequence

from orchestrator.cases.psse.records import RawFile
from orchestrator.cases.source_changes import Changes
from orchestrator.errors import InputError

_LINES = {"two-terminal dc": 3, "vsc dc line": 3, "facts device": 1, "induction machine": 1}  # lines of a record
LEFT_OUT = (*_LINES, "multi-terminal dc", "gne")
"""Elements that our network does not have; `leave_out` of the case names those that may go."""

_WITHOUT_EFFECT = {
    "area", "zone", "owner", "inter-area transfer", "multi-section line", "impedance correction", "system-wide",
    "substation", "voltage droop control", "switching device rating set",
}  # fmt: skip
_KNOWN = {"bus", "load", "fixed shunt", "generator", "branch", "system switching device", "transformer",
          "switched shunt"}  # fmt: skip


def leave_out(raw: RawFile, allowed: Sequence[str], changes: Changes) -> None:
    """Note the elements that our network does not have."""
    unknown = [kind for kind in allowed if kind not in LEFT_OUT]
    if unknown:
        raise InputError(f"leave_out: {unknown[0]!r} is unknown; choose from {', '.join(LEFT_OUT)}")
    refused = []
    for section, records in raw.sections.items():
        if section in _WITHOUT_EFFECT | _KNOWN or not records:
            continue
        step = _LINES.get(section, len(records))
        lines = [record.line for record in records[::step]]
        if section in allowed:
            for line in lines:
                changes.note(line, f"{section}: left out, as leave_out says")
        else:
            refused.append(f"{section} (line {', '.join(map(str, lines))})")
    if refused:
        raise InputError(
            f"{raw.place}: the network has no such elements: {'; '.join(refused)}; to go on without them, write "
            f"leave_out = [{', '.join(repr(text.split(' (line')[0]) for text in refused)}] in [network], and put what "
            "they feed or draw into loads"
        )
