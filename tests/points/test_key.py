"""What names a point's file."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.points import key
from orchestrator.points.key import LIBRARIES, code_hash, fingerprint, key_of, library_versions


@pytest.fixture
def fresh():
    yield
    code_hash.cache_clear()


@pytest.mark.parametrize("library", LIBRARIES)
def test_another_version_of_a_library_gives_other_names(fresh, monkeypatch, library):
    case = load_case("two_area")
    before = key_of({"a": 1}), fingerprint(case)
    versions = library_versions()
    assert versions[library]
    monkeypatch.setattr(key, "library_versions", lambda: versions | {library: "0.0.1"})
    code_hash.cache_clear()
    assert key_of({"a": 1}) != before[0]
    assert fingerprint(case) != before[1]
