"""Recordings of a plant whose parameters are known: the converter behind the two-area system, in a coupled run."""

import numpy as np
import pandas as pd

import orchestrator as gfor
from orchestrator.studies.validation.limits import EXAMPLE
from tests.support.once import computed_once

EVENT = {"time": 1.0, "component": "grid", "type": "load_change", "load": "load_2", "scale": 1.08}
INTERVAL = 1e-3  # between rows [s]
NOISE = {"v_pu": 2e-5, "angle_deg": 1e-3, "p_mw": 0.6, "q_mvar": 0.6}
"""Standard deviations of good instruments, those of the powers as 4e-4 of the rating."""


RECORDED = ["grid.bus_2.v_*", "grid.bus_3.v_*", "gfor.i_*"]
"""What recordings are made of: the voltages of the plant's bus and of its neighbour, and the plant's current."""

WHOLE = 6.0  # length of the run of which shorter ones without changes are the begin [s]


def run(scenario="pod_p", stop=WHOLE, scale=EVENT["scale"], **values):
    """A coupled run through which the load of the other area steps; kept for all tests of a session."""
    unchanged = scale == EVENT["scale"] and not values
    ran = _ran(scenario, WHOLE if unchanged else stop, scale, **values)
    return ran.sel(time=slice(0.0, stop + INTERVAL / 2))


SOLVER = {"record_interval": INTERVAL, "record_filter": "low-pass", "record": RECORDED}


@computed_once
def _ran(scenario, stop, scale, **values):
    case = gfor.load("two_area").with_(
        events=[EVENT | {"scale": scale}],
        solver=SOLVER,
    )
    set_to = {name.replace("__", "."): value for name, value in values.items()}
    return case.scenario(scenario, set_to).run(stop=stop).dataset


@computed_once
def phasor_plant(scale=EVENT["scale"], **values):
    """What a plant of phasors did, whose POD-P has a gain of 120 by default; an EMT one takes ten times as long."""
    solver = {"step_size": "100 us", "record_interval": "1 ms", "record_filter": "low-pass"}
    case = gfor.load("two_area_rms").with_(events=[EVENT | {"scale": scale}], solver=solver)
    own = {"pod_p.K": 120.0} | {name.replace("__", "."): value for name, value in values.items()}
    plant = case.scenario("pod_p", {f"gfor.{name}": value for name, value in own.items()})
    return table(plant.run(stop=3.0).dataset)


def table(dataset, unit="gfor", bus="grid.bus_2"):
    """A recording of a unit as a stranger's CSV has it."""
    v = dataset[f"{bus}.v_re"].values + 1j * dataset[f"{bus}.v_im"].values
    i = dataset[f"{unit}.i_re"].values + 1j * dataset[f"{unit}.i_im"].values
    s = 100 * v * i.conj()
    return pd.DataFrame(
        {
            "time": dataset["time"].values,
            "v_pu": np.abs(v),
            "angle_deg": np.rad2deg(np.unwrap(np.angle(v))),
            "p_mw": s.real,
            "q_mvar": s.imag,
        }
    )


def with_noise(clean, seed=1, **scale):
    """The same with white noise of good instruments."""
    random = np.random.default_rng(seed)
    noisy = clean.copy()
    for name, size in (NOISE | scale).items():
        noisy[name] += size * random.standard_normal(len(clean))
    return noisy


def of_pmu(frame, every=20, mean=40):
    """Means over two periods around each sample, as a PMU gives them."""
    angle = np.unwrap(np.deg2rad(frame.angle_deg))
    smooth = frame.assign(angle_deg=np.rad2deg(angle)).rolling(mean, center=True, min_periods=1)
    return smooth.mean().assign(time=frame.time).iloc[::every]


def written(frame, folder, name="rec.csv"):
    path = folder / name
    frame.to_csv(path, index=False, float_format="%.9g")
    return path


def limits_of_errors(folder):
    """The example's limits without those of a ring-down, which a recording of a few seconds leaves open."""
    errors, _, _ = EXAMPLE.read_text(encoding="utf-8").partition("[ring_down.p]")
    file = folder / "limits.toml"
    file.write_text(errors, encoding="utf-8")
    return file


def waves(frame, kilovolt=230.0):
    """Three instantaneous voltages [kV] and currents [kA] at 50 Hz, as a fault recorder has them, by name."""
    v = frame.v_pu * np.exp(1j * np.deg2rad(frame.angle_deg))
    i = np.conj((frame.p_mw + 1j * frame.q_mvar) / (np.sqrt(3) * kilovolt * v))
    found = {}
    for k, phase in enumerate("abc"):
        turn = np.exp(2j * np.pi * (50 * frame.time - k / 3))
        found[f"v{phase}"] = np.real(kilovolt * np.sqrt(2 / 3) * v * turn)
        found[f"i{phase}"] = np.real(np.sqrt(2) * i * turn)
    return found
