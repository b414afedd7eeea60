"""Names that a network's file gives its buses and branches, beside the identifiers of gfor.

Identifiers (``bus_7``, ``line_7_8_2``) stay in JSON, in files of results and in options. What people read shows the
file's name beside them: ``bus_7 NORTH 230``, ``gen_7 (NORTH 230)``, ``line_7_8_2 (NORTH 230 – SOUTH 230, circuit 2)``.
Options take the file's names as well, where a name is that of one element."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from html import escape
from typing import Protocol

from fmus.grid.network import Line, Load, Network, Shunt, ThreeWinding
from orchestrator.core.errors import InputError, few

_WINDINGS = 3  # of a transformer that is an element of its own
_MARKUP = re.compile(r"(<(script|style|code|pre|text)\b.*?</\2>|<[^>]*>)", re.DOTALL)
"""What of a page is not its text; texts in pictures have no room for more."""
_SHOWN = 4
_BETWEEN = " – "


class NamedData(Protocol):
    """A network as its file has it."""

    @property
    def lines(self) -> Sequence[Line]: ...
    @property
    def transformers(self) -> Sequence[ThreeWinding]: ...
    @property
    def loads(self) -> Sequence[Load]: ...
    @property
    def shunts(self) -> Sequence[Shunt]: ...
    @property
    def titles(self) -> Mapping[str, str]: ...
    @property
    def branch_names(self) -> Mapping[str, BranchName]: ...
    @property
    def unit_names(self) -> Mapping[str, str]: ...


@dataclass(frozen=True)
class BranchName:
    """Name of a branch in a network's file: its name, and its circuit among parallel ones; "" for none."""

    name: str = ""
    circuit: str = ""

    @property
    def of_circuit(self) -> str:
        return f"circuit {self.circuit}" if self.circuit else ""


@dataclass(frozen=True)
class ElementNames:
    """Texts that people read for identifiers; without names in the file, the identifiers themselves.

    Attributes
    ----------
    shown
        Identifier → what is shown for it.
    meant
        Name in the file, without capitals → the identifiers that it may mean.
    """

    shown: Mapping[str, str] = field(default_factory=dict)
    meant: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def of(self, identifier: str) -> str:
        """Return what is shown for an identifier: ``bus_7 NORTH 230``."""
        return self.shown.get(identifier, identifier)

    def in_text(self, text: str, write: Callable[[str], str] = str) -> str:
        """Return a text with the file's name beside the first mention of each identifier.

        Variables (``gen_7.P``), and what is to be typed (between backticks, or behind an option), stay.

        ``write``: escapes a name for the text, as for a page."""
        if not self.shown:
            return text
        if text in self.shown:
            return write(self.shown[text])
        seen: set[str] = set()

        def show(match: re.Match[str]) -> str:
            identifier = match["name"]
            if identifier is None or identifier in seen:
                return match[0]
            shown = write(self.shown.get(identifier, identifier))
            if match.string.startswith(shown, match.start()):
                return match[0]
            if identifier in self.shown:
                seen.add(identifier)
            return shown

        return self._pattern.sub(show, text)

    @cached_property
    def _pattern(self) -> re.Pattern[str]:
        """Identifiers as whole words; those without a digit or underscore could be any word, and are not looked for."""
        word = r"(?<![\w./'=-])(?P<name>(?=\w*[_\d])[A-Za-z]\w*(?:\.leg_[123])?)(?![\w*=]|\.\w|-\w)"
        return re.compile(rf"`[^`]*`|--[\w-]+ \S+|{word}")

    def in_page(self, html: str) -> str:
        """Return HTML with the file's names in its texts; scripts, styles and what is to be typed stay."""
        if not self.shown:
            return html
        pieces, at = [], 0
        for left in _MARKUP.finditer(html):
            pieces += [self.in_text(html[at : left.start()], escape), left[0]]
            at = left.end()
        return "".join([*pieces, self.in_text(html[at:], escape)])

    def identifier(self, name: str, known: Iterable[str], option: str = "") -> str:
        """Return the one of the known identifiers that a name in the file means; the name itself if it means none.

        Raises
        ------
        InputError
            If the file has several elements of this name.
        """
        allowed = {*known}
        if name in allowed:
            return name
        meant = self.meant.get(_plain(name)) or self.meant.get(_plain(name.removeprefix("bus_")))
        found = [one for one in meant or () if one in allowed]
        if len(found) > 1:
            where = option + f" {name!r}" if option else f"{name!r}"
            raise InputError(
                where
                + f": the file has {len(found)} elements of this name: {few(found, _SHOWN)}; give one of these"
            )
        return found[0] if found else name

    def with_meanings(self, meant: Mapping[str, str]) -> ElementNames:
        """Return the same with names that mean further identifiers."""
        added = {_plain(name): identifier for name, identifier in meant.items()}
        others = {
            name: (*self.meant.get(name, ()), identifier) for name, identifier in added.items()
        }
        return replace(self, meant={**self.meant, **others})

    def as_json(self) -> dict[str, dict[str, str]]:
        """Return the key ``names`` of a result: what is shown for each identifier; without names, no key."""
        return {"names": dict(self.shown)} if self.shown else {}


def _plain(name: str) -> str:
    return " ".join(name.casefold().replace("–", "-").split())


def element_names(
    titles: Mapping[str, str],
    branches: Mapping[str, BranchName],
    ends: Mapping[str, Sequence[str]],
    at_bus: Mapping[str, str],
    units: Mapping[str, str],
    generators: Mapping[str, str] | None = None,
) -> ElementNames:
    """Names of a network's buses and branches, and of what stands at its buses.

    Parameters
    ----------
    titles
        Names of buses in the file.
    branches
        Names of lines and transformers in the file.
    ends
        Buses of every line and transformer.
    at_bus
        Bus of every load and shunt.
    units
        Bus of every unit; a bus' name means its unit where units are asked for.
    generators
        Names of generators in the file, by their bus.
    """
    if not (titles or branches or generators):
        return ElementNames()
    shown = {bus: f"{bus} {title}" for bus, title in titles.items() if not _is_in(bus, title)}
    known = generators or {}
    own_names = {name: known[bus] for name, bus in units.items() if bus in known}
    for name, bus in {**at_bus, **units}.items():
        words = [own_names.get(name, "")]
        words += [titles[bus]] if bus in titles and not _is_in(bus, titles[bus]) else []
        others = ", ".join(filter(None, words))
        if others:
            shown[name] = f"{name} ({others})"
    meant = [(title, bus) for bus, title in titles.items()]
    meant += [(titles.get(bus, ""), name) for name, bus in units.items()]
    meant += [(own, name) for name, own in own_names.items()]
    for branch, buses in ends.items():
        own = branches.get(branch, BranchName())
        between = [titles.get(bus, "") for bus in buses]
        is_new = any(not _is_in(bus, titles.get(bus, "")) for bus in buses)
        shown |= _shown_of_branch(branch, own, between if is_new else [""] * len(buses))
        meant += [(name, branch) for name in _names_of_branch(branch, own, between)]
    meant += [(name, identifier) for identifier, name in shown.items()]
    by_name: dict[str, dict[str, None]] = {}
    for name, identifier in meant:
        by_name.setdefault(_plain(name), {})[identifier] = None
    by_name.pop("", None)
    return ElementNames(shown, {name: tuple(found) for name, found in by_name.items()})


def _is_in(bus: str, title: str) -> bool:
    """Return whether an identifier says a name already, as ``bus_North_1`` says ``North 1``."""
    return re.sub(r"\W+", "_", title).strip("_").casefold() in (
        bus.casefold(),
        bus.removeprefix("bus_").casefold(),
    )


def _shown_of_branch(branch: str, own: BranchName, between: Sequence[str]) -> dict[str, str]:
    """Return what is shown of a branch between buses of these names, and of its windings if it has three."""
    joined = _BETWEEN.join(between) if all(between) else ""
    words = ", ".join(filter(None, (own.name, joined, own.of_circuit)))
    shown = {branch: f"{branch} ({words})"} if words else {}
    if len(between) == _WINDINGS:
        legs = {f"{branch}.leg_{k + 1}": title for k, title in enumerate(between) if title}
        shown |= {leg: f"{leg} (winding at {title})" for leg, title in legs.items()}
    return shown


def _names_of_branch(branch: str, own: BranchName, between: Sequence[str]) -> Iterator[str]:
    """Yield what people may call a branch: its name, its buses in either order, with its circuit if it has one."""
    yield own.name
    if own.circuit:
        yield f"{branch} ({own.of_circuit})"
    if not all(between):
        return
    for joined in (_BETWEEN.join(between), _BETWEEN.join(reversed(between))):
        yield joined
        if own.circuit:
            yield f"{joined} {own.of_circuit}"


def names_of(network: Network, data: NamedData) -> ElementNames:
    """Names of the elements of a whole network, with its units."""
    units = {port.name: port.bus for port in network.ports}
    ends = _ends(network.lines, network.transformers)
    at_bus = _at_bus(network.loads, network.shunts)
    return element_names(data.titles, data.branch_names, ends, at_bus, units, data.unit_names)


def names_without_units(data: NamedData) -> ElementNames:
    """Names of the elements of a network as its file has it."""
    ends, at_bus = _ends(data.lines, data.transformers), _at_bus(data.loads, data.shunts)
    return element_names(data.titles, data.branch_names, ends, at_bus, {})


def _ends(lines: Iterable[Line], transformers: Iterable[ThreeWinding]) -> dict[str, Sequence[str]]:
    found: dict[str, Sequence[str]] = {x.name: (x.from_bus, x.to_bus) for x in lines}
    return found | {x.name: x.buses for x in transformers}


def _at_bus(loads: Iterable[Load], shunts: Iterable[Shunt]) -> dict[str, str]:
    return {x.name: x.bus for x in loads} | {x.name: x.bus for x in shunts}
