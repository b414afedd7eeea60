"""A plant of two branches, and models of it in Python: what is asked and told of them needs no FMU and no run."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd

from orchestrator.devices.fmi.description import VariableInfo
from orchestrator.studies.validation.device import Played, PlayedDevice
from orchestrator.studies.validation.record import PortBases
from orchestrator.studies.validation.study import (
    GivenRecording,
    ValidationRequest,
    validate_device,
)
from orchestrator.studies.validation.view import Validation

RATING = 450.0  # [MVA]
INTERVAL = 4e-3  # between samples [s]
TIMES = INTERVAL * np.arange(750)
BEGIN = 1.0  # of the event [s]
START = 0.5 + 0.1j  # power before the event [pu]
NOISE = 1e-4  # of P and Q [pu]


LEAST = {"K": -5.0, "X": 0.05}  # of the model's numbers


@cache
def course():
    """A voltage [pu] that falls by 4 % and swings at 1.5 Hz, with little damping, about its new value."""
    since = np.maximum(TIMES - BEGIN, 0.0)
    swing = 0.03 * np.exp(-0.6 * since) * np.sin(2 * np.pi * 1.5 * since)
    return 1 - 0.04 * (TIMES >= BEGIN) + swing


def behind(values, seconds):
    """Values behind a lag of the first order."""
    stays = np.exp(-INTERVAL / seconds)
    weights = (1 - stays) * stays ** np.arange(len(values))
    return values[0] + np.convolve(weights, values - values[0])[: len(values)]


def answer(moved, enabled=True, K=2.0, X=0.4):
    """P and Q [pu] of a voltage that moved: a damper of gain K, which may be off, and a reactance X in a lag's loop."""
    damper = K * enabled * (moved - behind(moved, 0.3))
    return START + damper - behind(moved, 0.05) / X * (0.4 - 1j)


@dataclass(frozen=True)
class MadeDevice(PlayedDevice):
    """A model that answers by the formula. ``over``: the limit that it lacks and is above, if it is."""

    over: object = None
    refuses: str = ""  # a parameter that it cannot be given, or P_0 if it only feeds
    error: Exception | None = None  # with which it refuses

    def play(self, recording, start):
        if self.refuses in self.values or (self.refuses == "P_0" and start.power.real < 0):
            raise self.error
        given = {name: x for name, x in self.values.items() if name in ("enabled", "K", "X")}
        moved = np.abs(recording.voltage) - abs(start.voltage)
        power = start.power - START + answer(moved, **given)
        return Played(power, 0.5, start.power, still=True, over_limit=self.over)


def model(name="made", rating=RATING, more=None, **values):
    """A model with values; ``S_n`` among them tells its rating."""
    starts = {"S_n": (rating, "Real"), "f_n": (50.0, "Real"), "enabled": (True, "Boolean")}
    starts |= {"K": (2.0, "Real"), "X": (0.4, "Real")}
    variables = {
        key: VariableInfo(key, k, kind, "parameter", "fixed", "pu", start, LEAST.get(key), None, "")
        for k, (key, (start, kind)) in enumerate(starts.items())
    } | {
        key: VariableInfo(key, 100 + k, "Real", of, "continuous", "pu", 0.0, None, None, "")
        for k, (key, of) in enumerate(
            {"v_re": "input", "v_im": "input", "i_re": "output", "i_im": "output"}.items()
        )
    }
    description = SimpleNamespace(path=Path(f"{name}.fmu"), variables=variables, model_name=name)
    return MadeDevice(
        name, description, values, rating, 50.0, INTERVAL, isolated=True, **more or {}
    )


def recorded(power=None, noise=NOISE, noise_q=None, rating=RATING, seed=1):
    """A recording of a plant whose power [pu] this is, at the made voltage; ``noise_q``: of Q, if it has another."""
    power = answer(course() - 1) if power is None else power
    random = np.random.default_rng(seed).standard_normal((3, len(TIMES)))
    columns = {
        "v_pu": course() + 1e-6 * random[2],
        "angle_deg": 1e-3 * random[2],
        "p_mw": rating * (power.real + noise * random[0]),
        "q_mvar": rating * (power.imag + (noise_q or noise) * random[1]),
    }
    return pd.DataFrame(columns, index=pd.Index(TIMES, name="time")).to_xarray()


def validated(device, *recordings, report=lambda text: None, **more):
    """What `gfor.validate` gives of a made model; ``report`` is told what is being done."""
    given = [GivenRecording(one, f"rec{k + 1}") for k, one in enumerate(recordings)]
    bases = PortBases(device.rating, 50.0, average=0.0)
    return Validation(validate_device(ValidationRequest(device, given, bases, **more), report))
