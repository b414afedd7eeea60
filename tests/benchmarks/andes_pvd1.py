"""PVD1 in ANDES beside a machine: ``python -m tests.benchmarks.andes_pvd1``.

Needs the extra ``peers``; writes ``andes_pvd1.json``: by time, the voltage at the plant's bus [pu, rad], the frequency
that it sees [pu], and the currents that it feeds [pu, 100 MVA]. First a coil comes and goes, and lowers the voltage
until the current is limited; then a load goes, which raises the frequency beyond the dead band and ft2; then a
capacitor bank comes and goes, and raises the voltage beyond vt2.

In ANDES 2.0.0 trips are not latched; a current is limited by what trips leave of the other one; the change of reactive
power by voltage has the other sign and jumps, so that no voltage leaves v0…v1, and xc is 0; the reactive current starts
at its lower limit in place of its command, at which it is put. Knows nothing of our models."""

import json
from pathlib import Path
from typing import Any

PLACE = Path(__file__).with_name("andes_pvd1.json")
RATING, POWER = 50.0, 0.4  # of the plant [MVA], and what it feeds [pu, 100 MVA]
FREQUENCY = 60.0  # rated [Hz]
STEP, UNTIL, EVERY = 1e-3, 3.2, 8  # step and end [s]; steps from one value that is kept to the next
NEAR = 0.01  # from a jump [s], where every step is kept
COIL, BANK = (0.5, 0.8), (2.3, 2.6)  # when each comes and goes [s]
LOAD_GOES = 1.0  # [s]
JUMPS = (*COIL, LOAD_GOES, *BANK)
FILTER = 1e-3  # of ANDES' measurement of the frequency, of either lag [s]

PLANT = {
    "pqflag": 0,
    "qmx": 0.33,
    "qmn": -0.33,
    "v0": 0.5,
    "v1": 1.5,
    "dqdv": -1.0,
    "fdbd": -0.05,
    "ddn": 0.6,
    "ialim": 0.835,
    "vt0": 0.85,
    "vt1": 0.9,
    "vt2": 1.03,
    "vt3": 1.2,
    "ft0": 57.0,
    "ft1": 58.0,
    "ft2": 60.1,
    "ft3": 60.8,
    "tip": 0.1,
    "tiq": 0.1,
}
"""Values by ANDES' names; fdbd in Hz and ddn in pu by Hz."""


def _system() -> Any:
    import andes  # noqa: PLC0415 - is not installed everywhere

    andes.config_logger(stream_level=50)
    made = andes.System(no_output=True, default_config=True)
    for bus in (1, 2):
        made.add("Bus", idx=bus, name=str(bus), Vn=230.0, v0=1.0, a0=0.0)
    made.add("Line", idx="L", bus1=1, bus2=2, r=0.01, x=0.2, b=0.0, Vn1=230.0, Vn2=230.0)
    made.add("Slack", idx=1, bus=1, v0=1.0, a0=0.0, Vn=230.0, Sn=100.0)
    made.add("PV", idx=2, bus=2, v0=1.0, p0=POWER, Vn=230.0, Sn=100.0)
    made.add("PQ", idx="D", bus=2, p0=0.55, q0=0.1, Vn=230.0)
    made.add("PQ", idx="C", bus=1, p0=0.1, q0=0.0, Vn=230.0)
    made.add("GENCLS", idx="G", bus=1, gen=1, Sn=100.0, Vn=230.0, M=8.0, D=2.0, ra=0.0, xd1=0.2)
    made.add("BusFreq", idx="F", bus=2, Tf=FILTER, Tw=FILTER, fn=FREQUENCY)
    made.add("PVD1", idx="P", bus=2, gen=2, busf="F", Sn=RATING, fn=FREQUENCY, **PLANT)
    for name, q, times in (("E", 0.12, COIL), ("B", -0.3, BANK)):
        made.add("PQ", idx=name, bus=2, p0=0.0, q0=q, Vn=230.0, u=0)
        for time in times:
            made.add("Toggle", model="PQ", dev=name, t=time)
    made.add("Toggle", model="PQ", dev="C", t=LOAD_GOES)
    made.setup()
    made.PQ.config.p2p, made.PQ.config.p2z = 0.0, 1.0
    made.PQ.config.q2q, made.PQ.config.q2z = 0.0, 1.0
    made.PFlow.run()
    made.TDS.config.criteria = 0
    made.TDS.config.fixt, made.TDS.config.tstep, made.TDS.config.tf = 1, STEP, UNTIL
    made.TDS.config.no_tqdm = 1
    return made


def main() -> None:
    import andes  # noqa: PLC0415 - as above

    made = _system()
    made.TDS.init()
    made.dae.x[made.PVD1.Iqout_y.a] = made.PVD1.Iqcmd_y.v
    made.vars_to_models()
    made.TDS.run()
    series = made.dae.ts
    kept = [
        k
        for k, t in enumerate(series.t)
        if k % EVERY == 0 or min(abs(t - jump) for jump in JUMPS) < NEAR
    ]
    y, x = series.y[kept], series.x[kept]
    plant = made.PVD1
    content = {
        "andes": andes.__version__,
        "q": round(float(plant.qref0.v[0]), 8),
        "t": [round(float(t), 6) for t in series.t[kept]],
        "v": [round(float(z), 7) for z in y[:, made.Bus.v.a[1]]],
        "a": [round(float(z), 7) for z in y[:, made.Bus.a.a[1]]],
        "f": [round(float(z), 8) for z in y[:, plant.f.a[0]]],
        "i_p": [round(float(z), 7) for z in x[:, plant.Ipout_y.a[0]]],
        "i_q": [round(float(z), 7) for z in x[:, plant.Iqout_y.a[0]]],
    }
    PLACE.write_text(json.dumps(content) + "\n", "utf-8")


if __name__ == "__main__":
    main()
