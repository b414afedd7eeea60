"""Libraries that only some users need: the extra that installs each, and one error where one is missing."""

from functools import cache
from importlib.util import find_spec

EXTRAS = {
    "ziglang": "build",
    "pandapower": "networks",
    "pypowsybl": "cgmes",
    "skrf": "black-box",
    "distributed": "cluster",
    "helics": "federation",
    "cryptography": "sign",
    "mcp": "mcp",
}
"""Name of a library in an import → extra of this distribution that installs it."""


class SetupError(Exception):
    """The machine needs another set-up for this; the message says which."""


class MissingLibraryError(SetupError, RuntimeError):
    """A library that an extra installs is needed, and is not installed."""


def require(purpose: str, *libraries: str) -> None:
    """Refuse a task whose libraries are not installed, before it imports them.

    ``purpose``: The task, as the subject of the error's sentence, such as "building an FMU".
    ``libraries``: Keys of `EXTRAS`."""
    missing = [library for library in libraries if find_spec(library) is None]
    if missing:
        extras = ",".join(sorted({EXTRAS[library] for library in missing}))
        are = "is" if len(missing) == 1 else "are"
        raise MissingLibraryError(
            f"{purpose} needs {', '.join(missing)}, which {are} not installed; "
            f"install what is missing with `pip install 'gfor-cosim[{extras}]'`"
        )


@cache
def installed_version(library: str) -> str:
    """Version of an installed distribution; empty text where it is not installed."""
    from importlib import metadata  # noqa: PLC0415 - imports what reads e-mail, also in a device's process

    try:
        return metadata.version(library)
    except metadata.PackageNotFoundError:
        return ""
