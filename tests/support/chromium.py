"""The browser in which pages are looked at; tests that need it are skipped where it is not there."""

import shutil
from contextlib import contextmanager

import pytest

CHROMIUM = (
    shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
)
# The list of boxes below the address, which no test opens, is a process of its own for each window: half a second of
# processor. The others are those of Playwright, which a list of ours replaces.
_WITHOUT = (
    "WebUIOmniboxPopup",
    "WebUIOmniboxAimPopup",
    "AimEnabled",
    "AvoidUnnecessaryBeforeUnloadCheckSync",
    "DestroyProfileOnBrowserClose",
    "HttpsUpgrades",
    "LensOverlay",
    "MediaRouter",
    "NetworkTimeServiceQuerying",
    "OptimizationHints",
    "PaintHolding",
    "PreconnectToSearch",
    "ThirdPartyStoragePartitioning",
)
# No services of its own: a page is a file, and tests run where there is no network.
OPTIONS = [
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-quic",
    f"--disable-features={','.join(_WITHOUT)}",
]
NEEDED = "needs chromium (Debian: apt-get install chromium)"

needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason=NEEDED)


@contextmanager
def running_browser(*more):
    """Start a browser with further options, and close it in the end."""
    if CHROMIUM is None:
        pytest.skip(NEEDED)
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as tools:
        found = tools.chromium.launch(executable_path=CHROMIUM, args=[*OPTIONS, *more])
        yield found
        found.close()
