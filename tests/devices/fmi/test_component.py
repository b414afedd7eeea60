"""One running FMU: values by name and in batches, errors in the FMU's own words, nothing left behind."""

import math
import sys
import tempfile
import zipfile
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest

from orchestrator.core.errors import ComponentError, InputError
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent

H = 1e-4


@pytest.fixture
def description(fmu_path):
    return read_description(fmu_path("gfor"))


@pytest.fixture
def component(description):
    with LoadedComponent("converter", description) as created:
        yield created


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """An empty folder where temporary folders are made."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def initialise(component, **parameters):
    component.setup(0.0, None)
    component.enter_initialization_mode()
    component.set({name.replace("__", "."): value for name, value in parameters.items()})
    component.exit_initialization_mode()
    return component


def reference(component, name):
    return component.description.variables[name].reference


# -- values ------------------------------------------------------------------------------------


def test_a_batch_reads_and_writes_in_the_order_of_its_names(component):
    initialise(component)
    batch = RealBatch(component, ("v_im", "v_re"))
    assert batch.read().tolist() == [0.0, 1.0]
    batch.values[:] = [0.25, 0.75]
    batch.write()
    assert component.get(["v_re", "v_im"]) == {"v_re": 0.75, "v_im": 0.25}
    assert RealBatch(component, ("v_re",)).read().tolist() == [0.75]


def test_one_value_of_a_batch_is_written_alone(component):
    initialise(component)
    batch = RealBatch(component, ("v_im", "v_re"))
    batch.values[:] = [np.nan, 0.75]
    batch.write_one(1)
    assert component.get(["v_im", "v_re"]) == {"v_im": 0.0, "v_re": 0.75}


def test_a_batch_works_on_the_callers_own_array(component):
    initialise(component)
    shared = np.full(6, 9.0)
    RealBatch(component, ("v_re", "v_im"), shared[2:4]).read()
    assert shared.tolist() == [9.0, 9.0, 1.0, 0.0, 9.0, 9.0]
    shared[2] = 0.5
    RealBatch(component, ("v_re", "v_im"), shared[2:4]).write()
    assert component.get(["v_re"]) == {"v_re": 0.5}


def test_an_empty_batch_is_allowed(component):
    initialise(component)
    batch = RealBatch(component, ())
    batch.write()
    assert batch.read().shape == (0,)
    assert component.get([]) == {}


def test_parameters_of_every_type_are_set_by_name(component):
    initialise(component, P_0=0.4, pod_p__N_S=3, pod_p__enabled=True)
    fmu = component._fmu
    assert component.get(["P_0"]) == {"P_0": 0.4}
    assert fmu.getInteger([reference(component, "pod_p.N_S")]) == [3]
    assert fmu.getBoolean([reference(component, "pod_p.enabled")]) == [True]
    component.set({"pod_p.enabled": False, "v_re": 1})  # a whole number for a Real
    assert fmu.getBoolean([reference(component, "pod_p.enabled")]) == [False]
    assert component.get(["p"])["p"] == pytest.approx(0.4, abs=1e-12)


def test_an_unknown_name_is_an_input_error_with_a_remedy(component):
    with pytest.raises(
        InputError,
        match=r"component 'converter' has no variable 'pod\.K'; `gfor fmu info` lists them",
    ):
        component.set({"pod.K": 1.0})


@pytest.mark.parametrize(
    "read", [lambda c: c.get(["pod.K"]), lambda c: RealBatch(c, ["v_re", "pod.K"])]
)
def test_reading_an_unknown_name_is_an_input_error(read, component):
    with pytest.raises(InputError, match=r"'converter' has no variable 'pod\.K'"):
        read(component)


def test_strings_cannot_be_set(description, component):
    text = replace(description.variables["P_0"], type="String")
    component.description = replace(description, variables={**description.variables, "P_0": text})
    with pytest.raises(InputError, match="'P_0' is of type String, which cannot be set here"):
        component.set({"P_0": 1.0})


def test_a_fraction_is_no_integer(component):
    with pytest.raises(InputError, match=r"pod_p\.N_S.*2\.7"):
        component.set({"pod_p.N_S": 2.7})


def test_stepping_moves_the_outputs(component):
    initialise(component)
    before = component.get(["i_re", "omega"])
    component.set({"v_re": 0.9})
    for k in range(20):
        component.step(k * H, H)
    after = component.get(["i_re", "omega"])
    assert all(abs(after[name] - before[name]) > 1e-5 for name in before)


# -- errors ------------------------------------------------------------------------------------


def test_a_refused_parameter_is_reported_in_the_fmus_words(component):
    with pytest.raises(ComponentError) as caught:
        component.set({"pod_p.K": -3.0})
    error = caught.value
    assert (error.component, error.call) == ("converter", "setting pod_p.K = -3.0")
    assert "parameter pod_p.K = -3; it must be at least 0" in error.log
    assert error.log in str(error)


def test_a_refused_initialisation_is_reported_in_the_fmus_words(component):
    with pytest.raises(
        ComponentError, match=r"fmi2ExitInitializationMode .*lower P_0 or raise S_n"
    ):
        initialise(component, P_0=2.0)


def test_a_refused_step_carries_status_time_and_cause(component):
    initialise(component)
    batch = RealBatch(component, ("v_re",))
    batch.values[:] = math.nan
    batch.write()
    with pytest.raises(ComponentError) as caught:
        component.step(0.5, H)
    error = caught.value
    assert (error.call, error.status, error.time) == ("fmi2DoStep", "fmi2Error", 0.5)
    assert "input v_re is not a finite number" in error.log
    assert "at t = 0.5 s" in str(error)


def test_components_do_not_share_their_messages(description):
    with LoadedComponent("good", description) as good, LoadedComponent("bad", description) as bad:
        initialise(good)
        with pytest.raises(ComponentError, match=r"component 'bad'.*pod_p.K = -1"):
            bad.set({"pod_p.K": -1.0})
        good.set({"pod_p.K": 1.0})  # would raise if it saw an error in its log
        with pytest.raises(ComponentError) as caught:
            good.step(0.0, -1.0)
        assert "pod_p.K" not in caught.value.log


def test_a_wrong_binary_name_is_a_component_error(description, temporary):
    with pytest.raises(
        ComponentError, match=r"component 'converter': fmi2Instantiate .*nothing.so"
    ):
        LoadedComponent("converter", replace(description, model_identifier="nothing"))
    assert list(temporary.iterdir()) == []


def test_a_wrong_guid_is_a_component_error(description):
    with pytest.raises(ComponentError, match=r"fmi2Instantiate.*guid"):
        LoadedComponent(
            "converter", replace(description, guid="{00000000-0000-0000-0000-000000000000}")
        ).close()


def test_a_slave_that_cannot_start_is_reported_with_its_reason(fmu_path, tmp_path, temporary):
    path = tmp_path / "broken.fmu"
    with zipfile.ZipFile(fmu_path("gfor")) as good, zipfile.ZipFile(path, "w") as bad:
        for name in good.namelist():
            if name != "resources/model.json":
                bad.writestr(name, good.read(name))
    with pytest.raises(
        ComponentError,
        match=r"(?s)fmi2Instantiate returned no instance: .*No such file or directory",
    ):
        LoadedComponent("converter", read_description(path))
    assert list(temporary.iterdir()) == []


# -- nothing is left behind --------------------------------------------------------------------


def test_the_extracted_folder_is_removed_on_leaving(description, temporary):
    with LoadedComponent("converter", description) as component:
        initialise(component)
        assert len(list(temporary.iterdir())) == 1
    assert list(temporary.iterdir()) == []


def test_a_python_backed_fmu_leaves_the_search_path_as_it_was(description, tmp_path):
    """Its host adds the FMU's folder for each instance: a thousand of them made a variable too long for Linux."""
    before = list(sys.path)
    with LoadedComponent("a", description), LoadedComponent("b", description):
        assert sys.path == before
    folder = fmpy.extract(str(description.path), unzipdir=str(tmp_path / "shared"))
    with LoadedComponent("c", description, Path(folder)) as outer:
        LoadedComponent("d", description, Path(folder)).close()
        outer.values(["p"])
    assert sys.path == before


def test_the_extracted_folder_is_removed_after_a_failure(description, temporary):
    with pytest.raises(ComponentError), LoadedComponent("converter", description) as component:
        initialise(component, P_0=2.0)
    assert list(temporary.iterdir()) == []


def test_closing_twice_is_harmless(description, temporary):
    component = initialise(LoadedComponent("converter", description))
    component.close()
    component.close()
    assert list(temporary.iterdir()) == []


def test_a_given_folder_is_used_and_kept(description, tmp_path, temporary):
    folder = Path(fmpy.extract(str(description.path), str(tmp_path / "extracted")))
    with (
        LoadedComponent("one", description, folder) as one,
        LoadedComponent("two", description, folder) as two,
    ):
        initialise(one, P_0=0.3)
        initialise(two, P_0=0.6)
        assert one.get(["p"])["p"] == pytest.approx(0.3, abs=1e-12)
        assert two.get(["p"])["p"] == pytest.approx(0.6, abs=1e-12)
    assert (folder / "modelDescription.xml").exists()
    assert list(temporary.iterdir()) == []


# -- state -------------------------------------------------------------------------------------


def test_a_saved_state_brings_back_values_and_parameters(component):
    initialise(component)
    names = [n for n, v in component.description.variables.items() if v.type == "Real"]
    state = component.save_state()
    before = component.get(names)
    component.set({"droop.R_f": 0.01, "v_re": 0.9})
    component.step(0.0, H)
    assert component.get(names) != before
    component.restore_state(state)
    assert component.get(names) == before
    component.free_state(state)


def test_a_state_can_be_restored_after_a_failed_step(component):
    initialise(component)
    state = component.save_state()
    batch = RealBatch(component, ("v_re",))
    batch.values[:] = math.nan
    batch.write()
    with pytest.raises(ComponentError):
        component.step(0.0, H)
    component.restore_state(state)
    component.step(0.0, H)
