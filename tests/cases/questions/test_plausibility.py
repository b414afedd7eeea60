"""Data that cannot be are refused, data that are most unusual are questioned; each with file and line, and once."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from fmus.converter_parts.usual_ranges import FOLLOWING
from fmus.regfm_a1.model import USUAL
from fmus.synchronous_generator.declarations import MACHINE
from fmus.synchronous_generator.dyr_records import DYR_RECORDS
from fmus.toolchain.catalogue import build_model, model_names, needs_arguments
from fmus.toolchain.description import model_description
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port_variables import RATED
from fmus.toolchain.variables import Usual
from gfor_fmu.usual_ranges import FORMING
from orchestrator.cases.case import built_in_cases, load_case
from orchestrator.cases.form.unusual_value import UnusualValue
from orchestrator.cases.questions import plausibility
from orchestrator.cases.questions.plausibility import RULES, question
from orchestrator.core.errors import CaseError
from orchestrator.devices.fmi.description import parse_description, read_description
from orchestrator.systems.coupling.system import ComponentPlan
from tests.devices.binding.test_binding import OURS
from tests.support.scenarios import prepare_one

CASE = """\
name = "plausible"
[solver]
stop_time = "0.1 s"
[power_flow]
grid = "grid"
slack = "sg"
[network]
buses = ["b1", "b2", "b3"]
[network.lines]
l12 = { from = "b1", to = "b2", X = 0.02, B = 0.02 }
l23 = { from = "b2", to = "b3", X = 0.02, R = 0.002, B = 0.02 }
[network.loads]
d3 = { bus = "b3", p = "900 MW", q = "100 Mvar" }
[components.grid]
model = "grid"
[components.sg]
model = "synchronous_generator_st4b_pss2a"
bus = "b1"
[components.sg.parameters]
S_n = "1000 MVA"
machine.H = 6.5
[components.vsc]
model = "gfor"
bus = "b2"
[components.vsc.parameters]
S_n = "500 MVA"
P_0 = 0.8
droop.R_f = 0.05
"""
H_LINE = 1 + CASE.splitlines().index("machine.H = 6.5")
S_N_LINE = 1 + CASE.splitlines().index('S_n = "500 MVA"')


@pytest.fixture
def questions(tmp_path):
    """Questions about the case after some replacements and overrides, as text."""

    def ask(*changes, overrides=None, text=CASE):
        for old, new in changes:
            assert text.count(old) == 1
            text = text.replace(old, new)
        (tmp_path / "case.toml").write_text(text, encoding="utf-8")
        prepared = prepare_one(tmp_path / "case.toml", None, overrides or {})
        return [str(question) for question in prepared.questions]

    return ask


def refused(questions, *changes, **keywords):
    """The problems of a case that cannot be used."""
    with pytest.raises(CaseError) as caught:
        questions(*changes, **keywords)
    return [str(problem) for problem in caught.value.problems]


def machine(line):
    return ("machine.H = 6.5", f"machine.H = 6.5\n{line}")


# -- what is questioned ------------------------------------------------------------------------------


def test_good_data_raise_no_question(questions):
    assert questions() == []


LARGE = {"ieee118", "ieee39"}


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.slow if n in LARGE else ()) for n in built_in_cases()],
)
def test_built_in_cases_raise_no_question(name):
    case = load_case(name)
    scenarios = list(case.scenarios)[1:2] if name in LARGE else ()  # all differ in switches alone
    assert all(prepared.questions == () for prepared in case.prepare(scenarios))


@pytest.mark.parametrize("name", [n for n in model_names() if not needs_arguments(n)])
def test_the_defaults_of_every_model_are_plausible_and_obey_the_rules(name):
    start = {v.name: v.start for v in build_model(name).parameters}
    for v in build_model(name).parameters:
        assert v.usual is None or v.usual.fits(v.start), v.name
    for rule in RULES:
        assert not {rule.larger, rule.smaller} <= start.keys() or rule.holds(
            start[rule.larger], start[rule.smaller]
        )


def parts_of(record):
    """The parts of a machine that has what a record is of, with what that needs beside it."""
    if record.kind == "machine":
        return {"machine": record.part}
    if record.kind == "supervisor":  # a loop around a governor, at the end of its name
        return {"exciter": "sexs", "governor": f"tgov1_{record.part}"}
    return {"exciter": "sexs", record.kind: record.part}


RECORDED_PARTS = [
    parts_of(record)
    for record in DYR_RECORDS.values()
    if record.kind != "compensator"  # which is parameters of an exciter, and no part
]


@pytest.mark.parametrize("parts", RECORDED_PARTS, ids=lambda parts: "-".join(parts.values()))
def test_the_defaults_of_every_part_that_a_record_can_be_are_plausible(parts):
    for v in build_model("synchronous_generator_phasor", **parts).parameters:
        assert v.usual is None or v.usual.fits(v.start), v.name


def test_every_range_and_rule_is_of_a_variable_that_some_model_has():
    known = {
        v.name
        for name in model_names()
        if not needs_arguments(name)
        for v in build_model(name).parameters
    }
    recorded = [build_model("synchronous_generator_phasor", **parts) for parts in RECORDED_PARTS]
    known |= {v.name for model in recorded for v in model.parameters}
    ranged = {*FOLLOWING, *FORMING, *MACHINE, *USUAL, *(v.name for v in RATED)}
    assert {*ranged, *(r.larger for r in RULES), *(r.smaller for r in RULES)} <= known


@pytest.mark.parametrize("name", [n for n in model_names() if not needs_arguments(n)])
def test_every_model_says_what_it_is_and_its_fmu_tells(name):
    model = build_model(name)
    assert model.kind or name in ("probe_a", "probe_b", "plant_controller_phasor")
    # what an FMU of the model holds, without building one
    described = parse_description(
        Path(f"{name}.fmu"), model_description(model, "{guid}", name, "a tool")
    )
    assert described.kind == model.kind
    for v in model.parameters:
        told = described.variables[v.name].usual
        assert told == v.usual or (v.usual is None and v.name in {r.name for r in RATED}), v.name


def test_what_an_fmu_declares_of_itself_is_read_and_a_bound_that_is_no_number_left_out():
    usual = Usual(2, 3, "their own data")
    m = ModelBuilder("own", "A load of somebody else", kind="load", usual={"machine.D": usual})
    with m.scope("machine"):
        D = m.parameter("D", 0.0, "pu", "Damping", base="S_n")
    m.output("y", D, "pu", "The same", base="S_n")
    text = model_description(m.build(), "{guid}", "own", "a tool")
    found = parse_description(Path("own.fmu"), text)
    assert (found.kind, found.variables["machine.D"].usual) == ("load", usual)
    wrong = parse_description(Path("own.fmu"), text.replace(b'low="2.0"', b'low="two"'))
    assert (wrong.kind, wrong.variables["machine.D"].usual) == ("load", None)


def test_a_port_that_does_not_say_what_it_is_is_a_converters(fmu_path):
    described = read_description(fmu_path("synchronous_generator_st1"))
    assert ComponentPlan(described).kind == "machine"
    assert ComponentPlan(replace(described, kind="")).kind == "converter"
    assert ComponentPlan(replace(read_description(fmu_path("infinite_bus")), kind="")).kind == ""


@pytest.mark.parametrize("value", [6500.0, 0.0999, 15.5])
def test_an_inertia_constant_outside_of_its_range_is_questioned_with_its_line(questions, value):
    (question,) = questions(("machine.H = 6.5", f"machine.H = {value}"))
    assert question.startswith(
        f"line {H_LINE}, components.sg.parameters.machine.H: sg: machine.H = {value:g} s"
    )
    assert "0.5 to 15 s" in question
    assert ("433 times too large, and usual by a factor of 1000" in question) == (value == 6500)


@pytest.mark.parametrize(
    ("variable", "value"),
    [
        ("machine.T_d10", 8000.0),  # ms for s
        ("machine.T_d10", 0.065),
        ("machine.X_d", 18.0),
        ("exciter.T_A", 20.0),
        ("exciter.T_R", 20.0),
        ("governor.T_5", 7000.0),
        ("governor.inverse_R", 0.05),  # R for 1/R
        ("pss.T_w1", 2000.0),
        ("pss.limit", 100.0),
    ],
)
def test_a_unit_slip_in_a_machine_is_questioned(questions, variable, value):
    (question,) = questions(machine(f"{variable} = {value}"))
    assert question.startswith(
        f"line {H_LINE + 1}, components.sg.parameters.{variable}: sg: {variable} = {value:g}"
    )


@pytest.mark.parametrize(
    ("variable", "value"),
    [
        ("droop.tau_P", 100.0),
        ("droop.R_V", 67.0),
        ("filter.X_c", 15.0),
        ("pod_p.T_W", 5000.0),
        ("pod_q.T_f", 100.0),
        ("pod_p.K", 50_000.0),
        ("voltage_control.tau", 50.0),
        ("current_control.tau", 1.0),
    ],
)
def test_a_unit_slip_in_a_converter_is_questioned(questions, variable, value):
    question, *others = questions(overrides={f"vsc.{variable}": value})
    assert all("cannot act" in other for other in others)  # its POD is off
    assert question.startswith(f"--set vsc.{variable}: vsc: {variable} = {value:g}")


def test_a_droop_that_made_a_system_grow_in_silence_is_questioned(questions):
    (question,) = questions(("droop.R_f = 0.05", "droop.R_f = 3"))
    assert re.match(
        rf"line {S_N_LINE + 2}, .*droop.R_f = 3 pu is outside of 0.001 to 0.3 pu", question
    )


@pytest.mark.parametrize("rating", ['"500 kVA"', "0.5"])
def test_a_rating_in_kva_is_questioned(questions, rating):
    (question,) = questions(('S_n = "500 MVA"', f"S_n = {rating}"), ('bus = "b2"', 'bus = "b1"'))
    assert question.startswith(
        f"line {S_N_LINE}, components.vsc.parameters.S_n: vsc: S_n = 0.5 MVA beside sg's 1000 MVA"
    )


def test_a_rating_in_kva_without_its_unit_is_questioned(questions):
    asked = questions(('S_n = "500 MVA"', "S_n = 500000"), ("P_0 = 0.8", "P_0 = 0.0008"))
    assert any("S_n = 500000 MVA is outside of 0.05 to 20000 MVA" in question for question in asked)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("X = 0.02, R = 0.002", "X = 0.002, R = 0.02", "R_l23 = 0.02 pu is 10 times X_l23"),
        ("R = 0.002, B = 0.02", "R = 0.002, B = 20", "B_l23 = 20 pu is outside of 0 to 10 pu"),
        (
            "X = 0.02, R = 0.002",
            "X = 0.02, R = 0.002, tap = 230",
            "tap_l23 = 230 is outside of 0.7 to 1.4",
        ),
        (
            "X = 0.02, R = 0.002",
            "X = 0.02, R = 0.002, X_C = 0.019",
            "l23.X_C = 0.019 pu is 0.95 of X_l23 = 0.02 pu",
        ),
        (
            "X = 0.02, R = 0.002",
            "X = 0.02, R = 0.002, X_C = 2e-5",
            "l23.X_C = 2e-05 pu is 0.001 of X_l23 = 0.02 pu",
        ),
    ],
)
def test_a_line_with_absurd_data_is_questioned_with_its_line(questions, old, new, said):
    text = CASE.replace(old, new)
    try:
        asked = questions(text=text)
    except (
        CaseError
    ) as error:  # with such a line the power flow has no solution, and the question says why
        asked = [str(p).replace("questioned besides: ", "") for p in error.problems]
    number = 1 + next(k for k, line in enumerate(text.splitlines()) if line.startswith("l23"))
    assert any(q.startswith(f"line {number}, network.lines.l23") and said in q for q in asked)


TRANSFORMER = """\
[network.three_winding_transformers]
t = { buses = ["b1", "b2", "b3"], X_12 = 0.1, X_13 = 0.2, X_23 = 0.12 }
"""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("X_12 = 0.1", "X_12 = 0.1", None),
        ("X_13 = 0.2", "X_13 = 15, X_23 = 15", "t.X_1 + X_3 = 15 pu is outside of 1e-05 to 10 pu"),
        (
            "X_12 = 0.1",
            "X_12 = 0.1, R_12 = 0.6",
            "t.R_1 + R_2 = 0.6 pu is 6 times t.X_1 + X_2 = 0.1 pu",
        ),
        (
            "X_12 = 0.1",
            "X_12 = 0.1, tap = [220.0, 1.0, 1.0]",
            "t.tap_1 = 220 is outside of 0.7 to 1.4",
        ),
        (
            "X_12 = 0.1",
            "X_12 = 0.1, shift = [0.0, 30.0, 0.0]",
            "t.shift_2 = 30 rad is more than half a turn",
        ),
    ],
)
def test_a_transformer_with_absurd_data_is_questioned_with_its_line(questions, old, new, said):
    table = TRANSFORMER.replace(", X_23 = 0.12", "" if "X_23" in new else ", X_23 = 0.12").replace(
        old, new
    )
    text = CASE.replace("[components.grid]", f"{table}[components.grid]")
    try:
        asked = questions(text=text)
    except CaseError as error:
        asked = [str(p).replace("questioned besides: ", "") for p in error.problems]
    if said is None:
        assert asked == []
        return
    number = 1 + next(k for k, line in enumerate(text.splitlines()) if line.startswith("t = "))
    assert any(
        q.startswith(f"line {number}, network.three_winding_transformers.t") and said in q
        for q in asked
    ), asked


def test_the_answer_about_a_transformer_is_taken(questions):
    text = CASE.replace("[components.grid]", f"{TRANSFORMER}[components.grid]").replace(
        "X_12 = 0.1", "X_12 = 0.1, R_12 = 0.6"
    )
    (asked,) = questions(text=text)
    (answer,) = re.findall(r"meant = \[.*\]", asked)
    assert questions(text=f"{answer}\n{text}") == []


def test_a_value_that_is_meant_is_not_questioned(questions):
    changes = [("machine.H = 6.5", "machine.H = 25")]
    assert len(questions(*changes)) == 1
    assert (
        questions(*changes, ('name = "plausible"', 'name = "plausible"\nmeant = ["s*.machine.H"]'))
        == []
    )
    assert (
        len(questions(*changes, ('name = "plausible"', 'name = "plausible"\nmeant = ["vsc.*"]')))
        == 1
    )


@pytest.mark.slow
def test_the_units_of_a_table_are_questioned_together_with_their_place(tmp_path):
    text = """\
name = "units"
[power_flow]
grid = "grid"
reactive_limits = false
[components.grid]
model = "grid"
[network]
pandapower = "case39"
stray_B = 0.05
load_model = { active = "impedance", reactive = "impedance" }
[units]
file = "units.csv"
generator = "synchronous_generator_ac4a"
converter = "gfor"
generator_parameters = { transformer.X_t = 0.0, transformer.R_t = 0.0, machine.T_d10 = 8000.0 }
"""
    rows = "\n".join(f"{bus},1000,{6500 if bus == 33 else 5}" for bus in range(30, 40))
    (tmp_path / "units.csv").write_text(
        f"bus,rating_mva,sg.machine.H\n{rows}\n".replace("39,1000", "39,9000")
    )
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    prepared = prepare_one(tmp_path / "case.toml")
    common, own = sorted(map(str, prepared.questions), key=lambda text: "machine.H" in text)
    assert re.match(
        r"line 15, units.generator_parameters.*: sg30, sg31, sg32 and 7 more: machine.T_d10 = 8000",
        common,
    )
    assert re.match(r".*units.csv, line 5, sg33.machine.H: sg33: machine.H = 6500 s", own)


@pytest.mark.parametrize(
    ("values", "moves"),
    [
        ({"sg1.S_n": "1800 MVA"}, "moves its power from 1350 to 1620 MW, which "),
        ({"sg1.S_n": "1800 MVA", "sg1.P_0": 0.75}, ""),
        ({"sg1.S_n": "1500 MVA"}, ""),
        ({"sg2.S_n": "6000 MVA"}, ""),  # it feeds what is left
    ],
)
def test_a_rating_that_moves_a_power_is_asked_about(values, moves):
    found = [
        str(q)
        for q in prepare_one("two_area", "base", values).questions
        if "in parts of S_n" in str(q)
    ]
    assert [moves in text for text in found] == [True] * bool(moves), found


@pytest.mark.parametrize(
    ("value", "other"),
    [
        ({"vsc.filter.R_c": 0.5}, "filter.X_c"),
        ({"sg.transformer.R_t": 0.5}, "transformer.X_t"),
        ({"sg.machine.X_q": 2.5}, "machine.X_d"),
        ({"grid.R_l23": 0.12}, "X_l23"),
    ],
)
def test_a_question_about_two_values_is_none_where_a_study_varies_the_other(tmp_path, value, other):
    """Each question names the second value in its text; a study that varies it means what it compares."""
    (name,) = value
    component = name.partition(".")[0]
    path = tmp_path / "case.toml"
    path.write_text(CASE.replace("900 MW", "90 MW"), encoding="utf-8")

    def asked(*varied):
        case = replace(load_case(path), varied=frozenset(varied))
        (prepared,) = case.prepare((), value)
        return [q.text for q in prepared.questions if f"{other} = " in q.text]

    assert len(asked()) == 1
    assert asked("vsc.droop.R_f", f"{component}.internal_step") == asked()
    assert asked(f"{component}.{other}") == []
    assert asked(f"*.{other}") == []


def test_questions_about_two_values_at_one_place_both_stay():
    found = SimpleNamespace(questions=[])
    given = SimpleNamespace(case=SimpleNamespace(meant=()))
    draft = SimpleNamespace(found=found, given=given, grid="grid")
    question(draft, [UnusualValue("a.H", "units.csv, line 5", "H is large", "a large H")])
    question(draft, [UnusualValue("a.S_n", "units.csv, line 5", "S_n is small", "a small S_n")])
    assert [one.text.partition(";")[0] for one in found.questions] == [
        "a: H is large",
        "a: S_n is small",
    ]


def test_a_question_is_put_once_on_the_terminal_and_stands_in_the_json(gfor, tmp_path):
    text = (
        CASE.replace("machine.H = 6.5", "machine.H = 6500") + "[scenarios.one]\n[scenarios.two]\n"
    )
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    code, out, err = gfor("modes", tmp_path / "case.toml", "--json")
    assert code == 0
    assert err.count("machine.H = 6500") == 1
    assert err.startswith(f"question: line {H_LINE}, ")
    assert out.count("machine.H = 6500") == 3  # among all questions, and with each scenario


# -- what is refused ---------------------------------------------------------------------------------


def test_two_rated_frequencies_in_one_network_are_refused_with_the_line(questions):
    text = CASE.replace("[network]\n", '[network]\nfrequency = "60 Hz"\n').replace(
        "6.5\n", '6.5\nf_n = "50 Hz"\n'
    )
    (problem,) = refused(questions, text=text)
    assert problem.startswith(
        f"line {H_LINE + 2}, components.sg.parameters.f_n: sg is rated at 50 Hz and grid at 60 Hz"
    )


def test_a_machine_that_keeps_its_default_frequency_is_refused_as_well(questions):
    """Without the network's key 'frequency' nothing gives the others theirs."""
    problems = refused(questions, overrides={"grid.f_n": 60.0})
    assert {p.partition(" is rated")[0].rpartition(" ")[2] for p in problems} == {"sg", "vsc"}


def test_all_at_60_hz_are_one_network(questions):
    assert questions(("[network]\n", '[network]\nfrequency = "60 Hz"\n')) == []


@pytest.mark.parametrize("rated", ["60 Hz", "50 Hz"])
def test_a_foreign_fmu_bound_with_another_frequency_is_refused(
    questions, tmp_path, fmu_path, rated
):
    (tmp_path / "vendor.toml").write_text(
        OURS.replace("[rating]", f'[rating]\nf_n = "{rated}"'), encoding="utf-8"
    )
    changes = [('model = "gfor"', f"fmu = '{fmu_path('gfor')}'\nbinding = \"vendor.toml\"")]
    if rated == "50 Hz":
        assert questions(*changes) == []
        return
    problem, asked = refused(questions, *changes)
    assert "f_n = 60 Hz, and the FMU's f_n is 50 Hz by itself" in asked
    line = 1 + CASE.replace(*changes[0]).splitlines().index('binding = "vendor.toml"')
    assert problem.startswith(
        f"line {line}, components.vsc.binding: vsc is rated at 60 Hz and grid at 50 Hz"
    )
    assert "rating.f_n" in problem


@pytest.mark.parametrize("rating", ["1500 MVA", "4 MVA"])
def test_a_binding_with_another_rating_than_the_fmu_starts_with_is_questioned(
    questions, tmp_path, fmu_path, rating
):
    text = OURS.replace('S_n = "1500 MVA"', f'S_n = "{rating}"')
    (tmp_path / "vendor.toml").write_text(text, encoding="utf-8")
    changes = [('model = "gfor"', f"fmu = '{fmu_path('gfor')}'\nbinding = \"vendor.toml\"")]
    asked = [
        q
        for q in questions(*changes, ('S_n = "500 MVA"', 'S_n = "1500 MVA"'))
        if "the binding has" in q
    ]
    assert len(asked) == (rating == "4 MVA")
    assert all("S_n = 4 MVA, and the FMU's S_n is 1500 MVA by itself" in q for q in asked)


def test_systems_that_are_not_coupled_may_have_two_frequencies(questions):
    apart = '[components.lone]\nmodel = "gfor"\nparameters = { f_n = 60.0 }\ninputs = { v_re = 1.0, v_im = 0.0 }\n'
    assert questions(text=CASE + apart) == []


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (
            "machine.X_d2 = 0.4",
            "machine.X_d2 = 0.4 pu must not exceed machine.X_d1 = 0.34 pu (the default)",
        ),
        (
            "machine.X_d1 = 2.135",
            "machine.X_d1 = 2.135 pu must be less than machine.X_d = 2.135 pu (the default)",
        ),
        (
            "machine.X_q1 = 2.1",
            "machine.X_q1 = 2.1 pu must not exceed machine.X_q = 2.046 pu (the default)",
        ),
        (
            "machine.X_l = 0.269",
            "machine.X_l = 0.269 pu must be less than machine.X_d2 = 0.269 pu (the default)",
        ),
        (
            "machine.T_d20 = 30.0",
            "machine.T_d20 = 30 s must be less than machine.T_d10 = 6.47 s (the default)",
        ),
        (
            "machine.T_q10 = 0.02",
            "machine.T_q20 = 0.034 s (the default) must be less than machine.T_q10 = 0.02 s",
        ),
    ],
)
def test_data_that_no_machine_can_have_are_refused_with_their_line(questions, line, said):
    problems = refused(questions, machine(line))
    variable = line.partition(" ")[0]
    assert any(
        p.startswith(f"line {H_LINE + 1}, components.sg.parameters.{variable}: ") and said in p
        for p in problems
    )


ROUND_ROTOR = (
    'model = "synchronous_generator_st4b_pss2a"',
    'model = "synchronous_generator"\nmachine = "genrou"',
)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (
            "machine.T_q10 = 0.04",
            "machine.T_q20 = 0.05 s (the default) must be less than machine.T_q10 = 0.04 s",
        ),
        (
            "machine.T_d10 = 0.02",
            "machine.T_d20 = 0.03 s (the default) must be less than machine.T_d10 = 0.02 s",
        ),
        (
            "machine.X_d2 = 0.35",
            "machine.X_d2 = 0.35 pu must not exceed machine.X_d1 = 0.3 pu (the default)",
        ),
        (
            "machine.X_l = 0.27",
            "machine.X_l = 0.27 pu must be less than machine.X_d2 = 0.25 pu (the default)",
        ),
    ],
)
def test_data_in_another_order_are_questioned_at_machines_that_hold_them(questions, line, said):
    """PSS/E warns of them and runs; the answer takes the question away."""
    about_both = [q for q in questions(machine(line), ROUND_ROTOR) if said in q]
    assert len(about_both) == 1
    answer = re.search(r"meant = .*", about_both[0])[0]
    answered = (CASE.splitlines()[0], f"{CASE.splitlines()[0]}\n{answer}")
    assert not [q for q in questions(machine(line), ROUND_ROTOR, answered) if said in q]


def test_a_leakage_reactance_that_makes_a_round_rotor_singular_is_refused(questions):
    """The remedy works as it is typed."""
    problems = refused(questions, machine("machine.X_l = 0.3"), ROUND_ROTOR)
    said = "machine.X_l = 0.3 pu must differ from machine.X_d1 = 0.3 pu (the default): "
    assert any(said in one and "such as half of this one" in one for one in problems)
    assert not any("the equations hold" in one for one in problems)
    assert not [q for q in questions(machine("machine.X_l = 0.15"), ROUND_ROTOR) if "X_l" in q]


@pytest.mark.parametrize(
    "line", ["machine.X_q1 = 2.046", "machine.X_q2 = 0.573", "machine.X_d2 = 0.34"]
)
def test_a_machine_without_some_winding_is_data_like_any_other(questions, line):
    assert questions(machine(line)) == []


def test_a_ratio_that_would_be_usual_in_percent_is_asked_about_so(questions):
    (question,) = questions(("droop.R_f = 0.05", "droop.R_f = 2"))
    assert (
        "(grid codes: 2 to 12 % of rated frequency at rated power); is it in percent? 0.02 pu would be usual"
        in question
    )


@pytest.mark.parametrize(("power", "asked"), [("0.8", None), ("1.3", "1.3")])
def test_a_converter_that_is_loaded_beyond_its_rating_is_questioned(questions, power, asked):
    found = questions(("P_0 = 0.8", f"P_0 = {power}"))
    assert bool(found) == bool(asked)
    if asked:
        (question,) = found
        assert question.startswith(
            f"line {S_N_LINE}, components.vsc.parameters.S_n: vsc: the operating point, P_0 = 1.3"
        )
        assert "more than the rating of the converter" in question
        assert (
            questions(
                ("P_0 = 0.8", f"P_0 = {power}"),
                ('name = "plausible"', 'name = "p"\nmeant = ["vsc.S_n"]'),
            )
            == []
        )


@pytest.mark.parametrize(("name", "largest"), [("droop.R_f", 0.3), ("droop.R_V", 0.5)])
def test_a_droop_of_a_tenth_of_a_percent_is_usual_and_less_is_asked_about(name, largest):
    wanted = FORMING[name]
    assert all(wanted.fits(value) for value in (0.0, 0.001, 0.05, largest))
    assert not any(wanted.fits(value) for value in (0.0009, 1.01 * largest))


@pytest.mark.parametrize(
    ("R", "X", "asked"),
    [
        (0.02, 0.01, True),
        (2.0, 1.5, True),
        (0.0104, 0.01, False),
        (0.01, 0.02, False),
        (0.1, 0.0, False),
        (0.1, -0.1, False),
    ],
)
def test_a_resistance_above_its_reactance_is_asked_about(R, X, asked, monkeypatch):
    plan = SimpleNamespace(kind="", description=SimpleNamespace(parameters=()))
    monkeypatch.setattr(plausibility, "RESISTANCES", (("R", "X"),))
    monkeypatch.setattr(plausibility, "value_of", lambda plan, name: {"R": R, "X": X}.get(name))
    monkeypatch.setattr(plausibility, "place_of", lambda *_: "here")
    for name in ("_small_units", "network_doubts", "source_doubts", "_ratings", "dead_band_doubts"):
        monkeypatch.setattr(plausibility, name, lambda draft: ())
    draft = SimpleNamespace(system=SimpleNamespace(components={"a": plan}))
    assert [doubt.name for doubt in plausibility._doubts(draft)] == ["a.R"] * asked
