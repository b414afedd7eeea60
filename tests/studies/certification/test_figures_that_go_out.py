"""Every figure of a whole certificate, as JSON and as a page, is one of what was computed and judged."""

import json
from html import escape
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.face.cli import main
from orchestrator.linear.spectra.mode_tracking import ModeSet
from orchestrator.studies.certification import files
from orchestrator.studies.certification import study as study_module
from orchestrator.studies.certification.judgement import LOWERED
from orchestrator.studies.certification.point import FREQUENCY, POWER, PointResult
from orchestrator.studies.certification.request import REACTANCES
from orchestrator.studies.certification.texts import TEXTS
from tests.support.figures import (
    foreign_in_json,
    foreign_in_page,
    unlike_eigenvalues,
    unseen_in_page,
    unseen_slips,
)


def uneven(task):
    """A point whose figures are no simple multiples of each other; the second reactance has others."""
    k = 1 if task.X_L == 0.1 else 1.37
    having = task.scenario == "with"
    values = np.array([-0.3137 * k + 3.7193j, -0.2719 + 7.3391j * k, -0.1931 + 11.417j])
    values = values - 0.0871 * having
    t = np.arange(0, 20, 1e-2)
    after = np.maximum(t - 1, 0)
    signal = 1.0173 + 0.0913 * np.exp(-0.3137 * k * after) * np.sin(3.7193 * after)
    shapes = np.array([[1, 0.3j], [0.2, 1], [0.7, -0.6j]], complex)
    off = {"off": values[:2] + 0.0419, "swings": values[:2] + 0.0419} if task.off else {}
    return PointResult(
        task.X_L,
        task.scenario,
        ModeSet(values, shapes, shapes.conj(), ("a", "b")),
        ["a 73 %, b 19 %", "b 61 %", "a 57 %"],
        -0.1931 * k - 0.0871 * having,
        residual=1.731e-9 * k,
        power=1347.31 if having else None,
        times=t,
        signals={POWER: signal, FREQUENCY: 49 + signal},
        units={POWER: "pu", FREQUENCY: "Hz"},
        stability={"stable": True, "sentence": "stable"},
        linearised={"converter": "perturbed"},
        fit_errors={"converter": 0.00417},
        **off,
    )


@pytest.fixture(scope="module")
def issued(tmp_path_factory, gallery):
    """A certificate of a foreign FMU whose units are not ours, its JSON and its page."""
    folder, seen = tmp_path_factory.mktemp("certificate"), []
    fmu, binding = gallery("converter_power_si")
    whole = files.page
    words = ["certify", fmu, "--binding", binding, "--reactances", "0.1,0.3", "--workers", 1]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study_module, "compute_point", uneven)
        patch.setattr(files, "page", lambda c, *rest: seen.append(c) or whole(c, *rest))
        main([*map(str, words), "--no-check", "--out", str(folder)])
    return SimpleNamespace(
        certificate=seen[0],
        said=json.loads((folder / files.JSON).read_text(encoding="utf-8")),
        page=(folder / files.HTML).read_text(encoding="utf-8"),
    )


def figures_behind(c):
    """What the points and the judgement hold, without the recorded signals, and what is worked out of it here."""
    hidden = ("times", "signals", "modes")
    points = [{k: v for k, v in vars(p).items() if k not in hidden} for p in c.results.values()]
    spectra = [p.modes.eigenvalues for p in c.results.values()]
    times = [time for v in c.verdicts for time in (v.time, v.base_time)]
    swings = [
        s for time in times for test in (time.swings, time.other_reading) for s in test.swings
    ]
    # the FMU has powers in MW at 1500 MVA, and its voltage as the amplitude of a phase [kV]
    own = [1500 * c.values[f"converter.{name}"] for name in ("P_0", "Q_0")]
    own += [1500 * 0.5, 230 * np.sqrt(2 / 3), 230, 0.02, 0.1]
    who = [0.73, 0.19, 0.61, 0.57]
    return [
        points,
        spectra,
        c.verdicts,
        [*map(below, swings)],
        own,
        who,
        REACTANCES,
        c.values,
        c.request,
    ]


def below(swing):
    """Where the line from one maximum to the next is above the minimum, and by how much."""
    ends = (swing.before, swing.after)
    line = np.interp(swing.minimum.time, [e.time for e in ends], [e.value for e in ends])
    return line, line - swing.minimum.value


def test_of_the_json(issued):
    assert issued.said["missing"] == [X for X in REACTANCES if X not in (0.1, 0.3)]
    source = figures_behind(issued.certificate)
    kept = {k: v for k, v in issued.said.items() if k not in ("missing", "environment")}
    assert foreign_in_json(kept, source) == []
    assert unseen_slips(kept, source) == []


def without_fixed_texts(c, page):
    """The page without what stands there whatever was computed, and without hashes and names."""
    fixed = [
        *(t for t in TEXTS.values() if isinstance(t, str)),
        *c.code.readings,
        c.code.source,
        c.code.date,
        c.description.guid,
    ]
    fixed += ["SHA-256", *c.computed_on.values()]
    for text in (*map(escape, fixed), *fixed):
        page = page.replace(text, " ")
    return page


def test_of_the_page(issued):
    page = without_fixed_texts(issued.certificate, issued.page)
    # the ranges of the norm and of what is kept beside [Hz], by how much a damping is lowered, and its least
    said = [0.05, 0.08, 0.1, 1.5, 1.875, 3.0, LOWERED, 5.0]
    source = [figures_behind(issued.certificate), {"norm": said, "norm_percent": said}]
    assert foreign_in_page(page, source) == []
    assert unseen_in_page(page, source) == []
    assert "λ [rad/s]" in page
    assert unlike_eigenvalues(page) == []
