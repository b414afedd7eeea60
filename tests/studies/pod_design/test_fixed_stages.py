"""A vendor's POD with a fixed number of stages: no variable says how many, and a design finds them out.

The device is our converter whose description calls the variables N_S by other names; what a design of the same
converter by its own names finds is the measure."""

import zipfile

import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import AnalysisError, InputError
from orchestrator.devices.fmi import instance
from orchestrator.studies.coordinated_design.one_point import design_controller
from orchestrator.studies.modes.modes import compute_modes
from orchestrator.studies.pod_design import stages
from orchestrator.studies.pod_design.closed_loop import PodSetting
from orchestrator.studies.pod_design.design import DesignRequest
from orchestrator.studies.pod_design.lead_lag import NO_COMPENSATION
from orchestrator.studies.pod_design.stages import count_stages, neutral_time
from orchestrator.studies.pod_design.target import find_target

RENAMED = {"pod_p.N_S": "stages", "pod_q.N_S": "stages_q"}


@pytest.fixture(scope="module")
def vendor(tmp_path_factory):
    """Write the two-area system with the device: variables' new names, and values of its parameters.

    It runs in this process, as our own do: questions to another one would take most of a design's time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(instance, "is_ours", lambda path: True)
        yield writing(tmp_path_factory.mktemp("vendor"))


def writing(folder):
    ours = load_case("two_area")
    fmu = ours.prepare(["gfor"])[0].system.components["gfor"].description.path

    def write(name="case", names=RENAMED, values=""):
        with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(folder / f"{name}.fmu", "w") as new:
            for entry in old.infolist():
                content = old.read(entry)
                if entry.filename == "modelDescription.xml":
                    text = content.decode()
                    for k, own in enumerate(names):
                        assert f'name="{own}"' in text
                        text = text.replace(f'name="{own}"', f'name="<{k}>"')
                    for k, given in enumerate(names.values()):
                        text = text.replace(f'name="<{k}>"', f'name="{given}"')
                    content = text.encode()
                new.writestr(entry, content)
        text = ours.path.read_text().replace(
            '[components.gfor]\nmodel = "gfor"', f'[components.gfor]\nfmu = "{name}.fmu"'
        )
        text = text.replace("P_0 = 0.9, v_0 = 1.0 }", f"P_0 = 0.9, v_0 = 1.0{values} }}", 1)
        path = folder / f"{name}.toml"
        path.write_text(text)
        return load_case(path)

    return write


def target(case, controller="pod_p", **asked):
    given = {"scenario": "gfor", "pattern": None, "stages": None, "overrides": {}, "parameters": ()}
    return find_target(case, controller, **given | asked)


@pytest.mark.parametrize("number", [1, 2, 3])
def test_the_stages_are_counted(vendor, number):
    case = vendor(f"of_{number}", values=f", stages = {number}")
    (prepared,) = case.prepare(["gfor"])
    assert "pod_p.N_S" not in prepared.system.components["gfor"].description.variables
    assert count_stages(prepared, "gfor", "pod_p") == number
    found = target(case)
    assert (found.stages, found.components) == (number, ("gfor",))
    assert found.neutral == pytest.approx(neutral_time(prepared.system.components["gfor"], "pod_p"))


def test_another_number_is_refused(vendor):
    with pytest.raises(InputError, match=r"--stages 3: gfor has 2 stages in pod_p, a fixed number"):
        target(vendor(), stages=3)
    assert target(vendor(), stages=2).stages == 2


def test_what_is_no_lead_lag_of_equal_stages_is_refused(vendor, monkeypatch):
    """A device that takes T_S1 for the lag and T_S2 for the lead."""
    turned = RENAMED | {"pod_p.T_S1": "pod_p.T_S2", "pod_p.T_S2": "pod_p.T_S1"}
    with pytest.raises(AnalysisError, match="which no number of equal stages"):
        target(vendor("turned", turned))
    monkeypatch.setattr(stages, "_WHOLE", 10.0)
    assert target(vendor("turned", turned)).stages == 0


def test_a_design_is_that_of_the_same_converter(vendor):
    request = DesignRequest("pod_p", "gfor", margins=False)
    ours, theirs = (design_controller(case, request) for case in (load_case("two_area"), vendor()))
    assert theirs.met
    assert theirs.result.target.stages == ours.result.target.stages == 2
    found, expected = theirs.parameters, ours.parameters
    assert set(expected) - set(found) == {"gfor.pod_p.N_S"}
    for name in found:
        assert found[name] == pytest.approx(expected[name], rel=0.01), name
    assert theirs.result.achieved == pytest.approx(ours.result.achieved, rel=0.01)
    # the file's values are taken where they are typed
    (prepared,) = vendor().prepare(["gfor"], found)
    assert prepared.system.components["gfor"].number("pod_p.K") == found["gfor.pod_p.K"]


def test_stages_that_do_nothing_have_equal_time_constants():
    """0 s would be a division by zero in a device whose stages cannot be taken out."""
    off = PodSetting(0.0, NO_COMPENSATION)
    assert off.tuned(0.1) == {"K": 0.0, "T_S1": 0.1, "T_S2": 0.1}
    assert off.tuned(None) == {"K": 0.0, "T_S1": 0.0, "T_S2": 0.0}
    assert "gfor.pod_p.N_S" not in off.parameters(["gfor"], "pod_p", 2, 0.1)


def test_a_pod_that_lacks_a_variable_is_told_with_what_it_lacks(vendor):
    hidden = RENAMED | {"pod_p.K": "gain"}
    case = vendor("hidden", hidden)
    with pytest.raises(InputError, match=r"gfor has pod_p.enabled, and lacks pod_p.K: name them"):
        target(case, scenario=None)
    assert target(case, "pod_q", scenario=None, stages=None).scenario == "gfor"


# a device that has a gain and a lead/lag of its own, which nobody can set
GAIN_ALONE = RENAMED | {"pod_p.T_S1": "lead", "pod_p.T_S2": "lag"}


@pytest.fixture(scope="module")
def by_gain(vendor):
    """The design of its gain; its two stages are those of the paper, 0.20 s and 0.37 s."""
    case = vendor("gain_alone", GAIN_ALONE, values=", lead = 0.20, lag = 0.37")
    return design_controller(case, DesignRequest("pod_p", "gfor", margins=False, damping=0.2))


def test_where_the_lead_lag_cannot_be_set_the_gain_alone_is_designed(by_gain):
    """The closed loop is that of our converter with the same lead/lag and the gain that was found."""
    assert by_gain.met
    assert set(by_gain.parameters) == {"gfor.pod_p.enabled", "gfor.pod_p.K"}
    gain = by_gain.parameters["gfor.pod_p.K"]
    own = {"enabled": True, "K": gain, "N_S": 2, "T_S1": 0.20, "T_S2": 0.37}
    values = {f"gfor.pod_p.{name}": value for name, value in own.items()}
    (prepared,) = load_case("two_area").prepare(["gfor"], values)
    modes = compute_modes(prepared).modes
    swing = min(abs(mode.eigenvalue - by_gain.result.achieved) for mode in modes)
    assert swing < 1e-3 * abs(by_gain.result.achieved)


@pytest.mark.slow
def test_that_it_is_the_gain_alone_is_told(by_gain, tmp_path):
    (said,) = [text for text in by_gain.warnings if text.startswith("only the gain is designed")]
    assert "gfor.pod_p.T_S1; gfor.pod_p.T_S2" in said or "gfor.pod_p.T_S1, gfor.pod_p.T_S2" in said
    assert '[signals."pod_p.T_S1"]' in said
    assert [by_gain.as_json()[name] for name in ("T_S1", "T_S2", "N_S")] == [None, None, None]
    written = by_gain.save(tmp_path / "gain.toml").read_text("utf-8")
    assert "gfor.pod_p.K" in written
    assert "only the gain is designed" in written


def test_stages_cannot_be_asked_for_where_the_lead_lag_cannot_be_set(vendor):
    case = vendor("gain_alone", GAIN_ALONE, values=", lead = 0.20, lag = 0.37")
    with pytest.raises(InputError, match=r"--stages 2: the lead/lag of gfor.pod_p cannot be set"):
        target(case, stages=2)
