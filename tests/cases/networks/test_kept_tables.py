"""Tables of pandapower's networks are kept to the last bit, and made anew where anything changed."""

from pathlib import Path

import numpy as np
import pytest

from orchestrator.cases.built_in import ieee39
from orchestrator.cases.networks import kept_tables as module
from orchestrator.cases.networks import sources as network_sources
from orchestrator.cases.networks.kept_tables import LIBRARIES, SourceTables, kept_tables
from orchestrator.core.errors import InputError

NUMBERS = np.array([[0.1 + 0.2, -0.0, np.inf], [np.nan, 5e-324, 1 / 3]])
TABLES = SourceTables(
    "net",
    100.0,
    NUMBERS,
    NUMBERS.T.copy(),
    np.zeros((0, 10)),
    np.array([[0.3 + 0.1j, -1e-9j]]),
    {0: "a", 7: "é"},
    50.0,
)


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("GFOR_COSIM_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def never():
    raise AssertionError("it is kept")


def test_tables_come_back_to_the_last_bit():
    kept_tables("net", b"", lambda: TABLES)
    back = kept_tables("net", b"", never)
    for name in ("bus", "branch", "gen", "branch_to_earth"):
        one, other = getattr(TABLES, name), getattr(back, name)
        assert (one.dtype, one.shape, one.tobytes()) == (other.dtype, other.shape, other.tobytes())
    assert (back.name, back.base_mva, back.labels, back.frequency) == (
        "net",
        100.0,
        {0: "a", 7: "é"},
        50.0,
    )


@pytest.mark.parametrize(("name", "content"), [("other", b""), ("net", b"{}")])
def test_another_network_is_made(name, content):
    kept_tables("net", b"", lambda: TABLES)
    with pytest.raises(AssertionError):
        kept_tables(name, content, never)


@pytest.mark.parametrize("library", LIBRARIES)
def test_another_version_makes_the_tables_anew(monkeypatch, library):
    kept_tables("net", b"", lambda: TABLES)
    installed = module.installed_version
    monkeypatch.setattr(
        module, "installed_version", lambda name: "0.0.1" if name == library else installed(name)
    )
    with pytest.raises(AssertionError):
        kept_tables("net", b"", never)


def test_other_code_makes_the_tables_anew(monkeypatch):
    kept_tables("net", b"", lambda: TABLES)
    monkeypatch.setattr(module, "_CODE", "changed")
    with pytest.raises(AssertionError):
        kept_tables("net", b"", never)


def test_damaged_tables_are_made_anew(own_cache, caplog):
    kept_tables("net", b"", lambda: TABLES)
    (file,) = own_cache.rglob("*.json")
    file.write_bytes(file.read_bytes().replace(b"100.0", b"200.0"))
    assert kept_tables("net", b"", lambda: TABLES) is TABLES
    assert "it is built again" in caplog.text


def test_an_error_is_not_kept(own_cache):
    def fails():
        raise InputError("no solution")

    for _ in range(2):
        with pytest.raises(InputError, match="no solution"):
            kept_tables("net", b"", fails)
    assert not list(own_cache.rglob("*.json"))


@pytest.mark.slow
def test_a_built_in_case_has_the_tables_of_its_network_beside_it(monkeypatch):
    folder = Path(ieee39.__file__).parent
    made = network_sources._made_by_pandapower("case39", folder / "case39")
    monkeypatch.setattr(network_sources, "kept_tables", lambda *_: never())
    found = network_sources.read_pandapower("case39", folder)
    for name in ("bus", "branch", "gen", "branch_to_earth"):
        assert np.allclose(
            getattr(found, name), getattr(made, name), rtol=1e-9, atol=1e-9, equal_nan=True
        )
    assert (found.name, found.base_mva, found.labels) == (made.name, made.base_mva, made.labels)
    with pytest.raises(AssertionError):
        network_sources.read_pandapower("case9", folder)
