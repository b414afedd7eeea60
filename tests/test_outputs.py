"""Two folders of outputs are compared to the last digit, key, row and line, but for differences that are named."""

import json

from tests.benchmarks.outputs import compare


def _folders(tmp_path, before, after):
    folders = []
    for name, files in (("before", before), ("after", after)):
        folder = tmp_path / name
        folder.mkdir()
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8")
        folders.append(folder)
    return folders


def test_the_last_digit_of_a_figure_counts(tmp_path):
    before, after = (
        '{"modes": [{"real": -0.38918872130123}]}',
        '{"modes": [{"real": -0.38918872130124}]}',
    )
    folders = _folders(tmp_path, {"modes.json": before}, {"modes.json": after})
    assert compare(*folders, []) == [
        "modes.json: .modes[0].real: '-0.38918872130123' -> '-0.38918872130124'"
    ]


def test_a_lost_key_a_lost_row_a_changed_line_and_a_lost_file_are_found(tmp_path):
    before = {
        "a.json": json.dumps({"x": 1, "y": 2}),
        "b.csv": "name,f\na,1\nb,2\n",
        "c.txt": "one\ntwo\n",
        "d.png": "",
    }
    after = {"a.json": json.dumps({"x": 1}), "b.csv": "name,f\na,1\n", "c.txt": "one\n2\n"}
    places = [line.rsplit(": ", 1)[0] for line in compare(*_folders(tmp_path, before, after), [])]
    assert places == [
        "a.json: .keys",
        "a.json: .y",
        "b.csv: row 2",
        "c.txt: line 1",
        "d.png: the file",
    ]


def test_a_difference_that_is_named_and_the_speed_of_a_run_are_left_out(tmp_path):
    before = {"a.json": '{"steps_per_second": 1.5, "title": "old"}', "b.txt": "2026-11-28 20:00:01"}
    after = {"a.json": '{"steps_per_second": 2.5, "title": "new"}', "b.txt": "2026-11-29 21:00:02"}
    folders = _folders(tmp_path, before, after)
    assert compare(*folders, ["a.json: .title"]) == []
    assert len(compare(*folders, [])) == 1
