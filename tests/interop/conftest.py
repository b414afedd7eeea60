"""``pytest tests/interop --write-table`` writes the README's table of masters from what it measures."""

import pytest

from tests.interop import table


def pytest_addoption(parser):
    parser.addoption("--write-table", action="store_true", help="write the README's table of masters")


@pytest.fixture(scope="session")
def results(request):
    """(master, kind) → system → outcome, as measured in this session."""
    measured = {}
    yield measured
    if request.config.getoption("--write-table", default=False):
        assert not table.missing(measured), f"no table is written without {', '.join(table.missing(measured))}"
        table.write(measured)
