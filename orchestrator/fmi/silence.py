"""An FMU that stops answering, to try what a set-up does about it."""

import os
import signal
import sys

from orchestrator.errors import InputError
from orchestrator.fmi.bound import BoundComponent
from orchestrator.fmi.component import Component
from orchestrator.fmi.isolation import IsolatedComponent


def silence(component: Component) -> None:
    """Stop the processes of an isolated component, so that the limit on its answers ends it as it ends a hang."""
    while isinstance(component, BoundComponent):
        component = component.inner
    if not isinstance(component, IsolatedComponent):
        raise InputError(
            f"component {component.name!r} runs in this process, where nothing limits how long it takes to answer; "
            "give it 'isolated = true' to try a time-out"
        )
    if sys.platform == "win32":
        raise InputError("a time-out cannot be tried on Windows, which stops no process; try it on Linux or macOS")
    os.killpg(component.process_group, signal.SIGSTOP)
