"""Files of a screening: a row for each item, a row for each mode there, and the summary."""

import csv
import json
from pathlib import Path

from orchestrator.screening.report import write_page
from orchestrator.screening.summary import ModeAt, Summary, as_json

ITEMS, MODES, SUMMARY, PAGE = "items.csv", "modes.csv", "screening.json", "screening.html"

_OF_ITEMS = ("point", "outage", "hours", "status", "stable", "counted", "least_damping_percent", "frequency_hz", "why")
_OF_MODES = ("point", "outage", "mode", "real", "imag", "frequency_hz", "damping_percent", "participation", "converter")


def save(summary: Summary, folder: Path) -> list[Path]:
    names = {id(one.item): {} for mode in summary.modes for one in mode.at}  # type: dict[int, dict[int, str]]
    for mode in summary.modes:
        for one in mode.at:
            names[id(one.item)][one.place] = mode.name
    with (folder / ITEMS).open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(_OF_ITEMS)
        for item in summary.result.items:
            record = item.record
            least = ModeAt(item, record.critical[0]) if record.critical else None
            figures = [repr(least.damping), repr(least.frequency)] if least else ["", ""]
            why = "; ".join(text for text in (record.text, *record.warnings) if text)
            known = "" if record.stable is None else str(record.stable).lower()
            rows.writerow([item.point.name, item.outage.name, item.point.hours, record.status, known,
                           str(record.counted).lower(), *figures, why])  # fmt: skip
    with (folder / MODES).open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(_OF_MODES)
        for item in summary.result.items:
            for place in item.record.critical:
                one = ModeAt(item, place)
                who = " ".join(f"{name}:{share:.3f}" for name, share in one.participation(3))
                best = next((f"{name}:{max(abs(p), abs(q)):.4g}" for name, p, q in one.ranking(1)), "")
                rows.writerow([item.point.name, item.outage.name, names[id(item)][place], repr(one.value.real),
                               repr(one.value.imag), repr(one.frequency), repr(one.damping), who, best])  # fmt: skip
    text = json.dumps(as_json(summary), indent=1, ensure_ascii=False)
    (folder / SUMMARY).write_text(text + "\n", encoding="utf-8")
    write_page(summary, folder / PAGE)
    return [folder / name for name in (ITEMS, MODES, SUMMARY, PAGE)]
