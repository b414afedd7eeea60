"""Our emulation of other people's masters, held against them: the same systems, the same FMUs, the same digits."""

from functools import cache

import pytest

from orchestrator.simulation.interop.probe_result import SIGNALS, read_probe_result
from orchestrator.simulation.interop.rules import MASTERS
from orchestrator.simulation.interop.which_master import identify
from tests.simulation.interop import table
from tests.simulation.interop.measurement import PROBES, measure, results_of, why_not
from tests.simulation.interop.systems import KINDS, SYSTEMS

pytestmark = [pytest.mark.interop, pytest.mark.slow]

EVERYTHING = [(master, kind) for master in MASTERS for kind in KINDS]


def skip_if_it_cannot_run(master, kind):
    reason = why_not(master, kind)
    if reason:
        pytest.skip(reason)


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    """What a master gives for all that it can run here."""

    @cache
    def of(master):
        kinds = tuple(kind for kind in KINDS if not why_not(master, kind))
        return results_of(master, tmp_path_factory.mktemp(master), kinds)

    return of


@pytest.mark.parametrize(("master", "kind"), EVERYTHING)
def test_the_emulation_gives_what_the_master_gives(master, kind, results, given):
    skip_if_it_cannot_run(master, kind)
    results[master, kind] = outcomes = measure(master, kind, given(master))
    assert set(outcomes) == set(SYSTEMS)
    for system, outcome in outcomes.items():
        assert outcome.moved > 0.1, system  # a system that stands still would tell nothing
        assert outcome.difference <= table.LIMIT, system
        assert outcome.rows == outcome.expected - (master == "libcosim"), system


@pytest.mark.parametrize("master", MASTERS)
def test_which_master_recognises_it(master, given, tmp_path):
    skip_if_it_cannot_run(master, "Python-backed")
    assert PROBES in given(master).results, given(master).said
    result = given(master).results[PROBES]
    path = tmp_path / "result.csv"
    rows = [["time", *SIGNALS], *result["rows"]]
    path.write_text("\n".join(",".join(map(str, row)) for row in rows), encoding="utf-8")
    verdict = identify(read_probe_result(path))
    assert master in verdict.masters
    for name in ("order", "extrapolation", "early_label", "after_exchange", "wire_by_wire"):
        assert len(verdict.answers(name)) == 1, name
    if result["order"]:
        assert verdict.answers("order") == [", then ".join(result["order"])]


def test_a_host_that_is_not_python_needs_a_preload_for_python_backed_fmus(tmp_path):
    skip_if_it_cannot_run("ecos_executable", "native")
    # native FMUs run in this very environment
    given = results_of("ecos_executable", tmp_path, ("Python-backed",), preload=False)
    with pytest.raises(AssertionError, match="ecos: return code"):
        measure("ecos_executable", "Python-backed", given)


def test_the_page_has_the_rows_and_verdicts_that_were_measured(results, write_table):
    """The last of this file: it needs what the others measured, and writes it where that is asked for."""
    absent = table.missing(results)
    assert not (absent and write_table), f"no table is written without {', '.join(absent)}"
    if absent:
        pytest.skip(f"not measured in this session: {'; '.join(absent)}")
    if write_table:
        table.write(results)
    shown = table.on_page()
    assert table.verdicts(shown) == table.verdicts(table.table(results))
