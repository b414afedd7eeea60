"""Induction motors in ANDES: ``python -m tests.benchmarks.andes_motors``.

Needs the extra ``peers``; writes ``andes_motors.json``: operating point and eigenvalues [rad/s] of Motor3 behind a line
at a stiff bus. Motor5 is left out: its transient emf does not see the second cage's current, which its circuit has.
ANDES 2.0.0 takes c2 for c3 in the torque's term of the slip's square, so both are equal here. The linear solver is
UMFPACK: with KLU, its default, it ends in a segmentation fault here. `tests.models.test_induction_machine` has ours
with the same data. Knows nothing of our models.
"""

import json
from pathlib import Path
from typing import Any

PLACE = Path(__file__).with_name("andes_motors.json")
FREQUENCY = 60.0  # Hz
R, X = 0.005, 0.05  # of the line [pu]
CIRCUIT = {"rs": 0.013, "xs": 0.067, "rr1": 0.03, "xr1": 0.17, "xm": 3.8, "Hm": 1.5}
MOTORS: dict[str, tuple[str, dict[str, float]]] = {
    "torque of the speed and its square": (
        "Motor3",
        {**CIRCUIT, "c1": 0.0, "c2": 0.35, "c3": 0.35},
    ),
    "with a constant part": ("Motor3", {**CIRCUIT, "rr1": 0.05, "c1": 0.1, "c2": 0.25, "c3": 0.25}),
}


def _at_rest(model: str, values: dict[str, float]) -> Any:
    """Return the motor's system in ANDES, at its power flow."""
    import andes  # noqa: PLC0415 - is not installed everywhere

    andes.config_logger(stream_level=50)
    made = andes.System(no_output=True, default_config=True)
    for bus in (1, 2, 3):
        made.add("Bus", idx=bus, name=str(bus), Vn=230.0, v0=1.0, a0=0.0)
    made.add("Slack", idx=1, bus=1, Vn=230.0, v0=1.0, a0=0.0, Sn=100.0)
    made.add("PV", idx=2, bus=3, v0=1.0, p0=0.1, Vn=230.0, Sn=100.0)
    made.add("PQ", idx="Q", bus=3, p0=0.1, q0=0.0, Vn=230.0)
    ends = {"Vn1": 230.0, "Vn2": 230.0, "Sn": 100.0, "b": 0.0}
    made.add("Line", idx="L", bus1=1, bus2=2, r=R, x=X, **ends)
    made.add("Line", idx="T", bus1=1, bus2=3, r=0.0, x=1e-3, **ends)
    made.add(model, idx="M", bus=2, Sn=100.0, Vn=230.0, fn=FREQUENCY, **values)
    made.setup()
    for routine in (made.PFlow, made.TDS):
        routine.solver.worker = routine.solver.umfpack
        routine.config.linsolve = 1
    made.TDS.config.criteria = 0
    made.PFlow.run()
    return made


def motor_in_andes(model: str, values: dict[str, float]) -> dict[str, Any]:
    """Return slip, power and voltage [pu] of a motor, and its eigenvalues."""
    made = _at_rest(model, values)
    motor = getattr(made, model)
    made.TDS.init()
    made.EIG.run()
    modes = sorted((complex(z) for z in made.EIG.mu), key=lambda z: (z.imag, z.real))
    return {
        "slip": float(motor.slip.v[0]),
        "power": [float(motor.p.v[0]), float(motor.q.v[0])],
        "voltage": [float(made.Bus.v.v[1]), float(made.Bus.a.v[1])],
        "modes": [[z.real, z.imag] for z in modes],
    }


def main() -> None:
    import andes  # noqa: PLC0415 - as above

    found = {name: motor_in_andes(*motor) for name, motor in MOTORS.items()}
    PLACE.write_text(json.dumps({"andes": andes.__version__, **found}) + "\n", "utf-8")


if __name__ == "__main__":
    main()
