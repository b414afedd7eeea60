"""``python -m orchestrator.face.cli``."""

import sys

from orchestrator.face.cli import main

if __name__ == "__main__":
    sys.exit(main())
