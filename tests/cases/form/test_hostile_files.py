"""Files that a stranger made to fill the memory, or that a program wrote by mistake: one clear error, and soon."""

import zipfile

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.form.csv_rows import MOST_ROWS, rows_of
from orchestrator.core.errors import MOST_PROBLEMS, CaseError, InputError
from orchestrator.core.toml_files import MOST_BYTES
from orchestrator.devices.fmi.archive import MOST_XML_ELEMENTS
from orchestrator.devices.fmi.description import read_description

HEAD = 'name = "x"\n[components.a]\nmodel = "gfor"\n'


@pytest.fixture
def case(tmp_path):
    """Text of a case file → its path."""

    def write(text):
        path = tmp_path / "case.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_nested_brackets_are_one_error(case, gfor):
    code, _, error = gfor("modes", case(f'name = "x"\na = {"[" * 20_000}{"]" * 20_000}\n'))
    assert code == 2
    assert "brackets nest too deeply" in error
    assert error.count("\n") == 1


def test_a_case_file_of_many_megabytes_is_refused_before_it_is_read(case):
    path = case("#" * (MOST_BYTES + 1))
    with pytest.raises(
        InputError, match=rf"has {MOST_BYTES + 1} bytes; at most {MOST_BYTES} are read"
    ):
        load_case(path)


@pytest.mark.parametrize(
    "text",
    [
        HEAD + "[components.a.parameters]\n" + "\n".join(f"p{k} = {k}" for k in range(20_000)),
        "\n".join(f"p{k} = {k}" for k in range(20_000)),
    ],
    ids=["unknown parameters", "unknown keys"],
)
def test_of_thousands_of_mistakes_the_first_are_listed(case, text):
    with pytest.raises(CaseError) as raised:
        load_case(case(text)).prepare()
    problems = raised.value.problems
    assert len(problems) == MOST_PROBLEMS + 1
    assert len(set(problems)) == len(problems)
    assert "more problems than are listed" in str(problems[-1])


@pytest.mark.parametrize("option", [("--stop", "1e9"), ("--step", "1e-12"), ("--stop", "1e300")])
def test_a_run_of_years_is_refused(gfor, option):
    code, _, error = gfor("run", "infinite_bus", *option)
    assert code == 2
    assert "communication steps, which take about" in error
    assert "years" in error


def test_a_table_of_a_million_rows_is_refused(tmp_path):
    path = tmp_path / "lines.csv"
    path.write_text("name,X\n" + "l,0.1\n" * (MOST_ROWS + 1), encoding="utf-8")
    with pytest.raises(InputError, match=f"more than {MOST_ROWS} rows"):
        rows_of(path, ["name", "X"])


def test_a_table_that_is_no_text_is_refused(tmp_path):
    path = tmp_path / "lines.csv"
    path.write_bytes(b"name,X\n\xff\xfe\x00,1\n")
    with pytest.raises(InputError, match=r"cannot be read as a table.*save it as CSV in UTF-8"):
        rows_of(path, ["name", "X"])


def test_an_fmu_of_hundreds_of_thousands_of_variables_is_refused(tmp_path):
    path = tmp_path / "big.fmu"
    variables = "<ScalarVariable/>" * (MOST_XML_ELEMENTS + 1)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(
            "modelDescription.xml", f"<fmiModelDescription>{variables}</fmiModelDescription>"
        )
    with pytest.raises(InputError, match=f"more than {MOST_XML_ELEMENTS} elements"):
        read_description(path)
