"""The list of tests that take long, and how it marks them."""

import pytest

from tests.benchmarks.durations import catches
from tests.support.durations import (
    LIST,
    LONGEST,
    NIGHTLY,
    ROOT,
    Measure,
    longest_first,
    mark,
    may_be_chosen,
    may_hold_slow_tests,
    read_list,
    require_readable,
)


class Item:
    def __init__(self, nodeid, *names):
        self.nodeid, self.names = nodeid, set(names)

    def get_closest_marker(self, name):
        return name in self.names or None

    def add_marker(self, name):
        self.names.add(name)


def test_what_is_on_the_list_is_slow_unless_it_is_always_to_be_quick():
    listed = next(iter(read_list()))
    items = [Item(listed), Item(listed, "quick"), Item("tests/test_new.py::test_new")]
    mark(items)
    assert [item.names for item in items] == [{"slow"}, {"quick"}, set()]


def test_the_longest_file_comes_first_where_all_are_slow():
    short, long = "tests/a.py::test_of_no_list", next(iter(read_list()))
    items = [Item(name, "slow") for name in (short, long)]
    longest_first(items)
    assert [item.nodeid for item in items] == [long, short]
    items = [Item(short), Item(long, "slow")]
    longest_first(items)
    assert [item.nodeid for item in items] == [short, long]


@pytest.mark.parametrize(
    ("expression", "all_are_read"),
    [
        ("slow", False),
        ("slow and not nightly and not wheel", False),
        ("nightly", False),
        ("not slow", True),
        ("slow or reproduction", True),
        ("slow and not nightly or reproduction", True),
        ("slow and (not nightly or reproduction)", True),
        ("reproduction", True),
        ("", True),
    ],
)
def test_files_without_slow_tests_are_read_unless_those_alone_are_asked_for(
    expression, all_are_read
):
    files = {path for path in ROOT.glob("tests/**/test_*.py") if may_be_chosen(path, expression)}
    listed = {ROOT / test.partition("::")[0] for test in read_list()}
    assert listed <= files
    assert (set(ROOT.glob("tests/**/test_*.py")) == files) == all_are_read


def test_a_test_that_is_slow_by_a_mark_from_elsewhere_is_told(tmp_path):
    quick = next(p for p in sorted(ROOT.glob("tests/**/test_*.py")) if not may_hold_slow_tests(p))
    item = Item("tests/a.py::test", "slow")
    item.path = quick
    with pytest.raises(pytest.UsageError, match=r"write pytest\.mark\.slow in this file"):
        require_readable([item])
    item.path = ROOT / next(iter(read_list())).partition("::")[0]
    require_readable([item])


def test_the_list_names_tests_of_files_that_are_there_each_once():
    lines = LIST.read_text(encoding="utf-8").splitlines()
    seconds = read_list()
    assert len(lines) == len(seconds)
    assert min(seconds.values()) >= LONGEST
    missing = {
        test.partition("::")[0]
        for test in seconds
        if not (LIST.parents[1] / test.partition("::")[0]).exists()
    }
    assert not missing, "python -m tests.benchmarks.durations writes the list anew"


def test_a_test_is_measured(tmp_path):
    around = Measure(tmp_path / "seconds").pytest_runtest_protocol(Item("tests/a.py::test[a b]"))
    next(around)
    sum(k * k for k in range(1_000_000))
    with pytest.raises(StopIteration):
        around.send(True)
    ((test, seconds),) = read_list(tmp_path / "seconds").items()
    assert test == "tests/a.py::test[a b]"
    assert 0.01 <= seconds < 10


def test_what_runs_by_night_is_there_and_is_none_of_the_papers_tables():
    root = NIGHTLY.parents[1]
    for line in NIGHTLY.read_text(encoding="utf-8").splitlines():
        file, _, name = line.partition("::")
        assert (
            f"def {name.partition('[')[0]}(" in (root / file).read_text(encoding="utf-8")
            or not name
        ), line
        assert "papers" not in name


def test_what_caught_a_mistake_is_there_and_quick():
    """Else the quick tests find fewer mistakes than `tests/benchmarks` says: name there a quick test that does."""
    nightly, slow = tuple(NIGHTLY.read_text(encoding="utf-8").split("\n")[:-1]), read_list()
    assert not [test for test in catches() if test in slow or test.startswith(nightly)]
    assert not [test for test in catches() if not _is_there(*test.partition("::")[::2])]


def _is_there(file, name):
    path = LIST.parents[1] / file
    function = f"def {name.partition('[')[0]}(" if name else ""  # a file of which none could run
    return path.exists() and function in path.read_text(encoding="utf-8")
