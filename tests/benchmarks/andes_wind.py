"""A wind turbine of WTDTA1, WTARA1, WTPTA1 and WTTQA1 in ANDES: ``python -m tests.benchmarks.andes_wind``.

Needs the extra ``peers``; writes ``andes_wind.json``: eigenvalues [1/s] of REGCA1, REECA1 and the four records at an
infinite bus, the real ones and the upper of each pair. In ANDES 2.0.0 both errors of WTTQA1 have the other sign, so
its gains are given the other sign; Freq1 there is an angular frequency; its pitch starts at 0, so that is the
operating point's, within its limits; and its lag of the power's reference is left out. Knows nothing of our models."""

import json
from math import pi
from pathlib import Path
from typing import Any

PLACE = Path(__file__).with_name("andes_wind.json")
R, X = 0.02, 0.2  # of the line to the infinite bus [pu]
POWER, VOLTAGE = 0.6, 1.01  # of the turbine [pu]
LEAST_ANGLE = -5.0  # of the pitch [deg]

CONTROL = {"PFFLAG": 0, "VFLAG": 1, "QFLAG": 0, "PQFLAG": 1, "Trv": 0.02, "Tp": 0.05}
CONTROL |= {"Tiq": 0.03, "Tpord": 0.05, "Imax": 1.3, "Kqp": 0.1, "Kqi": 0.4, "Kvp": 1.0, "Kvi": 30}
SHAFT = {"H": 4.5, "DAMP": 0.3, "Htfrac": 0.85, "Freq1": 1.6, "Dshaft": 1.4}
AERODYNAMICS = {"Ka": 0.007, "Theta0": 0.0}
PITCH = {"Kiw": 25.0, "Kpw": 12.0, "Kic": 3.0, "Kpc": 2.0, "Kcc": 0.1, "Tp": 0.3}
TORQUE = {"Kpp": 3.0, "Kip": 0.6, "Tp": 0.06, "Twref": 20.0, "Temax": 1.2, "Temin": 0.0}
LINE = ((0.2, 0.6), (0.4, 0.74), (0.55, 0.9), (0.8, 1.05))
"""Values by field of the records; power and speed of WTTQA1's line."""

COMPARED = ("WTDTA1", "WTPTA1", "WTTQA1")
"""Records whose equations decide the eigenvalues; at the pitch's start WTARA1 has no slope."""


def _system() -> Any:
    import andes  # noqa: PLC0415 - is not installed everywhere

    andes.config_logger(stream_level=50)
    # without a lag of the power's reference that the record does not have
    made = andes.System(no_output=True, default_config=True, config_option=["REECA1.tpfilt=0"])
    for bus, voltage in ((1, 1.0), (2, VOLTAGE)):
        made.add("Bus", idx=bus, name=str(bus), Vn=230.0, v0=voltage, a0=0.0)
    made.add("Line", idx="L", bus1=1, bus2=2, r=R, x=X, b=0.0, Vn1=230.0, Vn2=230.0, Sn=100.0)
    made.add("Slack", idx=1, bus=1, v0=1.0, a0=0.0, Vn=230.0, Sn=100.0)
    made.add("PV", idx=2, bus=2, v0=VOLTAGE, p0=POWER, Vn=230.0, Sn=100.0)
    made.add(
        "REGCA1",
        idx="G",
        bus=2,
        gen=2,
        Sn=100.0,
        Tg=0.02,
        Rrpwr=999.0,
        Lvplsw=0,
        Brkpt=0.8,
        Zerox=0.4,
        Lvpl1=1.22,
        Volim=1.3,
        Lvpnt1=0.8,
        Lvpnt0=0.4,
        Iolim=-1.3,
        Tfltr=0.02,
        Khv=0.0,
        Iqrmax=999.0,
        Iqrmin=-999.0,
        Accel=0.0,
    )
    made.add(
        "REECA1",
        idx="E",
        reg="G",
        PFLAG=0,
        Vdip=0.8,
        Vup=1.2,
        dbd1=-0.02,
        dbd2=0.02,
        Kqv=0.0,
        Iqh1=1.1,
        Iql1=-1.1,
        QMax=0.8,
        QMin=-0.8,
        VMAX=1.2,
        VMIN=0.8,
        dPmax=999.0,
        dPmin=-999.0,
        PMAX=1.0,
        PMIN=0.0,
        Vref0=0.0,
        Vref1=0.0,
        Iqfrz=0.0,
        Thld=0.0,
        Thld2=0.0,
        Vq1=0.0,
        Iq1=2.0,
        Vq2=0.5,
        Iq2=2.0,
        Vq3=1.0,
        Iq3=2.0,
        Vq4=1.5,
        Iq4=2.0,
        Vp1=0.0,
        Ip1=2.0,
        Vp2=0.5,
        Ip2=2.0,
        Vp3=1.0,
        Ip3=2.0,
        Vp4=1.5,
        Ip4=2.0,
        **CONTROL,
    )
    shaft = SHAFT | {"Freq1": 2 * pi * SHAFT["Freq1"]}
    made.add("WTDTA1", idx="S", ree="E", w0=1.0, **shaft)
    made.add("WTARA1", idx="A", rego="S", Ka=AERODYNAMICS["Ka"], theta0=AERODYNAMICS["Theta0"])
    limits = {"thmax": 27.0, "thmin": LEAST_ANGLE, "dthmax": 10.0, "dthmin": -10.0}
    made.add("WTPTA1", idx="P", rea="A", **PITCH, **limits)
    points = {
        f"{name}{k}": x
        for k, xy in enumerate(LINE, 1)
        for name, x in zip(("p", "sp"), xy, strict=True)
    }
    other_sign = {"Kpp": -TORQUE["Kpp"], "Kip": -TORQUE["Kip"]}
    made.add("WTTQA1", idx="T", rep="P", Tflag=0, **(TORQUE | other_sign), **points)
    made.setup()
    made.PFlow.run()
    made.TDS.config.criteria = 0
    return made


def main() -> None:
    import andes  # noqa: PLC0415 - as above

    made = _system()
    made.TDS.init()
    made.EIG.run()
    found = sorted((complex(z) for z in made.EIG.mu if z.imag >= 0), key=lambda z: (z.imag, z.real))
    q = float(made.REGCA1.Qe.v[0])
    content = {
        "andes": andes.__version__,
        "q": round(q, 8),
        "modes": [[round(z.real, 6), round(z.imag, 6)] for z in found],
    }
    PLACE.write_text(json.dumps(content) + "\n", "utf-8")


if __name__ == "__main__":
    main()
