"""How often the truth lies in the interval that a fit gives: draws of instruments and of a start, one coupled run.

``python -m tests.benchmarks.validation_draws [DRAWS [PARAMETERS [FIRST [DEVICE]]]]`` prints each draw, and for each of
two to four parameters (three by default) how many intervals of 95 % hold the value with which the recording was made.
One draw after the other the recorder gives every sample, the means of a PMU, and samples of which a twentieth is
missing; each has noise and errors of the gain of its own. ``FIRST``: number of the first draw, so that several
processes share them; ``DEVICE``: ``gfor_phasor``, or ``gfor``, which takes ten times as long."""

import sys

import numpy as np

import orchestrator as gfor
from tests.studies.validation.recordings import EVENT, of_pmu, run, table, with_noise

TRUTH = {"pod_p.K": 120.0, "droop.R_V": 0.067, "transformer.X_t": 0.15, "droop.R_f": 0.05}
_FARTHEST = 0.3  # part by which a start may be off
_LENGTH = 4.0  # of the recording, of which 3 s are after the event [s]
_MISSING = 0.05  # part of the samples
_GAIN = 1e-3  # part by which an instrument of class 0.1 may be off in P, and in Q
_STEPS = {"gfor_phasor": "1 ms", "gfor": "100 us"}  # of the play-back


def starts_of(seed, names):
    """Values from which a fit begins, each off by its own part."""
    off = np.random.default_rng(seed).uniform(-_FARTHEST, _FARTHEST, len(names))
    return {name: TRUTH[name] * (1 + way) for name, way in zip(names, off, strict=True)}


def _with_missing(frame, seed):
    return frame.sample(frac=1 - _MISSING, random_state=seed).sort_index()


RECORDERS = {
    "every sample": lambda frame, seed: frame,
    "PMU": lambda frame, seed: of_pmu(frame),
    "missing samples": _with_missing,
}


def _plant(device):
    """What the plant did, of which the recorders see a part: steps of 100 us, a row every millisecond."""
    if device == "gfor":
        return table(run("pod_p", stop=_LENGTH, gfor__pod_p__K=TRUTH["pod_p.K"]))
    solver = {"step_size": "100 us", "record_interval": "1 ms", "record_filter": "low-pass"}
    case = gfor.load("two_area_rms").with_(events=[EVENT], solver=solver)
    return table(
        case.scenario("pod_p", {"gfor.pod_p.K": TRUTH["pod_p.K"]}).run(stop=_LENGTH).dataset
    )


def _recorded(clean, seed, recorder):
    """The plant as one recorder saw it, with the noise and the gains of its instruments."""
    p, q = np.random.default_rng([seed, 1]).uniform(1 - _GAIN, 1 + _GAIN, 2)
    noisy = with_noise(clean, seed)
    gained = noisy.assign(p_mw=p * noisy.p_mw, q_mvar=q * noisy.q_mvar)
    return RECORDERS[recorder](gained, seed).set_index("time")


def draw(clean, seed, names, device):
    """One fit from a start that is off; for each parameter whether the truth lies inside, None if it is not told."""
    recorder = list(RECORDERS)[seed % len(RECORDERS)]
    values = {"pod_p.enabled": True, **starts_of(seed, names)}
    recording = _recorded(clean, seed, recorder)
    found = gfor.validate(device, recording, values=values, fit=names, step=_STEPS[device]).fitted()
    inside = {}
    for row in found.itertuples():
        truth = TRUTH[row.parameter]
        inside[row.parameter] = row.low <= truth <= row.high if row.identifiable else None
        said = f"{row.value:.6g} ({row.low} to {row.high}): {inside[row.parameter]}"
        print(f"{seed}, {recorder}: {row.parameter} {said}", flush=True)
    return inside


def main(draws=100, parameters=3, first=0, device="gfor_phasor"):
    names = list(TRUTH)[: int(parameters)]
    clean = _plant(device)
    seeds = range(int(first), int(first) + int(draws))
    found = [draw(clean, seed, names, device) for seed in seeds]
    for name in names:
        told = [one[name] for one in found if one[name] is not None]
        left = len(found) - len(told)
        print(f"{name}: {sum(told)} of {len(told)} intervals hold the truth; {left} not told")


if __name__ == "__main__":
    main(*sys.argv[1:])
