"""Taps and switched shunts of a RAW file that move in the power flow of a new case (``gfor new --move-controls``)."""

import pytest

from orchestrator.cases.new.new_case import write_case
from orchestrator.cases.new.wanted_case import WantedCase
from orchestrator.core.errors import InputError
from tests.cases.networks.psse import raw, records
from tests.support.scenarios import prepare_one

SHUNT = "5,1,0,1,{most},{least},0,100,'',10.0,4,10.0"


@pytest.fixture
def made(tmp_path):
    """A band of the voltage at bus 5 that four blocks of 10 Mvar hold, one of which is on → the case and its base."""

    def new(least, most, move_controls=True):
        found = records(33)
        found["SWITCHED SHUNT"] = [SHUNT.format(least=least, most=most)]
        file, out = tmp_path / "grid.raw", tmp_path / "case.toml"
        file.write_text(raw(33, found))
        case = write_case(WantedCase((file,), out, move_controls=move_controls))
        out.write_text(case.text, encoding="utf-8")
        return case, prepare_one(out, "base")

    return new


def voltage(base):
    return abs(base.power_flow.voltages["bus_5"])


def test_a_shunt_moves_until_its_voltage_is_in_the_band(made):
    _, held = made(0.9, 1.1, move_controls=False)
    least = voltage(held) + 0.004  # some 0.3 % for each block
    case, base = made(least, 1.1)
    moved = base.system.components["grid"].number("shunt_5.B")
    assert moved in (20, 30, 40)
    assert voltage(base) > least
    fewer = prepare_one(base.case.path, "base", {"grid.shunt_5.B": moved - 10})
    assert voltage(fewer) < least
    assert f"shunt_5.B 10 to {moved:g}" in "\n".join(case.assumed)
    assert f"shunt_5.B = {moved:g}    # 10 in the file" in case.text


def test_what_is_in_its_band_stays(made):
    case, base = made(0.9, 1.1)
    assert base.system.components["grid"].number("shunt_5.B") == 10
    assert "nothing had to move" in "\n".join(case.assumed)
    assert "[components.grid.parameters]" not in case.text
    assert base.case.table.network.move_controls


def test_it_is_for_raw_files_and_phasor_models(tmp_path):
    (tmp_path / "three.m").write_text("")
    for files, models, said in (
        (
            "three.m",
            None,
            "is for taps and switched shunts of a RAW file, and the network is three.m",
        ),
        ("grid.raw", "emt", "taps and switched shunts move in phasor models"),
    ):
        (tmp_path / "grid.raw").write_text(raw(33))
        wanted = WantedCase(
            (tmp_path / files,), tmp_path / "case.toml", models=models, move_controls=True
        )
        with pytest.raises(InputError, match=said):
            write_case(wanted)
