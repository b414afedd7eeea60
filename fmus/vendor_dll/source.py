"""The C source of the FMU around a DLL: tables of what the DLL declares, its host, and the functions of FMI 2.0."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fmus.toolchain.c_text import c_array, c_number, c_string
from fmus.toolchain.kernel import c_source
from fmus.toolchain.model import Model
from fmus.toolchain.variables import Input, Parameter, State, Variable
from fmus.vendor_dll.circuit import ANGLE, BRIDGE, MEASURED, TRIMS
from fmus.vendor_dll.device import Device, Route
from fmus.vendor_dll.interface import (
    CONTROLLER,
    DATA_TYPES,
    DllInterface,
    DllParameter,
    Place,
    Signal,
    layout,
)
from fmus.vendor_dll.state_trial import Trial

_KERNEL = {
    "initialise": "circuit_initialise",
    "outputs": "circuit_outputs",
    "derivatives": "circuit_derivatives",
    "requirements": "circuit_requirements",
    "advance": "circuit_advance_parts",
    "workspace_size": "circuit_workspace",
}
_PLACES = {
    "AT_ANGLE": ANGLE,
    "AT_INTERNAL_STEP": "internal_step",
    "AT_FREQUENCY": "f_n",
    "AT_V_RE": "v_re",
    "AT_V_IM": "v_im",
    "AT_V_0": "v_0",
    "AT_THETA_0": "theta_0",
    "AT_P_0": "P_0",
    "AT_Q_0": "Q_0",
    "AT_P": "p",
    "AT_Q": "q",
    "AT_TRIM_P": "trim.P",
    "AT_TRIM_Q": "trim.Q",
    "AT_TRIM_V": "trim.V",
}


def kernel_source(model: Model) -> str:
    """The kernel's source, under names that the host does not have."""
    define = "\n".join(f"#define {name} {other}" for name, other in _KERNEL.items())
    undefine = "\n".join(f"#undef {name}" for name in _KERNEL)
    size = f"enum {{ CIRCUIT_SIZE = {len(model.value_references)}, RULES = {len(model.requirement_texts)} }};"
    return "\n".join(["#define KERNEL static", define, c_source(model), undefine, size])


def circuit_source(model: Model, device: Device) -> str:
    places = model.value_references
    at = ", ".join(f"{name} = {places[variable]}" for name, variable in _PLACES.items())
    flags = {"DELAY": int(device.delay), "MEASUREMENTS": len(device.measured)}
    flags |= {f"TRIM_{letter}": int(letter in device.trims) for letter in "PQV"}
    numbers = {
        "LONGEST_START": device.longest_start,
        "FIRST_TRIM": device.first_trim,
        "TRIM_TIME": device.trim_time,
        "V_PER_Q": device.voltage_per_q,
    }
    lines = [
        f"enum {{ {at}, {', '.join(f'{name} = {value}' for name, value in flags.items())} }};",
        *(f"static const double {name} = {c_number(value)};" for name, value in numbers.items()),
        c_array("char *const", "RULE", map(c_string, model.requirement_texts)),
        "struct route { int type; size_t offset; int place, base; double factor; };",
        f"static const struct route MEASURED[] = {{{_routes(device.measured, model)}}};",
        f"static const struct route DRIVEN[] = {{{_routes(device.driven, model)}}};",
        (_C / "circuit.c").read_text(encoding="utf-8"),
    ]
    return "\n".join(lines)


def _routes(routes: Sequence[Route], model: Model) -> str:
    places = model.value_references
    return ", ".join(
        f"{{{r.place.row.data_type}, {r.place.offset}, {places[r.quantity]}, "
        f"{-1 if r.base is None else places[r.base]}, {c_number(r.factor)}}}"
        for r in routes
    )


_C = Path(__file__).with_name("c")
_TOOLCHAIN = Path(__file__).parents[1] / "toolchain" / "c"
# For Windows it would mean mingw's own functions of text, which `fmus.toolchain.windows` does without.
_HEADERS = "#ifndef _WIN32\n#define _GNU_SOURCE\n#endif\n" + "".join(
    f"#include <{name}.h>\n" for name in ("math", "stdarg", "stdint", "stdio", "stdlib", "string")
)

(
    PARAMETER,
    INITIAL,
    INPUT,
    OUTPUT,
    HELD,
    INT_STATE,
    FLOAT_STATE,
    DOUBLE_STATE,
    MEMORY_STATE,
    SAMPLES,
) = range(10)
CIRCUIT_PARAMETER, CIRCUIT_INPUT, CIRCUIT_STATE, CIRCUIT_VALUE, HELD_INPUT, CONSTANT_INPUT = range(
    10, 16
)
"""A variable's role for the host. Those up to `INITIAL` are set before the start."""

_ROLES = (
    "PARAMETER",
    "INITIAL",
    "INPUT",
    "OUTPUT",
    "HELD",
    "INT_STATE",
    "FLOAT_STATE",
    "DOUBLE_STATE",
    "MEMORY_STATE",
    "SAMPLES",
    "CIRCUIT_PARAMETER",
    "CIRCUIT_INPUT",
    "CIRCUIT_STATE",
    "CIRCUIT_VALUE",
    "HELD_INPUT",
    "CONSTANT_INPUT",
)
_STATES = {
    INT_STATE: ("IntStates", 6, 4),
    FLOAT_STATE: ("FloatStates", 8, 4),
    DOUBLE_STATE: ("DoubleStates", 9, 8),
}


@dataclass(frozen=True)
class HostVariable:
    """A variable of the FMU; its value reference is its place in the list of all."""

    name: str
    role: int  # `PARAMETER` to `SAMPLES`
    kind: str  # ``Real`` or ``Integer``
    data_type: int  # the interface's number
    offset: int  # in the structure or array it lies in [bytes]
    start: float = 0.0
    unit: str = ""
    text: str = ""
    parameter: DllParameter | Parameter | None = None
    declared: Variable | None = None
    # whether it is no output, though it is one of the DLL or the circuit: phase quantities never stand still.
    local: bool = False

    @property
    def is_state(self) -> bool:
        """Return whether it is a number that the next sample depends on and that a master may set."""
        own = (HELD, FLOAT_STATE, DOUBLE_STATE, MEMORY_STATE, CIRCUIT_STATE)
        return self.role in own and self.data_type in (8, 9)

    @property
    def fixed(self) -> bool:
        p = self.parameter
        return not p.tunable if isinstance(p, Parameter) else p is None or p.fixed


def device_variables(
    interface: DllInterface, trial: Trial, device: Device, circuit: Model
) -> tuple[HostVariable, ...]:
    """All variables of a controller with a circuit around it: what the circuit gives the controller is no input."""
    measured = {route.place.name for route in device.measured}
    driven = {route.place.name for route in device.driven}
    found = []
    for v in host_variables(interface, trial):
        kept = v
        if v.role == INPUT and v.name in measured:
            kept = replace(v, role=HELD_INPUT)
        elif v.role == INPUT and v.name in device.constants:
            kept = replace(v, role=CONSTANT_INPUT, start=device.constants[v.name])
        hidden = v.role == OUTPUT and v.name in driven
        found.append(replace(kept, name=f"{CONTROLLER}{v.name}", local=hidden))
    return (*found, *_of_circuit(circuit))


def _of_circuit(circuit: Model) -> list[HostVariable]:
    found = []
    for place, v in enumerate(circuit.variables):
        role, kind, start = CIRCUIT_VALUE, "Real", 0.0
        if isinstance(v, Parameter):
            role, kind, start = CIRCUIT_PARAMETER, v.type, float(v.start)
        elif isinstance(v, Input) and v.name in (*BRIDGE, *TRIMS):
            role = CIRCUIT_STATE if v.name in BRIDGE else CIRCUIT_VALUE
        elif isinstance(v, Input):
            role, start = CIRCUIT_INPUT, float(v.start)
        elif isinstance(v, State) and v.name != ANGLE:
            role = CIRCUIT_STATE
        parameter = v if isinstance(v, Parameter) else None
        hidden = v.name in MEASURED
        found.append(
            HostVariable(
                name=v.name,
                role=role,
                kind=kind,
                data_type=9,
                offset=place,
                start=start,
                unit=v.unit,
                text=v.text,
                parameter=parameter,
                declared=v,
                local=hidden,
            )
        )
    return found


def host_variables(interface: DllInterface, trial: Trial) -> tuple[HostVariable, ...]:
    """All variables of the FMU, in the order of their value references. Text is not among them."""
    found: list[HostVariable] = []
    taken = {row.name for rows in (interface.inputs, interface.outputs) for row in rows}
    for place in _numbers(interface.parameters):
        assert isinstance(place.row, DllParameter)
        name = place.name if place.name not in taken else f"parameter.{place.name}"
        found.append(
            _variable(place, name, PARAMETER, start=float(place.row.default), parameter=place.row)
        )
    outputs = _numbers(interface.outputs)
    for place in outputs:
        text = (
            f"Value of {place.name} before the first sample, from which the DLL initialises itself"
        )
        found.append(_variable(place, f"initial.{place.name}", INITIAL, text=text))
    inputs = {row.name for row in interface.inputs}
    found += [_variable(place, place.name, INPUT) for place in _numbers(interface.inputs)]
    for place in outputs:
        name = place.name if place.row.name not in inputs else f"output.{place.name}"
        found.append(_variable(place, name, OUTPUT))
    for place in outputs:
        if place.row.data_type in (8, 9):
            text = f"{place.name} as held until the next sample"
            found.append(_variable(place, f"held.{place.name}", HELD, text=text))
    for count, role in zip(interface.states, _STATES, strict=True):
        array, data_type, size = _STATES[role]
        kind = DATA_TYPES[data_type].kind
        found += [
            HostVariable(
                f"{array}[{k + 1}]",
                role,
                kind,
                data_type,
                k * size,
                text=f"Element {k} of the DLL's {array}",
            )
            for k in range(count)
        ]
    for data_type, places in ((9, trial.doubles), (8, trial.floats)):
        found += [
            HostVariable(
                f"memory[{at:#x}]",
                MEMORY_STATE,
                "Real",
                data_type,
                at,
                text="In the DLL's own memory",
            )
            for at in places
        ]
    found.append(HostVariable("samples", SAMPLES, "Integer", 6, 0, text="Samples so far"))
    return tuple(found)


def _numbers(rows: Sequence[DllParameter] | Sequence[Signal]) -> list[Place]:
    return [place for place in layout(rows).places if place.type.kind != "String"]


def _strings(rows: Sequence[DllParameter] | Sequence[Signal]) -> list[Place]:
    return [place for place in layout(rows).places if place.type.kind == "String"]


def _variable(
    place: Place,
    name: str,
    role: int,
    *,
    start: float = 0.0,
    text: str = "",
    parameter: DllParameter | None = None,
) -> HostVariable:
    row = place.row
    text = text or row.description
    return HostVariable(
        name=name,
        role=role,
        kind=place.type.kind,
        data_type=row.data_type,
        offset=place.offset,
        start=start,
        unit=row.unit,
        text=text,
        parameter=parameter,
    )


def host_source(
    interface: DllInterface,
    trial: Trial,
    texts: Mapping[str, str],
    carried: Mapping[str, str],
    vendor_file: str,
    variables: Sequence[HostVariable],
    around: tuple[Device, Model] | None = None,
) -> str:
    """The source without its identity."""
    code = [(_C / name).read_text(encoding="utf-8") for name in ("library.c", "host.c")]
    functions = (_TOOLCHAIN / "fmi2.c").read_text(encoding="utf-8")
    export = (_TOOLCHAIN / "fmi.h").read_text(encoding="utf-8").split("typedef")[0]
    tables = _tables(interface, trial, {**texts, **carried}, carried, vendor_file, variables)
    if around is None:
        before, after = (
            "enum { CIRCUIT_SIZE = 0 };",
            (_C / "no_circuit.c").read_text(encoding="utf-8"),
        )
    else:
        device, circuit = around
        before, after = kernel_source(circuit), circuit_source(circuit, device)
    return "\n".join([_HEADERS, before, export, *tables, *code, after, functions])


def _tables(
    interface: DllInterface,
    trial: Trial,
    texts: Mapping[str, str],
    carried: Mapping[str, str],
    vendor_file: str,
    variables: Sequence[HostVariable],
) -> list[str]:
    texts_of_parameters = _strings(interface.parameters)
    text_inputs = _strings(interface.inputs)
    ints, floats, doubles = interface.states
    numbers = {
        "IN_SIZE": layout(interface.inputs).size,
        "OUT_SIZE": layout(interface.outputs).size,
        "PAR_SIZE": layout(interface.parameters).size,
        "INTS": ints,
        "FLOATS": floats,
        "DOUBLES": doubles,
        "NV": len(variables),
        "TEXTS": len(texts_of_parameters),
        "TEXT_INPUTS": len(text_inputs),
        "REGIONS": len(trial.regions),
        "OWN_STATE": int(trial.state == "library"),
        "MEMORY": sum(size for _, size in trial.regions),
        "MODE": 2 if interface.mode == 2 else 1,
    }
    words = [
        texts.get(place.name, str(place.row.default))
        for place in texts_of_parameters
        if isinstance(place.row, DllParameter)
    ]
    carried_flags = [str(int(place.name in carried)) for place in texts_of_parameters]
    regions = [f"{{{start}, {size}}}" for start, size in trial.regions]
    return [
        "enum { " + ", ".join(f"{name} = {value}" for name, value in numbers.items()) + " };",
        "enum kind { REAL, INTEGER, BOOLEAN };",
        "enum role { " + ", ".join(_ROLES) + " };",
        f"static const double SAMPLE_TIME = {max(0.0, interface.sample_time)!r};",
        f"static const char VENDOR_FILE[] = {c_string(vendor_file)};",
        "struct variable { const char *name; int kind, role, type; size_t offset; "
        "double start, minimum, maximum; int tunable; };",
        c_array("struct variable", "VARIABLE", map(_row, variables)),
        _offsets("TEXT_AT", texts_of_parameters),
        c_array("char *const", "WORDS", map(c_string, words)),
        c_array("char *const", "NAMES", [c_string(place.name) for place in texts_of_parameters]),
        c_array("char", "CARRIED", carried_flags),
        _offsets("TEXT_INPUT_AT", text_inputs),
        'static const char *const EMPTY = "";',
        f"static const size_t REGION[][2] = {{{', '.join(regions) or '{0, 0}'}}};",
    ]


def _row(v: HostVariable) -> str:
    """A variable as an entry of the host's array."""
    least = c_number(v.parameter.minimum if v.parameter else None, "-INFINITY")
    most = c_number(v.parameter.maximum if v.parameter else None, "INFINITY")
    tunable = int(v.parameter is not None and not v.fixed)
    return (
        f"{{{c_string(v.name)}, {v.kind.upper()}, {v.role}, {v.data_type}, {v.offset}, {c_number(v.start)}, "
        f"{least}, {most}, {tunable}}}"
    )


def _offsets(name: str, places: Sequence[Place]) -> str:
    """The array of where places lie in their structure [bytes]."""
    return c_array("size_t", name, [str(place.offset) for place in places])
