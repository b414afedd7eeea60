"""Fixtures of tests of commands."""

import pytest

from tests.support.warm import running


@pytest.fixture(scope="session")
def warm():
    """Makes processes of ``gfor`` whose imports are behind them."""
    with running() as found:
        yield found
