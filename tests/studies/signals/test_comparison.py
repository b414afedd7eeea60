"""Two runs side by side, signal by signal, on curves whose difference is known."""

import numpy as np
import pytest
import xarray as xr

from orchestrator.core.errors import AnalysisError, InputError
from orchestrator.face.api.identification import identify
from orchestrator.studies.signals import comparison
from orchestrator.studies.signals.common_times import common_times
from orchestrator.studies.signals.comparison import compare, most_different

LABELS = ("one", "two")


def run_of(times, **signals):
    data = {
        name.replace("__", "."): ("time", values, {"units": "pu"})
        for name, values in signals.items()
    }
    return xr.Dataset(data, coords={"time": times})


def test_only_the_time_that_both_have_counts():
    a, b = np.linspace(0, 10, 101), np.linspace(4, 20, 33)
    found = compare(
        run_of(a, g__x=0.1 * a), run_of(b, g__x=0.1 * b + 0.2 * (b >= 7)), "g.x", 0.0, LABELS
    )
    assert found.largest == pytest.approx(0.2)
    assert 7 <= found.at <= 10
    assert found.deviations == pytest.approx((0.6, 0.8))


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("ratio", [4, 20])
def test_one_run_recorded_at_two_intervals_does_not_differ_from_itself(ratio, turned):
    """Interpolation of the longer interval would make a difference as large as the swing itself."""
    fine = np.arange(0, 1001) * 1e-3
    coarse = fine[::ratio] + 1e-13  # as another sum of steps is rounded
    fast, slow = np.sin(2 * np.pi * 20 * fine), 0.1 * fine
    runs = [
        run_of(fine, g__fast=fast, g__slow=slow),
        run_of(coarse, g__fast=fast[::ratio], g__slow=1.1 * slow[::ratio]),
    ]
    one, two = runs[::-1] if turned else runs
    found = compare(one, two, "g.fast", 0.0, LABELS)
    assert (found.largest, found.rms) == (0.0, 0.0)
    assert most_different(one, two) == ["g.slow", "g.fast"]
    times = common_times(one["time"].values, two["time"].values, LABELS)
    assert len(times.times) == len(coarse)
    intervals = [0.001 * ratio, 0.001] if turned else [0.001, 0.001 * ratio]
    assert times.remark == (
        f"one is recorded every {intervals[0]:g} s, two every {intervals[1]:g} s: they are compared at the "
        f"{len(coarse)} times that both have."
    )


@pytest.mark.parametrize("turned", [False, True])
def test_where_the_times_do_not_meet_the_shorter_interval_is_interpolated(turned):
    runs = [
        run_of(t, g__x=np.sin(2 * np.pi * t))
        for t in (np.linspace(0, 1, 1001), np.linspace(0, 1, 8))
    ]
    one, two = runs[::-1] if turned else runs
    found = compare(one, two, "g.x", 0.0, LABELS)
    assert found.largest < 1e-5  # interpolation of the longer interval would give 0.1
    remark = common_times(one["time"].values, two["time"].values, LABELS).remark
    assert f"at the 8 times of {'one' if turned else 'two'}, between the records of" in remark


def test_runs_with_the_same_times_need_no_remark():
    t = np.linspace(0, 1, 11)
    assert common_times(t, t[2:], LABELS).remark == ""
    assert common_times(t, t[2:], LABELS).times.tolist() == t[2:].tolist()


def test_the_figures_of_a_difference():
    """Each run's deviation is from its own start; the rms is that of all times."""
    t = np.linspace(0, 1, 5)
    found = compare(
        run_of(t, g__x=[0, 1, 0, 0, 0]), run_of(t, g__x=[5, 5, 5, 8, 5]), "g.x", 0.0, LABELS
    )
    assert found.deviations == (1.0, 3.0)
    assert (found.largest, found.at) == (8.0, 0.75)
    assert found.rms == pytest.approx(np.sqrt((25 + 16 + 25 + 64 + 25) / 5))


def test_a_difference_of_two_signals_keeps_their_unit():
    t = np.linspace(0, 1, 11)
    one, two = run_of(t, a__x=t, b__x=0 * t), run_of(t, a__x=t, b__x=0.5 * t)
    found = compare(one, two, "a.x - b.x", 0.0, LABELS)
    assert (found.unit, found.largest, found.at) == ("pu", pytest.approx(0.5), 1.0)


def test_runs_that_do_not_meet_are_refused():
    one, two = (
        run_of(np.linspace(0, 1, 11), g__x=np.zeros(11)),
        run_of(np.linspace(2, 3, 11), g__x=np.zeros(11)),
    )
    with pytest.raises(InputError, match="one and two have no time in common"):
        compare(one, two, "g.x", 0.0, LABELS)


def test_a_signal_that_one_run_lacks_is_named_with_the_run():
    t = np.linspace(0, 1, 11)
    with pytest.raises(InputError, match=r"two: signal 'g\.x' was not recorded; there are: g\.y"):
        compare(run_of(t, g__x=t), run_of(t, g__y=t), "g.x", 0.0, LABELS)


def test_signals_are_ranked_by_their_difference_beside_their_own_motion():
    t = np.linspace(0, 1, 11)
    one = run_of(t, g__large=100 * t, g__small=1e-3 * t, g__same=t)
    two = run_of(t, g__large=101 * t, g__small=2e-3 * t, g__same=t)
    assert most_different(one, two) == ["g.small", "g.large", "g.same"]
    assert most_different(one, two, 1) == ["g.small"]


def test_a_signal_that_is_no_number_is_one_error():
    times = np.linspace(0, 10, 101)
    broken = np.where(times < 8.95, 1.0, np.nan)
    one, two = run_of(times, g__x=np.sin(times)), run_of(times, g__x=broken)
    with pytest.raises(
        InputError,
        match=r"^two: g.x is no finite number \(nan\) at t = 9 s, and at 11 of 101 times",
    ):
        compare(one, two, "g.x", 0.0, LABELS)
    with pytest.raises(
        InputError, match=r"second: g.x is no finite number .* at t = 9 s, and at 11 of 81 times"
    ):
        identify(two.assign_attrs(scenario="second"), "g.x")
    with pytest.raises(AnalysisError, match="constant"):
        identify(two, "g.x", stop=8.0)  # there it is one


def test_without_doubts_modes_are_judged_by_the_length_of_their_window(monkeypatch):
    """What rings for less than a period of it is none, wherever the window begins."""
    found, judged = [object()], []
    monkeypatch.setattr(comparison, "_modes_of", lambda curve, order: found)
    monkeypatch.setattr(
        comparison, "worth_showing", lambda modes, seconds, weakest: judged.append(seconds) or modes
    )
    times = np.linspace(10.0, 14.0, 5)
    curve = xr.DataArray(np.sin(times), coords={"time": times}, dims="time")
    assert comparison.modes_without_doubts(curve) is found
    assert judged == [4.0]
