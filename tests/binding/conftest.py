"""Fixtures for bindings."""

from tests.acceptance.conftest import gallery

__all__ = ["gallery"]
