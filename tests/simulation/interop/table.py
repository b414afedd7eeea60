"""The table of masters on the page of validation, written from what was measured."""

import re
from pathlib import Path

from orchestrator.simulation.interop.rules import MASTERS, MasterRules
from tests.simulation.interop.measurement import Outcome
from tests.simulation.interop.systems import KINDS, SYSTEMS

PAGE = Path(__file__).parents[3] / ".docs" / "validation" / "interoperability.md"
BEGIN, END = "<!-- interop -->", "<!-- /interop -->"
LIMIT = 1e-9
PRELOAD = {"ecos_executable": "libpython for Python-backed FMUs, nothing for native ones"}

Results = dict[tuple[str, str], dict[str, Outcome]]


def missing(results: Results) -> list[str]:
    """What was not measured."""
    return [
        f"{master}, {kind}" for master in MASTERS for kind in KINDS if (master, kind) not in results
    ]


def table(results: Results) -> str:
    """All masters, with the largest difference for each system and kind of FMU."""
    columns = [f"{system}, {kind}" for system in SYSTEMS for kind in KINDS]
    lines = [
        "| Master | schedule | " + " | ".join(columns) + " | preload |",
        "|---|---|" + "---|" * len(columns) + "---|",
    ]
    for master, rules in MASTERS.items():
        figures = [figure(results[master, kind][system]) for system in SYSTEMS for kind in KINDS]
        cells = [rules.title, in_short(rules), *figures, PRELOAD.get(master, "–")]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def figure(outcome: Outcome) -> str:
    return f"{outcome.difference:.0e}" if outcome.difference else "0"


def in_short(rules: MasterRules) -> str:
    """The schedule in a few words."""
    first = {
        "consistent": "propagated",
        "once": "read once",
        "zero": "from zero",
        "start": "start values",
    }
    words = [
        "Jacobi" if rules.steps == "side by side" else "Gauss-Seidel",
        first[rules.first_inputs],
    ]
    words += ["wire by wire"] if rules.wire_by_wire else []
    words += ["read after exchange"] if rules.after_exchange else []
    words += ["labels one step early"] if rules.early_label else []
    count = rules.early_label - (rules.last_label == "before stop")
    steps = "N steps" if count == 0 else f"N{count:+d} steps"
    return ", ".join(
        [*words, "ends by a summed-up time" if rules.last_label.startswith("sum") else steps]
    )


def verdicts(text: str) -> dict[str, list[str]]:
    """Row by row what a table says, without its digits: figures become ``≤ 1e-9`` or ``> 1e-9``."""
    rows = {}
    for line in text.splitlines()[2:]:
        first, *cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        rows[first] = [_verdict(cell) for cell in cells]
    return rows


def _verdict(cell: str) -> str:
    try:
        return f"≤ {LIMIT:g}" if float(cell) <= LIMIT else f"> {LIMIT:g}"
    except ValueError:
        return cell


def on_page() -> str | None:
    """The table that stands there."""
    found = re.search(
        f"{re.escape(BEGIN)}\n(.*?)\n{re.escape(END)}", PAGE.read_text(encoding="utf-8"), re.DOTALL
    )
    return found.group(1) if found else None


def write(results: Results) -> None:
    """Put a new table between the page's markers."""
    text = PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    after = rest.partition(END)[2]
    PAGE.write_text(f"{before}{BEGIN}\n{table(results)}\n{END}{after}", encoding="utf-8")
