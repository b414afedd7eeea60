"""The guide's park of three vendors, and studies of it."""

from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from orchestrator.cases.case import load_case
from orchestrator.studies.interactions.request import InteractionsRequest
from orchestrator.studies.interactions.study import plan_interactions, run_interactions
from orchestrator.studies.interactions.view import Interactions
from orchestrator.studies.points.executor import Serial
from orchestrator.studies.points.points import Work
from orchestrator.studies.points.store import PointStore
from tests.pages.markdown import ROOT, blocks
from tests.support.once import shared_folder

GUIDE = ROOT / ".docs" / "how-to" / "several-vendors.md"


@cache
def folder() -> Path:
    """With the guide's case."""
    path = Path(mkdtemp())
    (text,) = (block.text for block in blocks(GUIDE) if block.path == "park.toml")
    (path / "park.toml").write_text(text, encoding="utf-8")
    return path


def kept() -> Path:
    """The folder of studies in which all workers keep the systems that they computed."""
    return shared_folder() / "parks"


def written(name, *changes):
    """A file with the case, and pieces of text in place of others."""
    text = (folder() / "park.toml").read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder() / name
    path.write_text(text, encoding="utf-8")
    return path


def studied(path=None, values=None, **wanted):
    """A study of the park, or of another case."""
    plan = plan_interactions(
        load_case(path or folder() / "park.toml"), InteractionsRequest(values=values, **wanted)
    )
    return Interactions(run_interactions(plan, Work(Serial(), PointStore(kept() / "points"))))


park = cache(studied)
"""The guide's study, computed once."""

swapped = cache(lambda: studied(swap=True, places=("west", "east")))
"""A and B at both of their places."""
