"""TOML files that users write: the errors that all of them share."""

import pytest
from pydantic import ValidationError

from orchestrator.core.errors import InputError
from orchestrator.core.toml_files import Table, fault_of, read_toml


def test_a_file_comes_as_text_and_as_tables(tmp_path):
    (tmp_path / "a.toml").write_text("[a]\nK = 2.0 # Ω\n", encoding="utf-8")
    assert read_toml(tmp_path / "a.toml", "the file", "") == (
        "[a]\nK = 2.0 # Ω\n",
        {"a": {"K": 2.0}},
    )


@pytest.mark.parametrize(
    ("option", "source"),
    [("", "{path}: "), ("--details", "--details {path}: ")],
    ids=["no option", "an option"],
)
@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "the file cannot be read: No such file or directory; print one"),
        (b"[a", "it is not a TOML file: Expected ']' at the end of a table declaration"),
        (
            b"a = 1\nb =\n\n",
            "it is not a TOML file: Invalid value (at line 2, column 4); write NAME = VALUE",
        ),
        (
            b"a = 1\nb = ",
            "it is not a TOML file: Invalid value (at the end of line 2, the last one); write NAME = VALUE",
        ),
        (b"a = " + 5000 * b"9", "a whole number in it has too many digits to be read; shorten it"),
        (b"\xff\xfe", "it is not a TOML file: 'utf-8' codec can't decode"),
    ],
)
def test_a_file_that_cannot_be_used(tmp_path, option, source, content, words):
    path = tmp_path / "a.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_toml(path, "the file", "print one", option)
    assert str(caught.value).startswith(source.format(path=path) + words)


class Gain(Table):
    K: float
    T: float = 1.0


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "this key is missing; add it"),
        ({"K": 1.0, "k": 2.0}, "this key is unknown; check its spelling, or remove it"),
        ({"K": "much"}, "it must be a valid number, unable to parse string as a number"),
    ],
)
def test_an_entry_that_is_wrong(given, words):
    with pytest.raises(ValidationError) as caught:
        Gain.model_validate(given)
    (detail,) = caught.value.errors()
    assert fault_of(detail) == words
