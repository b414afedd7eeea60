"""``gfor`` in a process of its own that sets pictures up and does not draw them: that is a quarter of a short run."""

import sys

_WITHOUT_PICTURES = """
from orchestrator.output.report import plot_style
plot_style.save_figure = lambda figure, path: plot_style.write_bytes(path, b"\\x89PNG")
from orchestrator.face.cli import main
raise SystemExit(main())
"""

UNDRAWN = (sys.executable, "-c", _WITHOUT_PICTURES)
"""What stands before the words of a command in the place of ``gfor``."""

DRAWN = (sys.executable, "-m", "orchestrator.face.cli")
"""The same for one that draws."""


def write_empty(figure, file, **how):
    """In the place of `Figure.savefig`."""
    file.write(b"\x89PNG")
