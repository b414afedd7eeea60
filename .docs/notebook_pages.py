"""Notebooks as pages of the site: nbconvert turns cells and kept outputs into Markdown, as other pages are written in.

Links, headings and code blocks are then treated, checked and shown as those of any page. The plugin mkdocs-jupyter does
not allow that: it puts finished HTML in a page's place, with links that lead to files of the repository.
"""

import re
from itertools import groupby
from pathlib import Path

import nbformat
from jinja2 import DictLoader
from nbconvert import MarkdownExporter
from nbformat import NotebookNode

TEMPLATE = """{%- extends 'markdown/index.md.j2' -%}
{%- block input -%}
{{ cell | fences }}
{%- endblock input -%}
{%- block stream -%}
{{ output.text | text_block }}
{%- endblock stream -%}
{%- block data_text scoped -%}
{{ output.data['text/plain'] | text_block }}
{%- endblock data_text -%}
{%- block data_html scoped -%}
{{ output.data['text/html'] | table_block }}
{%- endblock data_html -%}
{%- block data_png scoped %}

![{{ cell.metadata.heading }}]({{ output.metadata.filenames['image/png'] | path2url }})
{% endblock data_png -%}
"""
STYLE_OF_PANDAS = re.compile(r"<style.*?</style>", re.DOTALL)


def as_markdown(path: Path) -> tuple[str, dict[str, bytes]]:
    """Markdown of a notebook, and its pictures by the path that the Markdown names them by."""
    notebook = nbformat.read(path, as_version=4)
    heading = path.stem
    for cell in notebook.cells:
        found = (
            re.findall(r"^#+ +(.*)", cell.source, re.MULTILINE)
            if cell.cell_type == "markdown"
            else []
        )
        heading = found[-1] if found else heading
        cell.metadata["heading"] = heading
    exporter = MarkdownExporter(
        extra_loaders=[DictLoader({"page.md.j2": TEMPLATE})], template_file="page.md.j2"
    )
    for written in (fences, text_block, table_block):
        exporter.register_filter(written.__name__, written)
    names = {"unique_key": path.stem, "output_files_dir": f"{path.stem}_files"}
    text, resources = exporter.from_notebook_node(notebook, resources=names)
    return text, resources["outputs"]


def fences(cell: NotebookNode) -> str:
    """A code cell as fenced blocks: the file that it writes, or Python and commands of the shell, in order."""
    if written := re.match(r"%%writefile (\S+)\n", cell.source):
        language = Path(written[1]).suffix.removeprefix(".")
        return f'\n```{language} title="{written[1]}"\n{cell.source[written.end() :]}\n```\n'
    blocks = []
    for shell, lines in groupby(cell.source.splitlines(), key=lambda line: line.startswith("!")):
        inside = "\n".join(line.removeprefix("!") for line in lines).strip("\n")
        blocks.append(f"\n```{'sh' if shell else 'python'}\n{inside}\n```\n")
    return "".join(blocks)


def text_block(text: str) -> str:
    """What a cell prints."""
    inside = text.strip("\n")
    return f"\n```{{ .text .output }}\n{inside}\n```\n"


def table_block(html: str) -> str:
    """A table, which may be wider than the page."""
    lines = (line.strip() for line in STYLE_OF_PANDAS.sub("", html).splitlines())
    return '\n<div class="output">\n' + "\n".join(filter(None, lines)) + "\n</div>\n"
