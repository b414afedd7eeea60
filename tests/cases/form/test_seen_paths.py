"""Files in errors stand as the user in the working directory would write them."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import CaseError

NETWORK = """\
name = "own"
[components.grid]
model = "grid"
[power_flow]
grid = "grid"
[network]
{source}
[scenarios.plain]
"""
FILES = {
    "a MATPOWER case": ('matpower = "net.m"', "net.m", "mpc.baseMVA = 100;\n"),
    "no MATPOWER case": ('matpower = "net.m"', "other.txt", ""),
    "a network of pandapower": ('pandapower = "net.json"', "net.json", "{}"),
    "a table of lines": ('lines_file = "lines.csv"', "lines.csv", "from,to,R,X,B\n1,2,x,0.1,0\n"),
    "a table of loads": ('loads_file = "loads.csv"', "loads.csv", "bus,p_mw\n1,2\n"),
    "a table of units": (
        'buses = ["a"]\n[units]\nfile = "units.csv"\ngenerator = "synchronous_generator"\nconverter = "gfor"',
        "units.csv",
        "bus,rating_mva,p_mw,v_pu\na,x,1,1\n",
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_an_error_of_a_file_names_it_from_here(name, tmp_path, monkeypatch):
    source, file, text = FILES[name]
    told_file = "net.m" if name == "no MATPOWER case" else file
    (tmp_path / file).write_text(text)
    (tmp_path / "case.toml").write_text(NETWORK.format(source=source))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(CaseError) as caught:
        load_case(tmp_path / "case.toml").prepare()
    told = "\n".join(problem.text for problem in caught.value.problems)
    assert told_file in told
    assert str(tmp_path) not in told
