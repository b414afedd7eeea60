"""The WSCC 9-bus system as RAWX, PSS/E's data in JSON."""

import json

from tests.cases.networks.psse import BUSES, LINES, LOADS, MACHINES, REACTANCES, TRANSFORMERS


def table(fields, rows):
    return {"fields": fields.split(), "data": rows}


def network():
    """The nine buses, fields in another order than RAW's and no more than differ from their defaults."""
    return {
        "caseid": {
            "fields": ["title1", "rev", "sbase", "basfrq", "ic"],
            "data": ["nine buses", 35, 100.0, 60.0, 0],
        },
        "general": table("thrshz pqbrak", [[0.0001, 0.7]]),
        "bus": table(
            "name ibus ide baskv nvlo nvhi vm va",
            [[f"BUS {n}", n, kind, kv, 0.9, 1.1, vm, 0.0] for n, (kv, kind, vm) in BUSES.items()],
        ),
        "load": table("ql pl ibus loadid", [[q, p, n, "1"] for n, (p, q) in LOADS.items()]),
        "generator": table(
            "ibus machid pg qt qb vs mbase zx stat pt",
            [
                [n, "1", p, 300, -300, v, base, REACTANCES[n], None, base]
                for n, (p, v, base) in MACHINES.items()
            ],
        ),
        "acline": table("ibus jbus bpu rpu xpu", [[i, j, b, r, x] for i, j, r, x, b in LINES]),
        "transformer": table(
            "ibus jbus x1_2 name", [[i, j, x, f"T {j}"] for i, j, x in TRANSFORMERS]
        ),
        "subnode": table("isub inode", [[1, 2, 3, 4]]),
    }


def rawx(tables):
    """Text of the file with these tables."""
    return json.dumps({"network": tables}, indent=1)
