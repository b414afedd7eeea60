"""Parameter files: what they set, what goes before what, and what is said of a bad one."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.form.parameter_files import parameter_file_text, read_parameter_file
from orchestrator.core.errors import CaseError, InputError
from tests.support.scenarios import prepare_one


@pytest.fixture
def write(tmp_path):
    def make(text, name="values.toml"):
        (tmp_path / name).write_text(text, encoding="utf-8")
        return tmp_path / name

    return make


def test_what_is_written_is_read(write):
    values = {
        "gfor*.pod_p.K": 200.0,
        "gfor.pod_p.enabled": True,
        "gfor.pod_p.N_S": 2,
        "grid.load_2.P": "2600 MW",
    }
    file = read_parameter_file(
        write(parameter_file_text(values, ["made by\nsomebody", "for a test"]))
    )
    assert file.values == values
    assert file.text.startswith("# made by\n# somebody\n# for a test\n")


def test_unquoted_keys_and_tables_mean_the_same(write):
    file = read_parameter_file(write("[set]\ngfor.pod_p.K = 150.0\n[set.gfor.pod_q]\nK = 90\n"))
    assert file.values == {"gfor.pod_p.K": 150.0, "gfor.pod_q.K": 90}
    assert file.place("gfor.pod_p.K").endswith("values.toml, line 2, gfor.pod_p.K")


def test_scenario_then_file_then_command_line(write):
    case = load_case("two_area")
    file = read_parameter_file(
        write('[set]\n"gfor.pod_p.K" = 150.0\n"gfor.pod_p.enabled" = false\n')
    )

    def values(**arguments):
        (ready,) = case.prepare(["pod_p"], **arguments)
        return ready.values["gfor.pod_p.enabled"], ready.values.get("gfor.pod_p.K")

    assert values() == (True, None)
    assert values(parameters=[file]) == (False, 150.0)
    assert values(parameters=[file], overrides={"gfor.pod_p.K": 99.0}) == (False, 99.0)


def test_a_case_file_names_parameter_files(write):
    text = load_case("two_area").text
    write('[set]\n"gfor.pod_p.K" = 150.0\n"gfor.pod_p.T_S1" = 0.3\n', "pod.toml")
    path = write(
        text.replace(
            'set = { "gfor.pod_p.enabled" = true }',
            'parameters = ["pod.toml"]\nset = { "gfor.pod_p.enabled" = true, "gfor.pod_p.T_S1" = 0.25 }',
        ),
        "case.toml",
    )
    ready = prepare_one(path, "pod_p")
    assert [ready.values[f"gfor.pod_p.{v}"] for v in ("enabled", "K", "T_S1")] == [
        True,
        150.0,
        0.25,
    ]


def test_a_case_file_that_names_a_missing_one(write):
    text = load_case("two_area").text.replace(
        'set = { "gfor.pod_p.enabled" = true }', 'parameters = ["none.toml"]', 1
    )
    with pytest.raises(
        CaseError,
        match=r"line \d+, scenarios.pod_p.parameters.*none.toml: the parameter file cannot",
    ):
        load_case(write(text, "case.toml")).prepare(["pod_p"])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", r"needs a table \[set\] .*this one has at its top: nothing"),
        ("[values]\na = 1", r"needs a table \[set\] .*this one has at its top: values"),
        ("[set", "it is not a TOML file"),
        ('[set]\n"gfor.pod_p.K" = [1]', r"line 2, gfor.pod_p.K: \[1\] is neither a number"),
        ("[set]\nK = 1", "line 2, K: it is not of the form component.parameter"),
        ('title = "x"\n[set]\n"gfor.pod_p.K" = 1', "line 1, title: this key is unknown"),
    ],
)
def test_a_file_that_is_none(write, text, words):
    with pytest.raises(InputError, match="(?s)values.toml.*" + words):
        read_parameter_file(write(text))


def test_a_value_that_does_not_fit_names_file_and_line(write):
    file = read_parameter_file(
        write('[set]\n"gfor.pod_p.K" = -1.0\n"gfor.pod_p.T_X" = 1\n"converter.pod_p.K" = 1\n')
    )
    with pytest.raises(CaseError) as caught:
        load_case("two_area").prepare(["gfor"], parameters=[file])
    said = str(caught.value)
    assert "values.toml, line 2, gfor.pod_p.K: pod_p.K = -1 pu; it must be at least 0 pu" in said
    assert (
        "values.toml, line 3, gfor.pod_p.T_X: component 'gfor' has no variable 'pod_p.T_X'" in said
    )
    assert "values.toml, line 4, converter.pod_p.K: there is no component 'converter'" in said


def test_a_share_of_converters_comes_from_a_file_as_well(write):
    file = read_parameter_file(write('[set]\n"units.alpha" = 0.0\n'))
    assert not [
        n
        for n in load_case("ieee118").components_of("gfor", parameters=[file])
        if n.startswith("gfor")
    ]
