"""SSP archives written by hand, as other tools would write them, around the small FMUs."""

import zipfile

from fmpy.ssp.ssd import validate_tree
from lxml import etree

from orchestrator.systems.ssp.names import NAMESPACES
from tests.systems.coupling.small_fmus import small_fmu

HEAD = " ".join(f'xmlns:{prefix}="{address}"' for prefix, address in NAMESPACES.items())


def component(name, model, inside="", source=None, attributes=""):
    """A component with all its ports; its FMU is packed under the model's name."""
    fmu = small_fmu(model)
    ports = [(v, "input") for v in fmu.inputs] + [(v, "output") for v in fmu.outputs]
    connectors = "".join(connector(*port) for port in ports)
    source = source or f"resources/{model}.fmu"
    return (
        f'<ssd:Component name="{name}" source="{source}" {attributes}>'
        f"<ssd:Connectors>{connectors}</ssd:Connectors>{inside}</ssd:Component>"
    )


def connector(name, kind, unit=""):
    stated = f' unit="{unit}"' if unit else ""
    return f'<ssd:Connector name="{name}" kind="{kind}"><ssc:Real{stated}/></ssd:Connector>'


def wire(source, target, inside="", attributes=""):
    """A connection; "a.y" is a connector of an element, "y" one of the system."""
    ends = ""
    for end, text in (("start", source), ("end", target)):
        element, dot, name = text.partition(".")
        ends += (
            f' {end}Element="{element}" {end}Connector="{name}"'
            if dot
            else f' {end}Connector="{text}"'
        )
    return f"<ssd:Connection{ends} {attributes}>{inside}</ssd:Connection>"


def unit(name, **base):
    """A definition of a unit."""
    attributes = " ".join(f'{key}="{value}"' for key, value in base.items())
    return f'<ssc:Unit name="{name}"><ssc:BaseUnit {attributes}/></ssc:Unit>'


def values(prefix="", mapping="", units="", **given):
    """A parameter binding with its values inline; __ in a name is a dot, a value may be (number, unit)."""
    entries = "".join(
        f'<ssv:Parameter name="{name.replace("__", ".")}">{_value(value)}</ssv:Parameter>'
        for name, value in given.items()
    )
    parameters = (
        f'<ssv:ParameterSet version="1.0" name="values"><ssv:Parameters>{entries}</ssv:Parameters>'
        + (f"<ssv:Units>{units}</ssv:Units>" if units else "")
    )
    return (
        f'<ssd:ParameterBinding prefix="{prefix}"><ssd:ParameterValues>{parameters}</ssv:ParameterSet>'
        f"</ssd:ParameterValues>{mapping}</ssd:ParameterBinding>"
    )


def _value(value):
    if isinstance(value, bool):
        return f'<ssv:Boolean value="{str(value).lower()}"/>'
    if isinstance(value, tuple):
        return f'<ssv:Real value="{value[0]}" unit="{value[1]}"/>'
    return (
        f'<ssv:String value="{value}"/>'
        if isinstance(value, str)
        else f'<ssv:Real value="{value}"/>'
    )


def bindings(*texts):
    return f"<ssd:ParameterBindings>{''.join(texts)}</ssd:ParameterBindings>"


def system(name, elements, wires=(), connectors=(), bound="", after=""):
    ports = "".join(connector(*port) for port in connectors)
    return (
        f'<ssd:System name="{name}">'
        + (f"<ssd:Connectors>{ports}</ssd:Connectors>" if ports else "")
        + bound
        + f"<ssd:Elements>{''.join(elements)}</ssd:Elements>"
        + (f"<ssd:Connections>{''.join(wires)}</ssd:Connections>" if wires else "")
        + after
        + "</ssd:System>"
    )


def experiment(stop="0.1", annotations="", attributes=""):
    inside = f"<ssd:Annotations>{annotations}</ssd:Annotations>" if annotations else ""
    return f'<ssd:DefaultExperiment stopTime="{stop}" {attributes}>{inside}</ssd:DefaultExperiment>'


OSP_STEP = (
    '<ssc:Annotation type="com.opensimulationplatform"><osp:Algorithm>'
    '<osp:FixedStepAlgorithm baseStepSize="0.001"/></osp:Algorithm></ssc:Annotation>'
)


def write(path, top, after=None, models=("integrator",), version="1.0", valid=True, **members):
    """Write an archive; ``members`` are further files, ``__`` in their names is a dot."""
    after = experiment(annotations=OSP_STEP) if after is None else after
    text = (
        f'<ssd:SystemStructureDescription {HEAD} version="{version}" name="foreign">'
        f"{top}{after}</ssd:SystemStructureDescription>"
    )
    if valid:
        validate_tree(etree.fromstring(text), "SystemStructureDescription.xsd")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", text)
        for model in models:
            archive.write(small_fmu(model).path, f"resources/{model}.fmu")
        for name, content in members.items():
            archive.writestr(f"resources/{name.replace('__', '.')}", content)
    return path
