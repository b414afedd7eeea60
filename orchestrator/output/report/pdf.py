"""A page as PDF, printed by the browser that is installed."""

import shutil
import subprocess
import tempfile
from pathlib import Path

from orchestrator.core.errors import InputError
from orchestrator.core.options import Option

BROWSERS = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "msedge",
    "chrome",
)
_PATIENCE = 120  # how long the browser may take [s]


def find_browser() -> str | None:
    return next((found for name in BROWSERS if (found := shutil.which(name))), None)


def print_pdf(page: Path, target: Path) -> Path:
    browser = find_browser()
    if browser is None:
        raise InputError(
            Option.PDF
            + f": none of {', '.join(BROWSERS)} is installed; open {page} in a browser and print it to a file"
        )
    with tempfile.TemporaryDirectory() as profile:
        command = [
            browser,
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            f"--user-data-dir={profile}",
            "--no-pdf-header-footer",
            f"--print-to-pdf={target.resolve()}",
            page.resolve().as_uri(),
        ]
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=_PATIENCE, check=False
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise InputError(
                Option.PDF + f": {browser} does not print: {error}; print {page} by hand"
            ) from error
    if not target.is_file():
        said = (done.stderr.strip().splitlines() or ["it said nothing"])[-1]
        raise InputError(Option.PDF + f": {browser} printed nothing ({said}); print {page} by hand")
    return target
