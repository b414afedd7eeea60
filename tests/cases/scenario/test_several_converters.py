"""Two converters from one `gfor new`: their names, what machines feed less, and what other commands make of them."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.new.converter_places import ConverterPlace, with_names
from orchestrator.cases.new.new_case import write_case
from orchestrator.cases.new.wanted_case import WantedCase, read_converter
from orchestrator.core.errors import InputError
from orchestrator.studies.coordinated_design.study import PointsDesignRequest, plan_points_design
from orchestrator.studies.modes.modes import compute_modes
from tests.studies.screening.five_machines import POWERS, five_machines
from tests.support.scenarios import prepare_one

A, B = "bus 13, 100 MVA, 60 MW, less sg3", "bus 15, 80 MVA, 30 MW, less sg3"


@pytest.fixture
def made(tmp_path):
    five_machines(tmp_path)

    def write(*converters):
        files, out = (tmp_path / "five.raw", tmp_path / "five.dyr"), tmp_path / "case.toml"
        new = write_case(WantedCase(files, out, tuple(map(read_converter, converters))))
        out.write_text(new.text, encoding="utf-8")
        return load_case(out), new

    return write


def test_two_converters_bear_the_names_of_their_buses_and_share_what_a_machine_feeds_less(made):
    case, new = made(A, B)
    base, dispatch, both, pods = case.prepare(["base", "dispatch", "converter", "pod_p"])
    assert not {"gfor_13", "gfor_15", "injection_13"} & set(base.system.components)
    assert {"injection_13", "injection_15"} <= set(dispatch.system.components)
    assert {"gfor_13", "gfor_15"} <= set(both.system.components)
    powers = {name: power.real for name, power in both.power_flow.powers.items()}
    fed = {name: powers[name] * both.system.components[name].number("S_n") for name in powers}
    assert fed["sg3"] == pytest.approx(POWERS[3] - 60 - 30, rel=1e-5)
    assert (fed["gfor_13"], fed["gfor_15"]) == pytest.approx((60.0, 30.0))
    assert compute_modes(both).stability.stable
    on = {name for name in ("gfor_13", "gfor_15") if pods.values[f"{name}.pod_p.enabled"]}
    assert on == {"gfor_13", "gfor_15"}
    assert "sg3: 70 for 160 MW" in new.text
    # each question once, and none about a power that the command itself has set
    assert not any("P_0" in str(question) for question in both.questions)
    assert len(set(map(str, both.questions))) == len(both.questions)


def test_two_at_one_bus_have_two_names(made):
    case, _ = made(A, A.replace("60", "20"))
    (both,) = case.prepare(["converter"])
    assert {"gfor_13_1", "gfor_13_2"} <= set(both.system.components)


def test_two_at_one_bus_are_compared_each_with_its_own_stand_in(made):
    case, new = made(A, A.replace("60", "20"))

    def asked(text):
        case.path.write_text(text, encoding="utf-8")
        base = prepare_one(case.path, "base")
        return [str(q) for q in base.questions if "which stands for it" in str(q)]

    assert asked(new.text) == []
    (question,) = asked(new.text.replace("P_0 = 0.2", "P_0 = 0.3", 1))  # of gfor_13_2
    assert "gfor_13_2 feeds 30 MW, and injection_13_2, which stands for it, 20 MW" in question


@pytest.mark.parametrize("less", ["", ", less {slack}"])
def test_what_the_slack_feeds_less_for_one_of_two_is_not_asked_about(made, less):
    first, _ = made(A)
    (base,) = first.prepare(["base"])
    at_slack = [port.name for port in base.network.ports if port.bus == base.power_flow.slack]
    (slack,) = (name for name in at_slack if name in base.system.components)
    case, new = made(A, "bus 15, 80 MVA, 30 MW" + less.format(slack=slack))
    assert f"the slack ({slack}) feeds 30 MW less" in "".join(new.assumed)

    def asked(text):
        case.path.write_text(text, encoding="utf-8")
        both = prepare_one(case.path, "converter")
        return [str(q) for q in both.questions if "the slack takes the difference" in str(q)]

    assert asked(new.text) == []
    assert asked(new.text.replace("P_0 = 0.6", "P_0 = 0.8"))  # of gfor_13: nothing makes room


def test_one_converter_is_gfor_as_before(made):
    case, _ = made(A)
    assert "gfor" in case.prepare(["converter"])[0].system.components


@pytest.mark.parametrize(
    ("buses", "names"),
    [
        (["bus_13"], ["gfor"]),
        (["bus_13", "bus_15"], ["gfor_13", "gfor_15"]),
        (["bus_13", "bus_13"], ["gfor_13_1", "gfor_13_2"]),
        (["bus_13", "bus_15", "bus_13"], ["gfor_13_1", "gfor_15", "gfor_13_2"]),
        # a bus that is called as a numbered converter would be
        (["bus_13", "bus_13_1", "bus_13"], ["gfor_13_2", "gfor_13_1", "gfor_13_3"]),
        (["NORTH", "SOUTH"], ["gfor_NORTH", "gfor_SOUTH"]),
    ],
)
def test_converters_are_called_alike(buses, names):
    """One has a plain name; several have those of their buses, and numbers where a bus has several."""
    found = with_names([ConverterPlace(None, bus, 1.0, "") for bus in buses])
    assert [place.name for place in found] == names
    assert len({place.injection for place in found}) == len(buses)


@pytest.mark.parametrize(
    ("second", "said"),
    [
        ("bus 15, 200 MVA, 110 MW, less sg3", "sg3 feeds 100 MW and cannot feed 110 MW less"),
        ("bus 15, 200 MVA, 30 MW, instead of sg3", "sg3 is replaced, and another converter names"),
        ("bus 15, 200 MVA, 100 MW, less sg3", "sg3 would feed nothing"),
    ],
)
def test_what_two_cannot_take_together_is_refused(made, second, said):
    with pytest.raises(InputError, match=said):
        made(A, second)


def test_the_command_takes_both_and_a_design_takes_them_as_pairs(gfor, made, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made(A)
    code, out, err = gfor(
        "new", "five.raw", "five.dyr", "--converter", A, "--converter", B, "--out", "two.toml"
    )
    assert (code, err) == (0, "")
    assert "gfor_13: ours" in out
    (tmp_path / "points.csv").write_text("name,load\nusual,1\n")
    request = PointsDesignRequest(
        "points.csv",
        ("pod_p", "pod_q"),
        scenario="converter",
        components=("gfor_13", "gfor_15"),
        ranked=0,
    )
    plan = plan_points_design(load_case(tmp_path / "two.toml"), request)
    assert [group.name for group in plan.groups] == ["gfor_13: pod_p", "gfor_15: pod_q"]
    assert len(plan.candidates) == 2
