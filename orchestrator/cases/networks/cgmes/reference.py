"""Which machine or node a CGMES model takes as its reference: SSH's ``referencePriority``, SV's angle reference."""

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

_OBJECT = re.compile(rb"<cim:(\w+)\s+rdf:(?:about|ID)=\"([^\"]+)\"\s*>(.*?)</cim:\1\s*>", re.DOTALL)
_PRIORITY = re.compile(rb"\.referencePriority>\s*(\d+)\s*<")
_OWN = re.compile(rb"<cim:(\w+)\s+rdf:ID=")
_HEAD = 64 * 1024  # bytes of a file in which its profile is named
_ANGLE = re.compile(rb"AngleRefTopologicalNode\s+rdf:resource=\"([^\"]+)\"")


@dataclass(frozen=True, slots=True)
class Reference:
    """Units by their priority, 1 first (0 is none), and the topological nodes whose angle is the reference."""

    units: tuple[str, ...] = ()
    nodes: tuple[str, ...] = ()


def reference_of(profiles: Mapping[str, bytes]) -> Reference:
    """The references that the files of a model name; identifiers without ``#`` and ``_`` before them."""
    units: dict[str, int] = {}
    nodes: dict[str, None] = {}
    for content in profiles.values():
        nodes |= dict.fromkeys(_identifier(node) for node in _ANGLE.findall(content))
        if b"referencePriority" not in content:
            continue
        for _, name, inner in _OBJECT.findall(content):
            priority = _PRIORITY.search(inner)
            if priority is not None and int(priority[1]) > 0:
                units[_identifier(name)] = int(priority[1])
    return Reference(tuple(sorted(units, key=units.__getitem__)), tuple(nodes))


def _identifier(text: bytes) -> str:
    return text.decode("utf-8", errors="replace").removeprefix("#").removeprefix("_")


def dynamics_of(profiles: Mapping[str, bytes]) -> Counter[str]:
    """How many objects of which class the files of the profile DY hold."""
    found: Counter[str] = Counter()
    for content in profiles.values():
        if b"CIM/Dynamics/" in content[:_HEAD]:
            found.update(name.decode() for name in _OWN.findall(content))
    return found
