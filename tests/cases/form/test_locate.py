"""The line of a key in a TOML file."""

import tomllib

import pytest

from orchestrator.cases.form.locate import line_of

TEXT = """\
name = "x"
# [components.comment]
[solver]
step_size = "100 us"   # solver.stop_time = 3
  stop_time = 20

[components.gfor]
model = "gfor"
parameters = { S_n = 1500, droop.R_f = 0.05 }

[ components . sg1 ]
parameters.S_n = 5
"parameters"."droop.R_f" = 6
'model' = "y"

[components.grid.parameters]
load_2.P = "2600 MW"

[[events]]
type = "load_change"
[[events]]   # the second
type = "branch_change"
X = 0.2

[scenarios.base]
set = { "grid.X_L" = 0.1 }
[scenarios."a.b"]
title = "quoted"
[[scenarios.base.events]]
time = 1
"""


@pytest.mark.parametrize(
    ("path", "line"),
    [
        (("name",), 1),
        (("solver",), 3),
        (("solver", "step_size"), 4),
        (("solver", "stop_time"), 5),
        (("components", "gfor"), 7),
        (("components", "gfor", "model"), 8),
        (("components", "gfor", "parameters", "droop", "R_f"), 9),
        (("components", "sg1", "parameters", "S_n"), 12),
        (("components", "sg1", "parameters", "droop.R_f"), 13),
        (("components", "sg1", "model"), 14),
        (("components", "grid", "parameters", "load_2", "P"), 17),
        (("events", 0), 19),
        (("events", 0, "type"), 20),
        (("events", 1), 21),
        (("events", 1, "X"), 23),
        (("scenarios", "base", "set", "grid.X_L"), 26),
        (("scenarios", "a.b", "title"), 28),
        (("scenarios", "base", "events", 0, "time"), 30),
    ],
)
def test_the_line_where_a_key_stands(path, line):
    tomllib.loads(TEXT)  # the example itself is sound
    assert line_of(TEXT, path) == line


@pytest.mark.parametrize(
    ("path", "line"),
    [
        (("solver", "schedule"), 3),
        (("components", "sg1", "bus"), 11),
        (("events", 1, "R"), 21),
        (("scenarios", "base", "remove"), 25),
    ],
)
def test_a_key_that_is_missing_is_placed_at_its_table(path, line):
    assert line_of(TEXT, path) == line


@pytest.mark.parametrize("path", [(), ("network",), ("components",), ("events", 2)])
def test_what_has_no_line(path):
    assert line_of(TEXT, path) is None


def test_an_empty_file():
    assert line_of("", ("name",)) is None
