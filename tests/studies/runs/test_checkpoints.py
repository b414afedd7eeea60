"""A run that was interrupted and resumed gives what an undisturbed one gives, to the last bit."""

import warnings
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cases.case import BUILT_IN
from orchestrator.core.errors import InputError
from orchestrator.face.api.case import load
from orchestrator.face.api.scenario import CheckpointWarning
from orchestrator.output.results.checkpoint_file import previous, read_checkpoint, write_checkpoint
from orchestrator.studies.runs import checkpoint_mark
from orchestrator.studies.runs.checkpoints import Checkpoints
from orchestrator.studies.runs.files import summary_of
from orchestrator.studies.runs.run import run_scenario
from orchestrator.systems.coupling import run as coupled_run
from orchestrator.systems.coupling.run import Run
from tests.support.scenarios import prepare_one

STOP = 1.3
"""After both events of the scenario [s]."""

KINDS = {"python-backed": {}, "native": {"gfor.native": True}, "isolated": {"isolated": True}}


class KeptOnce(Checkpoints):
    """Keeps the run at the first chance from a time on, and is interrupted there."""

    def __init__(self, *arguments, at, times=1, **options):
        super().__init__(*arguments, 1e9, **options)
        self._at, self._left = at, times

    def is_due(self):
        return self._left > 0

    def keep(self, state):
        if state().index * self._step_size < self._at:
            return
        super().keep(state)
        self._left -= 1
        if not self._left:
            raise KeyboardInterrupt


def prepared_scenario(kind="python-backed", stop=STOP, values=None):
    options = dict(KINDS[kind])
    isolated = options.pop("isolated", None)
    prepared = prepare_one("infinite_bus", "dip", options | (values or {}), None, stop)
    prepared.system.components["gfor"].isolated = isolated
    return prepared


def told(result):
    """All of a run but the figures of its speed."""
    summary = summary_of(result)
    for speed in ("steps_per_second", "share_in_fmus", "real_time_factor", "threads"):
        del summary[speed]
    values = {str(name): result.dataset[name].values.tobytes() for name in result.dataset.variables}
    return summary, values, result.findings


@cache
def undisturbed(kind="python-backed"):
    """All of a run that nobody interrupts."""
    return told(run_scenario(prepared_scenario(kind)))


@pytest.fixture
def said():
    return []


def interrupted(prepared, folder, said, at, times=1):
    """A run to there, without modes, which have no part in what is kept."""
    kept = KeptOnce(prepared, folder, at=at, times=times, resume=False, say=said.append)
    result = run_scenario(prepared, checkpoints=kept, linear=False)
    assert "interrupted at t = " in str(result.failure)
    return result


def resumed(prepared, folder, said):
    return run_scenario(
        prepared, checkpoints=Checkpoints(prepared, folder, 1e9, resume=True, say=said.append)
    )


@pytest.mark.parametrize(
    ("at", "kind"),
    [
        *((at, "python-backed") for at in (0.4, 1.0, 1.15)),
        (1.15, "native"),
        (1.0, "isolated"),
    ],
)
def test_an_interrupted_run_goes_on_to_the_last_bit(tmp_path, said, kind, at):
    """Before, at and behind an event; and each kind of component, whose state is kept alike at any time."""
    prepared = prepared_scenario(kind)
    part = interrupted(prepared, tmp_path, said, at)
    assert part.dataset["time"].values[-1] < STOP - 0.1
    whole = resumed(prepared_scenario(kind), tmp_path, said)
    assert told(whole) == undisturbed(kind)
    assert said == []


DISTURBED = """
[imperfections.late]
type = "delay"
connection = "gfor.omega -> gfor.omega_pod"
delay = "20 ms"

[[scenarios.dip.events]]
type = "noise"
time = "1.05 s"
end = "1.25 s"
connection = "grid.v_re -> gfor.v_re"
deviation = "0.001 pu"
seed = 7
bandwidth = "100 Hz"

[scenarios.load_step]"""


def disturbed(folder, values=None):
    """A late POD, and a noisy measurement for a while."""
    text = (BUILT_IN / "infinite_bus" / "case.toml").read_text(encoding="utf-8")
    text = text.replace('model = "gfor"', 'model = "gfor_pod_input"')
    text = text.replace(
        "[[connections]]",
        '[[connections]]\nfrom = "gfor.omega"\nto = "gfor.omega_pod"\n[[connections]]',
        1,
    )
    (folder / "case.toml").write_text(
        text.replace("[scenarios.load_step]", DISTURBED, 1), encoding="utf-8"
    )
    values = {"gfor.pod_q.enabled": True} | (values or {})
    return prepare_one(folder / "case.toml", "dip", values, None, STOP)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """What a run with delay lines and noise tells that nothing interrupts."""
    return told(run_scenario(disturbed(tmp_path_factory.mktemp("whole"))))


@pytest.mark.parametrize("at", [0.5, 1.1, 1.26])
def test_delay_lines_and_noise_go_on_to_the_last_bit(tmp_path, said, whole, at):
    prepared = disturbed(tmp_path)
    assert len(prepared.system.wires) == 2
    interrupted(prepared, tmp_path / "kept", said, at)
    assert told(resumed(prepared, tmp_path / "kept", said)) == whole


def test_another_delay_is_named(tmp_path, said):
    one, other = disturbed(tmp_path), disturbed(tmp_path, {"imperfections.late.delay": "30 ms"})
    interrupted(one, tmp_path / "kept", said, 0.5)
    with pytest.raises(InputError, match=r"the connection into gfor\.omega_pod.* has changed"):
        resumed(other, tmp_path / "kept", said)


def test_it_goes_on_from_the_event_and_has_it_once(tmp_path, said):
    """The checkpoint at an event's time holds whether the event has happened."""
    prepared = prepared_scenario()
    interrupted(prepared, tmp_path, said, 1.0)
    kept = Checkpoints(prepared, tmp_path, 1e9, resume=True, say=said.append)
    assert kept.time == 1.0
    assert not kept.latest().applied


def test_a_finished_run_is_not_run_again(tmp_path, said, monkeypatch):
    prepared = prepared_scenario(stop=0.3)
    first = run_scenario(
        prepared, checkpoints=Checkpoints(prepared, tmp_path, 1e-3, resume=False, say=said.append)
    )
    monkeypatch.setattr(Run, "_run_to", lambda *_: iter(()))
    assert told(resumed(prepared_scenario(stop=0.3), tmp_path, said)) == told(first)


# -- what is damaged -----------------------------------------------------------------------------------


def spoil(path, place=0.5):
    content = bytearray(path.read_bytes())
    content[int(place * len(content))] ^= 1
    path.write_bytes(content)


@pytest.mark.parametrize("damage", ["a bit", "a cut", "nothing in it"])
def test_a_damaged_checkpoint_gives_way_to_the_one_before(tmp_path, said, damage):
    prepared = prepared_scenario()
    interrupted(prepared, tmp_path, said, 0.4, times=2)
    newest = tmp_path / "dip.checkpoint"
    if damage == "a bit":
        spoil(newest)
    else:
        newest.write_bytes(newest.read_bytes()[: 1000 if damage == "a cut" else 0])
    result = resumed(prepared_scenario(), tmp_path, said)
    assert len(said) == 1
    assert "the one before it is taken, of t = 0.40" in said[0]
    assert told(result) == undisturbed()


def test_two_damaged_checkpoints_are_refused(tmp_path, said):
    prepared = prepared_scenario()
    interrupted(prepared, tmp_path, said, 0.4, times=2)
    for path in (tmp_path / "dip.checkpoint", previous(tmp_path / "dip.checkpoint")):
        spoil(path)
    with pytest.raises(
        InputError, match=r"'dip' cannot be resumed: .*checksum.*checksum.*start it anew, without"
    ):
        Checkpoints(prepared, tmp_path, 1e9, resume=True, say=said.append)


def forged(folder, change):
    """The checkpoint with some of its arrays changed, behind a checksum that fits."""
    path = folder / "dip.checkpoint"
    header, arrays = read_checkpoint(path)
    write_checkpoint(path, header, arrays | change(arrays))
    previous(path).unlink()


FORGERIES = {
    "y of another length": lambda a: {"y": a["y"][:-1]},
    "y no number": lambda a: {"y": np.full_like(a["y"], np.nan)},
    "y a text": lambda a: {"y": np.array(["x"] * len(a["y"]))},
    "tracks of another shape": lambda a: {"tracks": a["tracks"].ravel()},
    "tracks infinite": lambda a: {"tracks": np.full_like(a["tracks"], np.inf)},
    "other times spent": lambda a: {"seconds": a["seconds"][:-1]},
    "a place before the start": lambda a: {"place": np.array([-5, 0, 0])},
    "a place after the end": lambda a: {"place": np.array([10**12, 0, 0])},
}


@pytest.mark.parametrize("change", FORGERIES.values(), ids=FORGERIES)
def test_arrays_of_another_form_are_not_gone_on_from(tmp_path, said, change):
    """A place far behind the end gave a finished run at once, and a shape a traceback."""
    stop = 0.1
    prepared = prepared_scenario(stop=stop)
    interrupted(prepared, tmp_path, said, 0.05)
    forged(tmp_path, change)
    result = resumed(prepared_scenario(stop=stop), tmp_path, said)
    assert len(said) == 1
    assert "'dip' is computed from its start again: " in said[0]
    assert result.failure is None
    assert result.dataset.time.values[-1] == pytest.approx(stop)


@pytest.mark.parametrize("header", [[], {"mark": []}])
def test_a_header_of_another_form_is_a_damaged_checkpoint(tmp_path, said, header):
    path = tmp_path / "dip.checkpoint"
    write_checkpoint(path, header, {"y": np.zeros(2)})
    with pytest.raises(InputError, match=r"cannot be resumed: .*its header is no table of names"):
        Checkpoints(prepared_scenario(), tmp_path, 1e9, resume=True, say=said.append)


# -- what has changed ----------------------------------------------------------------------------------


def test_another_value_is_named(tmp_path, said):
    interrupted(prepared_scenario(), tmp_path, said, 0.4)
    with pytest.raises(
        InputError, match=r"'dip' cannot be resumed: gfor.P_0 was 0.6 and is 0.5; bring that back"
    ):
        resumed(prepared_scenario(values={"gfor.P_0": 0.5}), tmp_path, said)


def test_another_kernel_is_another_run(monkeypatch):
    prepared = prepared_scenario()
    before = checkpoint_mark.mark_of(prepared)
    monkeypatch.setenv("GFOR_COSIM_KERNEL", "plain")
    after = checkpoint_mark.mark_of(prepared)
    assert {name for name in before if before[name] != after[name]} == {
        "the environment variable GFOR_COSIM_KERNEL"
    }


@pytest.mark.parametrize("library", ["numpy", "scipy"])
def test_another_version_of_a_library_is_named(tmp_path, said, monkeypatch, library):
    interrupted(prepared_scenario(), tmp_path, said, 0.4)
    versions = checkpoint_mark.library_versions()
    monkeypatch.setattr(checkpoint_mark, "library_versions", lambda: versions | {library: "0.0.1"})
    with pytest.raises(InputError, match=rf"{library} was {versions[library]} and is 0.0.1"):
        resumed(prepared_scenario(), tmp_path, said)


def test_another_fmu_of_the_same_name_is_named(tmp_path, said, monkeypatch):
    interrupted(prepared_scenario(), tmp_path, said, 0.4)
    before = checkpoint_mark.component_content
    monkeypatch.setattr(
        checkpoint_mark, "component_content", lambda fmu: ["0" * 64, before(fmu)[1]]
    )
    with pytest.raises(InputError, match=r"the FMU of 'gfor' \(.*\.fmu\) has changed"):
        resumed(prepared_scenario(), tmp_path, said)


def with_text(prepared, old, new):
    assert old in prepared.case.text
    return replace(prepared, case=replace(prepared.case, text=prepared.case.text.replace(old, new)))


def test_a_comment_in_the_case_changes_nothing(tmp_path, said):
    prepared = prepared_scenario()
    interrupted(prepared, tmp_path, said, 0.4)
    result = resumed(
        with_text(prepared, 'name = "infinite_bus"', 'name   =   "infinite_bus"  # remark'),
        tmp_path,
        said,
    )
    assert result.failure is None
    assert not said


def test_what_has_changed_in_the_case_is_named_with_both_values(tmp_path, said):
    prepared = prepared_scenario()
    interrupted(prepared, tmp_path, said, 0.4)
    other = with_text(prepared, "P_0 = 0.6", "P_0 = 0.7")
    with pytest.raises(InputError) as caught:
        resumed(other, tmp_path, said)
    line = 1 + other.case.text[: other.case.text.index("P_0 = 0.7")].count("\n")
    said_of = f"in the case {other.case.path}, line {line}, components.gfor.parameters.P_0 was 0.6 and is 0.7"
    assert f"'dip' cannot be resumed: {said_of}" in str(caught.value)
    (tmp_path / "case.toml").unlink()
    with pytest.raises(InputError, match="the case has changed; bring that back"):
        resumed(other, tmp_path, said)


def test_events_that_have_changed_are_named_with_their_line():
    now = (
        '[[events]]\ntime = "1 s"\n\n[[events]]\n# a remark\ntime = "2 s"\nscale = 0.99\nnew = 1\n'
    )
    was = now.replace("0.99", "0.98").replace("new", "old")
    marks = [
        {
            "the case": checkpoint_mark._digest(text),
            "the events": f"t = {time} s: grid.load_2.scale = {scale}",
        }
        for text, time, scale in ((was, 2, 0.98), (now, 2, 0.99))
    ]
    text = checkpoint_mark.differences(*marks, (was, now), Path("my.toml"))
    assert text == (
        "in the case my.toml, line 7, events.1.scale was 0.98 and is 0.99; in the case my.toml, events.1.old is gone; "
        "in the case my.toml, line 8, events.1.new is new; "
        "the events were t = 2 s: grid.load_2.scale = 0.98 and are t = 2 s: grid.load_2.scale = 0.99"
    )
    many = [
        {"the events": text * 3}
        for text in ("t = 1 s: grid.load_2.scale = 0.9; ", "t = 1 s: grid.load_2.scale; ")
    ]
    assert checkpoint_mark.differences(*many) == "the events have changed"


# -- FMUs that cannot be kept --------------------------------------------------------------------------


def without_state(prepared):
    for plan in prepared.system.components.values():
        plan.description = replace(plan.description, can_serialize_state=False)
    return prepared


def test_without_serialised_states_it_begins_anew(tmp_path, said):
    prepared = without_state(prepared_scenario(stop=0.3))
    result = run_scenario(
        prepared, checkpoints=KeptOnce(prepared, tmp_path, at=0.1, resume=False, say=said.append)
    )
    assert result.failure is not None
    assert not list(tmp_path.iterdir())
    kept = Checkpoints(prepared, tmp_path, 1e9, resume=True, say=said.append)
    assert kept.time is None


def test_an_fmu_that_does_not_come_back_is_not_believed(tmp_path, said, monkeypatch):
    """Planted: what was serialised is not restored."""
    prepared = prepared_scenario()
    interrupted(prepared, tmp_path, said, 1.15)
    monkeypatch.setattr(coupled_run, "set_state", lambda component, content: None)
    result = resumed(prepared_scenario(), tmp_path, said)
    assert len(said) == 1
    assert (
        "'dip' is computed from its start again: component 'gfor' does not go on from its state"
        in said[0]
    )
    assert told(result) == undisturbed()


def test_a_folder_that_cannot_be_written_is_refused_before_the_run(tmp_path, said):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="checkpoints cannot be kept there"):
        Checkpoints(
            prepared_scenario(), tmp_path / "file" / "x", 60.0, resume=False, say=said.append
        )


def test_a_disk_that_is_full_ends_no_run(tmp_path, said, monkeypatch):
    prepared = prepared_scenario(stop=0.2)
    kept = Checkpoints(prepared, tmp_path / "x", 1e-9, resume=False, say=said.append)
    (tmp_path / "x").rmdir()
    (tmp_path / "x").write_text("")
    assert run_scenario(prepared, checkpoints=kept).failure is None
    assert said[0].startswith("scenario 'dip': no checkpoints are written any more: ")


# -- in Python -----------------------------------------------------------------------------------------


def test_the_same_call_goes_on(tmp_path):
    scenario = load("infinite_bus").scenario("dip")
    prepared = scenario._until(STOP)
    interrupted(prepared, tmp_path, [], 0.4)
    with warnings.catch_warnings():
        warnings.simplefilter("error", CheckpointWarning)
        run = scenario.run(STOP, checkpoints=tmp_path)
    assert not list(tmp_path.iterdir())
    whole = scenario.run(STOP)
    assert all(
        np.array_equal(run.dataset[n].values, whole.dataset[n].values)
        for n in whole.dataset.variables
    )
