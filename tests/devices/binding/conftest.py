"""Fixtures for bindings."""

from tests.devices.acceptance.conftest import gallery

__all__ = ["gallery"]
