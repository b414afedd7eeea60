"""What one worker of pytest-xdist computed, the others read."""

from tests.support.once import computed_once, made_once

ASKED = []


def power(base, exponent=2):
    ASKED.append((base, exponent))
    return {"power": base**exponent}


def test_another_worker_reads_what_one_computed_and_other_arguments_are_computed():
    one, other = computed_once(power), computed_once(power)
    assert [one(3), other(3), other(3, exponent=3), one(3, exponent=3)] == [
        {"power": 9},
        {"power": 9},
        {"power": 27},
        {"power": 27},
    ]
    assert ASKED == [(3, 2), (3, 3)]


def test_a_folder_whose_making_failed_is_made_anew():
    def fail(folder):
        (folder / "half").write_text("")
        raise OSError

    def make(folder):
        (folder / "whole").write_text("")

    for filled in (fail, make):
        try:
            found = made_once("a folder of test_once", filled)
        except OSError:
            continue
    assert (found / "whole").exists()
