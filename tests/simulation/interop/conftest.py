"""``pytest tests/simulation/interop --write-table`` writes the pages' table of masters from what it measures."""

import pytest


def pytest_addoption(parser):
    parser.addoption("--write-table", action="store_true", help="write the pages' table of masters")


@pytest.fixture(scope="session")
def results():
    """(master, kind) → system → outcome, as measured in this session."""
    return {}


@pytest.fixture(scope="session")
def write_table(request):
    return request.config.getoption("--write-table", default=False)
