"""Hosts of a control DLL: one in Python by ctypes, and the circuit that the data sheet describes."""

import ctypes
import re
import subprocess
from pathlib import Path

import numpy as np
from scipy.linalg import expm

from fmus.control_dll.export import with_values
from fmus.toolchain.native_fmu import NativeFmu
from fmus.vendor_dll.interface import DATA_TYPES, layout
from fmus.vendor_dll.memory import LocalLibrary
from fmus.vendor_dll.reading import read_interface

HOST = Path(__file__).with_name("host") / "host.c"
STEP = 2e-5
"""Sample time, and communication step of the FMU [s]."""

UNITS = {"mH": 1e-3, "uF": 1e-6, "ohm": 1.0}
TURN = np.exp(-2j * np.pi / 3 * np.arange(3))


class _Instance(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("inputs", "outputs", "parameters")),
        *(("time", ctypes.c_double), ("mode", ctypes.c_uint8)),
        *((name, ctypes.c_char_p) for name in ("error", "message")),
        *((name, ctypes.c_void_p) for name in ("ints", "floats", "doubles")),
    )


class ControlHost:
    """One instance of a DLL. ``call`` gives the returned number; ``error`` is the DLL's last word."""

    def __init__(self, path, mode=1, **values):
        self.library = ctypes.CDLL(str(path))
        info = self.interface = read_interface(LocalLibrary(path))
        self.inputs, self.outputs = np.zeros(len(info.inputs)), np.zeros(len(info.outputs))
        self.ints, self.doubles = np.zeros(info.states[0], np.int32), np.zeros(info.states[2])
        laid = layout(info.parameters)
        self._at = {place.name: place for place in laid.places}
        self._parameters = np.zeros(laid.size, np.uint8)
        for row in info.parameters:
            self.set(row.name, row.default)
        for name, value in values.items():
            self.set(name, value)
        self._buffers = (self.inputs, self.outputs, self._parameters, self.ints, self.doubles)
        at = [buffer.ctypes.data for buffer in self._buffers]
        self.instance = _Instance(*at[:3], 0.0, mode, b"", b"", at[3], None, at[4])
        self._outputs = self.library.Model_Outputs
        self._pointer = ctypes.byref(self.instance)

    def set(self, name, value):
        place = self._at[name]
        kind = np.int32 if DATA_TYPES[place.row.data_type].kind == "Integer" else np.float64
        size = DATA_TYPES[place.row.data_type].size
        self._parameters[place.offset : place.offset + size] = np.array([value], kind).view(
            np.uint8
        )

    def call(self, name, time=0.0):
        self.instance.time = time
        return getattr(self.library, f"Model_{name}")(self._pointer)

    def sample(self, inputs):
        """Outputs of a sample."""
        self.inputs[:] = inputs
        assert self._outputs(self._pointer) == 0, self.error
        return self.outputs.copy()

    @property
    def error(self):
        return self.instance.error.decode()


def elements(sheet):
    """Values of the circuit in a data sheet's text [H, F, ohm], by symbol."""
    rows = re.findall(r"^\| (\w+) \| [^|]+ \| ([\d.e+-]+) (mH|uF|ohm) \|", sheet, re.MULTILINE)
    return {symbol: float(value) * UNITS[unit] for symbol, value, unit in rows}


class Circuit:
    """The data sheet's circuit in three phases at a stiff bus, exact between two samples while the bridge is held."""

    def __init__(self, e, sample_time, voltage, omega):
        """``voltage`` is the bus's phasor [V, peak of a phase]."""
        L, R, C, D, T, S = (e[name] for name in ("L_c", "R_c", "C_c", "R_cap", "L_t", "R_t"))
        # i_s, u_c, i_g of one phase; the bridge's voltage, held; the bus's, which turns
        a = np.zeros((5, 5), complex)
        a[0] = [-(R + D) / L, -1 / L, D / L, 1 / L, 0]
        a[1] = [1 / C, 0, -1 / C, 0, 0]
        a[2] = [D / T, 1 / T, -(D + S) / T, 0, -1 / T]
        a[4, 4] = 1j * omega
        self._turn, self.step, self.D = a, expm(a * sample_time), D
        self.v, self.omega = voltage, omega
        self.x = np.zeros((5, 3), complex)

    def begin(self, power):
        """The steady state in which three phases take this power [VA] into the bus."""
        e = -self._turn[:3, :3] + 1j * self.omega * np.eye(3)
        i_g = 2 / 3 * np.conj(power / self.v)
        # v_c is the unknown: the currents are linear in it and in the bus voltage
        response = np.linalg.solve(e, self._turn[:3, 3:])
        bridge = (i_g - response[2, 1] * self.v) / response[2, 0]
        self.x[:3] = (response @ [bridge, self.v])[:, None] * TURN
        self.x[4] = self.v * TURN

    def measured(self):
        """u [kV], i_s and i_g [kA] of the three phases."""
        i_s, u_c, i_g = self.x[:3].real
        return np.concatenate([u_c + self.D * (i_s - i_g), i_s, i_g]) / 1e3

    def advance(self, bridge):
        """One sample time with the bridge's voltages [kV] held."""
        self.x[3] = np.asarray(bridge) * 1e3
        self.x = self.step @ self.x

    def power(self):
        """Into the bus [VA]."""
        i, e = self.x[2].real, self.x[4].real
        i_clarke, e_clarke = (2 / 3 * np.sum(f * np.conj(TURN)) for f in (i, e))
        return 1.5 * e_clarke * np.conj(i_clarke)


def driven(call, drive, folder, width=8, environment=None):
    """What the host in C wrote and said."""
    (folder / "in.bin").write_bytes(np.ascontiguousarray(drive).tobytes())
    words = [str(word) for word in call]
    words[words.index("IN")], words[words.index("OUT")] = (
        str(folder / "in.bin"),
        str(folder / "out.bin"),
    )
    done = subprocess.run(
        words, capture_output=True, text=True, check=False, timeout=300, env=environment
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return np.frombuffer((folder / "out.bin").read_bytes()).reshape(-1, width), done.stdout


def fmu_call(part, values, folder, platform="linux64"):
    """Words for the host in C, to drive the control part's FMU."""
    model = with_values(part, values, STEP).model
    recipe = NativeFmu(model)
    members = recipe.contents((platform,))
    (name,) = (name for name in members if name.startswith("binaries/"))
    library = folder / Path(name).name
    library.write_bytes(members[name])
    guid = members["modelDescription.xml"].decode().split('guid="')[1].split('"')[0]
    at = model.value_references
    ports = [len(model.inputs), at["u_a"], len(model.outputs), at["v_a"]]
    return ["fmu", library, "IN", "OUT", guid, repr(STEP), *ports], model
