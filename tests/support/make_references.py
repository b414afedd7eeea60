"""Reference trajectories beside the leaflets: ``python -m tests.support.make_references`` makes them anew.

The equations are the models' own CasADi functions; the integration is scipy's Radau with exact
Jacobians and has nothing in common with the integrators inside the FMUs. Inputs are constant between
the steps given here, and integration starts anew at each.

Each file has one row every 2 ms and two at a step of the inputs, one with the inputs and outputs just
before it and one with those just after. So read linearly it is the input signal as well.
"""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from fmus.toolchain.catalogue import build_model
from tests.support.operating_point import OperatingPoint, operating_point

ROOT = Path(__file__).parents[2]
INTERVAL, STEP_TIME, STOP_TIME = 2e-3, 10e-3, 0.3


@dataclass(frozen=True)
class Reference:
    """A model with its parameters, its inputs before and after the step, and the outputs to keep."""

    model: str
    path: Path
    parameters: Mapping[str, float]
    before: Mapping[str, float]
    after: Mapping[str, float]
    outputs: tuple[str, ...]


def _bus(magnitude: float, degrees: float) -> dict[str, float]:
    v = magnitude * np.exp(1j * np.deg2rad(degrees))
    return {"v_re": v.real, "v_im": v.imag}


def _currents(**values: complex) -> dict[str, float]:
    return {f"{port}.i_{part}": getattr(i, f"{name}") for port, i in values.items() for part, name in _PARTS}


_PARTS = (("re", "real"), ("im", "imag"))
_PORT = ("i_re", "i_im", "p", "q")


def _generator(exciter: str, file: str) -> Reference:
    return Reference(
        model=f"synchronous_generator_{exciter}",
        path=ROOT / "fmus/synchronous_generator" / file,
        parameters={"P_0": 0.8, "Q_0": 0.1},
        before=_bus(1.0, 0.0),
        after=_bus(0.97, 2.0),
        outputs=(*_PORT, "omega", "delta", "v_t", "E_fd", "P_m", "T_e"),
    )


REFERENCES = (
    Reference(
        model="gfor",
        path=ROOT / "gfor_fmu/reference.csv",
        parameters={"P_0": 0.9, "pod_p.enabled": True, "pod_q.enabled": True},
        before=_bus(1.0, 0.0),
        after=_bus(0.97, 2.0),
        outputs=(*_PORT, "omega", "delta_p_pod", "delta_q_pod", "u", "i_s"),
    ),
    _generator("st4b", "reference.csv"),
    _generator("st1", "reference_st1.csv"),
    _generator("ac4a", "reference_ac4a.csv"),
    Reference(
        model="two_area_grid",
        path=ROOT / "fmus/grid/reference.csv",
        parameters={},
        before=_currents(sg1=12.5, sg2=40.0, gfor=13.5),  # the loads' own currents at 1 pu: none in the line
        after=_currents(sg1=13 - 1j, sg2=39 + 2j, gfor=14.2 + 0.6j),
        outputs=tuple(f"bus_{k}.{x}" for k in (2, 3) for x in ("v_re", "v_im", "v")) + ("L.p", "L.q"),
    ),
)


def trajectory(
    reference: Reference, method: str = "Radau", rtol: float = 1e-10, atol: float = 1e-12
) -> list[dict[str, float]]:
    """Rows of a reference file, by column name."""
    start = operating_point(build_model(reference.model), reference.parameters).changed(inputs=reference.before)
    before, at_step = _segment(start, 0.0, STEP_TIME, method, rtol, atol)
    after, _ = _segment(at_step.changed(inputs=reference.after), STEP_TIME, STOP_TIME, method, rtol, atol)
    return [
        {"time": time, **dict(zip(_input_names(point), point.u, strict=True))}
        | {name: point.output[name] for name in reference.outputs}
        for time, point in (*before, *after)
    ]


def _input_names(point: OperatingPoint) -> list[str]:
    return [v.name for v in point.model.inputs]


def _segment(
    start: OperatingPoint, begin: float, end: float, method: str, rtol: float, atol: float
) -> tuple[list[tuple[float, OperatingPoint]], OperatingPoint]:
    """Operating points every `INTERVAL` from begin to end, both included, and the last one."""
    times = np.round(np.linspace(begin, end, round((end - begin) / INTERVAL) + 1), 9)
    jacobian = start.model.jacobians()
    solution = solve_ivp(
        lambda t, x: start.changed(states=x).rates,
        (begin, end),
        start.x,
        method=method,
        t_eval=times,
        rtol=rtol,
        atol=atol,
        jac=lambda t, x: np.array(jacobian(x, start.u, start.p, start.c)[0]),
    )
    if not solution.success:
        raise RuntimeError(f"{start.model.name}: {solution.message}")
    points = [start.changed(states=np.ascontiguousarray(x)) for x in solution.y.T]
    return list(zip(times.tolist(), points, strict=True)), points[-1]


def main() -> None:
    """Write all reference files."""
    for reference in REFERENCES:
        rows = trajectory(reference)
        with reference.path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(rows[0])
            writer.writerows([f"{value:.15g}" for value in row.values()] for row in rows)


if __name__ == "__main__":
    main()
