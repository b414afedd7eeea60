"""The smoke test inside an FMU (LS-REF): another tool repeats it, and what does not fit it shows."""

import csv
import hashlib
import re
import zipfile

import fmpy
import numpy as np
import pytest
from lxml import etree

from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from orchestrator.face.api.models import build
from orchestrator.systems.ssp.reference_experiment import FOLDER, TOLERANCE, _purpose

LS = "{http://fmi-standard.org/fmi-ls-manifest}"
ROLE = re.compile(
    "(document|requirement|specification|model|parameter|system|testcase|experiment"
    "(/(smoke-test|validation|uncertainty-analysis))?|result|method|rationale|report|request|delivery|configuration|"
    "signature|serialized-state(/.*)?|meta-data|other)"
)
"""What LS-REF's schema allows."""

BUILT = [("infinite_bus", True, "2.0"), ("probe_a", True, "3.0")]
SLOW = [
    pytest.param(row, marks=pytest.mark.slow)
    for row in (("gfor", True, "2.0"), ("gfor", True, "3.0"))
]


@pytest.fixture(scope="module")
def converter(tmp_path_factory):
    """The Python-backed converter."""
    return build("gfor", tmp_path_factory.mktemp("converter"), reference=True)


@pytest.fixture(scope="module", params=[None, *BUILT, *SLOW], ids=str)
def built(request, tmp_path_factory, converter):
    """FMUs of both kinds and versions; the converter first."""
    if request.param is None:
        return converter
    name, native, fmi = request.param
    platforms = ["linux64"] if native else None
    return build(
        name,
        tmp_path_factory.mktemp(name),
        native=native,
        fmi=fmi,
        platforms=platforms,
        reference=True,
    )


def inside(path):
    """The files of LS-REF in an FMU, by name."""
    with zipfile.ZipFile(path) as archive:
        return {
            n.rpartition("/")[2]: archive.read(n)
            for n in archive.namelist()
            if n.startswith(f"{FOLDER}/")
        }


@pytest.fixture(scope="module")
def files(built):
    return inside(built)


def table(content):
    rows = list(csv.reader(content.decode().splitlines()))
    return rows[0], np.array(rows[1:], float)


def repeated(path, files, **other):
    """The experiment as FMPy runs it from the files: its outputs at each step."""
    (experiment,) = etree.fromstring(files["smoke-test.exp"]).findall("Experiment")
    times = {
        key: float(value) for key, value in experiment.find("TransientSimulation").attrib.items()
    }
    sources = {child.tag: child.get("source") for child in experiment if child.get("source")}
    given = etree.fromstring(files[sources["Parameters"]])
    start = {p.get("name"): p[0].get("value") for p in given.iter("{*}Parameter")} | other
    names, stimuli = table(files[sources["Stimuli"]])
    outputs, _ = table(files[sources["References"]])
    signals = np.array([tuple(row) for row in stimuli], [(name, float) for name in names])
    found = fmpy.simulate_fmu(
        str(path),
        start_time=times["startTime"],
        stop_time=times["stopTime"],
        step_size=times["stepSize"],
        output_interval=times["stepSize"],
        start_values=start,
        input=signals if len(names) > 1 else None,
        output=outputs[1:],
    )
    return np.array([list(row) for row in found])


def distance(found, files):
    _, reference = table(files["references.csv"])
    assert found.shape == reference.shape
    size = np.abs(reference[:, 1:]).max(axis=0)
    return (np.abs(found - reference)[:, 1:] / np.where(size > 0, size, 1)).max(initial=0)


def test_another_tool_repeats_it_from_the_files(built, files):
    assert distance(repeated(built, files), files) <= TOLERANCE


def test_a_wrong_parameter_shows(converter):
    files = inside(converter)
    assert distance(repeated(converter, files, **{"droop.R_V": "0.068"}), files) > 1e3 * TOLERANCE


def test_the_manifest_keeps_the_rules_of_its_schema(files):
    root = etree.fromstring(files["fmi-ls-manifest.xml"])
    assert root.tag == "fmiReferences"
    assert root.get(f"{LS}fmi-ls-name") == "org.fmi-standard.fmi-ls-ref"
    text = "Layered Standard providing information on related files included in an FMU."
    assert root.get(f"{LS}fmi-ls-description") == text
    related = {entry.get("source"): entry for entry in root}
    assert set(related) == set(files) - {"fmi-ls-manifest.xml"}
    for source, entry in related.items():
        assert set(entry.keys()) <= {
            "type",
            "source",
            "role",
            "description",
            "checksum",
            "checksumType",
        }
        assert ROLE.fullmatch(entry.get("role"))
        assert entry.get("checksum") == hashlib.sha3_256(files[source]).hexdigest()


def test_the_state_leads_back_to_the_start(built, files):
    """Restored after the run it gives the first row of the references again."""
    description = read_description(built)
    names, reference = table(files["references.csv"])
    (state,) = (content for name, content in files.items() if name.startswith("steady-state."))
    with LoadedComponent("again", description) as component:
        component.setup(0.0, None)
        component.enter_initialization_mode()
        component.exit_initialization_mode()
        for k in range(50):
            component.step(k * 1e-4, 1e-4)
        restored = component.deserialize_state(state)
        component.restore_state(restored)
        component.free_state(restored)
        values = component.values(names[1:])
    assert [values[name] for name in names[1:]] == list(reference[0, 1:])


def test_the_fmu_is_the_same_but_for_these_files(converter, tmp_path):
    members = []
    for path in (build("gfor", tmp_path), converter):
        with zipfile.ZipFile(path) as archive:
            members.append(
                {n: archive.read(n) for n in archive.namelist() if not n.startswith(FOLDER)}
            )
    assert members[0] == members[1]


def test_a_saved_state_names_its_platform():
    assert _purpose("state.win64.bin")[1] == "serialized-state/win64"
