"""All checks in the order in which they run: ours, then those of other distributions."""

from fmus.toolchain.plugins import import_modules
from orchestrator.devices.acceptance.checks import base

import_modules("gfor_cosim.checks")  # enters their checks

CHECKS = base.CHECKS  # by name
ORDER = tuple(CHECKS)
