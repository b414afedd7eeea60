"""Jobs for `drivers`: what to couple, as plain data, and an SSP of it."""

import zipfile
from pathlib import Path
from xml.sax.saxutils import quoteattr

from orchestrator.coupling.system import System


def job_of(system: System, step_size: float, stop_time: float, record: list[str]) -> dict:
    """A system as a job; see `drivers`."""
    plans = system.components
    return {
        "fmus": {name: str(plan.description.path) for name, plan in plans.items()},
        "parameters": {name: dict(plan.parameters) for name, plan in plans.items()},
        "references": {
            name: {v.name: v.reference for v in plan.description.variables.values()} for name, plan in plans.items()
        },
        "wires": [[[end.component, end.variable] for end in (wire.source, wire.target)] for wire in system.connections],
        "step_size": step_size,
        "stop_time": stop_time,
        "record": [list(name.split(".", 1)) for name in record],
    }


def write_ssp(job: dict, path: Path) -> None:
    """The job's system as an SSP with its parameters as the set ``start``."""
    wired = {tuple(end) for wire in job["wires"] for end in wire}
    seen = wired | {tuple(end) for end in job["record"]}
    targets = {tuple(wire[1]) for wire in job["wires"]}
    lines = []
    for name in job["fmus"]:
        lines += [f'<ssd:Component name={quoteattr(name)} type="application/x-fmu-sharedlibrary" '
                  f'source="resources/{name}.fmu"><ssd:Connectors>']  # fmt: skip
        for component, variable in sorted(seen):
            if component == name:
                kind = "input" if (component, variable) in targets else "output"
                lines.append(f'<ssd:Connector name={quoteattr(variable)} kind="{kind}"><ssc:Real/></ssd:Connector>')
        lines.append("</ssd:Connectors>")
        lines.append("<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>")
        lines.append('<ssv:ParameterSet version="1.0" name="start"><ssv:Parameters>')
        for variable, value in job["parameters"].get(name, {}).items():
            kind, text = ("Boolean", str(value).lower()) if isinstance(value, bool) else ("Real", repr(value))
            lines.append(f'<ssv:Parameter name={quoteattr(variable)}><ssv:{kind} value="{text}"/></ssv:Parameter>')
        lines.append("</ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding>")
        lines.append("</ssd:ParameterBindings></ssd:Component>")
    wires = [
        f'<ssd:Connection startElement="{a}" startConnector="{out}" endElement="{b}" endConnector="{into}"/>'
        for (a, out), (b, into) in job["wires"]
    ]
    ssd = (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<ssd:SystemStructureDescription version="1.0" name="system" '
        'xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" '
        'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" '
        'xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues">'
        f'<ssd:System name="system"><ssd:Elements>{"".join(lines)}</ssd:Elements>'
        f"<ssd:Connections>{''.join(wires)}</ssd:Connections></ssd:System></ssd:SystemStructureDescription>\n"
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", ssd)
        for name, fmu in job["fmus"].items():
            archive.write(fmu, f"resources/{name}.fmu")
