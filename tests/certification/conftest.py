"""Fixtures for damping tests."""

from tests.acceptance.conftest import gallery

__all__ = ["gallery"]
