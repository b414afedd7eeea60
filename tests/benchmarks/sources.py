"""Whether `gfor signal source` finds the unit that was forced: each reference of each unit, away from modes and at one.

    python -m tests.benchmarks.sources --case ieee39      # what is named, and what each method says
    python -m tests.benchmarks.sources --case ieee118 --part 2/4   # every fourth try, from the second on
    python -m tests.benchmarks.sources --pairs 60         # two references at once, at one frequency
    python -m tests.benchmarks.sources --noise 300        # noise of loads alone: what is named is named wrongly
    python -m tests.benchmarks.sources --models           # the linear models of tests/studies/oscillations/models

Records are 60 s at 30 samples a second from the case's linear model, with noise of loads and of measuring. With every
second bus in view, units elsewhere are not seen at all. Each is judged with the units' own models and without.
"""

import argparse
from collections import Counter

import numpy as np

from orchestrator.studies.oscillations import location
from orchestrator.studies.oscillations.models import OWN_MODEL
from orchestrator.studies.oscillations.verdict import locate
from tests.support.forced_records import (
    make_model,
    model,
    record,
    save,
    sine,
    times_of,
    unit_models_of,
)

CASES = {
    "two_area": (0.3, 0.5817, 0.9),
    "ieee39": (0.4, 0.722, 1.25),
    "ieee118": (0.4, 0.717, 1.12),
}
"""Frequencies [Hz], the second at the mode of the areas, the third of `ieee39` amid its local modes."""

# whose models are kept; that of ieee118 is made first: --models --case ieee118
SMALL = ("two_area", "ieee39")
AMPLITUDE = 0.02
LOADS, MEASURING = 5e-4, 5e-5
NO_CASE = "no case"
METHODS = (location.DEF, location.DYNAMIC_MODE, location.QV_PHASE)
TIMES = times_of(60.0)


def answers(case, forced, frequency, seed, hidden=(), loads=LOADS):
    """What is found near a frequency with the units' own models, and without."""
    inputs = {reference: sine(TIMES, frequency, AMPLITUDE) for reference in forced}
    measured = record(
        case, inputs, times=TIMES, loads=loads, measuring=MEASURING, seed=seed, without=hidden
    )
    for judge, models in ((OWN_MODEL, unit_models_of(model(case))), (NO_CASE, None)):
        found = locate(measured, models)
        near = next((x for x in found if abs(x.found.frequency - frequency) < 0.01), None)
        yield judge, near if forced else found


def named(name, units):
    """Whether it is one of the units, or what stands at the bus of one, with "or" between."""
    return "none" if name is None else "right" if set(units) & set(name.split(" or ")) else "wrong"


def forcings(case, half, part):
    """Counts of what was named, by how was forced and whether its bus is in view."""
    system, counts = model(case), Counter()
    hidden = sorted(set(system.buses))[1::2] if half else ()
    tries = [(k, r, f) for k, r in enumerate(system.references) for f in CASES[case]]
    for number, reference, frequency in tries[part[0] - 1 :: part[1]]:
        unit = reference.partition(".")[0]
        kind = (
            "P" if "P_ref" in reference else "V",
            system.buses[system.units.index(unit)] not in hidden,
        )
        for judge, one in answers(case, [reference], frequency, number, hidden):
            counts[kind, judge, "not found" if one is None else named(one.drives, [unit])] += 1
            for o in one.opinions if one and judge == NO_CASE else ():
                counts[kind, o.method, named(o.place, [unit])] += 1
                counts[kind, o.method, "first"] += bool(o.ranking) and o.ranking[0][0] == unit
    for kind in sorted({kind for kind, *_ in counts}, reverse=True):
        for judge in (OWN_MODEL, NO_CASE, *METHODS):
            cells = [
                counts[kind, judge, k] for k in ("right", "none", "not found", "wrong", "first")
            ]
            view = (
                "all PMUs"
                if not half
                else "every second bus, " + ("seen" if kind[1] else "not seen")
            )
            print("|", " | ".join(map(str, (case, view, kind[0], judge, *cells))), "|", flush=True)


def pairs(case, count):
    """Two units at once: a source, which drives alone, would be wrong, and so is a third unit."""
    system, rng, counts = model(case), np.random.default_rng(7), Counter()
    for number in range(count):
        one, other = rng.choice(system.references, 2, replace=False)
        units = {str(one).partition(".")[0], str(other).partition(".")[0]}
        if len(units) == 1:
            continue
        frequency = CASES[case][number % 3]
        for judge, x in answers(case, [one, other], frequency, number):
            counts[judge, "drives", named(x and x.drives, units)] += 1
            counts[judge, "source", "none" if x is None or x.source is None else "one of two"] += 1
            counts[judge, "both named in the reason"] += x is not None and all(
                u in x.reason for u in units
            )
    print(case, dict(counts), flush=True)


def noise(case, count):
    kinds = Counter()
    for seed in range(count):
        for judge, found in answers(case, (), 0, seed + 5000, loads=(5e-4, 2e-3, 5e-3)[seed % 3]):
            kinds.update((judge, x.evidence.kind, x.drives) for x in found)
    print(case, count, dict(kinds), flush=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--models", action="store_true")
    parser.add_argument("--case", choices=[*CASES], action="append")
    parser.add_argument("--part", default="1/1", help="which of how many parts of all tries")
    parser.add_argument("--pairs", type=int)
    parser.add_argument("--noise", type=int)
    options = parser.parse_args()
    if not (options.models or options.pairs or options.noise):
        print(
            "| Case | View | Forced | Judge | Right | None named | Not found | Wrong | Ranks it first |"
        )
        print("|---|---|---|---|---|---|---|---|---|")
    for case in options.case or SMALL:
        if options.models:
            save(make_model(case, "gfor", {} if case in SMALL else {"models": "phasor"}), case)
        elif options.pairs or options.noise:
            (pairs if options.pairs else noise)(case, options.pairs or options.noise)
        else:
            for half in (False, True):
                forcings(case, half, [int(x) for x in options.part.split("/")])


if __name__ == "__main__":
    main()
