"""Fixtures shared by all tests."""

from functools import cache

import pytest

from fmus.toolchain.catalogue import build_model
from fmus.toolchain.native_fmu import cached_native
from fmus.toolchain.python_fmu import cached


@pytest.fixture(scope="session")
def fmu_path():
    """Name of a catalogue model → its built .fmu, Python-backed or native."""
    return cache(lambda name, native=False: (cached_native if native else cached)(build_model(name)))
