"""``gfor mcp``: eight verbs for agents, over standard input and output."""

import argparse
from pathlib import Path

from fmus.toolchain.extras import require
from orchestrator.core.errors import InputError
from orchestrator.face.agents.question import Allowance
from orchestrator.face.cli.arguments import add_options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "mcp")


def run(options: argparse.Namespace) -> int:
    """Serve until the client closes standard input."""
    require("gfor mcp", "mcp")
    from orchestrator.face.agents.server import make_server  # noqa: PLC0415 - needs the extra

    roots = tuple(root.resolve() for root in options.root or [Path()])
    for root in roots:
        if not root.is_dir():
            raise InputError(
                f"--root {root}: there is no such folder; give one that agents may read"
            )
    results = (options.results or roots[0] / "results" / "mcp").resolve()
    make_server(Allowance(roots, results, options.seconds)).run("stdio")
    return 0
