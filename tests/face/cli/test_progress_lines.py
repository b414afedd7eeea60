"""Progress of long commands where no terminal is: lines on standard error, and nowhere else."""

import json
import re
import sys
import time
from types import SimpleNamespace

import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import InputError
from orchestrator.face.api import acceptance
from orchestrator.face.cli import at_work, explore, main, progress_lines, sensitivities
from orchestrator.face.cli.progress_lines import ProgressLines
from orchestrator.studies.points.under_way import (
    counting,
    join,
    parts_done,
    tally,
    tell_doing,
    tell_part,
)
from orchestrator.studies.siting import residues
from orchestrator.studies.siting.machines import find_machines
from orchestrator.studies.siting.study import SiteRequest, find_sites

pytestmark = pytest.mark.usefixtures("undrawn")

POINTS = "time,grid.X_L\n" + "".join(f"{k},{0.1 + 0.01 * k}\n" for k in range(6))


@pytest.fixture
def often(monkeypatch):
    monkeypatch.setattr(progress_lines, "EVERY", 0.05)


def lines_of(error, name):
    return [line for line in error.splitlines() if line.startswith(f"{name}: ")]


@pytest.mark.parametrize("workers", ["1", "2"])
def test_a_screening_tells_how_far_it_is_within_its_only_task(often, tmp_path, capsys, workers):
    points = tmp_path / "day.csv"
    points.write_text(POINTS)
    asked = ["two_area", "--scenario", "gfor", "--points", str(points), "--workers", workers]
    assert main(["screen", *asked, "--out", str(tmp_path / "out"), "--json"]) == 0
    out, error = capsys.readouterr()
    assert json.loads(out)["items"]
    said = lines_of(error, "screen")
    counts = [int(found[1]) for line in said if (found := re.search(r": (\d) of 6 items", line))]
    assert counts == sorted(counts)
    assert {*range(1, 6)} & {*counts}
    assert any(re.search(r"about \d+ s left$", line) for line in said)
    assert "of 6 items" not in out


def test_sensitivities_tell_how_many_parameters_are_done(often, capsys, monkeypatch):
    """104 s of processor time had no line."""

    def computed(scenario, request):
        request.report(1, 4)
        time.sleep(0.12)
        raise InputError("enough")

    monkeypatch.setattr(sensitivities, "sensitivities_of", computed)
    assert main(["sensitivities", "two_area", "--scenario", "gfor"]) == 2
    said = lines_of(capsys.readouterr().err, "sensitivities")
    assert said[0].startswith("sensitivities: 1 of 4 parameters, ")


def test_a_command_that_ends_before_the_first_line_says_nothing(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(progress_lines, "EVERY", 3600.0)
    asked = ["two_area", "--scenario", "gfor", "--vary", "grid.X_L=0.1:0.11:2", "--workers", "1"]
    assert main(["sweep", *asked, "--out", str(tmp_path)]) == 0
    assert lines_of(capsys.readouterr().err, "sweep") == []


def test_a_page_that_is_saved_tells_how_far_it_is(often, tmp_path, capsys, monkeypatch):
    def saved(path, case, desk, beginning, varied, report, *, further):
        time.sleep(0.2)
        report(3, 10)
        time.sleep(0.2)

    monkeypatch.setattr(explore, "save_page", saved)
    assert main(["explore", "infinite_bus", "--save", str(tmp_path / "page.html")]) == 0
    out, error = capsys.readouterr()
    said = lines_of(error, "explore")
    assert "preparing" in said[0]
    assert any("3 of 10 points" in line for line in said)
    assert lines_of(out, "explore") == []


@pytest.mark.parametrize(
    ("name", "asked"),
    [
        ("sweep", ["two_area_rms", "--vary=grid.X_L=0.1:0.2:5", "--scenario=gfor", "--workers=1"]),
        ("site", ["two_area_rms", "--scenario", "gfor", "--confirm", "1"]),
    ],
)
def test_other_studies_say_it_on_standard_error_alone(often, tmp_path, capsys, name, asked):
    assert main([name, *asked, "--out", str(tmp_path / "out")]) == 0
    out, error = capsys.readouterr()
    assert lines_of(error, name)
    assert lines_of(out, name) == []


@pytest.mark.parametrize(
    ("case", "find", "wanted"),
    [
        ("two_area_rms", find_sites, SiteRequest("pod_p", scenario="gfor", confirm=1)),
        ("kundur", find_machines, SiteRequest("regulator", scenario="thyristor", confirm=0)),
    ],
)
def test_a_search_for_places_counts_before_its_first_part_is_done(case, find, wanted):
    """Its first count came with the first part, so that this was taken for one that was there already."""
    counts = []
    find(load_case(case), wanted, lambda *count: counts.append(count))
    assert counts[0] == (0, 1 + wanted.confirm)
    assert counts == sorted(counts)
    done, total = counts[-1]
    assert done == total


@pytest.mark.parametrize("workers", ["1", "2"])
def test_a_run_tells_how_many_steps_of_all_its_scenarios_are_done(often, tmp_path, capsys, workers):
    scenarios = ["--scenario", "gfor", "--scenario", "pod_p"]
    asked = ["two_area", *scenarios, "--stop", "0.4", "--workers", workers, "--json", "--no-csv"]
    main(["run", *asked, "--out", str(tmp_path / "out")])
    out, error = capsys.readouterr()
    assert len(json.loads(out)) == 2
    counts = [
        (int(found[1]), int(found[2]))
        for line in lines_of(error, "run")
        if (found := re.match(r"run: (\d+) of (\d+) steps", line))
    ]
    assert counts == sorted(counts)
    assert {total for _, total in counts} == {8000}  # two of 0.4 s at 100 µs
    assert "steps, " not in out


def test_what_was_there_already_does_not_make_the_time_left_short(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(progress_lines, "monotonic", lambda: now[0])
    lines = ProgressLines("sweep", "points", shown=False)
    assert lines.line() == "sweep: preparing, 0 s"
    tell_doing("scenario a, 1 of 4")
    assert lines.line() == "sweep: preparing scenario a, 1 of 4, 0 s"
    tell_doing()
    lines.report(6, 10)
    now[0] += 60.0
    assert lines.line() == "sweep: 6 of 10 points, 60 s"
    lines.report(8, 10)
    assert lines.line() == "sweep: 8 of 10 points, 60 s, about 60 s left"
    now[0] += 90.0
    lines.report(9, 10)
    assert lines.line() == "sweep: 9 of 10 points, 2.5 min, about 50 s left"


def test_while_nothing_is_done_the_time_left_does_not_grow(monkeypatch):
    """A count that stood still was once told with "about 45 s left", then "about 90 s left"."""
    now = [100.0]
    monkeypatch.setattr(progress_lines, "monotonic", lambda: now[0])
    lines = ProgressLines("run", "steps", shown=False)
    lines.report(0, 1000)
    lines.report(400, 1000)
    now[0] += 30.0
    assert lines.line() == "run: 400 of 1000 steps, 30 s, about 45 s left"
    now[0] += 30.0
    assert lines.line() == "run: still at 400 of 1000 steps, 60 s"
    now[0] += 30.0
    lines.report(600, 1000)
    assert lines.line() == "run: 600 of 1000 steps, 90 s, about 60 s left"


def test_what_is_being_done_is_told_with_its_part_of_the_next_one(monkeypatch):
    """A search for places stood at "0 of 4 steps" while it computed the intact network."""
    now = [100.0]
    monkeypatch.setattr(progress_lines, "monotonic", lambda: now[0])
    lines = ProgressLines("site", "steps", shown=False)
    with counting():
        lines.report(0, 4)
        tell_doing("intact: eigenvalues")
        now[0] += 10.0
        assert lines.line() == "site: 0 of 4 steps (intact: eigenvalues), 10 s"
        tell_doing("intact: eigenvalues", 0.25)
        now[0] += 20.0
        assert lines.line() == "site: 0 of 4 steps (intact: eigenvalues), 30 s, about 7.5 min left"
        now[0] += 10.0
        assert lines.line() == "site: still at 0 of 4 steps (intact: eigenvalues), 40 s"
        tell_doing("intact: buses by mode 1 of 2", 0.5)
        assert lines.line().endswith("(intact: buses by mode 1 of 2), 40 s, about 4.7 min left")
    assert lines.line() == "site: 0 of 4 steps, 40 s"


def test_of_a_situation_the_time_left_is_that_of_its_modes():
    """After 40 s, and 2 of 10 modes in 6 s more, 24 s are left."""
    assert residues.part_of_time(0.0, 40.0, 0, 10, 40.0) == 0.0
    assert residues.part_of_time(0.0, 40.0, 2, 10, 46.0) == pytest.approx(46 / 70)


def test_a_search_for_places_tells_what_it_does_and_never_goes_back(monkeypatch):
    told = []
    monkeypatch.setattr(residues, "tell_doing", lambda text="", part=0.0: told.append((text, part)))
    find_sites(load_case("two_area_rms"), SiteRequest("pod_p", scenario="gfor", confirm=0))
    *parts, last = told
    assert last == ("", 0.0)
    assert [part for _, part in parts] == sorted(part for _, part in parts)
    assert len(parts) >= 4
    assert all(text.startswith("intact: ") and 0 <= part < 1 for text, part in parts)


def test_parts_that_are_told_twice_are_never_all():
    """As where a worker died and its task was computed again."""
    lines = ProgressLines("screen", "items", shown=False)
    with counting():
        lines.report(0, 3)
        for _ in range(7):
            tell_part()
        assert parts_done() == 7
        assert lines.line().startswith("screen: 2 of 3 items")
        lines.report(3, 3)
        assert lines.line().startswith("screen: 3 of 3 items")


def test_parts_are_told_to_nobody_once_nobody_counts():
    with counting():
        file = tally()
    tell_part()
    assert parts_done() == 0
    join(file)  # a worker whose parent is gone
    tell_part()
    assert parts_done() == 0
    join(None)


def test_a_command_without_a_count_says_that_it_is_at_work(capsys, monkeypatch):
    """A check of an FMU said nothing for a minute where its output was a pipe."""

    def say_twice(command):
        waits = iter([False, False, True])
        at_work._say_now_and_then(command, SimpleNamespace(wait=lambda seconds: next(waits)))
        return capsys.readouterr().err

    assert say_twice("modes") == "modes: at work, 0 s\n" * 2
    with at_work.tell_instead("another"):
        assert say_twice("screen") == ""
    started = []

    def thread(**given):
        return SimpleNamespace(start=lambda: started.append(given), join=lambda: None)

    monkeypatch.setattr(at_work, "Thread", thread)
    for command in ("modes", "mcp", None):
        with at_work.saying_that_it_is_at_work(command):
            pass
    assert len(started) == 1
    monkeypatch.setattr(sys, "stderr", None)  # closed: print would say it on standard output
    with at_work.saying_that_it_is_at_work("modes"):
        pass
    assert len(started) == 1
    monkeypatch.undo()
    monkeypatch.setattr(at_work, "Thread", thread)
    monkeypatch.setattr(sys, "stdout", None)
    with at_work.saying_that_it_is_at_work("modes"):
        pass
    assert len(started) == 2


def test_a_check_counts_its_questions(monkeypatch):
    """The count goes to whoever waits: a bar, or a line on standard error."""
    counts = []

    def checked(*given, told, **more):
        told(3, 25)
        raise InputError("enough")

    monkeypatch.setattr(acceptance, "check_fmu", checked)
    monkeypatch.setattr(acceptance, "as_fmu", lambda file: file)
    with pytest.raises(InputError, match="enough"):
        acceptance.check("a.fmu", report=lambda *count: counts.append(count))
    assert counts == [(3, 25)]


def test_stages_that_are_each_too_short_for_a_line_have_one_together(capsys, monkeypatch):
    """Sensitivities of four scenarios said nothing for 60 s: each was over before its first line."""
    now, waits = [100.0], []
    monkeypatch.setattr(at_work, "monotonic", lambda: now[0])

    def said_in(seconds):
        """Lines of a stage that lasts for so long."""
        end = now[0] + seconds

        def wait(step):
            waits.append(step)
            if now[0] + step >= end:
                now[0] = end
                return True
            now[0] += step
            return False

        lines = ProgressLines("sweep", "points", shown=False)
        lines.report(1, 4)
        lines._ended = SimpleNamespace(wait=wait)
        lines._say_now_and_then()
        return len(lines_of(capsys.readouterr().err, "sweep"))

    monkeypatch.setattr(at_work, "Thread", lambda **_: SimpleNamespace(start=int, join=int))
    with at_work.saying_that_it_is_at_work("sweep"):
        assert [said_in(17) for _ in range(4)] == [0, 1, 0, 1]
        assert at_work.silence() == pytest.approx(8.0)
    assert at_work.silence() == 0.0
    assert min(waits) >= at_work.LOOK
    assert [said_in(17) for _ in range(2)] == [0, 0]  # of Python, where no command is under way
