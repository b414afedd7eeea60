"""What is computed beside something else: at the same time, with its error, and with one thread of BLAS."""

import threading

import pytest
from threadpoolctl import threadpool_info

from orchestrator.analysis.threads import beside
from orchestrator.errors import AnalysisError


def blas_threads():
    return {library["num_threads"] for library in threadpool_info()}


def test_both_sides_are_under_way_at_the_same_time_with_one_thread_of_blas():
    here, there = threading.Event(), threading.Event()

    def compute():
        there.set()
        assert here.wait(10)  # would not come if the block began after this
        return blas_threads()

    with beside(compute) as found:
        assert there.wait(10)
        here.set()
        assert blas_threads() == {1}
    assert found.done()
    assert found.result() == {1}


def test_an_error_of_the_other_side_comes_with_its_result():
    def fail():
        raise AnalysisError("it does not converge")

    with beside(fail) as found:
        pass
    with pytest.raises(AnalysisError, match="does not converge"):
        found.result()
