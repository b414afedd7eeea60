"""Fixtures for FMUs of others."""

from functools import cache

import pytest

from tests.devices.acceptance.gallery.build import build
from tests.devices.acceptance.gallery.members import faulty, good


@pytest.fixture(scope="session")
def gallery(tmp_path_factory):
    """Name of a member → the paths of its FMU and of its binding, which may be None."""
    folder = tmp_path_factory.mktemp("gallery")
    members = {m.name: m for m in (*good(), *faulty())}

    @cache
    def make(name):
        member = members[name]
        path = build(member.source, folder)
        if member.binding is None:
            return path, None
        binding = folder / f"{name}.toml"
        binding.write_text(member.binding, encoding="utf-8")
        return path, binding

    return make
