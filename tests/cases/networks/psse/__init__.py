"""RAW files of the WSCC 9-bus system, written for these tests in each revision."""

from orchestrator.cases.networks.psse.raw import read_raw

BUSES = {1: (16.5, 3, 1.04), 2: (18.0, 2, 1.025), 3: (13.8, 2, 1.025)} | dict.fromkeys(
    range(4, 10), (230.0, 1, 1.0)
)
LOADS = {5: (125, 50), 6: (90, 30), 8: (100, 35)}
MACHINES = {1: (71.64, 1.04, 247.5), 2: (163.0, 1.025, 192.0), 3: (85.0, 1.025, 128.0)}
LINES = (
    (4, 5, 0.010, 0.085, 0.176),
    (4, 6, 0.017, 0.092, 0.158),
    (5, 7, 0.032, 0.161, 0.306),
    (6, 9, 0.039, 0.170, 0.358),
    (7, 8, 0.0085, 0.072, 0.149),
    (8, 9, 0.0119, 0.1008, 0.209),
)
REACTANCES = {1: 0.12, 2: 0.2, 3: 0.2}
"""Of the machines' sources, ZX: X''d of the tests' dynamics data."""
TRANSFORMERS = ((4, 1, 0.0576), (7, 2, 0.0625), (9, 3, 0.0586))
"""P. W. Sauer, M. A. Pai, "Power System Dynamics and Stability" (1998), figure 7.4: pu on 100 MVA, MW, Mvar."""

ORDER = (
    "BUS",
    "LOAD",
    "FIXED SHUNT",
    "GENERATOR",
    "BRANCH",
    "SYSTEM SWITCHING DEVICE",
    "TRANSFORMER",
    "AREA",
    "TWO-TERMINAL DC",
    "VSC DC LINE",
    "IMPEDANCE CORRECTION",
    "MULTI-TERMINAL DC",
    "MULTI-SECTION LINE",
    "ZONE",
    "INTER-AREA TRANSFER",
    "OWNER",
    "FACTS DEVICE",
    "SWITCHED SHUNT",
    "GNE",
    "INDUCTION MACHINE",
    "SUBSTATION",
)


def records(revision):
    """Lines of data of the WSCC system by section."""
    rates = ",".join(["0"] * (3 if revision == 33 else 12))
    name = "" if revision == 33 else "'',"
    node = "" if revision < 35 else "0,"
    found = {section: [] for section in ORDER}
    found["BUS"] = [
        f"{n},'BUS {n}     ',{kv},{kind},1,1,1,{vm},0.0,1.1,0.9,1.1,0.9"
        for n, (kv, kind, vm) in BUSES.items()
    ]
    found["LOAD"] = [f"{n},'1 ',1,1,1,{p},{q},0,0,0,0,1,1,0" for n, (p, q) in LOADS.items()]
    found["GENERATOR"] = [
        f"{n},'1 ',{p},0,300,-300,{v},0,{node}{base},0,{REACTANCES[n]},0,0,1,1,100,{base},0,1,1"
        for n, (p, v, base) in MACHINES.items()
    ]
    found["BRANCH"] = [
        f"{i},{j},'1 ',{r},{x},{b},{name}{rates},0,0,0,0,1,1,0,1,1" for i, j, r, x, b in LINES
    ]
    for i, j, x in TRANSFORMERS:
        found["TRANSFORMER"] += [
            f"{i},{j},0,'1 ',1,1,1,0,0,2,'T {j}',1,1,1",
            f"0,{x},100",
            f"1.0,0,0,{rates},0,0,1.1,0.9,1.1,0.9,33,0,0,0,0",
            "1.0,0",
        ]
    return found


def raw(revision=33, found=None, named=True):
    """Text of a RAW file; ``named``: whether lines between sections say what begins."""
    found = found or records(revision)
    order = [
        s for s in ORDER if revision > 33 or s not in ("SYSTEM SWITCHING DEVICE", "SUBSTATION")
    ]
    lines = [f"0,100.0,{revision},0,1,60.0 / WSCC, 9 buses", "Sauer and Pai", "figure 7.4"]
    if revision > 33:
        lines += [
            "@!comment",
            "GENERAL, THRSHZ=0.0001",
            f"0 / END OF SYSTEM-WIDE DATA, BEGIN {order[0]} DATA",
        ]
    lines += in_sections({section: found[section] for section in order}, named=named)
    return "\n".join([*lines, "Q", ""])


def in_sections(found, *, named=True):
    """Lines of sections, each with the line that ends it; ``named``: whether that says what begins."""
    lines = []
    for section, following in zip(found, [*list(found)[1:], ""], strict=True):
        begin = f", BEGIN {following} DATA" if following else ""
        lines += [*found[section], f"0 / END OF {section} DATA{begin}" if named else "0"]
    return lines


def read_text(folder, text, name="grid.raw"):
    """Write a text into a folder's file, and read it."""
    (folder / name).write_text(text, encoding="utf-8")
    return read_raw(folder / name)
