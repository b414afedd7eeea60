"""Mistakes in an operator's files: each is one error of the case, with file, line or name, the value and the remedy."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import CaseError
from tests.cases.networks.psse import raw, records
from tests.cases.networks.psse.test_dyr import CASE, DYR
from tests.cases.networks.psse.test_dyr_converters import MACHINES, PHASORS


def changed(section, index, old, new):
    """A RAW file with a change in one record."""
    found = records(33)
    assert old in found[section][index]
    found[section][index] = found[section][index].replace(old, new)
    return raw(33, found)


def generators(change):
    found = records(33)
    found["GENERATOR"] = [change(line) for line in found["GENERATOR"]]
    return raw(33, found)


RAWS = {
    "no generator in service": (
        generators(lambda line: line.replace(",1,1,100,", ",1,0,100,")),
        r"grid.raw: no generator is in service",
    ),
    "a voltage of zero": (
        changed("BUS", 3, ",1.0,0.0", ",0.0,0.0"),
        r"line 7: VM is 0 pu; it must exceed 0 and",
    ),
    "a load twice": (
        raw(33, records(33) | {"LOAD": ["5,'1 ',1,1,1,10,5"] * 2}),
        r"grid.raw, line 15: the load 5 1 stands in line 14 as well; remove one of them, or rename it",
    ),
    "a branch twice, from both ends": (
        raw(33, records(33) | {"BRANCH": [*records(33)["BRANCH"], "5,4,'1 ',0.01,0.085,0.176"]}),
        r"the branch \[4, 5\] 1 stands in line 23 as well",
    ),
    "a machine twice": (
        raw(
            33,
            records(33) | {"GENERATOR": [*records(33)["GENERATOR"], records(33)["GENERATOR"][0]]},
        ),
        r"the machine 1 1 stands in line 19 as well",
    ),
    "a line that ends at nothing": (
        changed("BRANCH", 0, "4,5,", "4,,"),
        r"the bus' number is ''; it must be a number",
    ),
}
DYRS = {
    "an empty file": ("", CASE, r"3 machines have no record of a machine \('1' at bus 1,"),
    "another identifier": (
        DYR.replace("2,'GENROU','1'", "2,'GENROU','7'"),
        CASE,
        r"(?s)does not have GENROU of machine '7' at bus 2; .*machine '1' at bus 2 has no record of a machine",
    ),
    "no number": (
        DYR.replace("9.55", "nan"),
        CASE,
        r"grid.dyr, line 2: GENROU has H = 'nan'; it must be a number",
    ),
    "no inertia": (
        DYR.replace("9.55", "0.0"),
        CASE,
        r"grid.dyr, line 2, sg1.machine.H: machine.H = 0 s; it must be",
    ),
    "a phasor model among others": (
        MACHINES,
        CASE,
        r"bus 3 is the phasor model regfm_a1_phasor, and the generator",
    ),
    "a time constant of zero": (
        MACHINES.replace("0.02 0.03 0.04", "0 0.03 0.04"),
        PHASORS,
        r"gfor3.TPf: TPf = 0 s; it must be at least 0.001",
    ),
    "no limit of the current": (
        MACHINES.replace("1.8 1.15", "0 1.15"),
        PHASORS,
        r"gfor3.ImaxF: ImaxF = 0 pu; it must be at least 0.1",
    ),
}
CASES = {
    "two sources": (
        CASE.replace("stray_B", 'cgmes = "m.zip"\nstray_B'),
        r"network: give either 'raw' or 'cgmes', not both",
    ),
    "RAW as CGMES": (
        CASE.replace('raw = "grid.raw"', 'cgmes = "grid.raw"'),
        r"grid.raw: it holds no .xml files; give a zip",
    ),
    "a name of CGMES for RAW": (
        CASE.replace("stray_B", 'leave_out = ["hvdc line"]\nstray_B'),
        r"leave_out: 'hvdc line' is unknown; choose",
    ),
    "text for a truth value": (
        CASE.replace(
            "stray_B",
            'keep_load_parts = "yes"\nload_model = { active = "impedance", reactive = "impedance" }\nstray_B',
        ),
        r"line 6, network.keep_load_parts: .*'yes'",
    ),
}
ALL = (
    {name: (text, DYR, CASE, words) for name, (text, words) in RAWS.items()}
    | {name: (raw(33), *rest) for name, rest in DYRS.items()}
    | {name: (raw(33), DYR, case, words) for name, (case, words) in CASES.items()}
)


@pytest.mark.parametrize("name", ALL)
def test_a_mistake_is_one_error(name, tmp_path):
    network, dynamics, case, words = ALL[name]
    (tmp_path / "grid.raw").write_text(network)
    (tmp_path / "grid.dyr").write_text(dynamics)
    (tmp_path / "case.toml").write_text(case)
    with pytest.raises(CaseError, match=words) as caught:
        load_case(tmp_path / "case.toml").prepare()
    assert len([p for p in caught.value.problems if "the file is not solved" not in str(p)]) == 1
