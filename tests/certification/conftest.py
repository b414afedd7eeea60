"""Fixtures for damping tests."""

from tests.vendor.conftest import gallery

__all__ = ["gallery"]
