"""The structure of an SSP: its nested systems, laid flat."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from math import isfinite
from xml.etree.ElementTree import Element

from orchestrator.core.errors import InputError
from orchestrator.systems.ssp.archive import SspArchive
from orchestrator.systems.ssp.names import (
    FMU_TYPE,
    PARAMETER_MAPPING_TYPE,
    PARAMETER_SET_TYPE,
    children,
    tag,
)
from orchestrator.systems.ssp.parameter_sets import (
    SspValue,
    read_parameter_mapping,
    read_parameter_set,
)
from orchestrator.systems.ssp.units import units_in

Owner = tuple[str, ...]  # path of a component or system below the top system; the top system is ()
Node = tuple[Owner, str]  # A connector of an owner, or its variable where it has no such connector

_SENDING_INSIDE = ("input", "parameter")
_SENDING_OUTSIDE = ("output", "calculatedParameter")
_REFUSED = {
    "ssd:Elements/ssd:SignalDictionaryReference": "a reference to a signal dictionary",
    "ssd:SignalDictionaries/ssd:SignalDictionary": "a signal dictionary",
}


@dataclass(frozen=True)
class Step:
    """A connector on the way of a value.

    ``as_it_is``: whether the value gets there without a conversion of its unit.
    ``transformed``: factor and offset by which the connection to it changes the value, after the conversion."""

    connector: Node
    as_it_is: bool = False
    transformed: tuple[float, float] | None = None


@dataclass
class Structure:
    """Components and their connections, without the systems that they were nested in."""

    sources: dict[Owner, str] = field(default_factory=dict)
    connections: list[tuple[Node, Node]] = field(default_factory=list)
    # the way of each connection, from its output to its input
    ways: dict[tuple[Node, Node], tuple[Step, ...]] = field(default_factory=dict)
    # the unit that a connector states
    units: dict[Node, str] = field(default_factory=dict)
    # attributes of ``BaseUnit`` of each unit that the description defines
    definitions: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    values: dict[Owner, dict[str, SspValue]] = field(default_factory=dict)


def read_structure(
    archive: SspArchive, description: Element, note: Callable[[str, str], None]
) -> Structure:
    systems = children(description, "ssd:System")
    if len(systems) != 1:
        note("ssd:System", "there must be exactly one system at the top; export the SSP again")
        return Structure()
    return _Reader(archive, note, units_in(description, "ssd:Units")).read(systems[0])


class _Reader:
    """Walks through nested systems and collects their components, connections and values."""

    def __init__(
        self,
        archive: SspArchive,
        note: Callable[[str, str], None],
        units: Mapping[str, Mapping[str, str]],
    ) -> None:
        self._archive, self._note, self._units = archive, note, units
        self._structure = Structure(definitions=units)
        self._elements: dict[Owner, list[str]] = {}
        self._kinds: dict[Node, str] = {}
        self._feeding: dict[Node, Node] = {}
        self._unconverted: set[Node] = set()  # ends of connections that suppress the conversion
        # factor and offset of connections with a transformation, by their end
        self._transformed: dict[Node, tuple[float, float]] = {}
        self._given: dict[Node, SspValue] = {}

    def read(self, system: Element) -> Structure:
        self._walk(system, ())
        self._bind(system, ())
        for node, value in self._given.items():
            if node[0] in self._structure.sources:
                self._structure.values[node[0]][node[1]] = value
        for sink in self._feeding:
            if sink[0] in self._structure.sources:
                self._connect(sink)
        return self._structure

    def _walk(self, system: Element, owner: Owner) -> None:
        for path, what in _REFUSED.items():
            for element in children(system, path):
                self._refuse(
                    (*owner, element.get("name", "")), f"it is {what}, which is not supported"
                )
        self._elements[owner] = []
        self._connectors(system, owner)
        for element, inner in _inside(system, owner):
            if inner in self._structure.sources or inner in self._elements:
                self._refuse(inner, "the name is used twice in its system")
                continue
            self._elements[owner].append(inner[-1])
            if element.tag == tag("ssd:System"):
                self._walk(element, inner)
            else:
                self._connectors(element, inner)
                self._structure.sources[inner] = self._source(element, inner)
                self._structure.values[inner] = {}
        for connection in children(system, "ssd:Connections/ssd:Connection"):
            self._connection(connection, owner)

    def _connectors(self, element: Element, owner: Owner) -> None:
        for connector in children(element, "ssd:Connectors/ssd:Connector"):
            node = owner, connector.get("name", "")
            self._kinds[node] = connector.get("kind", "")
            for real in children(connector, "ssc:Real"):
                self._structure.units[node] = real.get("unit", "")

    def _source(self, component: Element, owner: Owner) -> str:
        """The component's member of the archive. If this is not an FMU, the problem is noted and the result is
        empty."""
        kind, implementation = (
            component.get("type", FMU_TYPE),
            component.get("implementation", "any"),
        )
        if kind != FMU_TYPE:
            self._refuse(
                owner,
                f"it is of type {kind!r}; only FMUs ({FMU_TYPE}) and systems written out are supported",
            )
        elif implementation == "ModelExchange":
            self._refuse(owner, "it is to run as Model Exchange; only co-simulation is supported")
        else:
            try:
                return self._archive.member(component.get("source", ""))
            except InputError as error:
                self._refuse(owner, str(error))
        return ""

    def _connection(self, connection: Element, owner: Owner) -> None:
        ends = [self._end(connection, end, owner) for end in ("start", "end")]
        text = " - ".join(map(_text, ends))
        try:
            transformed = _transformation(connection)
        except InputError as error:
            self._note(f"connection {text}", str(error))
            return
        missing = [node for node in ends if node not in self._kinds]
        sources = [node for node in ends if self._sends(node, owner)]
        if missing:
            self._note(
                f"connection {text}",
                f"there is no connector {' and no '.join(map(_text, missing))}",
            )
        elif len(sources) != 1:
            kinds = " and ".join(self._kinds[node] for node in ends)
            self._note(
                f"connection {text}",
                f"it joins connectors of kind {kinds}; one must send and one receive",
            )
        else:
            (source,), (sink,) = sources, [node for node in ends if node not in sources]
            if connection.get("suppressUnitConversion") in ("true", "1"):
                self._unconverted.add(sink)
            if transformed is not None:
                self._transformed[sink] = transformed
            if self._feeding.setdefault(sink, source) != source:
                self._note(
                    f"connection {text}",
                    f"{_text(sink)} is already fed by {_text(self._feeding[sink])}",
                )

    @staticmethod
    def _end(connection: Element, end: str, owner: Owner) -> Node:
        """The connector at an end of a connection: of the named element, or of the system itself if no element is
        named."""
        element = connection.get(f"{end}Element")
        return (*owner, element) if element else owner, connection.get(f"{end}Connector", "")

    def _sends(self, node: Node, system: Owner) -> bool:
        """Return whether data flow from a connector into a connection of the system. The kind of the connector decides,
        because SSP allows start and end in either order."""
        return self._kinds.get(node) in (_SENDING_INSIDE if node[0] == system else _SENDING_OUTSIDE)

    def _connect(self, sink: Node) -> None:
        """Follow a component's input through the connectors of systems to an output, or to a value."""
        source: Node | None = self._feeding[sink]
        last, ends = source, [sink]
        while source is not None and source[0] not in self._structure.sources:
            ends.append(source)
            last, source = source, self._feeding.get(source)
        if source is not None:
            way = [
                Step(node, node in self._unconverted, self._transformed.get(node))
                for node in reversed(ends)
            ]
            self._structure.ways[source, sink] = (Step(source), *way)
            self._structure.connections.append((source, sink))
        elif last in self._given and any(node in self._transformed for node in ends):
            self._note(
                f"connection to {_text(sink)}",
                f"it transforms the value that is given to {_text(last)}, which is not supported; give it to "
                f"{_text(sink)} as that takes it",
            )
        elif last in self._given:
            self._structure.values[sink[0]].setdefault(sink[1], self._given[last])

    def _bind(self, element: Element, owner: Owner) -> None:
        """Give values from the inside out: bindings of an outer system override those of an inner one."""
        if element.tag == tag("ssd:System"):
            for child, inner in _inside(element, owner):
                self._bind(child, inner)
        for binding in children(element, "ssd:ParameterBindings/ssd:ParameterBinding"):
            try:
                values = self._values(binding)
            except InputError as error:
                self._note(f"parameter binding of {'.'.join(owner) or 'the system'}", str(error))
                continue
            for name, value in values.items():
                node = self._find(owner, binding.get("prefix", "") + name)
                if node is not None:
                    self._given[node] = value

    def _values(self, binding: Element) -> Mapping[str, SspValue]:
        self._check_type(binding, PARAMETER_SET_TYPE)
        content = self._content(binding, "ssd:ParameterValues", "ssv:ParameterSet")
        values = read_parameter_set(content, None if binding.get("source") else self._units)
        for mapping in children(binding, "ssd:ParameterMapping"):
            self._check_type(mapping, PARAMETER_MAPPING_TYPE)
            targets = read_parameter_mapping(self._content(mapping, ".", "ssm:ParameterMapping"))
            return {
                target: values[source] for target, source in targets.items() if source in values
            }
        return values

    @staticmethod
    def _check_type(element: Element, expected: str) -> None:
        if element.get("type", expected) != expected or element.get("sourceBase", "SSD") != "SSD":
            raise InputError(
                f"only the type {expected}, with sources relative to the archive, is supported"
            )

    def _content(self, element: Element, inline: str, name: str) -> Element:
        source = element.get("source")
        if source:
            return self._archive.xml(self._archive.member(source))
        found = next(
            (e for holder in children(element, inline) for e in children(holder, name)), None
        )
        if found is None:
            raise InputError(f"it has neither a source nor a {name} of its own")
        return found

    def _find(self, owner: Owner, name: str) -> Node | None:
        """The node that a hierarchical name means, seen from a component or system; None if there is no such node,
        which SSP allows."""
        if owner in self._structure.sources or (owner, name) in self._kinds:
            return owner, name
        inner = [e for e in self._elements.get(owner, []) if name.startswith(f"{e}.")]
        if not inner:
            return None
        element = max(inner, key=len)
        return self._find((*owner, element), name.removeprefix(f"{element}."))

    def _refuse(self, owner: Owner, text: str) -> None:
        self._note(f"element {'.'.join(owner)}", text)


def _inside(system: Element, owner: Owner) -> Iterator[tuple[Element, Owner]]:
    for group in children(system, "ssd:Elements"):
        for element in group:
            if element.tag in (tag("ssd:Component"), tag("ssd:System")):
                yield element, (*owner, element.get("name", ""))


_LINEAR = "LinearTransformation"
_MAPPINGS = (
    "BooleanMappingTransformation, IntegerMappingTransformation, EnumerationMappingTransformation"
)


def _transformation(connection: Element) -> tuple[float, float] | None:
    """Factor and offset of a connection; None without a transformation.

    Raises
    ------
    InputError
        If it is none of numbers by a factor and an offset, or one of these is no finite number."""
    kinds = {e.tag.rpartition("}")[2]: e for e in connection if e.tag.endswith("Transformation")}
    if not kinds:
        return None
    other = next((kind for kind in kinds if kind != _LINEAR), None)
    if other is not None:
        raise InputError(
            f"it has a {other}, which is not supported, as no {_MAPPINGS} is; do it inside a component"
        )
    given = kinds[_LINEAR]
    try:
        factor, offset = float(given.get("factor", "1")), float(given.get("offset", "0"))
    except ValueError as error:
        raise InputError(
            f"its {_LINEAR} holds what is no number: {error}; export it again"
        ) from error
    if not (isfinite(factor) and isfinite(offset)):
        raise InputError(
            f"its {_LINEAR} has factor {factor} and offset {offset}, which must be finite; export it again"
        )
    return factor, offset


def _text(node: Node) -> str:
    return ".".join((*node[0], node[1]))
