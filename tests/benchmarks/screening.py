"""What a screening costs: processor time a point, and all outages of one element, computed in this process alone.

`python -m tests.benchmarks.screening [CASE] [--points N] [--outages n-1]`
"""

import argparse
import resource
import tempfile
from pathlib import Path

import numpy as np

from orchestrator.cases.case import load_case
from orchestrator.core.threads import alone
from orchestrator.studies.operating_points.item import Status
from orchestrator.studies.points.executor import Serial
from orchestrator.studies.points.points import Work
from orchestrator.studies.points.store import PointStore
from orchestrator.studies.screening.request import ScreeningRequest
from orchestrator.studies.screening.study import plan_screening, run_screening


def processor_seconds():
    """User and system time of this process so far [s]."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def load_points(path, count):
    """Loads and dispatch together between 90 and 100 % of the case's, drawn with a fixed seed."""
    factors = np.random.default_rng(118).uniform(0.9, 1.0, count)
    rows = "".join(f"{k},{factor:.6f},{factor:.6f}\n" for k, factor in enumerate(factors))
    path.write_text(f"name,load,generation\n{rows}")
    return path


def screened(case, scenario, points, outages, folder):
    """Items, those with modes, and processor time of one screening, its FMUs built before [s]."""
    plan = plan_screening(case, ScreeningRequest(points, outages, scenario))
    before = processor_seconds()
    with alone():
        result = run_screening(plan, Work(Serial(), PointStore(folder)))
    computed = sum(item.record.status is Status.COMPUTED for item in result.items)
    return len(result.items), computed, processor_seconds() - before


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("case", nargs="?", default="ieee118")
    parser.add_argument("--scenario", default="gfor")
    parser.add_argument("--points", type=int, default=48)
    parser.add_argument(
        "--outages",
        default="n-1",
        help="of one more screening at the case's own point; '' for none",
    )
    options = parser.parse_args()
    case = load_case(options.case)
    with tempfile.TemporaryDirectory() as passing:
        folder = Path(passing)
        points = load_points(folder / "points.csv", options.points)
        count, computed, seconds = screened(case, options.scenario, points, None, folder / "points")
        print(
            f"{options.case}: {count} points, {computed} with modes: {seconds:.1f} s, {seconds / count:.3f} s a point"
        )
        if options.outages:
            (folder / "one.csv").write_text("name\nonly\n")
            count, computed, seconds = screened(
                case, options.scenario, folder / "one.csv", options.outages, folder / "outages"
            )
            print(f"{options.case}: {count} outages, {computed} with modes: {seconds:.1f} s")


if __name__ == "__main__":
    main()
