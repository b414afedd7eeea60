"""Paths as messages write them."""

from pathlib import Path

from orchestrator.errors import InputError


def seen_from_here(path: Path) -> Path:
    """The path as a user in the working directory writes it; places in messages are read there."""
    try:
        path.exists()  # false where there is none; it fails where nobody could tell
    except OSError as error:
        raise InputError(f"{str(path)[:200]}: it cannot be looked for: {error.strerror}; give another path") from error
    return path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path
