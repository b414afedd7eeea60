"""Whether `gfor signal source` finds the unit that was forced: each reference of each unit, away from modes and at one.

    python -m tests.benchmarks.sources             # the tables, some minutes
    python -m tests.benchmarks.sources --models    # the linear models of tests/oscillations/models

Records are 60 s at 30 samples a second from the case's linear model, with noise of loads and of measuring. With every
second bus in view, units elsewhere are not seen at all.
"""

import argparse
from collections import Counter

from orchestrator.oscillations import location
from orchestrator.oscillations.verdict import locate
from tests.support.forced_records import make_model, model, record, save, sine, times_of, unit_models_of

CASES = {"two_area": (0.3, 0.5817, 0.9), "ieee39": (0.4, 0.722, 1.25), "ieee118": (0.4, 0.717, 1.12)}
"""Frequencies [Hz], the second at the mode of the areas, the third of `ieee39` amid its local modes."""

SMALL = ("two_area", "ieee39")  # whose models are kept; that of ieee118 is made first: --models --case ieee118
AMPLITUDE = 0.02
NOISE = {"without noise": (0.0, 0.0), "with noise": (5e-4, 5e-5)}
METHODS = (location.DEF, location.DYNAMIC_MODE, location.QV_PHASE)


def tried(case, noise, half, own, every=1):
    """One answer for each reference and frequency: who was forced, how, and what was said."""
    times, system = times_of(60.0), model(case)
    hidden = sorted(set(system.buses))[1::2] if half else ()
    for number, reference in enumerate(system.references[::every]):
        unit = reference.partition(".")[0]
        for frequency in CASES[case]:
            measured = record(case, {reference: sine(times, frequency, AMPLITUDE)}, times=times, loads=noise[0],
                              measuring=noise[1], seed=number, without=hidden)  # fmt: skip
            found = [
                x
                for x in locate(measured, unit_models_of(system) if own else None)
                if abs(x.found.frequency - frequency) < 0.01
            ]
            seen = system.buses[system.units.index(unit)] not in hidden
            yield unit, "P" if "P_ref" in reference else "V", seen, found[0] if found else None


def verdict(unit, one):
    if one is None:
        return "not found"
    if one.drives is None:
        return "not known"
    return "right" if unit in one.drives.split(" or ") else "wrong"


def first(unit, one, method):
    """Whether the method puts the unit first, whether it applies or not."""
    ranking = next(o.ranking for o in one.opinions if o.method == method)
    return ranking[0][0] == unit


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--models", action="store_true")
    parser.add_argument("--own", dest="models_known", action="store_true", help="with each unit's own model")
    parser.add_argument("--case", choices=[*CASES], action="append")
    parser.add_argument("--every", type=int, default=1, help="only every so many references")
    options = parser.parse_args()
    if options.models:
        for case in options.case or SMALL:
            save(make_model(case, "gfor", {} if case in SMALL else {"models": "phasor"}), case)
        return
    print("| Case | Record | Forced | Tries | Right | Not known | Not found | Wrong | " + " | ".join(METHODS) + " |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for case in options.case or SMALL:
        for half in (False, True):
            for label, noise in NOISE.items():
                answers = list(tried(case, noise, half, options.models_known, options.every))
                for how in ("P", "V"):
                    for in_view in (True, False) if half else (True,):
                        chosen = [(u, one) for u, h, seen, one in answers if h == how and seen == in_view]
                        counts = Counter(verdict(u, one) for u, one in chosen)
                        ranks = [sum(one is not None and first(u, one, m) for u, one in chosen) for m in METHODS]
                        where = "" if not half else ", every second bus: " + ("seen" if in_view else "not seen")
                        cells = [counts[k] for k in ("right", "not known", "not found", "wrong")]
                        row = [case, label + where, how, len(chosen), *cells, *ranks]
                        print("| " + " | ".join(map(str, row)) + " |", flush=True)


if __name__ == "__main__":
    main()
