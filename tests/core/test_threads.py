"""What is computed side by side: at the same time, with its error, and with one thread of BLAS."""

import os
import subprocess
import sys
import threading

import pytest
from threadpoolctl import threadpool_info

from orchestrator.core.errors import AnalysisError
from orchestrator.core.threads import alone, side_by_side


def blas_threads():
    return {library["num_threads"] for library in threadpool_info()}


def test_two_computations_and_the_block_are_under_way_at_the_same_time_with_one_thread_of_blas():
    together = threading.Barrier(3, timeout=60)

    def compute():
        together.wait()  # breaks if one of them began after another's end
        return blas_threads()

    with side_by_side() as pool:
        found = [pool.submit(compute) for _ in range(2)]
        together.wait()
        assert blas_threads() == {1}
    assert [one.result() for one in found] == [{1}, {1}]


def test_an_error_of_a_computation_comes_with_its_result():
    def fail():
        raise AnalysisError("it does not converge")

    with side_by_side() as pool:
        found = pool.submit(fail)
    with pytest.raises(AnalysisError, match="does not converge"):
        found.result()


def test_where_threads_do_not_pay_all_is_computed_in_turn():
    """The thread that submits computes at once, with one thread of BLAS, and an error comes with its result."""

    def fail():
        raise AnalysisError("it does not converge")

    with side_by_side(pays=False) as pool:
        found, failed = pool.submit(threading.get_ident), pool.submit(fail)
        assert found.done()
        assert pool.submit(blas_threads).result() == {1}
    assert found.result() == threading.get_ident()
    with pytest.raises(AnalysisError, match="does not converge"):
        failed.result()


def test_what_has_not_begun_is_given_up_where_the_block_fails():
    go_on, begun = threading.Event(), threading.Semaphore(0)

    def wait():
        begun.release()
        assert go_on.wait(60)

    def interrupted():
        with side_by_side() as pool:
            computations.extend(pool.submit(wait) for _ in range(3))
            assert all(begun.acquire(timeout=60) for _ in range(2))
            computations[2].add_done_callback(lambda _: go_on.set())  # once it is given up
            raise KeyboardInterrupt

    computations = []
    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [one.cancelled() for one in computations] == [False, False, True]
    assert all(one.done() for one in computations)


def test_who_is_alone_may_ask_for_it_again_and_others_wait():
    """The benchmark of a screening did, and waited for itself for ever."""
    inside, go_on, entered = threading.Event(), threading.Event(), threading.Event()

    def twice():
        with alone(), alone():
            assert blas_threads() == {1}
            inside.set()
            assert go_on.wait(60)

    def another():
        with alone():
            entered.set()

    threads = [threading.Thread(target=work, daemon=True) for work in (twice, another)]
    threads[0].start()
    assert inside.wait(10)
    threads[1].start()
    assert not entered.wait(0.1)
    go_on.set()
    assert entered.wait(10)


def test_libraries_that_come_with_scipy_later_are_limited_as_well():
    """A device is checked by NumPy alone; what the same process computes afterwards has SciPy's BLAS beside it."""
    code = """
from orchestrator.core.threads import one_thread
from threadpoolctl import threadpool_info
with one_thread():
    early = len(threadpool_info())
import scipy.linalg
with one_thread():
    assert len(threadpool_info()) > early, "nothing new to limit"
    print({library["num_threads"] for library in threadpool_info()})
"""
    free = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    found = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=free, check=True
    )
    assert found.stdout == "{1}\n"
