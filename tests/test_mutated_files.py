"""Files of every kind that a user gives, changed at random, and the changes that once ended in another error."""

import random

import pytest

from orchestrator.core.errors import CosimError
from tests.benchmarks.reader_fuzz import Defect, fuzzed, kinds

KINDS = (
    "case",
    "case with files",
    "lines",
    "case of a planner",
    "parameters",
    "raw 33",
    "raw 35",
    "dyr",
    "cfg",
    "dat",
    "binary cfg",
    "binary dat",
    "ssd",
    "description",
    "binding",
    "points",
    "device",
)
LONG, HUGE = "x" * 5000, "9" * 400


@pytest.fixture(scope="module")
def of_kind():
    found = kinds()
    assert set(found) == set(KINDS)
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_a_changed_file_is_read_or_refused_and_a_good_one_is_read(kind, of_kind, tmp_path):
    found = list(fuzzed(kind, of_kind[kind], range(6), tmp_path))
    assert not [one for one in found if isinstance(one, Defect)]
    one = of_kind[kind]
    for name, content in one.files.items():
        (tmp_path / name).write_bytes(content)
    one.read(tmp_path / one.changed)


def test_the_program_tells_a_defect_with_its_place(of_kind, tmp_path):
    def read(path):
        raise TypeError("planted")

    one = of_kind["points"]
    (found,) = fuzzed("points", type(one)(one.files, one.changed, read), range(1), tmp_path)
    assert (found.kind, found.seed, found.error) == ("points", 0, "TypeError('planted')")
    assert found.where.startswith("test_mutated_files.py:")
    first, again = (one.one(random.Random("points 0"), tmp_path).read_bytes() for _ in range(2))
    assert first == again != one.files[one.changed]


@pytest.mark.parametrize(
    ("kind", "old", "new", "said"),
    [
        ("case", "reactive_power.K_p = 0.1667", f"reactive_power.K_p = {HUGE}", "too many digits"),
        ("parameters", '"gfor.P_0" = 0.5', f'"gfor.P_0" = {HUGE}', "too many digits"),
        ("device", "S_n = 2.0\nV_n", f"S_n = {HUGE}\nV_n", "must be a finite number"),
        ("device", 'voltage = ["e[1]"', 'voltage = [["e[1]"]', "three different outputs"),
        ("device", 'v_ref = "V_ref"', 'v_ref = { from = "V_dc", unit = [] }', "unit"),
        ("case of a planner", 'raw = "grid.raw"', f'raw = "{LONG}"', "File name too long"),
        ("case of a planner", 'dyr = "grid.dyr"', f'dyr = "{LONG}"', "File name too long"),
        ("case with files", 'fmu = "theirs.fmu"', f'fmu = "{LONG}.fmu"', "File name too long"),
        (
            "lines",
            "l2,b,c,0.001,0.01,0.1",
            "l2,b",
            "line 3: from = 'b', to = ''; name the bus at each end",
        ),
        ("raw 35", "1.0,0,0,0,0", "1e308,0,0,0,0", "WINDV is '1e308'; it must be a number"),
        ("ssd", 'source="resources/integrator.fmu"', 'source="//[x"', "is not a URI"),
        ("ssd", "<gfor:CaseTables>", "<gfor:CaseTables>solver = 3\n", "gives solver as 3"),
        ("ssd", "<gfor:CaseTables>", "<gfor:CaseTables>[title]\n", "gives title as"),
        ("ssd", "modes = []", f"modes = {'[' * 2000}", "cannot be read"),
        ("ssd", "modes = []", f"modes = {HUGE}", "a whole number has"),
        (
            "ssd",
            '<ssv:Real value="-20.0"/>',
            f'<ssv:Integer value="{HUGE}"/>',
            "is not a value of type Integer",
        ),
    ],
)
def test_what_changed_files_have_found_is_one_error(kind, old, new, said, of_kind, tmp_path):
    one = of_kind[kind]
    for name, content in one.files.items():
        text = content.decode("latin-1")
        if name == one.changed:
            assert old in text
            text = text.replace(old, new, 1)
        (tmp_path / name).write_bytes(text.encode("latin-1"))
    with pytest.raises(CosimError, match=said):
        one.read(tmp_path / one.changed)
