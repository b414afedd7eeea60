"""What a case file says twice, of nothing, or against itself is refused or asked about, with its line."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import CaseError
from tests.cases.form.test_case_files import THREE_BUSES
from tests.support.scenarios import prepare_one


@pytest.fixture(scope="module")
def text():
    return load_case("two_area_rms").text


@pytest.fixture
def prepared(tmp_path, text):
    """A scenario of the case of two areas, with a part of its text changed."""

    def prepare(old, new, scenario="pod_p"):
        assert old in text
        (tmp_path / "case.toml").write_text(text.replace(old, new, 1), encoding="utf-8")
        ready = prepare_one(tmp_path / "case.toml", scenario)
        return ready

    return prepare


@pytest.fixture
def the_problem(prepared):
    """The one problem of the case with a part of its text changed."""

    def find(old, new, scenario="pod_p"):
        with pytest.raises(CaseError) as caught:
            prepared(old, new, scenario)
        (problem,) = (
            text for text in map(str, caught.value.problems) if "questioned besides" not in text
        )
        return problem

    return find


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('stop_time = "20 s"', "stop_time = true"),
        ('time = "1 s"', "time = true"),
        ('start = "2 s"', "start = true"),
        ("scale = 1000", "scale = true"),
        ("real = 0.06", "real = false"),
        ('step_size = "5 ms"', "step_size = false"),
    ],
)
def test_a_truth_value_is_no_number(the_problem, old, new):
    problem = the_problem(old, new)
    assert problem.startswith("line ")
    assert "this is a truth value; give a number (value seen: " in problem


MODES = (
    'modes = [{ name = "electromechanical", states = ["sg?.machine.omega", "sg?.machine.delta"] }]'
)
TWO_SIDES = 'against = [["sg1.machine.omega"], ["sg2.machine.omega"]]'
RECORD = 'stop_time = "20 s"'
PLOT = '[[plots]]\nname = "gfor_power"'
PANEL = '{ signal = "gfor.omega", label = "ω_GFOR [pu]" }'


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            MODES,
            'modes = [{ name = "electromechanical" }]',
            "has neither of 'states' and 'against'",
        ),
        (
            MODES,
            MODES.replace(" }]", f", {TWO_SIDES} }}]"),
            "has both of 'states' and 'against'; give one of them",
        ),
        (
            MODES,
            MODES.replace(" }]", f" }}, {{ name = 'electromechanical', {TWO_SIDES} }}]"),
            "two modes are called",
        ),
        ("base.electromechanical", "bsae.electromechanical", "there is no scenario 'bsae'"),
        ("base.electromechanical", "base.electromechanic", "there is no mode 'electromechanic'"),
        (PANEL, PANEL.replace(" }", ", scale = 0 }"), "scale = 0 draws 'gfor.omega' as 0"),
        (
            PLOT,
            PLOT + '\ntitle = "T"\npanels = []\n[[plots]]\nname = "other"',
            "plot 'gfor_power' has no panels",
        ),
        (
            PLOT,
            PLOT.replace("gfor_power", "frequency_difference"),
            "two plots are called 'frequency_difference'",
        ),
        (
            RECORD,
            RECORD + '\nrecord = ["*", "gfor.omgea"]',
            "'gfor.omgea': no scenario has such an output",
        ),
        (
            'name = "two',
            'meant = ["nosuch.thing"]\nname = "two',
            "'nosuch.thing': there is no component 'nosuch'",
        ),
        (
            'schedule = "gauss-seidel"\ngroups = [["gfor"',
            'schedule = "jacobi"\ngroups = [["gfro"',
            "component 'gfro'",
        ),
        (
            "[power_flow]",
            '[network]\nfrequency = "60 Hz"\nbuses = ["a"]\n[power_flow]',
            "no component is built from",
        ),
        (
            'S_n = "1500 MVA"',
            'droop.R_f = 0.05, "droop.R_f" = 0.06, S_n = "1500 MVA"',
            "droop.R_f: it is given",
        ),
        (
            'set = { "gfor.pod_p.enabled" = true }',
            'set = { "grid.X_L" = 0.1, grid.X_L = 0.2 }',
            "it is given twice",
        ),
    ],
)
def test_a_contradiction_is_refused(the_problem, old, new, words):
    problem = the_problem(old, new)
    assert problem.startswith("line ")
    assert words in problem


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            RECORD,
            RECORD + '\nrecord = ["sg*"]',
            "'gfor.omega' is not shown, because solver.record leaves out",
        ),
        (RECORD, RECORD + '\nrecord = ["gfor.*"]', "leaves out sg1.omega and sg2.omega"),
        (
            'start = "2 s"',
            'start = "20 s"',
            "no ring-down is shown: it starts at 20 s, and runs stop at 20 s",
        ),
        (
            'area_2 = ["sg2"]',
            'area_2 = ["sg*"]',
            "sg1 is in area_1 and area_2; it counts to area_1",
        ),
    ],
)
def test_what_is_left_out_is_asked_about(prepared, old, new, words):
    ready = prepared(old, new)
    found = [str(question) for question in (*ready.questions, *ready.about_rows)]
    assert any(words in question and question.startswith("line ") for question in found), found


def test_a_ring_down_without_modes_is_asked_about(prepared, text):
    figures = text[text.index("[reference]") : text.index("[[plots]]")]
    found = prepared(
        text[text.index(MODES) : text.index("[[plots]]")],
        text[text.index(MODES) + len(MODES) : text.index("[[plots]]")].replace(figures, ""),
    )
    assert "no mode is looked for in the ring-down" in str(found.questions[0])


def test_a_sound_case_raises_no_question(prepared):
    assert prepared(RECORD, RECORD).questions == ()


def test_a_shift_in_degrees_and_a_bus_listed_twice(tmp_path):
    grid = THREE_BUSES.replace("B = 0.02 }", "B = 0.02, shift = 30 }", 1)
    (tmp_path / "case.toml").write_text(grid, encoding="utf-8")
    ready = prepare_one(tmp_path / "case.toml")
    assert (
        "shift_l12 = 30 rad is more than half a turn; if it is in degrees, write '30 deg'"
        in ready.questions[0].text
    )
    (tmp_path / "case.toml").write_text(
        grid.replace("shift = 30", "shift = '30 deg'"), encoding="utf-8"
    )
    ready = prepare_one(tmp_path / "case.toml")
    assert not [question for question in ready.questions if "shift" in question.text]
    (tmp_path / "case.toml").write_text(grid.replace('"b3"]', '"b3", "b2"]', 1), encoding="utf-8")
    with pytest.raises(CaseError, match="the bus 'b2' is listed twice"):
        load_case(tmp_path / "case.toml").prepare()
