"""Fixtures shared by all tests."""

from functools import cache

import pytest

from fmus.toolchain.catalogue import build_model
from fmus.toolchain.python_fmu import cached


@pytest.fixture(scope="session")
def fmu_path():
    """Name of a catalogue model → its built .fmu."""
    return cache(lambda name: cached(build_model(name)))
