"""Impedance correction tables: factors by hand, at and between points, of ratios and of phase shifts."""

from functools import partial

import pytest

from orchestrator.core.errors import InputError
from tests.cases.networks.psse import raw, read_text, records
from tests.cases.networks.psse.rawx_texts import network, rawx, table

X = 0.1  # of the transformer between buses 4 and 5 [pu]
RATIOS = "1,0.9,1.2,1.0,1.0,1.1,0.8"
SHIFTS = "2,-30,1.3,0,1.0,30,1.5"


@pytest.fixture
def read(tmp_path):
    return partial(read_text, tmp_path)


def with_transformer(revision, corrections, windv=1.0, ang=0.0, tab=1):
    """The nine buses with a transformer more, and correction tables."""
    found = records(revision)
    rates = ",".join(["0"] * (3 if revision == 33 else 12))
    node = "0," if revision > 34 else ""
    found["TRANSFORMER"] += [
        "4,5,0,'C ',1,1,1,0,0,2,'T',1,1,1",
        f"0,{X},100",
        f"{windv},0,{ang},{rates},0,0,{node}1.1,0.9,1.1,0.9,33,{tab},0,0,0",
        "1.0,0",
    ]
    found["IMPEDANCE CORRECTION"] = corrections
    return raw(revision, found)


def impedance(found):
    return complex(*found.tables.branch[-1][2:4])


@pytest.mark.parametrize(
    ("windv", "ang", "tab", "factor"),
    [
        (1.0, 0, 1, 1.0),
        (1.05, 0, 1, 0.9),
        (0.95, 0, 1, 1.1),
        (0.8, 0, 1, 1.2),
        (1.3, 0, 1, 0.8),
        (1.05, -15, 2, 1.15),
        (1.0, 20, 2, 1 + 0.5 * 20 / 30),
        (1.05, 15, 0, 1.0),
    ],
)
def test_the_factor_is_interpolated(read, windv, ang, tab, factor):
    """T of table 1 is a ratio, as it lies within 0.5 and 1.5; T of table 2 is a shift."""
    found = read(with_transformer(33, [RATIOS, SHIFTS], windv, ang, tab))
    assert impedance(found) == pytest.approx(1j * X * factor)
    assert not [x for x in found.changes if "correct" in x.text]


def test_factors_are_complex_from_revision_34_on(read):
    """A table goes on in the next line until F is 0."""
    lines = [
        "3,0.94,1.02,0.01,0.96,1.01,0.01,0.98,1.0,0.01,1.0,1.0,0,1.02,0.99,0.01,1.04,0.98,0.02",
        "1.06,0.97,0.03,0,0,0",
        "4,0.9,2,0,1.1,2,0,0,0,0",
    ]
    found = read(with_transformer(35, lines, 1.05, tab=3))
    assert impedance(found) == pytest.approx(1j * X * (0.975 + 0.025j))
    found = read(with_transformer(34, lines, 1.05, tab=4))
    assert impedance(found) == pytest.approx(2j * X)


def test_the_legs_of_a_star_are_corrected_each(read):
    found = records(33)
    found["TRANSFORMER"] += [
        "4,5,6,'C ',1,1,1,0,0,2,'T',1,1,1",
        "0,0.3,100,0,0.5,100,0,0.4,100,1,0",
        "1.05,0,0,0,0,0,0,0,1.1,0.9,1.1,0.9,33,1,0,0,0",
        "1.0,0,15,0,0,0,0,0,1.1,0.9,1.1,0.9,33,2,0,0,0",
        "1.0,0,0,0,0,0,0,0,1.1,0.9,1.1,0.9,33,0,0,0,0",
    ]
    found["IMPEDANCE CORRECTION"] = [RATIOS, SHIFTS]
    star = read(raw(33, found)).tables.branch[-3:, 3]
    assert star == pytest.approx([0.1 * 0.9, 0.2 * 1.25, 0.3])


def test_a_table_that_is_not_there_is_told(read):
    found = read(with_transformer(33, [RATIOS], 1.05, tab=7))
    assert impedance(found) == 1j * X
    (told,) = [x.text for x in found.changes if "TAB" in x.text]
    assert told == "TAB is 7, and the file has no such impedance correction table: not corrected"


def test_points_that_do_not_rise_are_refused(read):
    with pytest.raises(InputError, match=r"line \d+: T of the impedance.*is 1, 0\.9; it must rise"):
        read(with_transformer(33, ["1,1.0,1.0,0.9,1.1"]))


def test_rows_of_json_are_one_table(read):
    """RAWX has a row for each point."""
    given = network()
    given["transformer"] = table(
        "ibus jbus ckt x1_2 windv1 tab1", [[4, 5, "C", X, 1.05, 3], [4, 1, "1", 0.05, 1, 0]]
    )
    given["impcor"] = table(
        "itable tap refact imfact", [[3, 0.9, 1.2, 0], [3, 1.0, 1.0, 0], [3, 1.1, 0.8, 0.1]]
    )
    found = read(rawx(given), "grid.rawx")
    assert complex(*found.tables.branch[-2][2:4]) == pytest.approx(1j * X * (0.9 + 0.05j))
