"""Fixtures for damping tests."""

from tests.devices.acceptance.conftest import gallery

__all__ = ["gallery"]
