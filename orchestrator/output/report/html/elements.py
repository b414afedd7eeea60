"""Pieces of HTML: tables, figures with numbers, texts that are safe to put in a page, and the page around them."""

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from typing import Any

from fmus.toolchain.extras import installed_version
from orchestrator.cases.networks.element_names import ElementNames


def table(
    caption: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    left: int = 1,
    texts: Sequence[bool] = (),
) -> str:
    """A table of a page: the ``left`` first columns hold text, and those further ones of which ``texts`` says so or
    most of whose cells begin with a letter."""
    rows = list(rows)
    of_text = {*range(left), *(k for k, is_text in enumerate(texts) if is_text)}
    of_text |= {k for k, column in enumerate(zip(*rows, strict=False)) if _is_text(column)}

    def cells(tag: str, values: Sequence[str]) -> str:
        return "".join(
            f"<{tag}{' class=text' if k in of_text else ''}>{v}</{tag}>"
            for k, v in enumerate(values)
        )

    head = cells("th", [escape(c) for c in columns])
    body = "".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    return (
        f'<div class="scroll"><table><caption>{escape(caption)}</caption><thead><tr>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def _is_text(cells: Sequence[str]) -> bool:
    """Tell a column of words and names from one of figures, of which some may be missing."""
    filled = [text for text in (_TAG.sub("", cell).strip() for cell in cells) if text]
    return 2 * sum(text[0].isalpha() for text in filled) > len(filled)


def bullet_list(texts: Iterable[str]) -> str:
    items = "".join(f"<li>{escape(text)}</li>" for text in texts)
    return f"<ul>{items}</ul>" if items else ""


class Figures:
    def __init__(self) -> None:
        self.count = 0

    def add(self, content: str, caption: str) -> tuple[str, str]:
        """The figure, and how a text calls it: "Figure 3"."""
        self.count += 1
        name = f"Figure {self.count}"
        below = f"<figcaption><b>{name}.</b> {escape(caption)}</figcaption>"
        link = f'<a href="#figure-{self.count}">{name}</a>'
        return f'<figure id="figure-{self.count}">{content}{below}</figure>', link


def held_data(name: str, data: Any) -> str:
    """Data that a page holds as JSON, under an id; nothing in it is markup."""
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")
    return f'<script type="application/json" id="{name}">{text}</script>'


def number(value: float, digits: int) -> str:
    return with_minus(f"{value:.{digits}f}")


def with_minus(text: str) -> str:
    """Write a figure's sign, and that of its power of ten, as a minus."""
    return text.replace("-", "−")


def eigenvalue(real: float, imag: float) -> str:
    """``−0.389 ± j3.655``."""
    return f"{number(real, 3)} ± j{abs(imag):.3f}"


def damping(percent: float, least: float = 5.0) -> str:
    text = number(percent, 2)
    return f'<span class="bad">{text}</span>' if percent < least else text


SHADES: Mapping[bool | None, str] = {True: "good", False: "bad", None: "soft"}
"""The class in the page's style sheet for what is good, bad or not known."""

VERDICTS: Mapping[bool | None, str] = {
    True: "stable",
    False: "UNSTABLE",
    None: "not known whether stable",
}


def verdict_paragraph(shade: str, markup: str) -> str:
    """The verdict on top of a page; ``shade``: one of `SHADES`."""
    return f'<p class="verdict"><b class="{shade}">{markup}</b></p>'


def paragraphs(good: bool | None, texts: Sequence[str]) -> str:
    """Sentences; the first one is the verdict, in the colour of what is good, bad or not known."""
    first, *rest = texts
    return f'<p class="{SHADES[good]}">{escape(first)}</p>' + "".join(
        f"<p>{escape(text)}</p>" for text in rest
    )


_UNIT = re.compile(r"(?<=\d) (?=(?:%|°|Hz|s|ms|pu|rad/s|1/s|k?V|k?A|k?W|MW|Mvar|MVA)(?![\w/]))")
_MINUS = re.compile(r"(?<![\w=.:-])-(?=\d)")
_HEADLINE = re.compile(r'<p class="verdict">.*?</p>|<span class="remark">.*?</span>', re.DOTALL)
_TAG = re.compile(r"(<[^>]*>)")


def with_units_held(findings: str) -> str:
    """Return what stands on top of a page; in verdicts and remarks every figure stays beside its unit and has the minus
    sign of tables."""
    return _HEADLINE.sub(_hold_units, findings)


def _hold_units(found: re.Match[str]) -> str:
    parts = _TAG.split(found[0])
    held = [_UNIT.sub("\N{NO-BREAK SPACE}", text) for text in parts[::2]]
    parts[::2] = [_MINUS.sub("\N{MINUS SIGN}", text) for text in held]
    return "".join(parts)


_HERE = Path(__file__).parent


def document(
    title: str,
    kind: str,
    findings: str,
    content: Sequence[tuple[str, str]],
    moment: datetime | None = None,
    names: ElementNames | None = None,
) -> str:
    """A page; ``names``: of the network's file, shown beside the identifiers of elements."""
    if names is not None:
        findings = names.in_page(findings)
        content = [(name, names.in_page(text)) for name, text in content]
    links = "".join(
        f'<a href="#section-{k}">{escape(name)}</a>' for k, (name, _) in enumerate(content)
    )
    body = "".join(
        f'<section id="section-{k}"><h2>{escape(name)}</h2>{text}</section>'
        for k, (name, text) in enumerate(content)
    )
    made = f"gfor-cosim {installed_version('gfor-cosim')}, {moment or datetime.now(UTC):%Y-%m-%d %H:%M} UTC"
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(title)}</title><link rel="icon" href="data:,"><style>{_text("page.css")}{_footer(title)}</style></head>
<body><main><header><h1>{escape(title)}</h1><div class="soft">{escape(kind)} · {made}</div></header>
{f"<nav>{links}</nav>" if len(content) > 1 else ""}{with_units_held(findings)}{body}</main>
<div id="tooltip" role="status"></div><script>{_text("page.js")}</script></body></html>
"""


def _footer(title: str) -> str:
    safe = "".join(c if c.isalnum() or c in " .,:;()_-" else f"\\{ord(c):06x}" for c in title)
    return f'@page {{ @bottom-left {{ content: "{safe}"; }} }}'


def _text(name: str) -> str:
    return (_HERE / name).read_text(encoding="utf-8")
