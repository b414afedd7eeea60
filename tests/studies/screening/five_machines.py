"""Five machines on a ring with a radial load, as RAW and DYR: a network of these tests' own, 60 Hz, phasor models."""

from orchestrator.cases.case import load_case
from tests.cases.networks.psse import ORDER, raw

RATINGS = {1: 250.0, 2: 200.0, 3: 220.0, 4: 150.0, 5: 260.0}
POWERS = {1: 190.0, 2: 130.0, 3: 160.0, 4: 110.0, 5: 150.0}
DROOPS = {1: 0.05, 2: 0.04, 3: 0.05, 5: 0.06}
"""Machine 4 has no governor."""

LOADS = {11: 160, 12: 150, 13: 140, 14: 140, 15: 120, 16: 30}
LINES = ((11, 12), (12, 13), (13, 14), (14, 15), (15, 11), (11, 13), (13, 16))
CASE = """\
name = "five"
[solver]
step_size = "5 ms"
stop_time = "1 s"
[components.grid]
model = "phasor_grid"
[network]
raw = "five.raw"
[power_flow]
grid = "grid"
{flow}
[units]
dyr = "five.dyr"
generator = "synchronous_generator_phasor"
converter = "gfor_phasor"
alpha = 0.0
[scenarios.base]
"""


def five_machines(folder, highest=1.2, flow="", ratings=RATINGS, most=None):
    """The case in a folder; ``highest`` is V_MAX [pu], ``flow`` goes to [power_flow], ``most`` is PT [MW]."""
    rates = ",".join("000")
    found = {section: [] for section in ORDER}
    kinds = dict.fromkeys(range(1, 5), 2) | {5: 3} | dict.fromkeys(range(11, 17), 1)
    found["BUS"] = [
        f"{n},'BUS {n}     ',230.0,{kind},1,1,1,1.0,0.0,1.1,0.9,1.1,0.9"
        for n, kind in kinds.items()
    ]
    found["LOAD"] = [f"{n},'1 ',1,1,1,{p},{0.2 * p},0,0,0,0,1,1,0" for n, p in LOADS.items()]
    found["GENERATOR"] = [
        f"{n},'1 ',{POWERS[n]},0,300,-300,1.02,0,{base},0,0.25,0,0,1,1,100,{(most or {}).get(n, 9999)},0,1,1"
        for n, base in ratings.items()
    ]
    found["BRANCH"] = [f"{i},{j},'1 ',0.004,0.05,0.02,{rates},0,0,0,0,1,1,0,1,1" for i, j in LINES]
    for n in RATINGS:
        found["TRANSFORMER"] += [
            f"{10 + n},{n},0,'1 ',1,1,1,0,0,2,'T {n}',1,1,1",
            "0,0.05,100",
            f"1.0,0,0,{rates},0,0,1.1,0.9,1.1,0.9,33,0,0,0,0",
            "1.0,0",
        ]
    dyr = ""
    for n in RATINGS:
        dyr += f"{n} 'GENROU' 1 6.0 0.04 0.535 0.06 {4 + n / 2} 0.0 1.72 1.66 0.3 0.5 0.25 0.15 0.0 0.0 /\n"
        dyr += f"{n} 'SEXS' 1 0.1 10.0 100.0 0.05 -5.0 5.0 /\n"
        if n in DROOPS:
            dyr += f"{n} 'TGOV1' 1 {DROOPS[n]} 0.5 {highest} 0.0 2.1 7.0 0.0 /\n"
    (folder / "five.raw").write_text(raw(33, found))
    (folder / "five.dyr").write_text(dyr)
    (folder / "five.toml").write_text(CASE.format(flow=flow))
    return load_case(folder / "five.toml")
