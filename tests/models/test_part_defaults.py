"""What a part of a generator has where nobody gives it a value: default, least and most of each parameter.

A case that leaves a value out gets the default without a word, so that a changed one is a changed answer. The table is
part_defaults.json beside this file; whoever changes a default on purpose writes it anew:
`python -m tests.models.test_part_defaults`.
"""

import json
from pathlib import Path

import pytest

from fmus.synchronous_generator.parts import EXCITERS, GOVERNORS, STABILIZERS
from fmus.toolchain.catalogue import build_model
from tests.models.parts import exciter, governor, stabilizer

TABLE = Path(__file__).with_name("part_defaults.json")
PARTS = {
    **{f"exciter {name}": (exciter, name) for name in EXCITERS},
    **{f"governor {name}": (governor, name) for name in GOVERNORS},
    **{f"stabilizer {name}": (stabilizer, name) for name, part in STABILIZERS.items() if part is not None},
}


def defaults(part):
    make, name = PARTS[part]
    return {
        v.name: [v.start if isinstance(v.start, str | bool) else float(v.start), v.unit, v.minimum, v.maximum]
        for v in make(name).model.parameters
    }


@pytest.mark.parametrize("part", PARTS)
def test_a_part_has_the_defaults_of_the_table(part):
    assert defaults(part) == json.loads(TABLE.read_text(encoding="utf-8"))[part]


def test_the_table_has_no_other_parts():
    assert set(json.loads(TABLE.read_text(encoding="utf-8"))) == set(PARTS)


if __name__ == "__main__":
    rows = {part: defaults(part) for part in PARTS}
    TABLE.write_text(json.dumps(rows, indent=0, ensure_ascii=False) + "\n", encoding="utf-8")


def test_the_norms_exciter_has_the_values_of_its_table():
    """NTS 631, generator of area 1."""
    start = {v.name: v.start for v in build_model("synchronous_generator_st4b_pss2a").parameters}
    norm = {"K_PR": 3.15, "K_IR": 3.15, "T_A": 0.02, "K_P": 6.5, "K_C": -0.08}
    assert {name: start[f"exciter.{name}"] for name in norm} == norm
