"""What a damping controller changes: an honest one is accepted, and none that does nothing, harm, or otherwise act."""

from dataclasses import replace

import numpy as np
import pytest

from orchestrator.linear.spectra.mode_tracking import ModeSet
from orchestrator.studies.certification.case_file import WITH
from orchestrator.studies.certification.damping_controllers import DampingControllers
from orchestrator.studies.certification.judgement import PointVerdict
from orchestrator.studies.certification.pod_effect import kept_off, pod_section, with_pod
from orchestrator.studies.certification.point import POWER, PointResult

OFF, ON, OTHER = -0.4 + 3.6j, -1.1 + 4.2j, -3.0 + 9.0j
CONTROLLERS = DampingControllers("p", "", can_be_off=True)


def point(on=ON, off=OFF, recorded=ON, named=True, X_L=0.1):
    """``recorded``: the mode that the response rings with."""
    t = np.arange(0, 20, 5e-3)
    after = np.maximum(t - 1, 0)
    power = 1 + 0.1 * np.real(np.exp(recorded * after)) + 0.02 * np.real(np.exp(OTHER * after))
    values, shapes = np.array([on, OTHER]), np.empty((2, 0), complex)
    swings = np.array([off, on] if named else [np.nan, np.nan], dtype=complex)
    return PointResult(
        X_L,
        "with",
        ModeSet(values, shapes, shapes, ()),
        times=t,
        signals={POWER: power},
        off=np.array([off, OTHER]),
        swings=swings,
    )


def judged(*points, controllers=CONTROLLERS):
    before = [PointVerdict(p.X_L, (), None, None, ()) for p in points]
    return with_pod(before, {(WITH, p.X_L): p for p in points}, controllers, 1.0)


def test_an_honest_one_is_accepted_and_its_figures_are_told():
    (v,) = judged(point())
    assert v.accepted
    figures = v.pod.as_json()["modal"]
    assert figures["off"]["damping_percent"] == pytest.approx(100 * 0.4 / abs(OFF))
    assert figures["response"]["damping_percent"] == pytest.approx(
        figures["on"]["damping_percent"], abs=0.5
    )
    assert figures["better_off"] < 0.1
    assert figures["disagrees"] is False
    assert "11.04 %" in pod_section([v])


@pytest.mark.parametrize(
    ("planted", "said"),
    [
        (point(on=-0.2 + 3.4j, recorded=-0.2 + 3.4j), "does not damp"),
        (point(on=OFF, recorded=ON), "does not damp"),
        (point(on=OFF, recorded=OFF), "does not damp"),
        (point(recorded=OFF), "acts otherwise in the response"),
        (point(recorded=OFF, named=False), "acts otherwise in the response"),
    ],
    ids=[
        "wrong sign",
        "only above an amplitude",
        "off though declared",
        "limit at a tiny amplitude",
        "no shape",
    ],
)
def test_each_plant_is_told(planted, said):
    (v,) = judged(planted)
    assert not v.accepted
    assert said in "; ".join(v.faults)


def test_what_counts_is_where_the_mode_is_damped_least():
    """Far from there an honest controller may take a little damping away."""
    well = point(on=-1.4 + 2.4j, off=-1.5 + 2.4j, recorded=-1.4 + 2.4j, X_L=0.6)
    first, second = judged(point(), well)
    assert first.accepted
    assert second.accepted
    assert second.pod.apart("on", "off") < 0


def test_without_a_switch_it_is_not_known():
    (v,) = judged(replace(point(), off=None), controllers=replace(CONTROLLERS, can_be_off=False))
    assert not v.is_judged
    assert "no switch turns it off" in v.unknown


@pytest.mark.parametrize(
    ("failure", "off_failure", "why"),
    [
        (None, "", "it has no modes"),
        ("the FMU crashed", "", "the FMU crashed"),
        ("the FMU crashed", "no licence", "no licence"),
    ],
)
def test_a_point_without_modes_says_why_it_is_not_known(failure, off_failure, why):
    (v,) = judged(replace(point(), modes=None, failure=failure, off_failure=off_failure))
    assert not v.is_judged
    assert v.unknown == f"what POD-P changes is not known: {why}"


@pytest.mark.parametrize("named", [True, False])
def test_a_certificate_keeps_what_it_is_judged_by(named):
    made = point(named=named)
    (v,) = judged(made)
    stated = v.pod.as_json()
    again = replace(
        made, **kept_off(stated), signals={POWER: made.signals[POWER].astype(np.float32)}
    )
    assert judged(again)[0].pod.as_json() == stated


def test_a_response_that_is_damped_otherwise_is_a_finding():
    (v,) = judged(point(recorded=-0.8 + 4.2j))
    assert v.pod.disagrees
    assert "<b>yes</b>" in pod_section([v])
    assert "<b>yes</b>" not in pod_section(judged(point()))
    assert all(
        word not in pod_section(judged(point(named=False))) for word in ("<b>yes</b>", ">no<")
    )


def test_a_point_that_could_not_be_had_with_it_off_is_computed_anew():
    """What was in the way, such as a missing licence, may be gone."""
    assert point().lasting
    assert not replace(point(), off=None, off_failure="no licence").lasting


@pytest.mark.parametrize(("samples", "seen"), [(99, True), (98, False)])
def test_a_response_of_99_samples_tells_something_and_a_shorter_one_nothing(samples, seen):
    """From half a second after the event at 1 s, which is the 300th sample."""
    whole = point()
    part = slice(300 + samples)
    signals = {POWER: whole.signals[POWER][part]}
    (v,) = judged(replace(whole, times=whole.times[part], signals=signals))
    assert (v.pod.better_off is not None) is seen
