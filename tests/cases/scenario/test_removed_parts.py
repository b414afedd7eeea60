"""A part that a record gives a machine is taken off by one word: its parameters go along."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import CaseError
from tests.cases.networks.psse import raw
from tests.cases.networks.psse.test_dyr import CASE, DYR

PARTS = """\
1 'IEEEST' 1 1 0 0 0 0 0 0 0 0.1 0.05 0.1 0.05 5 5 10 0.1 -0.1 0 0 /
1 'MAXEX1' 1 2.5 1.1 120 1.2 40 1.5 15 1.0 0.002 -0.5 /
1 'MNLEX2' 1 0.1 1 0.1 0.5 0.1 1.3 1.95 /
"""
SCOPES = {"stabilizer": "pss.", "oel": "oel.", "uel": "uel."}


@pytest.fixture
def case(tmp_path):
    (tmp_path / "grid.raw").write_text(raw(33))
    (tmp_path / "grid.dyr").write_text(DYR + PARTS)
    (tmp_path / "case.toml").write_text(CASE)
    return load_case(tmp_path / "case.toml")


def scopes_of(case, values):
    (ready,) = case.prepare(["plain"], values)
    variables = ready.system.components["sg1"].description.variables
    return {part for part, begin in SCOPES.items() if any(v.startswith(begin) for v in variables)}


@pytest.mark.parametrize("pattern", ["sg1", "sg*"])
@pytest.mark.parametrize("part", SCOPES)
def test_a_part_of_a_record_is_taken_off_with_its_parameters(part, pattern, case):
    assert scopes_of(case, {f"{pattern}.{part}": "none"}) == set(SCOPES) - {part}


def test_a_parameter_that_is_given_for_a_part_that_is_off_is_still_a_mistake(case):
    with pytest.raises(CaseError, match=r"component 'sg1' has no variable 'oel\.KMX'"):
        case.prepare(["plain"], {"sg1.oel": "none", "sg1.oel.KMX": 0.1})
