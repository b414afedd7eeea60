"""Hooks of MkDocs: every page is a file of the repository, and links between files become links between pages.

Pages are the Markdown files and notebooks of this folder, the README and the packages' own leaflets. They stay where
they are, and their links are those that work in the repository. A link to a file that is no page (a case file, a
module) becomes the file's path.
"""

import argparse
import inspect
import logging
import posixpath
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from notebook_pages import as_markdown

ROOT = Path(__file__).resolve().parents[1]
LOG = logging.getLogger("mkdocs.hooks.gfor")
FOLDERS = (".docs", "gfor_fmu", "fmus", "orchestrator", "tests")
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)")
FENCE = re.compile(r"^\s*(```|~~~)")
NUMBERED = re.compile(r"\d+\. ")
"""An item of a list. Python-Markdown wants a blank line before it, and its further lines indented by four places."""
FILE_MARK = re.compile(r"<!-- (file|append|after|replace): ([^ ]+?)(?: \| .*?)? -->\n```(\w+)\n")


def repository_pages() -> dict[str, str]:
    """Path in the repository → path on the site, of every page and picture."""
    found = {"README.md": "index.md"}
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*")):
            kinds = (".md", ".ipynb", ".png")
            if path.suffix in kinds and "/." not in path.relative_to(ROOT / folder).as_posix():
                name = path.relative_to(ROOT).as_posix()
                site = name.removeprefix(".docs/").replace(".ipynb", ".md")
                # A README would become the page of the section of `nav` that it stands in, not one of its entries.
                found[name] = site.replace("/README.md", ".md")
    for path in sorted((ROOT / ".docs" / "live").glob("*.html")):
        found[f".docs/live/{path.name}"] = f"live/{path.name}"
    return found


PAGES = repository_pages()
ORIGIN = {site: name for name, site in PAGES.items()}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add all pages, wherever they are in the repository; notebooks with their pictures, and for download."""
    for name, site in PAGES.items():
        path = ROOT / name
        if path.suffix != ".ipynb":
            files.append(File.generated(config, site, abs_src_path=str(path)))
            continue
        text, pictures = as_markdown(path)
        files.append(File.generated(config, site, content=text))
        files.append(File.generated(config, site.replace(".md", ".ipynb"), abs_src_path=str(path)))
        for picture, content in pictures.items():
            files.append(
                File.generated(config, f"{posixpath.dirname(site)}/{picture}", content=content)
            )
    leads = (ROOT / ".docs" / "llms.txt").read_text(encoding="utf-8")
    files.append(File.generated(config, "llms.txt", content=leads.replace(".md)", "/)")))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn links of the repository into links of the site, and fill in what is generated."""
    name = ORIGIN[page.file.src_uri]
    text = markdown.replace("```sh first-run", "```sh").replace("<!-- commands -->", commands())
    text = text.replace("<!-- studies -->", studies())
    text = re.sub(r"^::: (orchestrator\.\S+)$", _as_typed, text, flags=re.MULTILINE)
    text = FILE_MARK.sub(lambda found: f'```{found[3]} title="{found[2]}"\n', text)
    inside, listed, lines = False, False, []
    for line in _with_links(text, name, page.file.src_uri).splitlines():
        if NUMBERED.match(line) and listed and lines[-1].strip():
            lines.append("")
        listed = bool(NUMBERED.match(line)) or (listed and line[:1] in ("", " "))
        if FENCE.match(line):
            inside = not inside
        lines.append(f" {line}" if listed and line.startswith("   ") else line)
    if name.endswith(".ipynb"):
        notebook = Path(name).name
        lines.insert(1, f'\n[Download this notebook]({notebook}){{ download="{notebook}" }}')
    return "\n".join(lines)


def _with_links(text: str, name: str, site: str) -> str:
    """The text with the site's links outside of fenced blocks; a link may go over two lines."""
    parts: list[list[str]] = [[]]
    for line in text.splitlines():
        if FENCE.match(line):
            parts.append([])
        parts[-1].append(line)
    for k in range(0, len(parts), 2):  # every second part begins with the end of a block
        fence = parts[k][:1] if k else []
        prose = "\n".join(parts[k][len(fence) :])
        parts[k] = [*fence, LINK.sub(lambda found: _link(found, name, site), prose)]
    return "\n".join("\n".join(part) for part in parts)


def _link(found: re.Match[str], name: str, site: str) -> str:
    picture, text, target = found.groups()
    if re.match(r"[a-z]+:|#", target) or (picture and name.endswith(".ipynb")):
        return found.group()
    path, _, anchor = target.partition("#")
    wanted = posixpath.normpath(posixpath.join(posixpath.dirname(name), path))
    if not (ROOT / wanted).exists():
        LOG.warning("%s: the link to %s leads nowhere", name, target)
        return found.group()
    if wanted in PAGES:
        relative = posixpath.relpath(PAGES[wanted], posixpath.dirname(site) or ".")
        return f"{picture}[{text}]({relative}{'#' if anchor else ''}{anchor})"
    return text if wanted in text or Path(wanted).name in text else f"{text} (`{wanted}`)"


@cache
def commands() -> str:
    """The reference of all commands, from their argument parsers."""
    from orchestrator.face.cli import COMMANDS  # noqa: PLC0415 - only the page of commands needs the package

    return "\n\n".join(_command(name, words) for name, words in COMMANDS.items())


def _command(name: str, words: str) -> str:
    from orchestrator.face.cli import module_of  # noqa: PLC0415 - as above

    parser = argparse.ArgumentParser(prog=f"gfor {name}", formatter_class=_formatter)
    module_of(name).add_arguments(parser)
    rows = ["| Argument | Meaning |", "|---|---|"]
    for action in parser._actions:
        shown = ", ".join(action.option_strings) or str(action.metavar or action.dest)
        if action.option_strings and action.nargs != 0:
            value = action.metavar or (
                "{" + ",".join(map(str, action.choices)) + "}" if action.choices else action.dest
            )
            shown += f" {value}"
        text = (action.help or "").replace("%%", "%").replace("|", "\\|").replace("<", "&lt;")
        rows.append(f"| `{shown.replace('|', '/')}` | {text} |")
    usage = "\n".join(
        line[len("usage: ") :] for line in parser.format_usage().rstrip().splitlines()
    )
    return (
        f"## `gfor {name}`\n\n{words[0].upper()}{words[1:]}.\n\n```text\n{usage}\n```\n\n"
        + "\n".join(rows)
    )


def _as_typed(found: re.Match[str]) -> str:
    """A directive of mkdocstrings, headed by the name that people type: ``gfor.Scenario``."""
    name = f"gfor.{found[1].rpartition('.')[2]}"
    options = {"heading": name, "toc_label": name, "inherited_members": "true"}
    return "\n".join(
        [found[0], "    options:", *(f"      {key}: {value}" for key, value in options.items())]
    )


@cache
def studies() -> str:
    """What is made from the requests of studies; mkdocstrings reads files, and sees none."""
    from orchestrator.face.api.case import Case  # noqa: PLC0415 - as above
    from orchestrator.face.api.certification import certify  # noqa: PLC0415 - as above
    from orchestrator.face.api.scenario import Scenario  # noqa: PLC0415 - as above
    from orchestrator.face.api.studies import of_study  # noqa: PLC0415 - as above
    from orchestrator.studies.added import STUDIES  # noqa: PLC0415 - only the page of Python needs the package

    of_case = [
        (
            f"Case.{name}",
            getattr(Case, name, None) or of_study(name, STUDIES[name]),
        )  # an added study has none
        for name in ("scenario", "choose", *sorted({*STUDIES, "design_over_points"}))
    ]
    of_scenario = [
        (f"Scenario.{name}", getattr(Scenario, name))
        for name in ("modes", "run", "sensitivities", "steps")
    ]
    return "\n\n".join(
        _method(name, function)
        for name, function in (*of_case, *of_scenario, ("gfor.certify", certify))
    )


def _method(name: str, function: Callable[..., object]) -> str:
    """A heading, and the documentation: a table of parameters, and what stands under other heads as text and code."""
    parts = re.split(r"\n(\w+)\n-+\n", inspect.cleandoc(function.__doc__ or ""))
    shown = [f"### `{name}`", parts[0]]
    for head, text in zip(parts[1::2], parts[2::2], strict=True):
        if head == "Examples":
            shown.append(f"```python\n{text.strip()}\n```")
            continue
        pairs = re.findall(r"^(\S+)\n((?:    .*\n?)+)", text, re.MULTILINE)
        rows = [
            f"| `{one}` | {' '.join(words.split()).replace('|', chr(92) + '|')} |"
            for one, words in pairs
        ]
        shown.append("\n".join([f"| {head} | |", "|---|---|", *rows]))
    return "\n\n".join(shown)


def _formatter(prog: str) -> argparse.HelpFormatter:
    return argparse.HelpFormatter(prog, width=90)
