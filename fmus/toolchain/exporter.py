"""Export of a model as an FMU, by the recipe for one kind of FMU."""

from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

from fmus.toolchain.archive import packed, write_archive
from fmus.toolchain.bill import BILL, bill_of
from fmus.toolchain.cache import cache_directory, intact, keep, key_of_digest
from fmus.toolchain.compiler import host_platform
from fmus.toolchain.model import Model


class Recipe(Protocol):
    model: Model
    digest: str  # hash over everything that the FMU is made from [hex]
    cache_prefix: str  # first part of the name of the folder that holds this machine's FMU

    def default_platforms(self) -> tuple[str, ...]:
        """Default platforms to compile for [FMI 2.0 names]."""

    def host_platforms(self) -> tuple[str, ...]:
        """Platforms to compile for where the FMU is for this machine alone [FMI 2.0 names]."""

    def description(self) -> bytes:
        """The text of modelDescription.xml, for which nothing is compiled."""

    def contents(self, platforms: tuple[str, ...]) -> dict[str, bytes]:
        """The archive's members by path, with a library for each platform."""


def export(
    recipe: Recipe,
    destination: Path,
    platforms: tuple[str, ...] | None = None,
    extra: Mapping[str, bytes] | None = None,
) -> Path:
    """Write ``<model name>.fmu`` into a folder, which is created where missing.

    ``platforms``: FMI 2.0 names of those to compile for; by default all of them for a native FMU, and this machine's
    for a Python-backed one, which elsewhere evaluates the same equations in pure Python. ``darwin64`` of a native FMU
    holds code for both kinds of Mac. ``extra``: further members of the archive, by path; a bill of all of them goes
    with them. Errors are those of `compile_library`."""
    chosen = recipe.default_platforms() if platforms is None else platforms
    members = recipe.contents(chosen) | dict(extra or {})
    members[BILL] = bill_of(recipe.model.name, recipe.digest, members)
    return write_archive(destination / f"{recipe.model.name}.fmu", members)


def kept_at(recipe: Recipe) -> Path:
    folder = cache_directory("fmus") / f"{recipe.cache_prefix}{key_of_digest(recipe.digest)}"
    return folder / f"{recipe.model.name}.fmu"


def cached(recipe: Recipe) -> Path:
    """Return this machine's FMU, building it if it was not built before, or was changed since."""
    platforms = recipe.host_platforms()
    target = kept_at(recipe)
    return target if intact(target) else keep(target, packed(recipe.contents(platforms)))


def this_machine() -> tuple[str, ...]:
    """The platform of this machine; empty if the compiler has no target for it."""
    host = host_platform()
    return (host,) if host else ()
