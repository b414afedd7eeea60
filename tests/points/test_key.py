"""What names a point's file."""

import shutil

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


@pytest.mark.parametrize(
    ("file", "counts"),
    [
        ("watch/synchronism.py", True),
        ("watch/finding.py", True),
        ("certification/codes/bench_point.py", True),
        ("cli/check.py", False),
    ],
)
def test_another_code_gives_other_names(fresh, monkeypatch, tmp_path, file, counts):
    """What a kept row says is the watch's as well; what only shows it does not count."""
    root = shutil.copytree(
        key._ROOT, tmp_path / "code", ignore=shutil.ignore_patterns("*.toml", "__pycache__", "cases")
    )
    monkeypatch.setattr(key, "_ROOT", root)
    code_hash.cache_clear()
    before = key_of({"a": 1})
    with (root / file).open("a", encoding="utf-8") as text:
        text.write("# another rule\n")
    code_hash.cache_clear()
    assert (key_of({"a": 1}) != before) is counts
