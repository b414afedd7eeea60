"""Limits of exciters and governors that a new case widens to its operating point (`[units.widened_limits]`)."""

import json
import re

import numpy as np
import pytest

from orchestrator.cases.new.new_case import write_case
from orchestrator.cases.new.wanted_case import WantedCase, read_converter
from orchestrator.core.errors import CaseError, StartError
from orchestrator.studies.modes.modes import compute_modes, running
from tests.studies.screening.five_machines import DROOPS, five_machines
from tests.support.scenarios import prepare_one

HEADROOM = 0.1  # [pu], as the page has it
ACCURACY = 7e-4  # of the search, and of three digits [pu]
OF_SEXS = "0.05 -5.0 5.0 /"  # T_E, E_MIN and E_MAX


def new_case(folder, highest=1.2, exciter=OF_SEXS, converters=(), **choices):
    """Return the path of the new case of five machines, whose TGOV1 end at ``highest`` and whose SEXS so."""
    five_machines(folder, highest=highest)
    dyr, out = folder / "five.dyr", folder / "case.toml"
    dyr.write_text(dyr.read_text().replace(OF_SEXS, exciter))
    files = (folder / "five.raw", dyr)
    wanted = WantedCase(files, out, tuple(map(read_converter, converters)), **choices)
    out.write_text(write_case(wanted).text, encoding="utf-8")
    return out


def widened(path):
    """Return the value taken, that of the file and that of the start by limit, ``component.variable``."""
    row = r"^(sg\d\.\S+) = (\S+)    # (\S+) in five.dyr; (\S+) at the start$"
    rows = re.findall(row, path.read_text(encoding="utf-8"), re.MULTILINE)
    return {name: tuple(map(float, numbers)) for name, *numbers in rows}


def asked(prepared):
    return [str(q) for q in prepared.questions if "which are widened" in str(q)]


def eigenvalues(prepared):
    return np.sort_complex(np.asarray(compute_modes(prepared).eigenvalues))


@pytest.fixture(scope="module")
def closed(tmp_path_factory):
    """The case whose valves end below what every machine with a governor feeds."""
    return new_case(tmp_path_factory.mktemp("closed"), highest=0.3)


def test_a_limit_is_widened_to_the_power_that_its_machine_feeds(closed):
    base = prepare_one(closed, "base")
    found = widened(closed)
    assert {*found} == {f"sg{n}.governor.V_MAX" for n in DROOPS}
    for name, (taken, given, at_start) in found.items():
        fed = base.power_flow.powers[name[:3]].real  # no resistance lies before the turbine
        assert given == 0.3
        assert at_start == pytest.approx(fed, abs=ACCURACY)
        assert taken == pytest.approx(fed + HEADROOM, abs=ACCURACY)
        assert base.system.components[name[:3]].number("governor.V_MAX") == taken


@pytest.mark.parametrize(
    ("exciter", "limit", "side"),
    [("0.05 -5.0 0.9 /", "E_MAX", 1), ("0.05 4.0 6.0 /", "E_MIN", -1)],
    ids=["upper", "lower"],
)
def test_a_limit_of_an_exciter_is_widened_to_its_field_voltage(tmp_path, exciter, limit, side):
    path = new_case(tmp_path, exciter=exciter)
    found = widened(path)
    assert {name.partition(".")[2] for name in found} == {f"exciter.{limit}"}
    with running(prepare_one(path, "base")) as master:
        for name, (taken, _, at_start) in found.items():
            (held,) = master.components[name[:3]].get(["E_fd"]).values()
            assert at_start == pytest.approx(held, abs=ACCURACY)
            assert taken == pytest.approx(held + side * HEADROOM, abs=ACCURACY)


def test_one_question_lists_every_limit_and_its_answer_silences_it(closed, tmp_path):
    (question,) = asked(prepare_one(closed, "base"))
    for name, (taken, given, _) in widened(closed).items():
        assert f"{name} from {given:g} to {taken:g}" in question
    assert "PSS/E would start with suspect initial conditions" in question
    answer = re.search(r"meant = \[.*?\]", question)[0]
    assert answer == 'meant = ["*.governor.V_MAX"]'
    text = closed.read_text(encoding="utf-8")
    said = closed.with_name("said.toml")
    said.write_text(f"{answer}\n{text}", encoding="utf-8")
    assert not asked(prepare_one(said, "base"))


def test_the_json_of_a_new_case_has_the_question(gfor, closed):
    files = closed.with_name("five.raw"), closed.with_name("five.dyr")
    code, out, _ = gfor("new", *files, "--out", closed.with_name("again.toml"), "--json")
    assert code == 0
    found = json.loads(out)
    assert sum("which are widened" in question for question in found["questions"]) == 1
    assert any("4 widened to 0.1 pu beyond the operating point" in x for x in found["assumed"])


def test_modes_are_those_of_limits_that_never_acted(closed, tmp_path):
    """Widened, by hand at the same values, and in files whose limits are far away."""
    taken = {name: value for name, (value, _, _) in widened(closed).items()}
    own = eigenvalues(prepare_one(closed, "base"))
    by_hand = new_case(tmp_path, highest=0.3, widen_limits=False)
    assert not widened(by_hand)
    written = eigenvalues(prepare_one(by_hand, "base", taken))
    far = eigenvalues(prepare_one(new_case(tmp_path, highest=1.2), "base"))
    np.testing.assert_allclose(own, written, rtol=0, atol=1e-9)
    np.testing.assert_allclose(own, far, rtol=0, atol=1e-9)


def test_a_value_by_name_goes_before_and_is_not_asked_about(closed):
    base = prepare_one(closed, "base", {"sg1.governor.V_MAX": 0.95})
    assert base.system.components["sg1"].number("governor.V_MAX") == 0.95
    (question,) = asked(base)
    assert "sg1" not in question
    with pytest.raises(StartError, match=r"sg1 .*cannot start: governor\.V_MAX"):
        running(prepare_one(closed, "base", {"sg1.governor.V_MAX": 0.3}))


def test_a_corrected_record_is_taken_and_not_asked_about(tmp_path):
    path = new_case(tmp_path, highest=0.3)
    five_machines(tmp_path, highest=1.2)
    base = prepare_one(path, "base")
    assert not asked(base)
    assert {base.system.components[f"sg{n}"].number("governor.V_MAX") for n in DROOPS} == {1.2}


def test_a_point_beyond_a_widened_limit_is_refused(closed):
    beyond = prepare_one(closed, "base", {"sg1.P_0": 0.76 + 2 * HEADROOM})
    with pytest.raises(StartError, match=r"sg1 .*cannot start: governor\.V_MAX"):
        running(beyond)


def test_a_refused_start_names_values_with_which_every_machine_starts(tmp_path):
    path = new_case(tmp_path, highest=0.3, widen_limits=False)
    with pytest.raises(StartError, match=r"sg1 .*cannot start: governor\.V_MAX") as refused:
        running(prepare_one(path, "base"))
    typed = dict(re.findall(r"--set (\S+)=([\d.]+)", str(refused.value)))
    assert {*typed} == {f"sg{n}.governor.V_MAX" for n in DROOPS}
    assert "S_n, or" not in str(refused.value), "P_0 is in parts of it, so another does not help"
    running(prepare_one(path, "base", typed)).close()


def test_the_scenario_with_a_converter_starts_with_the_limits_of_the_base(tmp_path):
    path = new_case(tmp_path, highest=0.3, converters=["bus 13, 100 MVA, 60 MW, less sg3"])
    assert {*widened(path)} == {f"sg{n}.governor.V_MAX" for n in DROOPS}
    running(prepare_one(path, "converter")).close()


def test_nothing_is_widened_where_all_start(tmp_path):
    path = new_case(tmp_path)
    assert "widened_limits" not in path.read_text(encoding="utf-8")
    assert not asked(prepare_one(path, "base"))


def test_only_limits_of_exciters_and_governors_are_widened(closed):
    text = closed.read_text(encoding="utf-8")
    bad = closed.with_name("bad.toml")
    for row, said in (
        ("sg1.machine.H = 9", "'machine.H' is no limit of an exciter or a governor"),
        ("gfor1.voltage_control.i_d_max = 2", "'voltage_control.i_d_max' is no limit"),
        ("sg9.governor.V_MAX = 1", "there is no component 'sg9'"),
        ('sg1.governor.V_MAX = "1 MW"', "MW"),
    ):
        table = f"[units.widened_limits]\n{row}\n\n[scenarios.base]"
        kept, _, rest = text.partition("[units.widened_limits]")
        bad.write_text(kept + table + rest.partition("[scenarios.base]")[2], encoding="utf-8")
        with pytest.raises(CaseError, match=said):
            prepare_one(bad, "base")
