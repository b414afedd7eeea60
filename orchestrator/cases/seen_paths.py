"""Paths as messages write them."""

from pathlib import Path


def seen_from_here(path: Path) -> Path:
    """The path as a user in the working directory writes it; places in messages are read there."""
    return path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path
