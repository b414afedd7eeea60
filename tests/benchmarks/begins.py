"""Whether the begin of a forced oscillation lies in the interval that `gfor signal source` tells, also beside a mode.

    python -m tests.benchmarks.begins                # 200 records: how many intervals hold the truth, and their width
    python -m tests.benchmarks.begins --draws 40 --seed 7

Each record has a source, a begin and a frequency that are drawn: half of the frequencies within 3 % of the mode of the
areas, half away from modes. 70 s at 30 samples a second, with noise of loads and of measuring.
"""

import argparse

import numpy as np

from orchestrator.studies.oscillations.detection import find_oscillations, signals_of
from tests.support.forced_records import model, record, sine, times_of

MODES = {"two_area": 0.5817, "ieee39": 0.722}
AWAY = {"two_area": (0.28, 0.42), "ieee39": (0.35, 0.55)}
BEGINS = (8.0, 30.0)
TIMES = times_of(70.0)


def drawn(rng):
    """Name of a case, reference, frequency [Hz], whether it is beside the mode, begin [s]."""
    case = str(rng.choice([*MODES]))
    reference = str(rng.choice(model(case).references))
    beside = bool(rng.integers(2))
    mode = MODES[case]
    frequency = mode * rng.uniform(0.97, 1.03) if beside else rng.uniform(*AWAY[case])
    return case, reference, float(frequency), beside, float(rng.uniform(*BEGINS))


def trial(case, reference, frequency, begin, seed):
    """The line that is found at a frequency; None where there is none, or one that was there before the record."""
    forced = {reference: sine(TIMES, frequency, 0.02, begin)}
    measured = record(case, forced, times=TIMES, loads=5e-4, measuring=5e-5, seed=seed)
    found = [
        one
        for one in find_oscillations(signals_of(measured))
        if abs(one.frequency - frequency) < 0.02
    ]
    return found[0] if found and found[0].onset is not None else None


def coverage(draws, seed):
    """By whether beside the mode: of each record whether the interval holds the begin, its half width and error [s]."""
    rng = np.random.default_rng(seed)
    found = {True: [], False: []}
    for k in range(draws):
        case, reference, frequency, beside, begin = drawn(rng)
        line = trial(case, reference, frequency, begin, seed + k)
        if line is not None:
            onset = line.onset
            held = onset.earliest <= begin <= onset.latest
            found[beside].append((held, (onset.latest - onset.earliest) / 2, onset.at - begin))
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    for beside, tried in coverage(options.draws, options.seed).items():
        held, width, error = (np.array(column) for column in zip(*tried, strict=True))
        where = "beside the mode" if beside else "away from modes"
        print(
            f"{where}: {held.sum()} of {len(held)} intervals hold the begin ({held.mean():.1%}); half width "
            f"{np.median(width):.2f} s in the middle, {np.quantile(width, 0.9):.2f} s in 90 %; error of the best begin "
            f"{np.median(np.abs(error)):.2f} s in the middle"
        )


if __name__ == "__main__":
    main()
