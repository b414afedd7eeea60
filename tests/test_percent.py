"""How a part is written as percent: with a space before the sign, as in all texts for people."""

import re
from pathlib import Path

PRODUCT = Path(__file__).parents[1] / "orchestrator"
CELLS = {
    "output/report/html/chapters/runs.py": 1,
    "output/report/short_texts.py": 1,
    "studies/immittance/view.py": 1,
    "studies/interactions/view.py": 1,
    "studies/runs/tables.py": 2,
    "studies/signals/ambient.py": 1,
    "studies/validation/words.py": 1,
}
"""Modules with narrow columns of tables, in which the sign follows the number, and how many there are."""


def test_a_sentence_has_a_space_before_the_sign_of_percent():
    """Causes explained "77%" of an error, which is "77 %" elsewhere."""
    found = {}
    for path in PRODUCT.rglob("*.py"):
        formats = re.findall(r":\.\d%\}", path.read_text(encoding="utf-8"))
        if formats:
            found[path.relative_to(PRODUCT).as_posix()] = len(formats)
    assert found == CELLS
