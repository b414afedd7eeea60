"""A linear model that travels inside an FMU, for tools that cannot linearise one.

It lies under ``extra/`` as FMI's layered standards have it: a manifest, the model as JSON, and the same for MATLAB.
The README of this folder has its form."""

import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, indent, register_namespace, tostring

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.errors import FmuFileError
from orchestrator.devices.fmi.archive import read_member
from orchestrator.devices.fmi.description import REVERSE_DOMAIN

NAME = f"{REVERSE_DOMAIN}.fmi-ls-linear-model"
VERSION = "1.0.0"
FOLDER = f"extra/{NAME}"

_LS = "http://fmi-standard.org/fmi-ls-manifest"
# bytes of free text at the beginning of a MAT file, in which scipy writes the date
_MATLAB_HEADER = 116

register_namespace("fmi-ls", _LS)


@dataclass(frozen=True)
class EmbeddedModel:
    """ẋ = A·x + B·u, y = C·x + D·u in deviations from an operating point."""

    # A, B, C, D: shapes (n, n), (n, m), (p, n), (p, m), in the variables' own units and seconds
    A: NDArray[np.float64]
    B: NDArray[np.float64]
    C: NDArray[np.float64]
    D: NDArray[np.float64]
    # states, inputs, outputs: values at the operating point by name, in the order of rows and columns
    states: dict[str, float]
    inputs: dict[str, float]
    outputs: dict[str, float]
    # Those that differ from the FMU's start values. With them and the inputs the FMU comes to this point.
    parameters: dict[str, float | bool]
    units: dict[str, str]
    # the case, scenario and component that the operating point is of, in words and figures
    origin: dict[str, str | float]


def linear_model_members(model: EmbeddedModel) -> dict[str, bytes]:
    return {
        f"{FOLDER}/fmi-ls-manifest.xml": _manifest(),
        f"{FOLDER}/linear_model.json": _json(model),
        f"{FOLDER}/linear_model.mat": _matlab(model),
    }


def read_embedded_model(path: Path) -> EmbeddedModel | None:
    member = f"{FOLDER}/linear_model.json"
    try:
        text = read_member(path, member)
        return None if text is None else _read(json.loads(text))
    except (KeyError, TypeError, ValueError) as error:
        raise FmuFileError(
            f"{path}: the linear model inside ({member}) cannot be read: {error}; build the FMU again with "
            "`gfor fmu build --with-linear-model`"
        ) from error


def _read(content: dict[str, Any]) -> EmbeddedModel:
    if str(content["version"]).partition(".")[0] != VERSION.partition(".")[0]:
        raise ValueError(f"version {content['version']} of its form is not known, but {VERSION} is")
    variables = {kind: content[kind] for kind in ("states", "inputs", "outputs", "parameters")}
    n, m, p = (len(variables[kind]) for kind in ("states", "inputs", "outputs"))
    shapes = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
    matrices: Any = {
        key: np.array(content[key], dtype=np.float64).reshape(shape)
        for key, shape in shapes.items()
    }
    values: Any = {
        kind: {v["name"]: v["value"] for v in entries} for kind, entries in variables.items()
    }
    units = {v["name"]: v["unit"] for entries in variables.values() for v in entries}
    return EmbeddedModel(**matrices, **values, units=units, origin=content["origin"])


def _manifest() -> bytes:
    root = Element(
        "fmiLayeredStandardManifest",
        {
            f"{{{_LS}}}fmi-ls-name": NAME,
            f"{{{_LS}}}fmi-ls-version": VERSION,
            f"{{{_LS}}}fmi-ls-description": "Continuous linear model of the FMU around an operating point: "
            "linear_model.json, and the same in linear_model.mat",
        },
    )
    indent(root)
    text: bytes = tostring(root, encoding="UTF-8", xml_declaration=True)
    return text + b"\n"


def _json(model: EmbeddedModel) -> bytes:
    def entries(values: Mapping[str, float | bool]) -> list[dict[str, Any]]:
        return [
            {"name": n, "unit": model.units.get(n, ""), "value": value}
            for n, value in values.items()
        ]

    content = {
        "version": VERSION,
        "equations": "der(x) = A*x + B*u, y = C*x + D*u; x, u, y are deviations from the values given here",
        "origin": model.origin,
        "parameters": entries(model.parameters),
        "states": entries(model.states),
        "inputs": entries(model.inputs),
        "outputs": entries(model.outputs),
    }
    lines = [f" {json.dumps(key)}: {_lines(value)}" for key, value in content.items()]
    lines += [f' "{key}": {_lines(getattr(model, key).tolist())}' for key in "ABCD"]
    return ("{\n" + ",\n".join(lines) + "\n}\n").encode()


def _lines(value: Any) -> str:
    """Compact, but with a line for every row of a matrix and every variable."""
    if isinstance(value, list):
        return (
            "[\n" + ",\n".join(f"  {json.dumps(row, ensure_ascii=False)}" for row in value) + "\n ]"
        )
    return json.dumps(value, ensure_ascii=False)


def _matlab(model: EmbeddedModel) -> bytes:
    """Matrices and names under the names that they have in the JSON file; equal models give equal files."""
    content: dict[str, Any] = {key: getattr(model, key) for key in "ABCD"}
    for kind in ("states", "inputs", "outputs", "parameters"):
        values = getattr(model, kind)
        content[kind] = _column(list(values), object)
        content[f"{kind[:-1]}_values"] = _column([float(v) for v in values.values()], float)
        content[f"{kind[:-1]}_units"] = _column(
            [model.units.get(name, "") for name in values], object
        )
    from scipy.io import savemat  # noqa: PLC0415 - a tenth of a second that only this format needs

    file = io.BytesIO()
    savemat(file, content)
    header = f"MATLAB 5.0 MAT-file, {NAME} {VERSION}".encode().ljust(_MATLAB_HEADER)
    return header + file.getvalue()[_MATLAB_HEADER:]


def _column(values: Sequence[Any], kind: type) -> NDArray[Any]:
    return np.array(values, dtype=kind).reshape(-1, 1)
