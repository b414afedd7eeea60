"""modelDescription.xml of FMI 2.0 for co-simulation, from a model's declarations.

Beyond what the standard demands it declares every continuous state with its derivative, and what
each output and derivative depends on, so that a master can order its calls and linearise.
"""

from xml.etree.ElementTree import Element, SubElement, indent, tostring

import casadi as ca
import numpy as np

from fmus.toolchain.model import Model
from fmus.toolchain.variables import UNITS, CalculatedParameter, Input, Output, Parameter, State, Variable

VENDOR = "gfor-cosim"


def model_description(model: Model, guid: str, identifier: str, tool: str) -> bytes:
    """Return the file's text.

    Parameters
    ----------
    guid, identifier
        As in the standard; the identifier also names the binaries.
    tool
        Name and version for ``generationTool``. No date is written: equal contents give equal files.
    """
    root = Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=model.name,
        guid=guid,
        description=model.title,
        generationTool=tool,
        variableNamingConvention="structured",
        numberOfEventIndicators="0",
    )
    SubElement(
        root,
        "CoSimulation",
        modelIdentifier=identifier,
        needsExecutionTool="true",
        canHandleVariableCommunicationStepSize="true",
        canNotUseMemoryManagementFunctions="true",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
        providesDirectionalDerivative="false",
    )
    _units(root, model)
    categories = SubElement(root, "LogCategories")
    for status in ("Warning", "Discard", "Error", "Fatal"):
        SubElement(
            categories,
            "Category",
            name=f"logStatus{status}",
            description=f"Messages with fmi2{status} status",
        )
    SubElement(categories, "Category", name="logAll", description="All messages")
    SubElement(root, "DefaultExperiment", startTime="0", stopTime="20", stepSize="1e-4")
    annotation = SubElement(SubElement(root, "VendorAnnotations"), "Tool", name=VENDOR)
    SubElement(annotation, "ContinuousStates", settable="true")
    _variables(root, model)
    _structure(root, model)
    indent(root)
    text: str = tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


def _derivative_unit(state: State) -> str:
    return f"{state.unit}/s"


def _units(root: Element, model: Model) -> None:
    used = {v.unit for v in model.variables} | {_derivative_unit(s) for s in model.states}
    definitions = SubElement(root, "UnitDefinitions")
    for unit in sorted(used):
        element = SubElement(definitions, "Unit", name=unit)
        exponents = {key: f"{value:g}" for key, value in UNITS[unit].items()}
        if exponents:
            SubElement(element, "BaseUnit", exponents)


def _variables(root: Element, model: Model) -> None:
    variables = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(model.variables):
        attributes, kind, own = _attributes(variable)
        element = SubElement(
            variables,
            "ScalarVariable",
            {
                "name": variable.name,
                "valueReference": str(reference),
                "description": variable.text,
                **attributes,
            },
        )
        SubElement(element, kind, own)
    first_state = len(model.parameters) + len(model.calculated) + len(model.inputs)
    for position, state in enumerate(model.states):
        name = f"der({state.name})"
        element = SubElement(
            variables,
            "ScalarVariable",
            name=name,
            valueReference=str(model.value_references[name]),
            description=f"Time derivative of {state.name}",
            causality="local",
            variability="continuous",
            initial="calculated",
        )
        SubElement(element, "Real", unit=_derivative_unit(state), derivative=str(first_state + position + 1))


def _attributes(variable: Variable) -> tuple[dict[str, str], str, dict[str, str]]:
    """Causality, variability and initial; the type element's name; and its own attributes."""
    match variable:
        case Parameter(type=kind):
            attributes = {
                "causality": "parameter",
                "variability": "tunable" if variable.tunable else "fixed",
                "initial": "exact",
            }
            return attributes, kind, _parameter_type(variable)
        case CalculatedParameter():
            attributes = {"causality": "calculatedParameter", "variability": "fixed", "initial": "calculated"}
            return attributes, "Real", {"unit": variable.unit}
        case Input():
            attributes = {"causality": "input", "variability": "continuous"}
            return attributes, "Real", {"unit": variable.unit, "start": repr(float(variable.start))}
        case Output():
            attributes = {"causality": "output", "variability": "continuous", "initial": "calculated"}
            return attributes, "Real", {"unit": variable.unit}
        case _:
            attributes = {"causality": "local", "variability": "continuous", "initial": "calculated"}
            return attributes, "Real", {"unit": variable.unit}


def _parameter_type(parameter: Parameter) -> dict[str, str]:
    if parameter.type == "Boolean":
        return {"start": "true" if parameter.start else "false"}
    convert = int if parameter.type == "Integer" else float
    bounds = {"min": parameter.minimum, "max": parameter.maximum, "start": parameter.start}
    attributes = {key: repr(convert(value)) for key, value in bounds.items() if value is not None}
    return attributes if parameter.type == "Integer" else {"unit": parameter.unit, **attributes}


def _structure(root: Element, model: Model) -> None:
    """Outputs and derivatives with what they depend on; initial unknowns with theirs."""
    np_, nc, nu = len(model.parameters), len(model.calculated), len(model.inputs)
    nx, ny = len(model.states), len(model.outputs)
    parameters, inputs = np.arange(np_), np_ + nc + np.arange(nu)
    states = np_ + nc + nu + np.arange(nx)
    first_output, first_derivative = np_ + nc + nu + nx, np_ + nc + nu + nx + ny

    f, g = model.derivatives, model.outputs_function
    f_x, f_u, f_p, f_c = (_dependence(f, 0, k) for k in range(4))
    g_x, g_u, g_p, g_c = (_dependence(g, 0, k) for k in range(4))
    c_p, x_p = _dependence(model.initialise, 0, 0), _dependence(model.initialise, 1, 0)

    def write(parent: Element, first: int, blocks: list[tuple[np.ndarray, np.ndarray]]) -> None:
        for row in range(len(blocks[0][0])):
            known = [str(index + 1) for matrix, indices in blocks for index in indices[matrix[row]]]
            SubElement(parent, "Unknown", index=str(first + row + 1), dependencies=" ".join(known))

    structure = SubElement(root, "ModelStructure")
    if ny:
        write(SubElement(structure, "Outputs"), first_output, [(g_u, inputs), (g_x, states)])
    if nx:
        write(SubElement(structure, "Derivatives"), first_derivative, [(f_u, inputs), (f_x, states)])
    unknowns = SubElement(structure, "InitialUnknowns")
    write(unknowns, np_, [(c_p, parameters)])
    write(unknowns, np_ + nc + nu, [(x_p, parameters)])
    through = [(g_p | _product(g_x, x_p) | _product(g_c, c_p), parameters), (g_u, inputs)]
    write(unknowns, first_output, through)
    write(
        unknowns,
        first_derivative,
        [(f_p | _product(f_x, x_p) | _product(f_c, c_p), parameters), (f_u, inputs)],
    )


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    product: np.ndarray = (a.astype(int) @ b.astype(int)) > 0
    return product


def _dependence(function: ca.Function, output: int, input_: int) -> np.ndarray:
    """Which element of an output depends on which element of an input, as a Boolean matrix."""
    pattern = function.jac_sparsity(output, input_)
    matrix = np.zeros(pattern.shape, dtype=bool)
    rows, columns = pattern.get_triplet()
    matrix[rows, columns] = True
    return matrix
