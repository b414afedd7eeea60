"""RAW files of the WSCC 9-bus system in revisions before 31, which have loads or shunts in their buses."""

from tests.cases.networks.psse import (
    BUSES,
    LINES,
    LOADS,
    MACHINES,
    REACTANCES,
    TRANSFORMERS,
    in_sections,
    records,
)

HEAD = "0  100.0\nWSCC, 9 buses\nSauer and Pai\n"
TAIL = (
    *("AREA", "TWO-TERMINAL DC", "SWITCHED SHUNT", "IMPEDANCE CORRECTION", "MULTI-TERMINAL DC"),
    *("MULTI-SECTION LINE", "ZONE", "INTER-AREA TRANSFER", "OWNER", "FACTS DEVICE"),
)


def early(revision, *, named=True, ratio=1.0, charging=0.0, adjustments=(), shunts=()):
    """Text of the system in revisions 23 to 28, as GridPACK's files of revision 23 have it."""
    sections = {"BUS": [], "LOAD": [], "GENERATOR": [], "BRANCH": []}
    for n, (kv, kind, vm) in BUSES.items():
        p, q = LOADS.get(n, (0, 0))
        if revision == 23:
            bus = f"{n},{kind},{p},{q},0,0,1,{vm},0.0,'BUS {n}',{kv},1"
        else:
            bus = f"{n},'BUS {n}',{kv},{kind},0,0,1,1,{vm},0.0,1"
        sections["BUS"].append(bus)
    sections["LOAD"] = [f"{n},'1',1,1,1,{p},{q}" for n, (p, q) in LOADS.items()]
    sections["GENERATOR"] = [
        f"{n},'1 ',{p},0,300,-300,{v},0,{base},0,{REACTANCES[n]},0,0,1,1,100,{base},0"
        for n, (p, v, base) in MACHINES.items()
    ]
    sections["BRANCH"] = [
        f"{i},{j},'1 ',{r},{x},{b},0,0,0,0,0,0,0,0,0,1" for i, j, r, x, b in LINES
    ]
    sections["BRANCH"] += [
        f"{i},{-j},'1 ',0,{x},{charging},0,0,0,{ratio},0,0,0,0,0,1" for i, j, x in TRANSFORMERS
    ]
    sections["TRANSFORMER ADJUSTMENT"] = [*adjustments]
    sections |= {name: [*shunts] if name == "SWITCHED SHUNT" else [] for name in TAIL}
    if revision == 23:
        del sections["LOAD"]
    lines = in_sections(sections, named=named)
    head = HEAD if revision == 23 else HEAD.replace("100.0", f"100.0,{revision}", 1)
    return head + "\n".join([*lines, ""])


def with_shunts_in_buses(revision):
    """The WSCC system as revisions 29 and 30 have it: GL and BL in the buses, no fixed shunts."""
    found = records(33)
    found["BUS"] = [
        ",".join(
            [
                *line.split(",")[:4],
                "0",
                "50" if line.startswith("5") else "0",
                "1,1",
                *line.split(",")[7:9],
                "1",
            ]
        )
        for line in found["BUS"]
    ]
    lines = [f"0, 100.0   / PSS/E-{revision}.3  WED, SEP 15 2021", "WSCC", "9 buses"]
    for section in ("BUS", "LOAD", "GENERATOR", "BRANCH", "TRANSFORMER"):
        lines += [*found[section], "0 / end of unit cards" if section == "GENERATOR" else "0"]
    return "\n".join([*lines, *["0"] * 11, ""])
