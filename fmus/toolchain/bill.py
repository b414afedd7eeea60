"""A bill of what an FMU holds, in the form of CycloneDX, with the licence of each part."""

import hashlib
import json
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

from fmus.toolchain.extras import installed_version

BILL = "extra/org.cyclonedx/bom.cdx.json"
"""Place of the bill in an FMU; FMI 3.0 keeps ``extra`` for others' files, by a domain turned round."""

_SPECIFICATION = "1.6"
_LIBRARIES = (".so", ".dll", ".dylib")


def bill_of(name: str, digest: str, members: Mapping[str, bytes]) -> bytes:
    """Return the bill of an FMU: its files with their hashes, and whose code they are.

    The same members give the same bytes: it has neither a time nor a number by chance."""
    parts = [_part(path, content) for path, content in sorted(members.items())]
    content = {
        "bomFormat": "CycloneDX",
        "specVersion": _SPECIFICATION,
        "version": 1,
        "metadata": {
            "component": _component("application", name, digest[:16], "MIT"),
            "tools": {
                "components": [
                    _component("application", "gfor-cosim", version("gfor-cosim"), "MIT")
                ]
            },
        },
        "components": [*parts, *_others(members)],
    }
    return (json.dumps(content, indent=1) + "\n").encode()


def _component(kind: str, name: str, of_version: str, licence: str) -> dict[str, Any]:
    return {
        "type": kind,
        "name": name,
        "version": of_version,
        "licenses": [{"license": {"id": licence}}],
    }


def _part(path: str, content: bytes) -> dict[str, Any]:
    return {
        "type": "file",
        "name": path,
        "hashes": [{"alg": "SHA-256", "content": hashlib.sha256(content).hexdigest()}],
    }


def _others(members: Mapping[str, bytes]) -> list[dict[str, Any]]:
    """Code of others in the FMU: the wrapper around Python, and what a compiler links into each library."""
    found = [_component("library", "gfor-cosim", version("gfor-cosim"), "MIT")]
    wrapped = any(
        "pythonfmu-export" in path or path.endswith("slavemodule.txt") for path in members
    )
    if wrapped:
        found.append(_component("library", "pythonfmu", installed_version("pythonfmu"), "MIT"))
    if any(path.endswith(_LIBRARIES) for path in members):
        headers = _component("library", "FMI headers", "2.0 and 3.0", "BSD-2-Clause")
        runtime = _component("library", "compiler-rt", "as of ziglang", "MIT")
        found += [headers, runtime]
    return found
