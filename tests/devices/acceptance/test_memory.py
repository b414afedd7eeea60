"""What the check of memory does where a block misleads, where a call is refused, and where nothing can be measured."""

from contextlib import contextmanager
from itertools import accumulate, combinations

import pytest

from orchestrator.core.errors import ComponentError
from orchestrator.devices.acceptance.checks import resources
from orchestrator.devices.acceptance.checks.resources import _growth, _Unknown
from orchestrator.devices.acceptance.checks.subject import Running, Subject
from orchestrator.devices.acceptance.runner import check_fmu
from orchestrator.devices.sandbox.resource_limits import Limits


class Memory:
    """A subject of which only the memory is asked."""

    def __init__(self, *growths):
        self._sizes = accumulate(growths, initial=1_000_000)
        next(self._sizes)

    def memory_in_use(self):
        return next(self._sizes)


@pytest.mark.parametrize("places", [*combinations(range(8), 2)])
@pytest.mark.parametrize("other", [-40_000, 40_000])
def test_what_happens_in_two_blocks_hides_no_leak_and_makes_none(places, other):
    """Growths of eight blocks; the first fills what fills once."""
    for leak in (0, 3000):
        growths = [leak] * 8
        for place in places:
            growths[place] += other
        assert _growth(Memory(*growths), lambda: None, 6) == leak / 6


def test_memory_that_is_no_longer_told_is_no_growth_of_zero():
    subject = Memory(*8 * [0])
    subject.memory_in_use = lambda: 0
    assert isinstance(_growth(subject, lambda: None, 6), _Unknown)


def checked(path):
    (_, found) = check_fmu(path, None, Limits(seconds=30.0), ("memory",), run_for=0.3).results
    return found


@pytest.fixture
def quick(monkeypatch):
    """The parts that these tests are not about take a moment."""
    for name in ("_of_steps", "_of_instances", "_of_states"):
        monkeypatch.setattr(resources, name, lambda *_: 0.0)


def test_a_python_backed_fmu_of_ours_passes_by_the_common_rule(fmu_path):
    """Each instance kept a class that was made for it, 28 kB, and a rule of its own excused that."""
    found = checked(fmu_path("infinite_bus"))
    assert found.fault == "", found.evidence
    assert found.figures["instance"] < 2500


def test_resets_that_could_not_be_measured_are_no_pass(gallery, quick, monkeypatch):
    def refuses(self):
        raise ComponentError("fmu", "fmi2Reset", "fmi2Error", "no room")

    monkeypatch.setattr(Running, "reset", refuses)
    found = checked(gallery("converter")[0])
    assert found.verdict == "remark"
    assert "not measured: fmi2Reset, because fmi2Reset returned fmi2Error" in found.evidence
    assert "fmi2Reset" not in found.figures


def test_a_good_fmu_passes_and_says_what_was_left_out(gallery, quick):
    found = checked(gallery("converter")[0])
    assert found.verdict == "pass"
    assert (
        "not measured: later step, because the check 'runs' did not run long enough"
        in found.evidence
    )
    assert found.figures["fmi2Reset"] < 120


def test_a_leak_of_each_reset_is_found_though_one_block_frees_more(gallery, quick, monkeypatch):
    """As where something else in the FMU's process gives memory back."""
    asked, count = Subject.memory_in_use, [0]

    def with_a_gift(self):
        count[0] += 1
        return asked(self) - (50_000 if count[0] > 4 else 0)

    monkeypatch.setattr(Subject, "memory_in_use", with_a_gift)
    found = checked(gallery("leaking_resets_sampled")[0])
    assert (found.verdict, found.fault) == ("fail", "memory leak")
    assert 450 < found.figures["fmi2Reset"] < 600


def test_a_platform_that_tells_nothing_of_files_is_named(gallery, quick, monkeypatch):
    monkeypatch.setattr(
        resources, "_of_files", lambda subject: _Unknown("nothing tells", refused=False)
    )
    assert (
        "; not measured: open files, because nothing tells"
        in checked(gallery("converter")[0]).evidence
    )


class Counted:
    """A subject that counts the steps of each block."""

    def __init__(self, ends):
        self.ends, self.step_size, self.blocks = ends, 1e-3, []

    def steps(self, hold):
        return None

    @contextmanager
    def running(self):
        yield self

    def record(self, count, step_size, stimulus):
        self.blocks.append(count)

    def memory_in_use(self):
        return 1


@pytest.mark.parametrize(("ends", "steps"), [(None, 100), (1000.0, 100), (0.8, 100), (0.4, 50)])
def test_fewer_steps_are_looked_at_only_where_the_experiment_ends(ends, steps):
    subject = Counted(ends)
    assert resources._of_steps(subject, 100) == 0
    assert subject.blocks == [steps] * 8
    assert isinstance(resources._of_steps(Counted(0.1), 100), _Unknown)
