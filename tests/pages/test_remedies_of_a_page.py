"""The page on a planner's own network tells the options and the keys that messages print."""

import re
from pathlib import Path

from orchestrator.cases.form import remedies
from orchestrator.cases.networks.psse.dyr_mistakes import WITHOUT_RECORD

PAGE = Path(__file__).parents[2] / ".docs" / "how-to" / "own-network.md"
PRINTED = (
    remedies.without_kinds(["facts device"]),
    remedies.without_models(["MODEL"]),
    remedies.without_models([WITHOUT_RECORD]),
    remedies.APPROXIMATING,
    remedies.replacement_of("3"),
    remedies.replacement_of(WITHOUT_RECORD),
    remedies.with_frequency(60.0),
    remedies.with_slack("sg1"),
    remedies.KEEPING_LIMITS,
    remedies.WITHOUT_PARTS,
)


def test_the_table_has_every_remedy_that_readers_print():
    page = PAGE.read_text(encoding="utf-8")
    rows = dict(re.findall(r"\| `(--[^`]*)`[^|]*\| (.*?) \|\n", page))
    for text in PRINTED:
        key, table, option = re.fullmatch(
            r"(\w+) = .* in (\[.*?\]) \(`gfor new (.*)`\)", text
        ).groups()
        assert rows[option] == f"`{key}` in `{table}`"
    assert len(rows) == len(PRINTED)
