"""Like is compared with like: a pair's mode is the same mode in the systems with one vendor and with none."""

from functools import cache

import numpy as np
import pytest

from orchestrator.linear.spectra.modes import damping_percent
from orchestrator.studies.interactions.following import FollowedMode, Ways, followed
from orchestrator.studies.interactions.judgement import SAME
from orchestrator.studies.interactions.point import SharedMode
from orchestrator.studies.interactions.systems import NONE, Kind, SystemName
from orchestrator.studies.modes.modes import compute_modes
from tests.pages.markdown import ROOT
from tests.studies.interactions.park import folder, park, studied
from tests.support.scenarios import prepare_one

WSCC9 = ROOT / "orchestrator" / "cases" / "built_in" / "wscc9"

CONVERTERS = """
[components.A]
vendor = "A"
model = "{a}"
bus = "bus_7"
parameters = {{ S_n = "40 MVA", P_0 = 0.0, Q_0 = 0.0{pod_p} }}
[components.B]
vendor = "B"
model = "{b}"
bus = "bus_5"
parameters = {{ S_n = "40 MVA", P_0 = 0.0, Q_0 = 0.0{pod_q} }}
"""
POD_P, POD_Q = ", pod_p.enabled = true", ", pod_q.enabled = true"
IDLE = "static_generation"


def written(name, *, a="gfor", b="gfor", pod_p=POD_P, pod_q=POD_Q):
    """Three machines with a converter at each of two buses: POD-P at A, POD-Q at B."""
    text = (WSCC9 / "case.toml").read_text(encoding="utf-8")
    text = text[: text.index("[[events]]")].replace(
        '"gfor*.omega", "gfor*.p", "gfor*.q", "gfor*.delta_*", ', ""
    )
    converters = CONVERTERS.format(
        a=a, b=b, pod_p=pod_p if a == "gfor" else "", pod_q=pod_q if b == "gfor" else ""
    )
    (folder() / "units.csv").write_bytes((WSCC9 / "units.csv").read_bytes())
    path = folder() / name
    path.write_text(text + converters, encoding="utf-8")
    return path


@cache
def helped(threshold=0.05):
    return studied(written("helped.toml"), frequencies=(0.1, 5.0), threshold=threshold)


def slow_swing(path):
    """Damping [%] of the swing of 1.3 Hz: of the modes below 1.6 Hz the one that is not well damped."""
    prepared = prepare_one(path)
    modes = compute_modes(prepared, (1.0, 1.6)).modes
    (found,) = [mode.damping_percent for mode in modes if mode.damping_percent < 20]
    return found


def test_two_converters_that_help_are_not_accused():
    """Each holds less of the swing alone than the threshold, or hardly more; the swing is the same in all systems."""
    judgement = helped().judgement
    b_alone = judgement.alone["B"].record.modes
    swing = min(b_alone, key=lambda mode: abs(mode.frequency_hz - 1.32))
    assert swing.components["B"] < 0.05  # a list of the modes of B alone would not have it
    (pair,) = judgement.pairs
    apart = {
        "neither": slow_swing(written("neither.toml", a=IDLE, b=IDLE)),
        "A": slow_swing(written("a.toml", b=IDLE)),
        "B": slow_swing(written("b.toml", a=IDLE)),
        "both": slow_swing(folder() / "helped.toml"),
    }
    assert apart["neither"] < apart["B"] < apart["A"] < apart["both"]
    assert pair.mode.neither_percent == pytest.approx(apart["neither"], abs=1e-4)
    assert pair.mode.alone_percent == pytest.approx((apart["A"], apart["B"]), abs=1e-4)
    assert pair.mode.together.damping_percent == pytest.approx(apart["both"], abs=1e-4)
    assert pair.fall == pytest.approx(apart["B"] - apart["both"], abs=1e-4)
    assert helped().worst_pair is None
    assert "no worst pair: A + B: stable, no lower together: 1.332 Hz has 4.63 % together" in (
        " ".join(helped().sentences)
    )
    assert judgement.alone["B"].least_damping == pytest.approx(apart["B"], abs=1e-4)
    none = [mode for mode in judgement.none.record.modes if judgement.none.counts(mode)]
    assert [mode.damping_percent for mode in none] == pytest.approx([apart["neither"]], abs=1e-4)


@pytest.mark.parametrize("threshold", [0.0, 0.01, 0.2, 0.5])
def test_the_threshold_does_not_turn_the_verdict(threshold):
    (usual,), (other,) = helped().judgement.pairs, helped(threshold).judgement.pairs
    assert helped(threshold).worst_pair is None
    assert (usual.fall > SAME, other.fall is None or other.fall > SAME) == (
        False,
        other.fall is None,
    )


@pytest.mark.parametrize("threshold", [0.0, 0.5])
def test_two_converters_that_harm_are_named_at_any_threshold(threshold):
    (worst, other, _), found = park().judgement.pairs, studied(threshold=threshold)
    assert found.worst_pair == worst.vendors == ("A", "B")
    assert found.judgement.worst_pair.fall == pytest.approx(worst.fall)
    again = next(pair for pair in found.judgement.pairs if pair.vendors == other.vendors)
    assert other.fall > SAME
    assert again.fall == pytest.approx(other.fall)


def test_a_mode_that_a_vendor_brings_is_not_there_without_it():
    def follow(value, begin, end):
        return None if "B" in begin.names and "B" not in end.names else value

    mode = SharedMode(-1.0, 10.0, {"B": 1.0})
    found = followed(mode, ("A", "B"), follow)
    assert found == FollowedMode(mode, (None, mode.eigenvalue), None)
    assert found.fall == pytest.approx(0.0)


def test_two_ways_to_another_mode_leave_that_with_neither_unknown():
    def follow(value, begin, end):
        if end == NONE:
            return value + (1.0 if begin.names == ("A",) else 0.0)
        return value

    found = followed(SharedMode(-1.0, 10.0, {}), ("A", "B"), follow)
    assert found.neither is None
    assert found.fall == pytest.approx(0.0)


def test_the_way_from_one_system_to_another_is_that_of_small_steps_of_the_presence():
    """Followed in 100 small steps by the nearest eigenvalue, the swing ends where the study says."""
    ways, both = Ways(helped().result), SystemName(Kind.PAIR, ("A", "B"))
    alone = SystemName(Kind.ALONE, ("A",))
    (pair,) = helped().judgement.pairs
    ways.follow(pair.mode.together.eigenvalue, both, alone)
    way = ways._ways[both, alone]
    value = pair.mode.together.eigenvalue
    for part in np.linspace(1.0, 0.0, 101):
        model = way.model_at(float(part))
        eigenvalues = np.linalg.eigvals(model.A).astype(complex)
        eigenvalues = np.log(eigenvalues[np.abs(eigenvalues) > 1e-9]) / model.step_size
        value = eigenvalues[np.argmin(np.abs(eigenvalues - value))]
    assert damping_percent(complex(value)) == pytest.approx(pair.mode.alone_percent[0], abs=1e-6)
