"""The pages that are looked at before an install: made anew by the guide's commands, or put into today's page.

    python -m tests.benchmarks.live_pages          # all commands of .docs/how-to/look-first.md: half an hour
    python -m tests.benchmarks.live_pages --put    # seconds: what the explorer's pages hold, in the page of today

The second is for changes of the page's own text, style and scripts: what a page holds, its command alone changes.
"""

import argparse
import contextlib
import json
import re
import shlex
import sys
import tempfile
import time
from pathlib import Path

from orchestrator.face.cli import main as gfor
from orchestrator.face.explore.files import whole_page

ROOT = Path(__file__).parents[2]
PLACE = Path(".docs") / "live"
GUIDE = ROOT / ".docs" / "how-to" / "look-first.md"
_HELD = re.compile(r'<script[^>]* id="saved"[^>]*>(.*?)</script>')


def held_in(page):
    """What a page of the explorer holds; None if it is another page."""
    found = _HELD.search(page.read_text(encoding="utf-8"))
    return None if found is None else json.loads(found[1])


def pages_with_answers():
    """Path and content of each page of the explorer."""
    found = {path: held_in(path) for path in sorted((ROOT / PLACE).glob("*.html"))}
    return {path: held for path, held in found.items() if held is not None}


def commands():
    """The guide's commands, as words, each with the file that its output goes to."""
    (block,) = re.findall(r"```sh\n(.*?)```", GUIDE.read_text(encoding="utf-8"), re.DOTALL)
    for line in block.splitlines():
        typed, _, target = line.partition(" > ")
        yield shlex.split(typed)[1:], target.strip()


def make_anew():
    """Run the guide's commands in a folder of their own, and put what they write in the place of the pages."""
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        PLACE.mkdir(parents=True)
        for words, target in commands():
            begin = time.process_time()
            with contextlib.ExitStack() as stack:
                if target:
                    file = stack.enter_context(Path(target).open("w", encoding="utf-8"))
                    stack.enter_context(contextlib.redirect_stdout(file))
                code = gfor(words)
            if code != 0:
                sys.exit(f"gfor {shlex.join(words)}: exit code {code}")
            print(
                f"gfor {' '.join(words[:2])}: {time.process_time() - begin:.0f} s of this process"
            )
        for page in PLACE.glob("*.html"):
            (ROOT / PLACE / page.name).write_bytes(page.read_bytes())


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--put", action="store_true", help="put what they hold into today's page")
    if not parser.parse_args().put:
        make_anew()
        return
    for path, held in pages_with_answers().items():
        path.write_text(whole_page(held), encoding="utf-8")
        print(f"{path.relative_to(ROOT)}: {path.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
