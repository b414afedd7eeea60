"""A recorder hands its rows on in blocks, and a recording can be taken up again."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.core.errors import ResultsError
from orchestrator.systems.coupling import recorder as module
from orchestrator.systems.coupling import recording_blocks
from orchestrator.systems.coupling.recorder import Recorder


class Rows:
    """A sink that keeps its blocks by their first row."""

    def __init__(self):
        self.blocks = {}

    def begin(self, names):
        self.names, self.blocks = names, {}

    def keep(self, first, times, values):
        self.blocks[first] = (times.copy(), values.copy())

    def resume(self, names, rows):
        self.blocks = {first: block for first, block in self.blocks.items() if first < rows}
        for first, (times, values) in sorted(self.blocks.items()):
            yield first, times[: rows - first], values[: rows - first]

    @property
    def times(self):
        return np.concatenate([block[0] for _, block in sorted(self.blocks.items())])

    @property
    def values(self):
        return np.concatenate([block[1] for _, block in sorted(self.blocks.items())])


class Model:
    """What a recorder needs of a component: it gives its index, and its negative."""

    def __init__(self, run):
        self.run = run
        self.description = SimpleNamespace(variables={"y": None, "z": None})


@pytest.fixture
def run(monkeypatch):
    run = SimpleNamespace(index=0, time=0.0, components={})
    run.components["a"] = Model(run)

    class Batch:
        def __init__(self, component, names):
            self.component, self.names = component, names

        def read(self):
            k = self.component.run.index
            return np.array([{"y": 0.1 * k, "z": -k}[name] for name in self.names])

    monkeypatch.setattr(module, "RealBatch", Batch)
    monkeypatch.setattr(recording_blocks, "BLOCK_ROWS", 64)
    return run


def go(run, recorder, until, stop=1000):
    recorder.begin(run, stop)
    recorder.observe(run)
    go_on(run, recorder, until)


def go_on(run, recorder, until):
    while run.index < until:
        run.index += recorder.every
        run.time = run.index * 1e-4
        recorder.observe(run)


@pytest.mark.parametrize("rows", [1, 63, 64, 65, 128, 500])
def test_blocks_hold_what_memory_would(run, rows):
    sink = Rows()
    plain, streamed = Recorder(["a.z", "a.y"], 2), Recorder(["a.z", "a.y"], 2, sink=sink, keep=10)
    plain.begin(run, 2 * rows)
    plain.observe(run)
    streamed.begin(run, 2 * rows)
    streamed.observe(run)
    for _ in range(rows - 1):
        run.index += 2
        run.time = run.index * 1e-4
        plain.observe(run)
        streamed.observe(run)
    streamed.end(run)
    assert sink.values.shape == (rows, 2) == plain.values.shape
    assert np.array_equal(sink.times, plain.times)
    assert np.array_equal(sink.values, plain.values)
    assert np.array_equal(streamed.values, plain.values[::10])
    assert np.array_equal(streamed.times, plain.times[::10])
    assert plain.values[-1].tolist() == [-2.0 * (rows - 1), 0.1 * 2 * (rows - 1)]


@pytest.mark.parametrize(("slow", "known"), [(0.0, 10), (0.4, 4)])
def test_rows_that_wait_are_handed_over_unless_that_takes_too_much_of_the_time(
    run, monkeypatch, slow, known
):
    """A row comes every 2 s and may wait for 5 s; where handing over takes 0.4 s, for 40 s."""

    class Slow(Rows):
        passed = 0.0

        def keep(self, first, times, values):
            self.passed += slow
            super().keep(first, times, values)

    sink = Slow()
    monkeypatch.setattr(module, "monotonic", lambda: 2.0 * run.index + sink.passed)
    recorder = Recorder(["a.y"], 1, sink=sink)
    go(run, recorder, 9)
    assert len(sink.times) == known
    assert list(sink.blocks) == [0]


@pytest.mark.parametrize("at", [1, 40, 64, 200])
@pytest.mark.parametrize("streamed", [True, False])
def test_a_recording_is_taken_up_again(run, at, streamed):
    """Rows after the position, which the killed process had written already, go; none is missing or there twice."""
    whole, sink = Recorder(["a.y"], 1), Rows()
    go(run, whole, 300)
    run.index, run.time = 0, 0.0
    first = Recorder(["a.y"], 1, sink=sink if streamed else None, keep=1)
    go(run, first, at)
    position = first.position()
    go_on(run, first, at + 30)
    first.end(run)
    run.index, run.time = at, at * 1e-4
    second = Recorder(["a.y"], 1, sink=sink if streamed else None, keep=1)
    second.resume(position)
    go(run, second, 300)
    second.end(run)
    assert np.array_equal(second.times, whole.times)
    assert np.array_equal(second.values, whole.values)
    assert not streamed or np.array_equal(sink.values, whole.values)


def test_a_sink_that_fails_is_not_asked_again(run):
    class Full(Rows):
        asked = 0

        def keep(self, first, times, values):
            self.asked += 1
            raise ResultsError("no room")

    sink = Full()
    recorder = Recorder(["a.y"], 1, sink=sink)
    with pytest.raises(ResultsError, match="no room"):
        go(run, recorder, 300)
    recorder.end(run)
    assert sink.asked == 1
