"""A design that was interrupted continues, and comes out the same."""

import json

import pytest

from orchestrator.studies.pod_design.closed_loop import PodLoop
from orchestrator.studies.points.store import PointStore

WORDS = ("design", "two_area", "--controller", "pod_p")


@pytest.mark.slow
def test_an_interrupted_design_continues_and_gives_the_same(gfor, tmp_path, monkeypatch):
    whole = tmp_path / "whole.toml"
    assert gfor(*WORDS, "--out", whole)[0] == 0
    path, saved = tmp_path / "again.toml", []

    def interrupting(store, key, header, arrays, save=PointStore.save):
        save(store, key, header, arrays)
        saved.append(key)
        if len(saved) == 4:
            raise KeyboardInterrupt

    monkeypatch.setattr(PointStore, "save", interrupting)
    code, _, error = gfor(*WORDS, "--out", path)
    assert code == 130
    assert error.splitlines()[-1] == (
        f"interrupted: what was computed is in {path.with_suffix('.points')}; the same command continues from there"
    )
    monkeypatch.undo()
    followed = []
    follow = PodLoop._followed
    monkeypatch.setattr(
        PodLoop, "_followed", lambda *words: followed.append(words) or follow(*words)
    )
    assert gfor(*WORDS, "--out", path)[0] == 0
    assert not path.with_suffix(".points").exists()
    monkeypatch.undo()
    results = [
        json.loads(p.with_suffix(".json").read_text(encoding="utf-8")) for p in (whole, path)
    ]
    for result in results:
        del result["made"]
        del result["parameter_file"]
    assert results[0] == results[1]
    everything = []
    monkeypatch.setattr(
        PodLoop, "_followed", lambda *words: everything.append(words) or follow(*words)
    )
    assert gfor(*WORDS, "--out", tmp_path / "third.toml")[0] == 0
    assert len(followed) < len(everything)
