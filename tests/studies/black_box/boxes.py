"""The converter as a black box, and the exact linear map of it that the measurement never sees."""

import numpy as np
import scipy.linalg

from fmus.toolchain.catalogue import build_model
from orchestrator.devices.fmi.description import read_description
from orchestrator.studies.black_box.bench import Bench
from tests.support.jacobians import jacobians
from tests.support.scenarios import prepare_one

H = 1e-4


def prepared(scenario, native=True):
    """The two-area case; native FMUs run ten times as fast."""
    found = prepare_one("two_area", scenario, {"*.native": native})
    return found


def bench_of(scenario, native=True, **settings):
    plan = prepared(scenario, native).system.components["gfor"]
    start = plan.parameters
    angle = start["theta_0"]
    rest = start["v_0"] * np.array([np.cos(angle), np.sin(angle)])
    return Bench(read_description(plan.description.path), start, rest, step_size=H, **settings)


def continuous(scenario):
    """A, B, C of the converter's equations at the operating point, by CasADi."""
    bench = bench_of(scenario)
    model = build_model("gfor")
    p = np.array([float(bench.parameters.get(v.name, v.start)) for v in model.parameters])
    c, x = model.initialise(p)
    A, B, C, D = (np.array(block) for block in jacobians(model)(x, bench.rest, p, c))
    rows = [[o.name for o in model.outputs].index(name) for name in bench.outputs]
    assert not D[rows].any()
    return A, B, C[rows]


def held(scenario):
    """Step map with inputs held, exactly: what a perfect integrator gives."""
    A, B, C = continuous(scenario)
    n, m = B.shape
    whole = scipy.linalg.expm(H * np.block([[A, B], [np.zeros((m, n + m))]]))
    return whole[:n, :n], whole[:n, n:], C


def runge_kutta(scenario):
    """Step map of one classical Runge-Kutta step of a linear system: what the FMU computes."""
    A, B, C = continuous(scenario)
    X, one = A * H, np.eye(len(A))
    series = one + X / 2 + X @ X / 6 + X @ X @ X / 24
    return one + X @ series, series @ B * H, C


def response(step_map, frequencies):
    A, B, C = step_map
    return np.array(
        [
            C @ np.linalg.solve(np.exp(2j * np.pi * f * H) * np.eye(len(A)) - A, B)
            for f in frequencies
        ]
    )
