"""Reference trajectories of the FMU folders, integrated without any FMU.

``python -m tests.support.make_references [MODEL …]`` writes them, all or those of the models that are named.

The models' CasADi equations are integrated by SciPy's Radau method (rtol 1e-10, atol 1e-12), from their
steady state, with inputs that step once.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from fmus.toolchain.catalogue import build_model
from tests.support.written_out import written_out

ROOT = Path(__file__).parents[2]
STEP_TIME, STOP_TIME, INTERVAL = 0.01, 0.3, 0.002


@dataclass(frozen=True)
class Reference:
    """What a reference trajectory is of: a model, its parameters, its inputs before and after the step."""

    model: str
    file: str
    parameters: dict[str, float]
    before: dict[str, float]
    after: dict[str, float]
    outputs: tuple[str, ...]

    @property
    def path(self) -> Path:
        return ROOT / self.file


_DIP = 0.99 * np.exp(0.5j * np.pi / 180)  # small enough to leave the current limit alone
_BUS = ({"v_re": 1.0, "v_im": 0.0}, {"v_re": float(_DIP.real), "v_im": float(_DIP.imag)})
_FOLDER = "fmus/synchronous_generator"
_GENERATOR = ("i_re", "i_im", "omega", "delta", "v_t", "E_fd", "P_m")
_EXACT = {"machine.exact_conversion": 1.0}  # one generator shows the other conversion
_FROM_INVERTER = {
    "inverter.V_most": 545.8,
    "inverter.drop": 25.43,
    "inverter.v": 1.0,
    "inverter.beyond": 0.0,
}
_INFEED = {"i_re": 13.5, "i_im": 0.0}
REFERENCES = (
    Reference(
        "gfor",
        "gfor_fmu/reference.csv",
        {"P_0": 0.9, "Q_0": 0.05, "pod_p.enabled": 1.0, "pod_q.enabled": 1.0},
        *_BUS,
        ("i_re", "i_im", "omega", "u", "delta_p_pod", "delta_q_pod"),
    ),
    Reference(
        "gfl",
        "fmus/grid_following/reference.csv",
        {"P_0": 0.9, "Q_0": 0.05, "frequency_droop.enabled": 1.0},
        *_BUS,
        ("i_re", "i_im", "omega", "u", "i_s", "current_demand"),
    ),
    Reference(
        "gfl_phasor",
        "fmus/grid_following/reference_phasor.csv",
        {"P_0": 0.9, "Q_0": 0.05, "frequency_droop.enabled": 1.0},
        *_BUS,
        ("i_re", "i_im", "e_re", "e_im", "omega", "u", "i_s"),
    ),
    Reference(
        "gfl_l2ep",
        "fmus/gfl_l2ep/reference.csv",
        {"P_0": 0.8, "Q_0": 0.05},
        *_BUS,
        ("i_re", "i_im", "omega", "u_c", "i", "current_demand"),
    ),
    Reference(
        "gfl_l2ep_phasor",
        "fmus/gfl_l2ep/reference_phasor.csv",
        {"P_0": 0.8, "Q_0": 0.05},
        *_BUS,
        ("i_re", "i_im", "e_re", "e_im", "omega", "u_c", "i"),
    ),
    Reference(
        "external_grid",
        "fmus/external_grid/reference.csv",
        {"S_n": 17700.0},
        *_BUS,
        ("i_re", "i_im", "p", "q"),
    ),
    Reference(
        "static_generation",
        "fmus/static_generation/reference.csv",
        {"P_0": 0.9, "Q_0": 0.05},
        *_BUS,
        ("i_re", "i_im", "p", "q"),
    ),
    Reference(
        "static_generation_phasor",
        "fmus/static_generation/reference_phasor.csv",
        {"P_0": 0.9, "Q_0": 0.05},
        *_BUS,
        ("i_re", "i_im", "e_re", "e_im"),
    ),
    Reference(
        "regfm_a1_phasor",
        "fmus/regfm_a1/reference.csv",
        {"P_0": 0.9, "Q_0": 0.05},
        *_BUS,
        ("i_re", "i_im", "e_re", "e_im", "omega", "E_droop"),
    ),
    Reference(
        "regfm_b1_phasor",
        "fmus/regfm_b1/reference.csv",
        {"P_0": 0.6, "Q_0": 0.05},
        *_BUS,
        ("i_re", "i_im", "e_re", "e_im", "omega", "E_inner"),
    ),
    Reference(
        "regfm_c1_phasor",
        "fmus/regfm_c1/reference.csv",
        {"P_0": 0.6, "Q_0": 0.05, "dbVL1": 0.0, "dbVH1": 0.0},
        *_BUS,
        ("i_re", "i_im", "e_re", "e_im", "omega", "E_inner", "P_forming"),
    ),
    Reference(
        "regca1_repca1_phasor",
        "fmus/wecc_renewable/reference.csv",
        {"P_0": 0.8, "Q_0": 0.05, "plant.Fflag": 1.0, "plant.RefFlag": 1.0},
        *_BUS,
        ("i_re", "i_im", "e_re", "e_im", "I_p_fed", "I_q_fed"),
    ),
    Reference(
        "csvgn1_phasor",
        "fmus/static_var/reference.csv",
        {"Q_0": 0.15},
        *_BUS,
        ("i_re", "i_im", "e_re", "e_im", "B"),
    ),
    Reference(
        "csvgn5_phasor",
        "fmus/static_var/reference_csvgn5.csv",
        {"Q_0": 0.15},
        *_BUS,
        ("i_re", "i_im", "e_re", "e_im", "B"),
    ),
    Reference(
        "svsmo1_phasor",
        "fmus/static_var/reference_svsmo1.csv",
        {"Q_0": 0.15},
        *_BUS,
        ("i_re", "i_im", "e_re", "e_im", "B"),
    ),
    Reference(
        "lcc_rectifier_phasor",
        "fmus/dc_line/reference_rectifier.csv",
        {},
        *(bus | _FROM_INVERTER for bus in _BUS),
        ("i_re", "i_im", "e_re", "e_im", "inverter_I", "V_inverter", "alpha"),
    ),
    Reference(
        "lcc_inverter_phasor",
        "fmus/dc_line/reference_inverter.csv",
        {},
        *(bus | {"I_dc": 2.0, "V_dc": 490.0} for bus in _BUS),
        ("i_re", "i_im", "e_re", "e_im", "V_most", "v", "gamma"),
    ),
    Reference(
        "cstatt_phasor",
        "fmus/static_var/reference_cstatt.csv",
        {"Q_0": 0.15},
        *_BUS,
        ("i_re", "i_im", "e_re", "e_im", "I"),
    ),
    Reference(
        "dera1_phasor",
        "fmus/distributed_generation/reference.csv",
        {"P_0": 0.8, "Q_0": 0.05, "Kqv": 5.0, "dbd1": -0.001, "dbd2": 0.001},
        *_BUS,
        ("i_re", "i_im", "e_re", "e_im", "I_p_fed", "I_q_fed", "share"),
    ),
    Reference(
        "pvd1_phasor",
        "fmus/distributed_generation/reference_pvd1.csv",
        {"P_0": 0.8, "Q_0": 0.05, "V0": 0.999, "V1": 1.001, "Dqdv": 5.0},
        *_BUS,
        ("i_re", "i_im", "e_re", "e_im", "I_p_fed", "I_q_fed", "share"),
    ),
    Reference(
        "induction_motor_phasor",
        "fmus/induction_machine/reference.csv",
        {"P_0": -0.8, "Q_0": -0.35, "R2": 0.05, "X2": 0.1, "E": 2.0},
        *_BUS,
        ("i_re", "i_im", "e_re", "e_im", "speed", "T_e", "T_L"),
    ),
    Reference(
        "synchronous_generator_ac4a",
        f"{_FOLDER}/reference_ac4a.csv",
        {"P_0": 0.8, **_EXACT},
        *_BUS,
        _GENERATOR,
    ),
    Reference(
        "synchronous_generator_st1",
        f"{_FOLDER}/reference_st1.csv",
        {"P_0": 0.78},
        *_BUS,
        _GENERATOR,
    ),
    Reference(
        "synchronous_generator_st4b",
        f"{_FOLDER}/reference_st4b.csv",
        {"P_0": 0.9},
        *_BUS,
        _GENERATOR,
    ),
    Reference(
        "gfor_phasor",
        "gfor_fmu/reference_phasor.csv",
        {"P_0": 0.9, "Q_0": 0.05, "pod_p.enabled": 1.0, "pod_q.enabled": 1.0},
        *_BUS,
        ("i_re", "i_im", "e_re", "e_im", "omega", "u", "delta_p_pod", "delta_q_pod"),
    ),
    *(
        Reference(
            f"synchronous_generator_{exciter}_phasor",
            f"{_FOLDER}/reference_{exciter}_phasor.csv",
            {"P_0": P_0, **(_EXACT if exciter == "ac4a" else {})},
            *_BUS,
            (*_GENERATOR, "e_re", "e_im"),
        )
        for exciter, P_0 in (("ac4a", 0.8), ("st1", 0.78), ("st4b", 0.9))
    ),
    Reference(
        "two_area_grid",
        "fmus/grid/reference.csv",
        {"X_L": 0.1},
        {"sg1.i_re": 27.0, "sg2.i_re": 39.0},
        {"sg1.i_re": 26.5, "sg1.i_im": -0.5, "sg2.i_re": 39.0},
        ("bus_2.v_re", "bus_2.v_im", "bus_3.v_re", "bus_3.v_im", "L.p"),
    ),
    Reference(
        "infinite_bus",
        "fmus/infinite_bus/reference.csv",
        {"load.P": 600.0},
        _INFEED,
        {"i_re": 13.0, "i_im": 0.5},
        ("v_re", "v_im", "v", "p", "q"),
    ),
)


def integrate(reference: Reference) -> tuple[list[str], np.ndarray]:
    """Column names and rows: time, inputs held from that time on, outputs."""
    model = written_out(build_model(reference.model))
    p = np.array([reference.parameters.get(v.name, v.start) for v in model.parameters])
    c, x = model.initialise(p)
    names = [v.name for v in model.outputs]
    x, rows = np.array(x).ravel(), []
    times = np.arange(round(STOP_TIME / INTERVAL) + 1) * INTERVAL
    change = round(STEP_TIME / INTERVAL)
    for inputs, span in (
        (reference.before, times[: change + 1]),
        (reference.after, times[change:]),
    ):
        u = np.array([inputs.get(v.name, 0.0) for v in model.inputs])
        solution = solve_ivp(
            lambda t, x, u=u: np.array(model.derivatives(x, u, p, c)).ravel(),
            (span[0], span[-1]),
            x,
            "Radau",
            t_eval=span,
            rtol=1e-10,
            atol=1e-12,
        )
        assert solution.success, solution.message
        x = solution.y[:, -1]
        for time, state in zip(span, solution.y.T, strict=True):
            y = np.array(model.outputs_function(state, u, p, c)).ravel()
            rows.append([time, *u, *(y[names.index(n)] for n in reference.outputs)])
    del rows[change]  # at the step itself the row after it counts
    return ["time", *(v.name for v in model.inputs), *reference.outputs], np.array(rows)


def main(models: list[str]) -> None:
    for reference in REFERENCES:
        if models and reference.model not in models:
            continue
        columns, rows = integrate(reference)
        np.savetxt(
            reference.path, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.12g"
        )


if __name__ == "__main__":
    main(sys.argv[1:])
