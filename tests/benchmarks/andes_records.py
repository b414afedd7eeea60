"""Exciters, stabilisers, governors and compensators in ANDES: ``python -m tests.benchmarks.andes_records``.

Needs the extra ``peers``; writes ``andes_records.json``. One machine (GENROU) at an infinite bus; eigenvalues in rad/s,
of a pair the upper one. Where the source depends on the terminal (IEEET3, ESST3A) ANDES' eigenvalues hold it constant,
so the voltage after a step of the reference is compared. Its measurement of a bus' frequency is given the filter of
PSS/E's, and its other lag is left out. In ANDES 2.0.0 EXAC2, ESDC2A and EXDC2 regulate the voltage
itself, without T_R, which is 0 here; EXAC2's reference at the start has K_L for K_H, so they are equal here;
IEEEVC leaves the voltage control open, so that it is not compared. `tests.models.test_andes_records` has
ours from the same records. Knows nothing of our models.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

PLACE = Path(__file__).with_name("andes_records.json")
FREQUENCY, RATING = 60.0, 100.0  # Hz, MVA
VOLTAGES, POWER = (
    (1.0, 1.02),
    0.8,
)  # of the infinite bus and the machine's, and the machine's power [pu]
R, X = 0.01, 0.3  # of the line between them [pu]
MACHINE = "8.0 0.03 0.4 0.05 6.175 0.0 1.8 1.7 0.3 0.55 0.25 0.2 0 0"
"""GENROU's record."""

_NAMES = (
    "Td10",
    "Td20",
    "Tq10",
    "Tq20",
    "M",
    "D",
    "xd",
    "xq",
    "xd1",
    "xq1",
    "xd2",
    "xl",
    "S10",
    "S12",
)

SEXS = "TATB=0.1 TB=10 K=100 TE=0.1 EMIN=-9 EMAX=9"
CURVE = "E1=2 SE1=0.1 E2=3 SE2=0.4"
RECORDS: dict[str, tuple[str, ...]] = {
    "EXAC2": (
        "EXAC2 TR=0 TB=2 TC=0.5 KA=80 TA=0.02 VAMAX=50 VAMIN=-50 KB=3 VRMAX=50 VRMIN=-50 TE=0.8 KL=0.4 KH=0.4 "
        f"KF=0.03 TF=1 KC=0.2 KD=0.3 KE=1 VLR=99 {CURVE}",
    ),
    "ESDC2A": (
        f"ESDC2A TR=0 KA=40 TA=0.1 TB=1 TC=0.2 VRMAX=9 VRMIN=-9 KE=1 TE=0.5 KF=0.1 TF1=0.9 Switch=0 {CURVE}",
    ),
    "EXDC2": (
        f"EXDC2 TR=0 KA=40 TA=0.1 TB=1 TC=0.2 VRMAX=9 VRMIN=-9 KE=1 TE=0.5 KF1=0.1 TF1=0.9 Switch=0 {CURVE}",
    ),
    "AC8B": (
        "AC8B TR=0.02 kP=20 kI=5 kD=2 Td=0.1 VPMAX=99 VPMIN=-99 VRMAX=50 VRMIN=0 VFEMAX=99 VEMIN=0 TA=0.02 "
        f"KA=1.2 TE=1.1 KC=0.2 KD=0.3 KE=1 {CURVE}",
    ),
    "ESAC5A": (
        f"ESAC5A TR=0.02 KA=60 TA=0.05 VRMAX=20 VRMIN=-20 KE=1 TE=0.5 KF=0.04 TF1=0.7 TF2=0.9 TF3=0.3 {CURVE}",
    ),
    "SEXS, ST2CUT": (
        f"SEXS {SEXS}",
        "ST2CUT MODE=1 busr=0 MODE2=3 busr2=0 K1=8 K2=0.4 T1=0.02 T2=0.03 T3=2 T4=1.5 T5=0.2 T6=0.03 T7=0.1 T8=0.02 "
        "T9=0.3 T10=0.5 LSMAX=0.3 LSMIN=-0.3 VCU=0.5 VCL=-0.5",
    ),
    "SEXS, IEEEST of the power": (
        f"SEXS {SEXS}",
        "IEEEST MODE=3 busr=0 A1=0.06 A2=0.0017 A3=0.02 A4=0.001 A5=0.03 A6=0.001 T1=0.2 T2=0.05 T3=0.1 T4=0.03 T5=1.4 "
        "T6=1.1 KS=-0.5 LSMAX=0.3 LSMIN=-0.3 VCU=0 VCL=0",
    ),
    "SEXS, IEEEST of the frequency": (
        f"SEXS {SEXS}",
        "IEEEST MODE=2 busr=0 A1=0.06 A2=0.0017 A3=0.02 A4=0.001 A5=0.03 A6=0.001 T1=0.2 T2=0.05 T3=0.1 T4=0.03 T5=1.4 "
        "T6=1.1 KS=6 LSMAX=0.3 LSMIN=-0.3 VCU=0 VCL=0",
    ),
    "SEXS, ST2CUT of voltage and frequency": (
        f"SEXS {SEXS}",
        "ST2CUT MODE=5 busr=0 MODE2=2 busr2=0 K1=-0.3 K2=7 T1=0.02 T2=0.03 T3=2 T4=1.5 T5=0.2 T6=0.03 T7=0.1 T8=0.02 "
        "T9=0.3 T10=0.5 LSMAX=0.3 LSMIN=-0.3 VCU=0.5 VCL=-0.5",
    ),
    "SEXS, IEESGO": (
        f"SEXS {SEXS}",
        "IEESGO T1=0.12 T2=0.3 T3=0.5 T4=0.25 T5=7 T6=0.4 K1=20 K2=0.7 K3=0.4 PMAX=1.5 PMIN=0",
    ),
}
"""By what is compared: records with ANDES' names of the parameters, in the order of PSS/E's records."""

RUNS: dict[str, tuple[str, ...]] = {
    "IEEET3": (
        "IEEET3 TR=0.02 KA=20 TA=0.05 VRMAX=20 VRMIN=-20 TE=0.5 KF=0.05 TF=0.8 KP=3 KI=1.2 VBMAX=20 KE=0.8",
    ),
    "ESST3A": (
        "ESST3A TR=0.02 VIMAX=0.8 VIMIN=-0.8 KM=7.9 TC=1 TB=6 KA=80 TA=0.05 VRMAX=20 VRMIN=-20 KG=0.8 KP=4 "
        "KI=1.1 VBMAX=18 KC=0.2 XL=0.1 VGMAX=9 THETAP=20 TM=0.4 VMMAX=3 VMMIN=0",
    ),
}
"""Those of which the machine's voltage after a step of the reference is compared."""

GOVERNORS = ("IEESGO",)
STEP_OF_REFERENCE, UNTIL, EVERY = 0.01, 5.0, 0.1  # pu, and s after the step
_BEFORE = 1.0  # s before it
_FREQUENCY_POLES = (
    -50.0,
    -10.0,
)  # of the measurement of a frequency that ANDES adds to a stabiliser [rad/s]

_FREQUENCY, _FILTER = 2, 0.04  # a stabiliser's signal, and the filter that PSS/E has for it [s]

_REMOTE = (
    "busr",
    "busr2",
    "Switch",
)  # fields of a record that ANDES has no number for, or takes for a bus


def _system(records: tuple[str, ...]) -> Any:
    """The machine with these records in ANDES, at its power flow."""
    import andes  # noqa: PLC0415 - is not installed everywhere

    andes.config_logger(stream_level=50)
    made = andes.System(no_output=True, default_config=True)
    for bus, voltage in enumerate(VOLTAGES, start=1):
        made.add("Bus", idx=bus, name=str(bus), Vn=230.0, v0=voltage, a0=0.0)
    made.add("Line", idx="L", bus1=1, bus2=2, r=R, x=X, b=0.0, Vn1=230.0, Vn2=230.0, Sn=100.0)
    made.add("Slack", idx=1, bus=1, v0=VOLTAGES[0], a0=0.0, Vn=230.0, Sn=100.0)
    made.add("PV", idx=2, bus=2, v0=VOLTAGES[1], p0=POWER, Vn=230.0, Sn=100.0)
    machine = dict(zip(_NAMES, map(float, MACHINE.split()), strict=True))
    machine |= {"M": 2 * machine["M"], "xq2": machine["xd2"], "ra": 0.0, "S12": 1.0}
    made.add("GENROU", idx="G", bus=2, gen=2, Sn=RATING, Vn=230.0, fn=FREQUENCY, **machine)
    for record in records:
        kind, *given = record.split()
        values: dict[str, Any] = dict(pair.split("=") for pair in given)
        numbers = {name: float(text) for name, text in values.items() if name not in _REMOTE}
        is_exciter = record is records[0]
        at = {"syn": "G"} if is_exciter or kind in GOVERNORS else {"avr": "X"}
        of_frequency = {
            field: "F"
            for number, field in (("MODE", "busf"), ("MODE2", "busf2"))
            if numbers.get(number) == _FREQUENCY
        }
        if of_frequency:
            made.add("BusFreq", idx="F", bus=2, Tf=0.0, Tw=_FILTER)
        made.add(kind, idx="X" if is_exciter else "Y", **at, **of_frequency, **numbers)
    made.setup()
    made.PFlow.run()
    made.TDS.config.criteria = 0
    return made


def modes_in_andes(records: tuple[str, ...]) -> list[complex]:
    """Eigenvalues [rad/s] of the machine with these records, the real ones and the upper of each pair."""
    made = _system(records)
    made.TDS.init()
    made.EIG.run()
    found = sorted((complex(z) for z in made.EIG.mu if z.imag >= 0), key=lambda z: (z.imag, z.real))
    apart = _FREQUENCY_POLES if len(records) > 1 else ()
    return [z for z in found if all(abs(z - pole) > 1e-6 for pole in apart)]


def run_in_andes(records: tuple[str, ...]) -> list[float]:
    """Voltage of the machine's bus [pu] from a step of the reference on."""
    made = _system(records)
    config = made.TDS.config
    config.fixt, config.tstep, config.no_tqdm, config.tf = 1, 0.001, 1, _BEFORE
    made.TDS.run()
    exciter = getattr(made, records[0].split()[0])
    exciter.vref0.v[0] += STEP_OF_REFERENCE
    config.tf = _BEFORE + UNTIL
    made.TDS.run()
    instants = _BEFORE + EVERY * np.arange(round(UNTIL / EVERY) + 1)
    voltage = np.array(made.dae.ts.y)[:, made.Bus.v.a[1]]
    return [float(v) for v in np.interp(instants, np.array(made.dae.ts.t), voltage)]


def main() -> None:
    import andes  # noqa: PLC0415 - as above

    modes = {
        name: [[round(z.real, 6), round(z.imag, 6)] for z in modes_in_andes(records)]
        for name, records in RECORDS.items()
    }
    runs = {name: [round(v, 7) for v in run_in_andes(records)] for name, records in RUNS.items()}
    found = {"andes": andes.__version__, "modes": modes, "runs": runs}
    PLACE.write_text(json.dumps(found) + "\n", "utf-8")


if __name__ == "__main__":
    main()
