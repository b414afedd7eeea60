"""The C source of the circuit around a controller: its kernel, and which value goes where."""

from collections.abc import Sequence
from pathlib import Path

from fmus.toolchain.c_text import c_number, c_string
from fmus.toolchain.kernel import c_source
from fmus.toolchain.model import Model
from fmus.vendor_dll.circuit import ANGLE
from fmus.vendor_dll.device import Device, Route

_C = Path(__file__).with_name("c")
_KERNEL = {"initialise": "circuit_initialise", "outputs": "circuit_outputs", "derivatives": "circuit_derivatives",
           "requirements": "circuit_requirements", "advance": "circuit_advance_parts",
           "workspace_size": "circuit_workspace"}  # fmt: skip
_PLACES = {
    "AT_ANGLE": ANGLE, "AT_INTERNAL_STEP": "internal_step", "AT_FREQUENCY": "f_n", "AT_V_RE": "v_re", "AT_V_IM": "v_im",
    "AT_V_0": "v_0", "AT_THETA_0": "theta_0", "AT_P_0": "P_0", "AT_Q_0": "Q_0", "AT_P": "p", "AT_Q": "q",
    "AT_TRIM_P": "trim.P", "AT_TRIM_Q": "trim.Q", "AT_TRIM_V": "trim.V",
}  # fmt: skip


def kernel_source(model: Model) -> str:
    """The kernel's source, under names that the host does not have."""
    define = "\n".join(f"#define {name} {other}" for name, other in _KERNEL.items())
    undefine = "\n".join(f"#undef {name}" for name in _KERNEL)
    size = f"enum {{ CIRCUIT_SIZE = {len(model.value_references)}, RULES = {len(model.requirement_texts)} }};"
    return "\n".join(["#define KERNEL static", define, c_source(model), undefine, size])


def no_kernel_source() -> str:
    """The same for a controller alone."""
    return "enum { CIRCUIT_SIZE = 0 };"


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
        f"static const char *const RULE[] = {{{', '.join(map(c_string, model.requirement_texts)) or '0'}}};",
        "struct route { int type; size_t offset; int place, base; double factor; };",
        f"static const struct route MEASURED[] = {{{_routes(device.measured, model)}}};",
        f"static const struct route DRIVEN[] = {{{_routes(device.driven, model)}}};",
        (_C / "circuit.c").read_text(encoding="utf-8"),
    ]
    return "\n".join(lines)


def no_circuit_source() -> str:
    """The same for a controller alone."""
    return (_C / "no_circuit.c").read_text(encoding="utf-8")


def _routes(routes: Sequence[Route], model: Model) -> str:
    places = model.value_references
    return ", ".join(
        f"{{{r.place.row.data_type}, {r.place.offset}, {places[r.quantity]}, "
        f"{-1 if r.base is None else places[r.base]}, {c_number(r.factor)}}}"
        for r in routes
    )
