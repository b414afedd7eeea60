"""The C source of a model as IEEE/CIGRE DLL: its kernel, what it declares, and the interface's functions."""

from collections.abc import Iterable, Sequence
from importlib.metadata import version as version_of
from pathlib import Path

from fmus.toolchain.c_text import c_array, c_number, c_string
from fmus.toolchain.kernel import c_source
from fmus.toolchain.model import Model
from fmus.toolchain.variables import Input, Output, Parameter

_C = Path(__file__).with_name("c")
# bound of a parameter without one: the interface has no word for "none", and a host may print it
_UNBOUNDED = 1e30


def dll_source(model: Model, sample_time: float) -> str:
    """Source of the DLL, which needs nothing but the C library.

    ``model``: Integrated by explicit steps, as the kernel does in an FMU.
    ``sample_time``: ``FixedStepBaseSampleTime`` [s]."""
    if model.integrator != "runge_kutta":
        raise ValueError(f"model {model.name}: only models with explicit steps become DLLs")
    parts = [
        "#define KERNEL static",
        c_source(model),
        (_C / "interface.h").read_text(encoding="utf-8"),
        _declarations(model, sample_time),
        (_C / "model.c").read_text(encoding="utf-8"),
    ]
    return "\n".join(parts)


def c_name(name: str) -> str:
    """A variable's name as the interface wants it: a name in C."""
    return name.replace(".", "_")


def _check_names(model: Model) -> None:
    """Refuse names that are one and the same name in C."""
    for group in (model.parameters, model.inputs, model.outputs):
        names = [c_name(variable.name) for variable in group]
        twice = [name for name in names if names.count(name) > 1]
        if twice:
            raise ValueError(
                f"model {model.name}: two variables would be called {twice[0]!r} in the DLL"
            )


def _declarations(model: Model, sample_time: float) -> str:
    _check_names(model)
    lines = [
        f"enum {{ NR = {len(model.requirement_texts)}, INTERNAL_STEP = {model.value_references['internal_step']} }};",
        f"static const double SAMPLE_TIME = {sample_time!r};",
        *_parameter_arrays(model.parameters),
        *_texts(model),
        _table("dll_signal", "INPUTS", map(_signal, model.inputs)),
        _table("dll_signal", "OUTPUTS", map(_signal, model.outputs)),
        _table("dll_parameter", "PARAMETERS", map(_parameter, model.parameters)),
        _info(model, sample_time),
    ]
    return "\n".join(lines)


def _parameter_arrays(parameters: Sequence[Parameter]) -> list[str]:
    """The structure of the parameters, and arrays that say where each is in it and what it may be."""
    members = ""
    at, whole, fixed, least, most = [], [], [], [], []
    for p in parameters:
        lower, upper = _bounds(p)
        members += f" {'double' if p.type == 'Real' else 'int32_t'} {c_name(p.name)};"
        at.append(f"offsetof(struct parameters, {c_name(p.name)})")
        whole.append(str(int(p.type != "Real")))
        fixed.append(str(int(not p.tunable)))
        least.append(c_number(lower))
        most.append(c_number(upper))
    return [
        f"struct parameters {{{members} }};",
        c_array("size_t", "AT", at),
        c_array("char", "WHOLE", whole),
        c_array("char", "FIXED", fixed),
        c_array("double", "LEAST", least),
        c_array("double", "MOST", most),
    ]


def _texts(model: Model) -> list[str]:
    """Every text of an error: whole ones, so that the DLL needs no memory to write one."""

    def line(text: str) -> str:
        return c_string(f"{model.name}: {text}")

    def lines(name: str, texts: Iterable[str]) -> str:
        return c_array("char *const", name, map(line, texts))

    bounds = [
        f"parameter {c_name(p.name)} must be from {_bounds(p)[0]:g} to {_bounds(p)[1]:g}"
        for p in model.parameters
    ]
    free = ", ".join(c_name(p.name) for p in model.parameters if p.tunable)
    single = {
        "FOR_EMT": "it is for EMT programs: its inputs are instantaneous values, which an RMS program does not have",
        "NOT_STARTED": "Model_Outputs was called before Model_Initialize had succeeded",
        "NO_START": "the operating point gives no finite state; check the parameters",
        "FIXED_CHANGED": f"a fixed parameter was changed after Model_Initialize; these may change: {free}",
    }
    rules = [f"parameters cannot be used: {rule}" for rule in model.requirement_texts]
    inputs = [f"input {c_name(v.name)} is not a finite number" for v in model.inputs]
    states = [f"state {v.name} is no longer finite: the solution diverges" for v in model.states]
    title = f"{model.name}, gfor-cosim {_version()}: {model.title}"
    return [
        lines("OUT_OF_BOUNDS", bounds),
        lines("RULE", rules),
        lines("INPUT_NOT_FINITE", inputs),
        lines("STATE_NOT_FINITE", states),
        *(f"static const char {key}[] = {line(text)};" for key, text in single.items()),
        f"static const char TITLE[] = {c_string(title)};",
    ]


def _version() -> str:
    return version_of("gfor-cosim")


def _bounds(p: Parameter) -> tuple[float, float]:
    if p.type == "Boolean":
        return 0.0, 1.0
    return (
        -_UNBOUNDED if p.minimum is None else p.minimum,
        _UNBOUNDED if p.maximum is None else p.maximum,
    )


def _table(kind: str, name: str, rows: Iterable[str]) -> str:
    return c_array(f"struct {kind}", name, rows, empty="")


def _signal(v: Input | Output) -> str:
    return f"{{{c_string(c_name(v.name))}, {c_string(v.text)}, {c_string(v.unit)}, REAL64, 1}}"


def _parameter(p: Parameter) -> str:
    scope = p.name.rpartition(".")[0]
    texts = ", ".join(map(c_string, (c_name(p.name), scope or "general", p.text, p.unit)))
    numbers = (p.start, *_bounds(p))
    if p.type == "Real":
        kind, values = "REAL64", [f"{{.real64 = {c_number(v)}}}" for v in numbers]
    else:
        kind, values = (
            "INT32",
            [f"{{.int32 = {max(-(2**31), min(2**31 - 1, int(v)))}}}" for v in numbers],
        )
    return f"{{{texts}, {kind}, {int(not p.tunable)}, {', '.join(values)}}}"


def _info(model: Model, sample_time: float) -> str:
    texts = (
        model.name,
        _version(),
        model.title,
        "Data sheet with the circuit around it: the file of this name that ends in .md",
        *("", "gfor-cosim", "", "", "", ""),
    )
    return (
        f"static const struct dll_info INFO = {{{{1, 1, 0, 0}}, {', '.join(map(c_string, texts))}, "
        f"{sample_time!r}, EMT, NU, INPUTS, NY, OUTPUTS, NP, PARAMETERS, "
        "NI, 0, NX};"
    )
