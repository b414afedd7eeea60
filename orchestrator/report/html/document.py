"""The frame of every page: one file that needs no network and no other file."""

from collections.abc import Sequence
from datetime import UTC, datetime
from html import escape
from importlib.metadata import version
from pathlib import Path

_HERE = Path(__file__).parent


def document(
    title: str, kind: str, findings: str, content: Sequence[tuple[str, str]], moment: datetime | None = None
) -> str:
    links = "".join(f'<a href="#section-{k}">{escape(name)}</a>' for k, (name, _) in enumerate(content))
    body = "".join(
        f'<section id="section-{k}"><h2>{escape(name)}</h2>{text}</section>' for k, (name, text) in enumerate(content)
    )
    made = f"gfor-cosim {version('gfor-cosim')}, {moment or datetime.now(UTC):%Y-%m-%d %H:%M} UTC"
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(title)}</title><link rel="icon" href="data:,"><style>{_text("page.css")}{_footer(title)}</style></head>
<body><main><header><h1>{escape(title)}</h1><div class="soft">{escape(kind)} · {made}</div></header>
<nav>{links}</nav>{findings}{body}</main>
<div id="tooltip" role="status"></div><script>{_text("page.js")}</script></body></html>
"""


def _footer(title: str) -> str:
    safe = "".join(c if c.isalnum() or c in " .,:;()_-" else f"\\{ord(c):06x}" for c in title)
    return f'@page {{ @bottom-left {{ content: "{safe}"; }} }}'


def _text(name: str) -> str:
    return (_HERE / name).read_text(encoding="utf-8")
