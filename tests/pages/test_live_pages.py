"""The pages that a newcomer opens before an install: small, alone, and with the figures of today."""

import json
import re

import pytest

import orchestrator as gfor
from tests.pages.markdown import ROOT, links

GUIDE = ROOT / ".docs" / "how-to" / "look-first.md"
PAGES = sorted((ROOT / ".docs" / "live").glob("*.html"))
LARGEST = 3_000_000
"""Bytes of a page: a slow line fetches it in ten seconds."""


def saved(path):
    """What a page holds."""
    (content,) = re.findall(r'<script[^>]* id="saved"[^>]*>(.*?)</script>', path.read_text("utf-8"))
    return json.loads(content)


def test_the_guide_leads_to_every_page_and_says_how_it_was_made():
    led = {(GUIDE.parent / target).resolve() for _, target in links(GUIDE)}
    assert len(PAGES) >= 5
    text = GUIDE.read_text(encoding="utf-8")
    for path in PAGES:
        assert path in led
        assert re.search(rf"--(save|html|out) \.docs/live/{re.escape(path.name)}[\n`]", text)


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.stem)
def test_a_page_is_small_and_asks_nothing_of_the_network(path):
    text = path.read_text(encoding="utf-8")
    assert len(text.encode()) <= LARGEST
    assert not re.search(r"""(src|href)=["']?(https?:)?//""", text)
    assert not re.search(r"""@import|url\(["']?(https?:)?//""", text)
    assert not re.search(r"[\"' ]/(home|root|tmp|work)/", text), (
        "a folder of the machine that made it"
    )


@pytest.mark.parametrize("name", ["two_area"])
def test_the_figures_are_those_of_today(name):
    held = saved(ROOT / ".docs" / "live" / f"{name}.html")
    for one in (held["answers"][0], held["answers"][-1]):
        (found,) = one["answer"]["modes"]["scenarios"]
        modes = gfor.load(name).scenario(one["scenario"], one["values"]).modes()
        assert [mode["damping_percent"] for mode in found["modes"]] == pytest.approx(
            [mode.damping_percent for mode in modes], abs=1e-3
        )
