"""A command that an agent asks for, in a process of its own that opens no other files than those it may."""

import json
import sys
from pathlib import Path

from orchestrator.face.agents.guard import keep_within
from orchestrator.face.cli import main as run_command
from orchestrator.face.cli.at_work import tell_instead


def main() -> int:
    """Run the command of the task that is the first argument of this process."""
    task = json.loads(sys.argv[1])
    keep_within([Path(root) for root in task["roots"]], Path(task["results"]))
    with tell_instead("the server, which knows who waits"):
        return run_command(task["words"])


if __name__ == "__main__":
    sys.exit(main())
