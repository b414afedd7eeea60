"""How often the truth lies in the interval that a fit gives: draws of noise and of a start, one coupled run.

``python -m tests.benchmarks.validation_draws [DRAWS [PARAMETERS]]`` prints each draw, and for each of two to four
parameters (three by default) how many intervals of 95 % hold the value with which the recording was made."""

import sys

import numpy as np

import orchestrator as gfor
from tests.studies.validation.recordings import run, table, with_noise

TRUTH = {"pod_p.K": 120.0, "droop.R_V": 0.067, "transformer.X_t": 0.15, "droop.R_f": 0.05}
_FARTHEST = 0.3  # part by which a start may be off


def starts_of(seed, names):
    """Values from which a fit begins, each off by its own part."""
    off = np.random.default_rng(seed).uniform(-_FARTHEST, _FARTHEST, len(names))
    return {name: TRUTH[name] * (1 + way) for name, way in zip(names, off, strict=True)}


def draw(clean, seed, names):
    """One fit from a start that is off; for each parameter whether the truth lies inside, None if it is not told."""
    recording = with_noise(clean, seed).set_index("time")
    values = {"pod_p.enabled": True, **starts_of(seed, names)}
    found = gfor.validate("gfor", recording, values=values, fit=names).fitted()
    inside = {}
    for row in found.itertuples():
        print(f"{seed}: {row.parameter} {row.value:.6g} ({row.low} to {row.high})", flush=True)
        truth = TRUTH[row.parameter]
        inside[row.parameter] = row.low <= truth <= row.high if row.identifiable else None
    return inside


def main(draws=100, parameters=3):
    names = list(TRUTH)[:parameters]
    clean = table(run("pod_p", gfor__pod_p__K=TRUTH["pod_p.K"]))
    found = [draw(clean, seed, names) for seed in range(draws)]
    for name in names:
        told = [one[name] for one in found if one[name] is not None]
        print(
            f"{name}: {sum(told)} of {len(told)} intervals hold the truth; {draws - len(told)} not told"
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
