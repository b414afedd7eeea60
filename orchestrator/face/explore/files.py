"""The files of the page: no build step, nothing from elsewhere."""

from functools import cache
from pathlib import Path
from typing import Any

from orchestrator.cases.case import without_installed_folder
from orchestrator.output.report.html.elements import held_data

PAGE = "page.html"
SCRIPTS = (
    "base.js",
    "mode_map.js",
    "table.js",
    "values.js",
    "network.js",
    "response.js",
    "study.js",
    "first.js",
    "saved.js",
    "page.js",
)
STYLE = "page.css"
FILES = {
    PAGE: "text/html; charset=utf-8",
    STYLE: "text/css; charset=utf-8",
    **dict.fromkeys(SCRIPTS, "text/javascript; charset=utf-8"),
}

_PLACE = Path(__file__).parent / "page"


@cache
def content_of(name: str) -> bytes:
    return (_PLACE / name).read_bytes()


def whole_page(saved: Any) -> str:
    """The page as one file that asks no server: ``saved`` is what it shows, as JSON's types.

    A page that is handed on does not tell where the built-in cases are installed."""
    text = content_of(PAGE).decode()
    text = text.replace(
        f'<link rel="stylesheet" href="{STYLE}">', f"<style>{content_of(STYLE).decode()}</style>"
    )
    for name in SCRIPTS:
        held = held_data("saved", saved) if name == SCRIPTS[0] else ""
        text = text.replace(
            f'<script src="{name}"></script>',
            f"{without_installed_folder(held)}<script>{content_of(name).decode()}</script>",
        )
    return text
