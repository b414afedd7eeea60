"""A name in the analysis or the plots that nothing has in any scenario is an error with its line."""

from types import SimpleNamespace

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.questions.mentions import _of_foreign
from orchestrator.core.errors import CaseError


def problems(tmp_path, text, scenario="with_gen"):
    path = tmp_path / "case.toml"
    path.write_text(text, encoding="utf-8")
    try:
        load_case(path).prepare([scenario])
    except CaseError as error:
        return [str(p) for p in error.problems]
    return []


@pytest.fixture
def text():
    return load_case("two_area_rms").text


MODES = 'states = ["sg?.machine.omega", "sg?.machine.delta"]'
RING = 'ring_down = { signal = "sg1.omega - sg2.omega"'
PANEL = '{ signal = "gfor.omega"'


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            MODES,
            'against = [["sg1.machine.omega"], ["nosuch"]]',
            "'nosuch': no scenario has a state",
        ),
        (MODES, 'states = ["nosuch.*"]', "'nosuch.*': no scenario has a state"),
        (MODES, 'states = ["sg1.machine.omga"]', "did you mean sg1.machine.omega"),
        (
            "areas = {",
            'swing = ["*.machine.nosuch"]\nareas = {',
            "'*.machine.nosuch': no scenario has a state",
        ),
        ('area_2 = ["sg2"]', 'area_2 = ["sg3"]', "'sg3': no scenario has such a component or bus"),
        (
            RING,
            RING.replace("sg1.omega", "sg1.omga"),
            "no scenario has an output 'sg1.omga'; did you mean sg1.omega",
        ),
        (RING, RING.replace(" - ", " + "), "no scenario has an output 'sg1.omega + sg2.omega'"),
        (RING, RING.replace(" - sg2", " - sg1.p - sg2"), "write 'component.variable', 'component"),
        (PANEL, PANEL.replace("omega", "omga"), "no scenario has an output 'gfor.omga'"),
    ],
)
def test_a_name_that_matches_nothing_is_an_error_with_its_line(tmp_path, text, old, new, said):
    assert old in text
    changed = text.replace(old, new, 1)
    (found,) = problems(tmp_path, changed, "base")
    assert said in found
    line = int(found.removeprefix("line ").partition(",")[0])
    at = changed.splitlines()[line - 1 : line + 4]  # an array may stretch over some lines
    assert any(new.splitlines()[0][:20] in row for row in at), (found, at)


def test_a_component_may_be_absent_from_some_scenarios(tmp_path, text):
    """The base scenario has no converter, whose signals are plotted."""
    assert problems(tmp_path, text, "base") == []
    assert (
        problems(tmp_path, text.replace('area_2 = ["sg2"]', 'area_2 = ["sg2", "bus_3"]'), "gfor")
        == []
    )


def test_states_of_a_component_whose_file_does_not_name_them_may_be_asked_for():
    named = SimpleNamespace(foreign={"vendor_1", "plant"})
    assert [
        _of_foreign(named, pattern)
        for pattern in ("vendor_?.x", "plant.a.b", "sg1.x", "x", "vendor_1")
    ] == [
        True,
        True,
        False,
        False,
        False,
    ]
