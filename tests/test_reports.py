"""What a worker of the tests reports of each: nothing that fails or is skipped is kept back."""

from textwrap import dedent

from tests.support.reports import FewReports

pytest_plugins = ["pytester"]

TESTS = dedent(
    """
    import pytest

    @pytest.fixture
    def broken():
        raise ValueError

    @pytest.fixture
    def broken_later():
        yield
        raise ValueError

    def test_good(): ...
    def test_bad(): raise ValueError
    def test_without_set_up(broken): ...
    def test_without_teardown(broken_later): ...
    def test_left_out(): pytest.skip("by itself")
    @pytest.mark.skip
    def test_marked(): ...
    @pytest.mark.xfail
    def test_known(): raise ValueError
    """
)


def test_a_set_up_or_teardown_is_told_only_if_it_does_not_pass(pytester):
    ran = pytester.inline_run(pytester.makepyfile(TESTS), plugins=[FewReports()])
    reports = ran.getreports("pytest_runtest_logreport")
    assert [(r.nodeid.partition("::test_")[2], r.when, r.outcome) for r in reports] == [
        ("good", "call", "passed"),
        ("bad", "call", "failed"),
        ("without_set_up", "setup", "failed"),
        ("without_teardown", "call", "passed"),
        ("without_teardown", "teardown", "failed"),
        ("left_out", "call", "skipped"),
        ("marked", "setup", "skipped"),
        ("known", "call", "skipped"),
    ]
