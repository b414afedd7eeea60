"""The pages of the site as files of the repository: their fenced blocks, links and headings.

A comment on the line before a fence says what a test does with the block:

``<!-- not run: REASON -->``
    it is only parsed.
``<!-- file: PATH -->``
    it is the whole text of a file that a guide writes.
``<!-- append: PATH -->``
    it is appended to a file.
``<!-- after: PATH | TEXT -->``
    it is inserted after the first line that holds TEXT.
``<!-- replace: PATH | TEXT -->``
    it stands in place of the first line that holds TEXT.

A notebook is read as the page that it becomes: each code cell is a block of Python, of shell commands (``!gfor …``), or
of a file's text (``%%writefile``).
"""

import json
import re
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOLDERS = (".docs", "gfor_fmu", "fmus", "orchestrator", "tests")
_FENCE = re.compile(r"^(?P<indent> *)```(?P<info>.*)$")
_MARK = re.compile(r"^ *<!-- (?P<kind>not run|file|append|after|replace): (?P<rest>.*) -->$")
_LINK = re.compile(r"!?\[(?:[^\[\]]|\[[^\]]*\])*\]\(([^)\s]+)\)")


def pages() -> list[Path]:
    """README, changelog, pages of the site, leaflets of the packages."""
    found = [ROOT / "README.md", ROOT / "CHANGELOG.md"]
    for folder in FOLDERS:
        files = (p for p in (ROOT / folder).rglob("*") if p.suffix in (".md", ".ipynb"))
        found += sorted(p for p in files if "/." not in p.relative_to(ROOT / folder).as_posix())
    return found


def text_of(page: Path) -> str:
    """Markdown of a page; that of a notebook has its code cells as fenced blocks, and no outputs."""
    text = page.read_text(encoding="utf-8")
    if page.suffix != ".ipynb":
        return text
    cells = [("".join(cell["source"]), cell["cell_type"]) for cell in json.loads(text)["cells"]]
    return "\n".join(source if kind == "markdown" else _fenced(source) for source, kind in cells)


def _fenced(source: str) -> str:
    """A code cell as blocks: what it writes, or Python and the commands of the shell in it, in order."""
    if written := re.match(r"%%writefile (\S+)\n", source):
        language = Path(written[1]).suffix.removeprefix(".")
        return f"<!-- file: {written[1]} -->\n```{language}\n{source[written.end() :]}\n```\n"
    blocks = []
    whole = source.replace("\\\n", " ")  # a command over several lines
    for shell, lines in groupby(whole.splitlines(), key=lambda line: line.startswith("!")):
        inside = "\n".join(line.removeprefix("!") for line in lines)
        blocks.append(f"```{'sh' if shell else 'python'}\n{inside}\n```\n")
    return "".join(blocks)


def name_of(page: Path) -> str:
    """Path in the repository."""
    return page.relative_to(ROOT).as_posix()


@dataclass(frozen=True)
class Block:
    """A fenced block.

    Attributes
    ----------
    line
        Of its first fence; in a notebook that of the text which `text_of` gives.
    language
        The first word behind it.
    kind, path, text_of_line
        Of the comment before it; empty where there is none.
    """

    page: Path
    line: int
    language: str
    text: str
    kind: str = ""
    path: str = ""
    text_of_line: str = ""

    @property
    def place(self) -> str:
        return f"{name_of(self.page)}:{self.line}"


def blocks(page: Path) -> list[Block]:
    """All fenced blocks of a page, in order."""
    found, lines = [], text_of(page).splitlines()
    k = 0
    while k < len(lines):
        opened = _FENCE.match(lines[k])
        if opened is None:
            k += 1
            continue
        end = next(j for j in range(k + 1, len(lines)) if lines[j].strip() == "```")
        inside = [line.removeprefix(opened["indent"]) for line in lines[k + 1 : end]]
        mark = _MARK.match(lines[k - 1]) if k else None
        kind, rest = (mark["kind"], mark["rest"]) if mark else ("", "")
        path, _, text = ("", "", rest) if kind == "not run" else rest.partition(" | ")
        language = (opened["info"].split() or [""])[0]
        found.append(
            Block(page, k + 1, language, "".join(f"{line}\n" for line in inside), kind, path, text)
        )
        k = end + 1
    return found


def prose(page: Path) -> list[str]:
    """Lines outside of fenced blocks; inside they are empty."""
    inside, lines = False, []
    for line in text_of(page).splitlines():
        fence = line.strip().startswith("```")
        lines.append("" if inside or fence else line)
        inside ^= fence
    return lines


def links(page: Path) -> list[tuple[int, str]]:
    """Line and target of every link outside of fenced blocks."""
    text = "\n".join(prose(page))
    return [(1 + text.count("\n", 0, found.start()), found[1]) for found in _LINK.finditer(text)]


def anchors(page: Path) -> set[str]:
    """What links can point at: headings, as GitHub and the site name them."""
    found: set[str] = set()
    for line in prose(page):
        if heading := re.match(r"#+ +(.*)", line):
            text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading[1]).strip().lower()
            found.add(re.sub(r"[^\w\- ]", "", text).replace(" ", "-"))
    return found


def commands(block: Block) -> list[str]:
    """The single commands of a shell block: without comments and ``> file``, and parted at ``&&`` and ``||``."""
    found = []
    for line in block.text.replace("\\\n", " ").splitlines():
        text = re.sub(r"(^|\s)#.*|\s> \S+$", "", line).strip()
        found += [part.strip() for part in re.split(r"&&|\|\|", text) if part.strip()]
    return found
