"""Functions for workers: they compute, fail, or kill their process."""

import os
import signal
import time
from pathlib import Path

from orchestrator.core.errors import InputError


def double(number):
    return 2 * number


def sleepy_double(number):
    time.sleep(0.5)
    return 2 * number


def fail(number):
    if number == 3:
        raise InputError("three cannot be used")
    return number


def die_once(task):
    """Task (number, folder): numbers 2 and 5 kill their worker the first time."""
    number, folder = task
    mark = Path(folder) / str(number)
    if number in (2, 5) and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return 2 * number


def waits(task):
    """Task (number, folder): holds something until it is left, all but number 0."""
    number, folder = task
    mark = Path(folder) / str(number)
    if not number:
        while len(list(Path(folder).iterdir())) < 1:
            time.sleep(0.01)
        return number
    try:
        mark.touch()
        time.sleep(600)
    finally:
        mark.unlink()
    return number


def always_die(number):
    if number == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return 2 * number
