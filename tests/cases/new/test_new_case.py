"""`gfor new`: from RAW and DYR to a case that runs, and what cannot become one."""

import io
import json
import re
import shlex
import sys
import tomllib
from dataclasses import replace
from functools import partial

import pytest

from orchestrator.cases.case import case_of_text, load_case
from orchestrator.cases.form.parameter_files import read_parameter_file
from orchestrator.cases.form.schema import NetworkTable
from orchestrator.cases.networks import data as network_data
from orchestrator.cases.networks.psse.raw import read_raw
from orchestrator.cases.new.new_case import _switched, write_case
from orchestrator.cases.new.wanted_case import WantedCase, read_converter
from orchestrator.core.errors import CaseError, InputError
from orchestrator.devices.fmi.description import read_description
from orchestrator.linear.spectra.continuation import ModesMeetError
from orchestrator.studies.modes import beside
from orchestrator.studies.modes.modes import compute_modes, running
from tests.cases.networks.psse import raw, records
from tests.cases.networks.psse.test_solution import solved_records
from tests.cases.networks.test_network_sources import solved
from tests.studies.screening.five_machines import POWERS, RATINGS, five_machines
from tests.support import vendor
from tests.support.scenarios import prepare_one

CONVERTER = "bus 13, 100 MVA, 60 MW, less sg3"


@pytest.fixture
def gfor(gfor):
    return partial(gfor, "new")


@pytest.fixture
def files(tmp_path):
    five_machines(tmp_path)
    return tmp_path / "five.raw", tmp_path / "five.dyr"


@pytest.fixture
def solved_raw(tmp_path):
    """Text of the WSCC system's RAW file with its solution."""
    (tmp_path / "grid.raw").write_text(raw(33, records(33)), encoding="utf-8")
    data = network_data.network_data(NetworkTable(raw="grid.raw"), tmp_path)
    return raw(33, solved_records(solved(data), setpoint=1.025))


def made(files, converter=CONVERTER, **more):
    out = files[0].parent / "case.toml"
    texts = [converter] if isinstance(converter, str) else converter or ()
    new = write_case(WantedCase(files, out, tuple(map(read_converter, texts)), **more))
    out.write_text(new.text, encoding="utf-8")
    return load_case(out), new


def test_a_case_is_written_and_said_in_few_lines(gfor, files):
    out = files[0].parent / "case.toml"
    code, text, err = gfor(*files, "--converter", CONVERTER, "--out", out)
    assert (code, err) == (0, "")
    assert len(text.splitlines()) <= 9
    assert "base, dispatch, converter, pod_p, pod_q, fault" in text
    assert "sg3 feeds 60 MW less (160 before)" in text
    again = gfor(*files, "--converter", CONVERTER, "--out", out)
    assert again[0] == 2
    assert "--force" in again[2]
    assert gfor(*files, "--converter", CONVERTER, "--out", out, "--force")[0] == 0


def test_the_distance_from_the_files_voltages_is_told(gfor, tmp_path, solved_raw):
    """A solved file is met within its digits; with another load the line names the bus and what is left there."""
    path = tmp_path / "solved.raw"
    path.write_text(solved_raw, encoding="utf-8")
    code, text, err = gfor(path, "--out", tmp_path / "case.toml", "--json")
    told = json.loads(text)["power_flow"]
    assert (code, told["cause"]) == (0, "")
    assert told["beside_file_pu"] < 1e-6
    assert "power flow: within" in err
    path.write_text(solved_raw.replace("8,'1 ',1,1,1,100,35", "8,'1 ',1,1,1,102,35"))
    text = gfor(path, "--out", tmp_path / "case.toml", "--force")[1]
    text = " ".join(text.split())
    assert "beside the file's voltages: " in text
    assert "which leave -2 MW" in text


def test_the_converter_takes_over_what_the_machine_feeds_less(files):
    case, _ = made(files)
    base, converter = case.prepare(["base", "converter"])
    assert "gfor" not in base.system.components
    fed = {name: power.real for name, power in converter.power_flow.powers.items()}
    assert fed["gfor"] * 100 == pytest.approx(60, abs=1e-3)
    assert fed["sg3"] * RATINGS[3] == pytest.approx(POWERS[3] - 60, abs=1e-3)
    assert fed["sg1"] * RATINGS[1] == pytest.approx(POWERS[1])
    held = [abs(x.power_flow.voltages["bus_13"]) for x in (base, converter)]
    assert held[0] == pytest.approx(held[1], abs=1e-5)
    assert compute_modes(converter).stability.stable


def test_how_much_power_comes_from_machines_without_a_record_is_said(files):
    """In what is assumed and in the question, in MW and in percent of all machines' power."""
    dyr = files[1]
    own = [line for line in dyr.read_text().splitlines() if not line.strip().startswith("3 ")]
    dyr.write_text("\n".join(own) + "\n")
    case, new = made(files, None, dyr_leave_out=("machine without record",))
    total = sum(POWERS.values())
    share = f"{POWERS[3]:.0f} of {total:.0f} MW ({100 * POWERS[3] / total:.1f} %)"
    assert f"machines without a record: 1 constant current, {share}" in new.assumed
    (asked,) = (
        str(q) for q in case.prepare(["base"])[0].questions if "no record of the m" in str(q)
    )
    assert f"all such machines feed {share}" in asked


@pytest.mark.parametrize(
    ("edit", "asked"),
    [
        (('"100 MVA", P_0 = 0.6', '"100 MVA", P_0 = 0.6'), 0),
        (('"100 MVA", P_0 = 0.6', '"100 MVA", P_0 = 0.9'), 1),
        (('"100 MVA", P_0 = 0.6', '"200 MVA", P_0 = 0.6'), 1),
        (('"100 MVA", P_0 = 0.6', '"0.2 GVA", P_0 = 0.3'), 0),
    ],
)
def test_a_device_of_another_power_than_what_stands_for_it_is_asked_about(files, edit, asked):
    case, new = made(files)
    text = new.text.replace(*edit, 1)  # of the device, which comes first
    case = case_of_text(text, tomllib.loads(text), case.path)
    found = [str(q) for q in case.prepare(["base"])[0].questions if "which stands for it" in str(q)]
    assert len(found) == asked
    assert all("gfor feeds " in one for one in found)


def test_a_file_of_values_is_for_the_scenario_it_was_made_for(files, tmp_path):
    case, _ = made(files)
    (tmp_path / "pod.toml").write_text('[set]\n"gfor.pod_p.enabled" = true\n')
    file = read_parameter_file(tmp_path / "pod.toml")
    with pytest.raises(
        CaseError, match=r"line 2, gfor.pod_p.enabled: it would switch this on in converter too"
    ):
        case.prepare(["converter", "pod_p"], parameters=[file])
    case.prepare(["base", "pod_p"], parameters=[file])  # only one of them has the controller
    (alone,) = case.prepare(["converter"], {"sg1.machine.H": 4.0}, parameters=[file])
    assert alone.changed == "pod.toml, sg1.machine.H = 4.0"
    assert case.prepare(["converter"])[0].changed == ""
    with pytest.raises(
        CaseError,
        match=r"it would switch this on in pod_q beside gfor.pod_q.enabled, where it is off",
    ):
        case.prepare(["pod_q"], parameters=[file])
    # who says so means both
    case.prepare(["pod_q"], {"gfor.pod_q.enabled": True}, parameters=[file])


def test_a_mode_is_followed_along_the_gains_to_what_the_device_brings(files, monkeypatch):
    case, _ = made(files)
    strong = {"gfor.pod_p.K": 160, "gfor.pod_p.T_S1": 0.22, "gfor.pod_p.T_S2": 0.0485}
    dispatch, pod = (compute_modes(*case.prepare([name], strong)) for name in ("dispatch", "pod_p"))
    weakest, same = sorted(pod.modes, key=lambda mode: mode.damping_percent)[:2]
    # the POD's own mode is damped least now
    assert abs(weakest.frequency_hz - same.frequency_hz) > 0.4
    now = (
        f"({same.damping_percent:.2f} %, and the least damped now {weakest.damping_percent:.2f} %)"
    )
    (sentence,) = beside.sentences_beside([dispatch, pod])
    assert sentence.endswith(now)

    def meets(*_, **__):
        raise ModesMeetError(1j, 0.7, 1.0)

    monkeypatch.setattr(beside.continuation, "follow_along", meets)
    (sentence,) = beside.sentences_beside([dispatch, pod])
    least = weakest.damping_percent - min(mode.damping_percent for mode in dispatch.modes)
    assert (
        f"POD-P at least {least:+.2f} points (least damped: {weakest.damping_percent:.2f} %)"
        in sentence
    )
    assert sentence.endswith("as the mode meets another one at 70 % of the controllers' gains")


def test_what_the_device_brings_is_told_apart_from_the_dispatch(files):
    case, new = made(files)
    dispatch, converter = map(compute_modes, case.prepare(["dispatch", "converter"]))
    least = [min(mode.damping_percent for mode in result.modes) for result in (dispatch, converter)]
    (sentence,) = beside.sentences_beside([dispatch, converter])
    assert (
        f"{least[0]:.2f} %), at the same power flow: Converter {least[1] - least[0]:+.2f} points"
        in sentence
    )
    assert list(beside.sentences_beside([converter])) == [
        "What the change of power flow alone does: --scenario dispatch beside"
    ]
    (moved,) = map(compute_modes, case.prepare(["converter"], {"gfor.P_0": 0.5}))
    assert "Converter: not known, as its power flow is another one" in "".join(
        beside.sentences_beside([dispatch, moved])
    )
    # The same as a negative load of the network, which is a constant current there, without any device
    fed = 100 * dispatch.prepared.power_flow.powers["injection"]
    load = f'[network.loads.fed]\nbus = "bus_13"\np = {-fed.real}\nq = {-fed.imag}\n\n[units]'
    text = new.text.replace("[units]", load, 1).replace(
        'remove = ["gfor"]', 'remove = ["injection", "gfor"]'
    )
    case.path.write_text(text, encoding="utf-8")
    (alike,) = map(compute_modes, load_case(case.path).prepare(["dispatch"]))
    assert min(mode.damping_percent for mode in alike.modes) == pytest.approx(least[0], abs=0.01)


def test_a_case_that_cannot_start_is_said_at_once(gfor, files):
    five_machines(files[0].parent, highest=0.3)  # the valves' end, below what the machines feed
    code, out, err = gfor(*files, "--no-widened-limits", "--out", files[0].parent / "case.toml")
    assert code == 2
    assert "scenario 'base': sg" in err
    assert (
        "governor.V_MAX: the operating point of the power flow lies at or above this limit" in err
    )
    assert "Next:" not in out
    assert (files[0].parent / "case.toml").exists()


def test_what_a_case_that_cannot_start_names_works_as_it_is_typed(gfor, files):
    """Its values at `gfor modes`, whose option they are; and the case written again, with its limits widened."""
    five_machines(files[0].parent, highest=0.3)
    out = files[0].parent / "case.toml"
    code, _, err = gfor(*files, "--no-widened-limits", "--out", out)
    assert code == 2
    (said,) = (line for line in err.splitlines() if "it is written all the same" in line)
    assert said.startswith(f"  - {out}: ")
    typed = shlex.split(re.findall("`gfor modes ([^`]+)`", said)[0])
    assert typed[0] == str(out)
    assert typed[1::2] == ["--set"] * 4
    with running(prepare_one(out, "base", dict(word.split("=") for word in typed[2::2]))):
        pass
    assert said.endswith("write it again with --force and without --no-widened-limits")
    assert gfor(*files, "--force", "--out", out)[0] == 0


def test_a_start_beyond_a_limiter_is_told_with_the_field_voltage(gfor, files):
    """The limiter of machine 1 ends at 0.55 pu, below any field voltage of a machine that feeds power."""
    record = "1 'MAXEX2' 1 0 0.5 1.1 60 1.3 30 1.6 15 1.05 0.02 -0.05 /\n"
    files[1].write_text(files[1].read_text(encoding="utf-8") + record, encoding="utf-8")
    out = files[0].parent / "case.toml"
    code, printed, err = gfor(*files, "--out", out, "--json")
    assert code == 0
    (said,) = json.loads(printed)["warnings"]
    assert f"warning: scenario 'base': {said}" in err
    fields = running(prepare_one(out, "base")).components["sg1"].values(["E_fd"])
    assert f"E_fd = {fields['E_fd']:.4g} pu at the start, and oel.EFD1 = 1.1 of" in said
    assert said.endswith(f"without it: gfor modes {out} --set sg1.oel=none")
    without = compute_modes(prepare_one(out, "base", {"sg1.oel": "none"}))
    assert not [text for text in without.warnings if "its limiter" in text]


def test_limits_of_reactive_power_are_kept_where_asked(gfor, files):
    text = files[0].read_text(encoding="utf-8")
    files[0].write_text(text.replace(",300,-300,", ",20,-20,"), encoding="utf-8")
    out = files[0].parent / "case.toml"
    flows = []
    for more in ([], ["--reactive-limits", "--force"]):
        assert gfor(*files, "--out", out, *more)[0] == 0
        flows.append(prepare_one(out, "base").power_flow)
    assert [bool(flow.at_limits) for flow in flows] == [False, True]
    most = [max(flow.powers[f"sg{n}"].imag * RATINGS[n] for n in range(1, 5)) for flow in flows]
    assert most[0] > 21
    assert most[1] == pytest.approx(20)


def test_emt_models_come_from_the_same_file(files):
    case, _ = made(files)
    emt = case._of_kind({"models": "emt"}, ()).table
    models = [c.model for c in emt.components.values()] + [emt.units.generator, emt.units.converter]
    assert models == ["grid", "gfor", "static_generation", "synchronous_generator", "gfor"]
    assert emt.solver.step_size == 1e-4
    largest = 0.25 * 100 / max(RATINGS.values())  # X''_d [pu, 100 MVA]
    assert emt.network.stray_B == pytest.approx((2 * 3.14159 * 60 * 1e-4) ** 2 / largest, rel=0.1)
    assert (case.table.solver.step_size, case.table.network.stray_B) == (2e-3, 0)
    names = [{p.signal for plot in t.plots for p in plot.panels} for t in (case.table, emt)]
    assert names[0] ^ names[1] == {"gfor.current_limit", "gfor.current_demand"}


def test_models_of_no_kind_are_refused(files):
    case, _ = made(files)
    with pytest.raises(InputError, match="must be emt or phasor"):
        case.prepare(["base"], {"models": "both"})


def test_questions_stand_at_the_lines_that_they_are_about(files):
    lines = made(files)[1].text.splitlines()
    at = lines.index('raw = "five.raw"')
    above = "\n".join(lines[at - 4 : at])
    assert "# question: " in above
    assert "the file is not solved" in above
    assert max(map(len, lines)) < 260


def test_questions_name_the_lines_of_the_written_file(gfor, files):
    """Comments move the lines on which the case's keys stand."""
    out = files[0].parent / "case.toml"
    code, printed, _ = gfor(*files, "--out", out, "--json")
    assert code == 0
    lines = out.read_text(encoding="utf-8").splitlines()
    found = [re.match(r"line (\d+), ([\w.]+): ", q) for q in json.loads(printed)["questions"]]
    keys = {one[2]: lines[int(one[1]) - 1] for one in found if one}
    assert keys["network.raw"] == 'raw = "five.raw"'
    assert keys["network"] == "[network]"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["--slack", "bus_999"], "--slack bus_999: 'bus_999' is neither a unit"),
        (["--frequency", "50 kV"], "--frequency '50 kV': '50 kV' is in kV"),
        (["--replace", "77"], "--replace 77: there is no unit '77'"),
        (["--leave-out", "foo"], "five.raw: leave_out: 'foo' is unknown"),
    ],
)
def test_a_refusal_names_what_was_given_and_no_file_that_is_not_there(gfor, files, given, said):
    out = files[0].parent / "case.toml"
    code, _, err = gfor(*files, "--out", out, *given)
    assert code == 2
    assert not out.exists()
    text = " ".join(err.split())
    assert said in text
    assert text.startswith("error: five.raw, five.dyr: ")
    assert "case.toml" not in text
    assert not re.search(r" line \d+, (network|power_flow|units)", text)


def test_a_refusal_of_the_file_names_its_line(gfor, files):
    raw = files[0]
    raw.write_text(raw.read_text().replace("0.004,0.05", "x,0.05", 1))
    code, _, err = gfor(*files)
    assert code == 2
    assert re.search(r"- \S*five\.raw, line \d+: ", err)


def test_a_refusal_of_a_value_names_its_machine_and_counts_no_question(gfor, files):
    dyr = files[1]
    dyr.write_text(
        re.sub(r"('GEN\w+'.*?)(\d\.\d+)(?= 0\.0 )", r"\g<1>-5.0", dyr.read_text(), count=1)
    )
    code, _, err = gfor(*files)
    assert code == 2
    said = " ".join(err.split())
    assert re.search(
        r"- \S*five\.dyr, line \d+, sg\d\.machine\.H: machine\.H = -5 s; it must be at least", said
    )
    asked = said.count("questioned besides")
    assert f"five.dyr: 1 problem, and {asked} question" in said


def test_without_a_converter(files):
    case, new = made(files, None)
    assert [prepared.name for prepared in new.scenarios] == ["base", "fault"]
    assert "machines: emf w·e''; [conventions] like = \"psse\" takes PSS/E's" in "".join(
        new.assumed
    )
    (fault,) = case.prepare(["fault"])
    assert [event.time for event in fault.events] == [1.0, 1.1]


def test_scenarios_are_those_of_the_written_case(files):
    """The scenario ``base`` is prepared once, before its file's text is complete."""
    case, new = made(files, converter=None)
    for ours, again in zip(new.scenarios, case.prepare(), strict=True):
        assert ours.name == again.name
        assert ours.values == again.values
        assert ours.events == again.events
        assert ours.power_flow.voltages == again.power_flow.voltages
        assert ours.records == again.records
        # comments above move the lines that their places name
        assert [q.text for q in ours.questions] == [q.text for q in again.questions]


def test_a_network_is_read_once_for_all_scenarios_and_again_if_it_changes(files, monkeypatch):
    asked = []

    def read(*arguments, **more):
        asked.append(arguments)
        return read_raw(*arguments, **more)

    monkeypatch.setattr(network_data, "read_raw", read)
    case, _ = made(files)
    assert len(asked) == 1
    load = case.prepare(["base"])[0].network.loads[0]
    text = files[0].read_text()
    drawn = next(line for line in text.splitlines() if line.startswith(f"{load.bus[4:]},'1"))
    shown = f",{load.p_mw:g},"
    assert shown in drawn
    files[0].write_text(text.replace(drawn, drawn.replace(shown, f",{load.p_mw + 1:g},", 1)))
    assert case.prepare(["base"])[0].network.loads[0].p_mw == load.p_mw + 1
    assert len(asked) == 2


def test_the_slack_needs_no_new_power(files):
    case, new = made(files, "bus 13, 100 MVA, 60 MW, less sg5")
    assert "the slack (sg5) feeds 60 MW less" in "".join(new.assumed)
    assert case.scenarios["converter"].set == {}


@pytest.mark.parametrize("less", ["", ", less sg3"])
def test_a_converter_of_no_power_moves_none(files, less):
    """Mvar alone move: machine and slack feed the MW of before."""
    case, new = made(files, f"bus 13, 300 MVA, 0 MW{less}")
    said = "".join(new.assumed)
    assert "it feeds 0 MW, so no MW moves: the Mvar that this voltage takes alone do" in said
    assert "0 MW less" not in said
    before, after = (case.prepare([name])[0].power_flow.powers for name in ("base", "converter"))
    for name in before:
        assert after[name].real == pytest.approx(before[name].real, abs=1e-4)


def test_a_converter_can_replace_a_machine(files):
    case, new = made(files, "bus 13, 200 MVA, 160 MW, instead of sg3")
    assert "sg3 is gone (160 MW before)" in "".join(new.assumed)
    base, converter = case.prepare(["base", "converter"])
    assert "sg3" in base.system.components
    assert "sg3" not in converter.system.components
    assert compute_modes(converter).stability.stable


def test_a_case_names_the_machines_that_a_converter_of_ours_replaces(files):
    case, new = made(files, None, replace=("3",))
    title = "As in the files, but with our gfor3 for unit 3"
    assert case.table.scenarios["base"].title == title
    assert "gfor3: our grid-forming converter with a droop replaces unit 3 and its 160 MW" in (
        "".join(new.assumed)
    )
    (base,) = case.prepare(["base"])
    assert {"gfor3", "sg2"} <= {*base.system.components}
    assert "sg3" not in base.system.components
    untouched, _ = made(files, None)
    assert untouched.table.scenarios["base"].title == "As in the files"


def test_a_case_replaces_all_machines_without_a_record_by_one_word(files):
    dyr = files[1]
    own = [line for line in dyr.read_text().splitlines() if line.split()[:1] not in (["2"], ["3"])]
    dyr.write_text("\n".join(own) + "\n")
    case, new = made(files, None, replace=("machine without record",))
    title = "As in the files, but with our converters for machines without a record"
    assert case.table.scenarios["base"].title == title
    fed, total = POWERS[2] + POWERS[3], sum(POWERS.values())
    share = f"{fed:.0f} of {total:.0f} MW ({100 * fed / total:.1f} %)"
    converters = "2 grid-forming converters of ours with a droop (gfor2, gfor3)"
    assert f"machines without a record: {converters}, {share}" in new.assumed
    (base,) = case.prepare(["base"])
    assert {"gfor2", "gfor3", "sg1"} <= {*base.system.components}
    assert not {"sg2", "sg3"} & {*base.system.components}


def test_without_dynamics_data_the_machines_are_typical_and_said(files):
    _, new = made(files[:1])
    assert "machines: no dynamics data" in "".join(new.assumed)
    assert "conventions" not in "".join(new.assumed)


@pytest.mark.parametrize(
    ("converter", "said"),
    [
        ("bus 31, 100 MVA, 60 MW", "the network has no bus '31'"),
        ("bus 13, 100 MVA, 60 MW, less sg33", "no unit 'sg33' to feed less; did you mean sg3"),
        ("bus 13, 300 MVA, 200 MW, less sg3", "sg3 feeds 160 MW and cannot feed 200 MW less"),
        ("bus 13, 300 MVA, 160 MW, less sg3", "sg3 would feed nothing; write 'instead of sg3'"),
        ("bus 13, 300 MVA, 60 MW, instead of sg5", "it is at the slack"),
        ("100 MVA, 60 MW", "the bus is missing"),
        ("bus 13", "the rating in MVA and the power in MW is missing"),
        ("bus 13, 100 MVA, 60 MW, cheap", "'cheap' is not understood"),
        ("bus 13, 100 MVA, 50 MVA, 60 MW", "MVA is given twice"),
        ("bus 13, 100 MVA, 160 MW", "160 MW with a rating of 100 MVA"),
    ],
)
def test_a_converter_that_cannot_be_is_refused(files, converter, said):
    with pytest.raises(InputError) as refused:
        made(files, converter)
    assert said in str(refused.value)


@pytest.mark.parametrize("option", ["--details", "--json"])
def test_a_refusal_lists_all_that_is_wrong_at_ones_word(gfor, files, option):
    """Without it the first twenty are shown, and how to see the others."""
    raw, dyr = files
    wrong = "".join(f"{1 + n % 5} 'COMP' 1 x{n} /\n" for n in range(30))
    own = [line for line in dyr.read_text().splitlines() if "SEXS" not in line]
    dyr.write_text("\n".join(own) + "\n" + wrong)
    code, _, err = gfor(raw, dyr)
    assert code == 2
    assert "and 10 more; gfor new lists all with --details" in " ".join(err.split())
    code, out, err = gfor(raw, dyr, option)
    assert code == 2
    if option == "--json":
        (problem,) = json.loads(out)["problems"]
        assert problem["text"].count("at bus 5") == 5
    assert " more" not in err
    assert "at bus 5" in err.splitlines()[-1]
    assert len(err.splitlines()) == 2 + 30  # what they are, and each of them


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["five.dyr"], "no network is given"),
        (["five.rew"], "no network that is read"),
        (["fife.raw"], "no such file; did you mean five.raw"),
        (["five.raw", "other.raw"], "a case has one of them"),
        (["five.raw", "--binding", "b.toml"], "say where by --converter"),
        (["five.raw", "--out", "case.txt"], "ends in .toml"),
        ([], "no terminal to ask at"),
        (["lines.csv", "loads.csv"], "one with the columns bus, rating_mva is missing"),
        (["lines.csv", "five.raw"], "a case has one of them"),
        (["empty.csv"], "no table of a network"),
        (
            ["five.raw", "--converter", CONVERTER, "--fmu", "vendor.fmu", "--force"],
            "say which of its variables it is with --binding",
        ),
    ],
)
def test_files_that_make_no_case_are_refused(gfor, files, monkeypatch, words, said):
    monkeypatch.chdir(files[0].parent)
    monkeypatch.setattr(sys, "stdin", io.StringIO())
    (files[0].parent / "other.raw").touch()
    tables(files[0].parent)
    if "--fmu" in words:
        vendor.device(files[0].parent)
    code, _, err = gfor(*words)
    assert code == 2
    assert said in " ".join(err.split())


LINES = "from,to,kv,R_ohm,X_ohm,B_us,R,X,B\n1,2,,,,,0,0.02,0\n2,4,,,,,0.004,0.05,0.1\n4,3,,,,,0,0.03,0\n"


def tables(folder, lines=LINES):
    """Two machines and a line of 0.05 pu between them, and what a planner would type for the line at 345 kV."""
    (folder / "lines.csv").write_text(lines)
    (folder / "machines.csv").write_text(
        "bus,rating_mva,p_mw,v_pu\n3,500,300,1.01\n1,900,500,1.02\n"
    )
    (folder / "loads.csv").write_text("bus,p_mw,q_mvar\n2,400,50\n4,400,50\n")
    (folder / "buses.csv").write_text("bus\n1\n2\n3\n4\n")
    (folder / "empty.csv").write_text("bus,p_mw\n")
    return tuple(folder / f"{name}.csv" for name in ("buses", "lines", "loads", "machines"))


def test_a_case_comes_from_nothing_but_tables(tmp_path):
    case, new = made(tables(tmp_path), "bus 4, 100 MVA, 60 MW, less sg3", frequency="60 Hz")
    (base,) = case.prepare(["base"])
    assert (base.network.buses, base.power_flow.slack) == (
        ("bus_1", "bus_2", "bus_3", "bus_4"),
        "bus_1",
    )
    assert {
        plan.number("f_n") for name, plan in base.system.components.items() if name != "grid"
    } == {60}
    assert "slack bus_1, 60 Hz" in "".join(new.assumed)
    z = 345**2 / 100
    ohms = LINES.replace(
        "2,4,,,,,0.004,0.05,0.1", f"2,4,345,{0.004 * z},{0.05 * z},{0.1 / z * 1e6},,,"
    )
    (again,) = made(tables(tmp_path, ohms), None)[0].prepare(["base"])
    assert abs(again.power_flow.voltages["bus_3"] - base.power_flow.voltages["bus_3"]) < 1e-12
    for wrong, said in (
        ("2,44,", "'bus_44', which does not exist"),
        ("2,4,0,1,1,1,,,", "kv = 0"),
        ("2,4,345,1,1,1,1,1,1", "both"),
    ):
        with pytest.raises(InputError, match=said):
            made(
                tables(
                    tmp_path,
                    LINES.replace("2,4,,,,,0.004,0.05,0.1" if wrong[-2] == "," else "2,4,", wrong),
                ),
                None,
            )


def test_it_asks_at_a_terminal(gfor, files, monkeypatch):
    monkeypatch.chdir(files[0].parent)
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    answers = iter(["five.raw five.dyr", "13", "100", "60 MW", "sg3", "", ""])
    monkeypatch.setattr("builtins.input", lambda _: next(answers))
    (files[0].parent / "five.toml").unlink()
    code, text, _ = gfor()
    assert code == 0
    assert text.startswith("five.toml: scenarios base, dispatch, converter")
    assert next(answers, None) is None


def test_every_further_signal_of_a_panel_is_looked_for(files):
    case, new = made(files)
    case.path.write_text(new.text.replace('"sg2.omega"', '"sg2.omgea"'), encoding="utf-8")
    with pytest.raises(
        InputError, match=r"no scenario has an output 'sg2.omgea'; did you mean sg2.omega"
    ):
        load_case(case.path).prepare(["base"])


def test_a_vendors_switches_become_scenarios(fmu_path):
    device = read_description(fmu_path("gfor"))
    assert _switched(device) == _switched(None) == {"p": False, "q": False}
    assert _switched(read_description(fmu_path("synchronous_generator"))) == {}
    on = replace(device.variables["pod_q.enabled"], start="true")
    assert _switched(replace(device, variables={**device.variables, "pod_q.enabled": on})) == {
        "p": False,
        "q": True,
    }
