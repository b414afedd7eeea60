"""A page of the New England system in which the place of a converter is chosen.

    python -m tests.benchmarks.places --html .docs/live/ieee39_places.html

The case has a converter at each of some buses, all out of service; each scenario connects one.
"""

import argparse
import contextlib
import shutil
import sys
import tempfile
import tomllib
from pathlib import Path

import tomli_w

from orchestrator.cases import built_in
from orchestrator.face.cli import main as gfor

BUILT_IN = Path(built_in.__file__).parent / "ieee39"
BUSES = tuple(range(1, 30))  # those that are no machine's terminal
RANGE = "0.4:1.6"  # where the machines swing [Hz]
RATING = 500.0  # of the converter [MVA]
GAINS = "0,100,200"  # of its POD-P [pu]


def case_of(folder, buses=BUSES):
    """Write the case into a folder; returns its path and the names of its scenarios."""
    table = tomllib.loads((BUILT_IN / "case.toml").read_text(encoding="utf-8"))
    for name in ("units.csv", "case39.tables.json"):
        shutil.copy(BUILT_IN / name, folder)
    table |= {
        "name": "ieee39_places",
        "title": f"New England IEEE 39-bus system: where to put a converter of {RATING:.0f} MVA",
    }
    table["plots"] = table["plots"][:1]  # the others are of the case's own converters
    without = {"units.alpha": 0.0}
    table["scenarios"] = {"none": {"title": "No converter", "set": without}}
    for bus in buses:
        name = f"gfor_at_{bus}"
        values = {"S_n": RATING, "P_0": 0.0, "Q_0": 0.0, "connected": False, "pod_p.enabled": True}
        table["components"][name] = {"model": "gfor", "bus": f"bus_{bus}", "parameters": values}
        table["scenarios"][f"bus_{bus}"] = {
            "title": f"Converter at bus {bus}",
            "set": {**without, f"{name}.connected": True},
        }
    path = folder / "ieee39_places.toml"
    path.write_text(tomli_w.dumps(table), encoding="utf-8")
    return path, [*table["scenarios"]]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--html", type=Path, required=True)
    options = parser.parse_args()
    page = options.html.absolute()
    with tempfile.TemporaryDirectory() as place, contextlib.chdir(place):
        path, names = case_of(
            Path()
        )  # the page has the case's path, and shall have no folder of this machine
        first = sorted(names, key=lambda name: name != "bus_16")
        chosen = [word for name in first for word in ("--scenario", name)]
        words = ["explore", str(path), *chosen, "--range", RANGE]
        words += ["--vary", f"gfor_at_*.pod_p.K={GAINS}"]
        return gfor([*words, "--save", str(page)])


if __name__ == "__main__":
    sys.exit(main())
