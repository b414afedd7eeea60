"""The slave inside every Python-backed FMU: a thin pythonfmu class around one kernel.

This file is not imported by the toolchain. It is copied into the FMU's resources under a name that
carries the FMU's own hash, because all Python-backed FMUs of a process share one interpreter. It
needs a Python and nothing else.

pythonfmu's wrapper crashes the process on the second exception of an instance, so no callback may
raise: a problem is logged and remembered, and every later step is discarded with its text. Where the
master takes no log, the first such step writes it to the standard error stream. The one exception is
the constructor: there a failure must make fmi2Instantiate return NULL."""

import ctypes
import functools
import importlib
import json
import math
import os
import platform
import sys
from pathlib import Path

from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

INSTANTIATED, INITIALISING, STEPPING, TERMINATED = range(4)
MOST_PARTS = 1_000_000  # internal steps in one communication step
# where the wrapper's logger, a C++ object, says whether it logs
LOGGING = ctypes.sizeof(ctypes.c_void_p)
PLATFORMS = {
    ("linux", "x86_64"): ("linux64", ".so"),
    ("win32", "amd64"): ("win64", ".dll"),
    ("darwin", "x86_64"): ("darwin64", ".dylib"),
    ("darwin", "arm64"): ("darwin64", ".dylib"),
}
POINTER = ctypes.c_void_p
DAMAGED = "resources/tape.bin is damaged ({}); build or copy the FMU again"


PYTHON = (
    "PyLong_AsVoidPtr",
    "PyList_Size",
    "PyList_GetItem",
    "PyList_New",
    "PyList_SetItem",
    "PyLong_AsLong",
    "PyFloat_AsDouble",
    "PyFloat_FromDouble",
    "PyBool_FromLong",
    "PyErr_Occurred",
    "PyErr_Clear",
    "PyObject_CallMethod",
    "Py_IncRef",
)
"""Functions of Python that ``c/slave.c`` calls, in its order."""


class Now(ctypes.Structure):
    """Marks, sizes and pointers that a step goes by; the functions in C read and write them, too."""

    _fields_ = [
        ("size", ctypes.c_double),  # that the next step may have without a further look, or none
        ("part", ctypes.c_double),
        *(
            (name, ctypes.c_int32)
            for name in ("parts", "stale", "first_input", "first_state", "first_derivative")
        ),
        *((name, POINTER) for name in ("variables", "workspace", "advance", "slave")),
    ]


class Slave(Fmi2Slave):
    """All variables of the instance lie in one vector, indexed by value reference: [p | c | u | x | y | der(x)]."""

    _tape = None

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        try:
            self._load(Path(kwargs["resources"]))
            self._logger = kwargs.get("logger")
            if kwargs["resources"] in sys.path:
                # the wrapper puts it there for each instance; all is imported
                sys.path.remove(kwargs["resources"])
        except Exception as error:
            raise RuntimeError(f"{self.instance_name}: {error}") from error

    def _load(self, resources):
        model = json.loads((resources / "model.json").read_text(encoding="utf-8"))
        self.modelName = model["name"]
        self._names = model["names"]
        self._parameters = model["parameters"]  # per parameter: [type, minimum, maximum, tunable]
        self._rules = model["requirements"]
        counts = model["counts"]
        self._first_calculated = counts["parameters"]
        self._first_input = self._first_calculated + counts["calculated"]
        self._first_state = self._first_input + counts["inputs"]
        self._first_output = self._first_state + counts["states"]
        self._first_derivative = self._first_output + counts["outputs"]
        self._z = (ctypes.c_double * len(self._names))()
        for reference, value in model["start"].items():
            self._z[int(reference)] = value
        self._margins = (ctypes.c_double * max(1, len(self._rules)))()
        self._identity = bytes.fromhex(model["hash"])[:16]
        self._internal_step = model["internal_step"]
        self._phase = INSTANTIATED
        self._failure = None
        self._parameters_changed = True
        firsts = self._first_input, self._first_state, self._first_derivative
        self._now, self._of = Now(math.nan, math.nan, 0, True, *firsts), None
        self._load_kernel(resources, model["kernel_module"])

    def _load_kernel(self, resources, python_kernel):
        """Take the compiled kernel or the library for tapes, where one fits the platform, else evaluate in Python."""
        folder, ending = PLATFORMS.get((sys.platform, platform.machine().lower()), ("none", ""))
        for name, use in (("kernel", self._use_compiled), ("tape", self._use_tape)):
            library = resources / "kernel" / folder / (name + ending)
            if library.exists() and os.environ.get("GFOR_COSIM_KERNEL") != "python":
                try:
                    kernel = ctypes.PyDLL(str(library))
                except OSError as error:
                    self.log(
                        f"compiled kernel not usable ({error}); evaluating in Python",
                        Fmi2Status.warning,
                    )
                else:
                    use(kernel, resources)
                    return
        content, evaluated = self._read_tape(resources), importlib.import_module(python_kernel)
        try:
            self._kernel = evaluated.Kernel(content, len(self._names))
        except ValueError as error:
            raise ValueError(DAMAGED.format(error)) from error
        # an instance that held itself would stay in memory
        advance, z = self._kernel.advance, self._z
        self._advance = lambda h, n: functools.partial(advance, z, h, n, None)
        self._arguments, self._margins_address = (self._z,), self._margins

    def _use_compiled(self, kernel, _):
        self._use(kernel, (ctypes.c_double * max(1, kernel.workspace_size()))())

    def _use_tape(self, kernel, resources):
        content = self._read_tape(resources)
        kernel.tape_fault.argtypes = [ctypes.c_char_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_int]
        kernel.tape_fault.restype = ctypes.c_char_p
        fault = kernel.tape_fault(content, len(content), len(self._names), len(self._rules))
        if fault is not None:
            raise ValueError(DAMAGED.format(fault.decode()))
        tape = ctypes.cast(ctypes.c_char_p(content), POINTER)
        kernel.workspace_size.argtypes, kernel.workspace_size.restype = [POINTER], ctypes.c_int64
        workspace = (ctypes.c_double * kernel.workspace_size(tape))()
        kernel.begin.argtypes, kernel.begin.restype = [POINTER, POINTER], None
        kernel.begin(tape, ctypes.addressof(workspace))
        self._use(kernel, workspace)

    def _quicken(self, functions, *addresses):
        """Lay functions in C before the three methods that a master calls in every step."""
        self._now.variables, self._now.workspace, self._now.advance = addresses
        self._now.slave = id(self)
        addresses = [ctypes.cast(getattr(ctypes.pythonapi, name), POINTER).value for name in PYTHON]
        functions.restype = POINTER
        first = functions((POINTER * (len(PYTHON) + 1))(*addresses, id(None)))
        make = ctypes.PYFUNCTYPE(ctypes.py_object, POINTER, ctypes.py_object, POINTER)
        made = make(("PyCFunction_NewEx", ctypes.pythonapi))
        for place, name in enumerate(("do_step", "get_real", "set_real")):
            own = made(
                first + place * 4 * ctypes.sizeof(POINTER), ctypes.addressof(self._now), None
            )
            setattr(self, name, own)

    def _use(self, kernel, workspace):
        # The cheapest call is one of objects without a prototype, then one of addresses as integers.
        self._kernel, self._workspace, advance = kernel, workspace, kernel["advance"]
        z, own = POINTER(ctypes.addressof(self._z)), POINTER(ctypes.addressof(workspace))
        self._advance = lambda h, n: functools.partial(
            advance, z, ctypes.c_double(h), ctypes.c_int(n), own
        )
        self._arguments = (ctypes.addressof(self._z), ctypes.addressof(workspace))
        for function in (
            kernel.initialise,
            kernel.outputs,
            kernel.derivatives,
            kernel.requirements,
        ):
            function.argtypes, function.restype = [POINTER] * 2, None
        kernel.requirements.argtypes = [POINTER] * 3
        self._margins_address = ctypes.addressof(self._margins)
        if sys.implementation.name == "cpython" and sys.version_info >= (3, 7):
            self._quicken(kernel.python_functions, z, own, ctypes.cast(advance, POINTER))

    @classmethod
    def _read_tape(cls, resources):
        """Return what all instances of the process execute."""
        if cls._tape is None:
            cls._tape = (resources / "tape.bin").read_bytes()
        return cls._tape

    def _report(self, text):
        self.log(f"{self.instance_name}: {text}", Fmi2Status.error)

    def _fail(self, text):
        """Report a problem after which no step may succeed."""
        self._failure, self._now.size = self._failure or text, math.nan
        self._report(text)

    def _discard(self, text, reported=False):
        """Report why a step is discarded, once to a master that takes no log, which would never learn it."""
        if not reported:
            self._report(text)
        if (
            self._logger
            and not ctypes.c_bool.from_address(self._logger + LOGGING).value
            and sys.stderr
        ):
            self._logger = None
            print(f"{self.instance_name}: fmi2DoStep: {text}", file=sys.stderr, flush=True)
        return False

    def _check_requirements(self):
        self._kernel.requirements(*self._arguments, self._margins_address)
        broken = [rule for rule, margin in zip(self._rules, self._margins) if not margin > 0.0]
        if broken:
            self._fail("parameters cannot be used: " + "; ".join(broken))

    def enter_initialization_mode(self):
        self._phase, self._now.size = INITIALISING, math.nan

    def exit_initialization_mode(self):
        try:
            self._refresh()
            self._check_requirements()
            worst = [n for n, v in zip(self._names, self._z) if not math.isfinite(v)]
            if worst:
                self._fail(
                    f"initialisation gives no finite value for {', '.join(worst[:5])}; check the parameters"
                )
        except Exception as error:
            self._fail(f"initialisation failed: {error!r}")
        self._parameters_changed = False
        self._phase = STEPPING

    def do_step(self, current_time, step_size):
        try:
            if step_size != self._now.size and not self._begin(step_size):
                return False
            status = self._again()
            self._now.stale = False
            return not status or self._stop(status, current_time)
        except Exception as error:
            self._failure, self._now.size = (
                f"step from {current_time} s failed: {error!r}",
                math.nan,
            )
        return self._discard(self._failure)

    def _stop(self, status, time):
        """Discard a step that left a state without a finite value, with all that may follow."""
        self._failure, self._now.size = self._describe_divergence(status - 1, time), math.nan
        return self._discard(self._failure)

    def _begin(self, step_size):
        """Return whether a step may have this size, now that something is not as it was in the last one."""
        if self._failure is not None:
            return self._discard(self._failure)
        if self._phase != STEPPING:
            return self._discard(
                "fmi2DoStep is allowed only between initialisation and fmi2Terminate"
            )
        longest = MOST_PARTS * self._z[self._internal_step]
        if not 0.0 < step_size <= longest:
            return self._discard(
                f"communication step size {step_size!r} s; it must exceed 0 and be at most {longest:g} s"
            )
        if self._parameters_changed:
            self._check_requirements()
            self._parameters_changed = False
            if self._failure is not None:
                return self._discard(self._failure, reported=True)
        parts = max(1, math.ceil(step_size / self._z[self._internal_step] - 1e-9))
        if self._of != (step_size, parts):
            self._of, self._again = (step_size, parts), self._advance(step_size / parts, parts)
        self._now.size, self._now.part, self._now.parts = step_size, step_size / parts, parts
        return True

    def terminate(self):
        self._phase, self._now.size = TERMINATED, math.nan

    def _describe_divergence(self, state, time):
        inputs = range(self._first_input, self._first_state)
        bad = [self._names[i] for i in inputs if not math.isfinite(self._z[i])]
        cause = f"input {', '.join(bad)} is not a finite number" if bad else "the solution diverges"
        return f"state {self._names[self._first_state + state]} is no longer finite after t = {time:.6g} s: {cause}"

    def _refresh(self):
        if self._phase < STEPPING and self._parameters_changed:
            self._kernel.initialise(*self._arguments)
            self._parameters_changed = False
        elif self._phase == STEPPING and self._parameters_changed:
            # before partners see what follows from values that cannot be used
            self._check_requirements()
            self._parameters_changed = False
        self._kernel.outputs(*self._arguments)
        self._now.stale = False

    def get_real(self, vrs):
        try:
            if self._now.stale:
                self._refresh()
                return self.get_real(vrs)  # quick, unless derivatives are asked for
            if vrs and max(vrs) >= self._first_derivative:
                self._kernel.derivatives(*self._arguments)
            if (
                vrs and min(vrs) < 0
            ):  # references above 2**31 arrive so, and Python would count from the end
                raise IndexError("there is no such value reference")
            z = self._z
            return [z[reference] for reference in vrs]
        except Exception as error:
            self._fail(f"reading value references {list(vrs)} failed: {error!r}")
            return [math.nan] * len(vrs)

    def set_real(self, vrs, values):
        try:
            for reference, value in zip(vrs, values):
                if self._first_input <= reference < self._first_state:
                    self._z[reference] = value
                else:
                    self._set_guarded(reference, value, "Real")
            self._now.stale = True
        except Exception as error:
            self._fail(f"setting value references {list(vrs)} failed: {error!r}")

    # for what the functions in C leave to them
    _step, _get_real, _set_real = do_step, get_real, set_real

    def get_integer(self, vrs):
        return self._get_discrete(vrs, "Integer", int)

    def get_boolean(self, vrs):
        return self._get_discrete(vrs, "Boolean", bool)

    def _get_discrete(self, vrs, kind, convert):
        try:
            if all(0 <= r < self._first_calculated and self._parameters[r][0] == kind for r in vrs):
                return [convert(self._z[reference]) for reference in vrs]
            self._fail(f"value references {list(vrs)}: not all of them are of type {kind}")
        except Exception as error:
            self._fail(f"reading value references {list(vrs)} failed: {error!r}")
        return [convert(0)] * len(vrs)

    def set_integer(self, vrs, values):
        self._set_discrete(vrs, values, "Integer")

    def set_boolean(self, vrs, values):
        self._set_discrete(vrs, values, "Boolean")

    def _set_discrete(self, vrs, values, kind):
        try:
            for reference, value in zip(vrs, values):
                self._set_guarded(reference, float(value), kind)
            self._now.stale = True
        except Exception as error:
            self._fail(f"setting value references {list(vrs)} failed: {error!r}")

    def get_string(self, vrs):
        self._fail("this FMU has no String variables")
        return [""] * len(vrs)

    def set_string(self, vrs, values):
        self._fail("this FMU has no String variables")

    def _set_guarded(self, reference, value, kind):
        """Set a parameter within its bounds, or a state of a running instance (our extension of FMI)."""
        if 0 <= reference < self._first_calculated:
            self._set_parameter(reference, value, kind)
        elif self._first_state <= reference < self._first_output and kind == "Real":
            if self._phase != STEPPING:
                self._fail(
                    f"state {self._names[reference]} can be set only after initialisation, which computes it"
                )
            self._z[reference] = value
        elif 0 <= reference < len(self._names):
            self._fail(f"{self._names[reference]} is computed by the FMU and cannot be set")
        else:
            self._fail(f"there is no variable with value reference {reference}")

    def _set_parameter(self, reference, value, kind):
        name = self._names[reference]
        declared, minimum, maximum, tunable = self._parameters[reference]
        if kind != declared:
            self._fail(f"parameter {name} is of type {declared}, not {kind}")
        elif self._phase >= STEPPING and not tunable:
            self._fail(
                f"parameter {name} is fixed; it can be set only before the end of initialisation"
            )
        elif not math.isfinite(value):
            self._fail(f"parameter {name} = {value}; it must be a finite number")
        elif minimum is not None and value < minimum:
            self._fail(f"parameter {name} = {value:g}; it must be at least {minimum:g}")
        elif maximum is not None and value > maximum:
            self._fail(f"parameter {name} = {value:g}; it must be at most {maximum:g}")
        else:
            self._z[reference] = value
            self._parameters_changed = True
            self._now.size = math.nan  # internal_step may be what changed

    def _get_fmu_state(self):
        """Everything that this instance is, as bytes: identity, phase, variables."""
        if self._now.stale and self._phase < STEPPING:
            self.get_real([])
        check_again = self._parameters_changed or self._failure is not None
        return self._identity + bytes((self._phase, check_again)) + bytes(self._z)

    def _set_fmu_state(self, state):
        if len(state) != 18 + ctypes.sizeof(self._z) or state[:16] != self._identity:
            self._fail("the FMU state to restore was not saved by this FMU")
            return
        self._phase, self._parameters_changed = state[16], bool(state[17])
        ctypes.memmove(self._z, state[18:], ctypes.sizeof(self._z))
        self._now.stale, self._now.size, self._failure = True, math.nan, None

    @staticmethod
    def _fmu_state_to_bytes(state):
        return state

    @staticmethod
    def _fmu_state_from_bytes(state):
        return bytes(state)
