"""The published cases in ANDES, another program: ``python -m tests.benchmarks.andes_peers > andes.json``.

Needs the extra ``peers``. Data from `tests.reference.published`, machines of sixth order (GENROU); eigenvalues in
rad/s. Knows nothing of our models. ``andes.json`` is what ANDES 2.0.0 gave.
"""

import json
from typing import Any

import numpy as np

from tests.reference.multi_machine import Commutator, System, Thyristor
from tests.reference.published import (
    KUNDUR_EXCITERS,
    exponential,
    kundur,
    quadratic,
    with_subtransients,
    wscc9,
)


def modes_in_andes(system: System) -> list[complex]:
    """Swings of a system [rad/s], slowest first; loads as the first one's exponent says."""
    import andes  # noqa: PLC0415 - is not installed everywhere

    andes.config_logger(stream_level=40)
    made = andes.System(no_output=True, default_config=True)
    _network(made, system)
    share = dict.fromkeys(("p2p", "p2i", "p2z", "q2q", "q2i", "q2z"), 0.0)
    load = system.loads[0]
    share[("p2p", "p2i", "p2z")[round(load.a)]] = 1.0
    share[("q2q", "q2i", "q2z")[round(load.b)]] = 1.0
    for name, value in share.items():
        setattr(made.PQ.config, name, value)
    made.setup()
    made.PFlow.run()
    made.TDS.config.criteria = 0
    made.TDS.init()
    made.EIG.run()
    found = [complex(z) for z in made.EIG.mu]
    return sorted(
        (z for z in found if 0.3 < z.imag / 6.2832 < 2.5 and -z.real < 0.4 * abs(z)),
        key=lambda z: z.imag,
    )


def _network(made: Any, system: System) -> None:
    flow = system.power_flow()
    for k in range(1, system.buses + 1):
        made.add("Bus", idx=k, name=str(k), Vn=230.0, v0=abs(flow[k - 1]), a0=0.0)
    for n, line in enumerate(system.branches):
        made.add(
            "Line",
            idx=f"L{n}",
            bus1=line.a,
            bus2=line.b,
            r=line.R,
            x=line.X,
            b=line.B,
            Vn1=230.0,
            Vn2=230.0,
            Sn=100.0,
        )
    for bus, B in system.shunts.items():
        made.add("Shunt", idx=f"S{bus}", bus=bus, b=B, Vn=230.0, Sn=100.0)
    for load in system.loads:
        made.add("PQ", idx=f"D{load.bus}", bus=load.bus, p0=load.P, q0=load.Q, Vn=230.0)
    for m in system.machines:
        kind = "Slack" if m.bus == system.slack else "PV"
        made.add(kind, idx=m.bus, bus=m.bus, v0=m.V, p0=m.P, Vn=230.0, Sn=m.base, a0=0.0)
    for m in system.machines:
        made.add(
            "GENROU",
            idx=f"G{m.bus}",
            bus=m.bus,
            gen=m.bus,
            Sn=m.base,
            Vn=230.0,
            fn=system.frequency,
            M=2 * m.H,
            D=m.D,
            ra=m.R_a,
            xl=m.X_l,
            xd=m.X_d,
            xq=m.X_q,
            xd1=m.X_d1,
            xq1=m.X_q1,
            xd2=m.X_d2,
            xq2=m.X_d2,
            Td10=m.T_d10,
            Tq10=m.T_q10,
            Td20=m.T_d20,
            Tq20=m.T_q20,
            S10=m.S_10,
            S12=m.S_12 or 1.0,
        )
        x = system.exciter
        if isinstance(x, Thyristor):
            made.add(
                "EXST1",
                idx=f"X{m.bus}",
                syn=f"G{m.bus}",
                TR=x.T_R,
                KA=x.K_A,
                TA=0.0,
                TB=x.T_B,
                TC=x.T_A,
                KF=0.0,
                TF=1.0,
                KC=0.0,
                VIMAX=99.0,
                VIMIN=-99.0,
                VRMAX=99.0,
                VRMIN=-99.0,
            )
        elif isinstance(x, Commutator):
            made.add(
                "IEEET1",
                idx=f"X{m.bus}",
                syn=f"G{m.bus}",
                TR=x.T_R,
                KA=x.K_A,
                TA=x.T_A,
                KE=x.K_E,
                TE=x.T_E,
                KF=x.K_F,
                TF=x.T_F,
                E1=1.0,
                SE1=exponential(1.0),
                E2=2.0,
                SE2=exponential(2.0),
                VRMAX=99.0,
                VRMIN=-99.0,
            )


def cases() -> dict[str, System]:
    """What is compared."""
    found = {
        f"wscc9, {name}": with_subtransients(wscc9(exponent=exponent, saturation=quadratic))
        for name, exponent in (("impedance", 2.0), ("power", 0.0))
    }
    for name, exciter in KUNDUR_EXCITERS.items():
        if exciter is None or not exciter.K_STAB:
            found |= {
                f"kundur {name}, {load}": kundur(name, active=a)
                for load, a in (("current", 1.0), ("impedance", 2.0))
            }
    return found


def main() -> None:
    import andes  # noqa: PLC0415 - as above

    modes = {
        name: [[round(z.real, 6), round(z.imag, 6)] for z in modes_in_andes(s)]
        for name, s in cases().items()
    }
    print(
        json.dumps({"andes": andes.__version__, "numpy": np.__version__, "modes": modes}, indent=1)
    )


if __name__ == "__main__":
    main()
