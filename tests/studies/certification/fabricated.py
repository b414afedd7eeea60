"""Points of a damping test as they may come out, at once, for tests of what is made of them."""

import json

import numpy as np

from orchestrator.linear.spectra.mode_tracking import ModeSet
from orchestrator.studies.certification.point import FREQUENCY, POWER, PointResult

VOLATILE = ("made", "files", "seal")

EVERY = 0.04
"""Time between two samples [s]: a sixteenth of the fastest judged mode's period; each command judges all anew."""

TIMES = EVERY * np.arange(500)


def rings(task):
    """A point that meets both criteria."""
    t = TIMES
    signal = 1 + 0.1 * np.exp(-0.5 * np.maximum(t - 1, 0)) * np.sin(
        2 * np.pi * 0.6 * np.maximum(t - 1, 0)
    )
    modes = ModeSet(
        np.array([-0.5 + 4j]), np.ones((1, 2), complex), np.ones((1, 2), complex), ("a", "b")
    )
    names = {POWER: signal, FREQUENCY: 50 + signal - 1}
    off = (
        {"off": np.array([-0.2 + 3j]), "swings": np.array([-0.2 + 3j, -0.5 + 4j])}
        if task.off
        else {}
    )
    return PointResult(
        task.X_L,
        task.scenario,
        modes,
        ["a 100 %"],
        -0.5,
        residual=1e-9,
        power=1350.0,
        times=t,
        signals=names,
        units=dict.fromkeys(names, "pu"),
        stability={"stable": True, "sentence": "stable: -0.5 1/s"},
        **off,
    )


def figures(folder):
    """What a certificate says, without the moment at which it was written and what depends on that."""
    content = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
    assert set(VOLATILE) <= set(content)
    return {key: value for key, value in content.items() if key not in VOLATILE}
