"""Native FMUs whose model is data: each instance has its own, derivatives are exact, and damage is refused."""

import shutil
import struct
import subprocess
import zipfile

import numpy as np
import pytest

from fmus.toolchain import native_fmu
from fmus.toolchain.catalogue import build_model
from fmus.toolchain.exporter import export
from fmus.toolchain.native_fmu import NativeFmu
from orchestrator.core.errors import ComponentError
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from orchestrator.devices.fmi.validation import fmpys_problems
from tests.support.host import OK, Host
from tests.toolchain.test_native_fmi3 import Host3

NETWORKS = ("two_area_grid", "two_area_phasor_grid", "infinite_bus")


def unpacked(folder, name, version="2.0"):
    path = export(NativeFmu(build_model(name), version), folder / "packed" / version, ("linux64",))
    assert fmpys_problems(path) == []
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder / f"{name}{version}")
    return folder / f"{name}{version}"


def stepped(hosts, steps=20):
    rows = {host: [] for host in hosts}
    for k in range(steps):
        for host in hosts:
            assert host.step(k * 1e-4) == OK
            rows[host].append(host.fmu.getReal([host.vr[name] for name in host.reals]))
    return list(rows.values())


def test_networks_take_turns_in_one_process_from_folders_of_any_name(tmp_path):
    folders = [unpacked(tmp_path / "Prüf stand #1 (ä%20b)", name) for name in NETWORKS]
    together = stepped([Host(folder).initialise() for folder in (*folders, folders[0])])
    assert together[0] == together[3]
    assert together[:3] == [stepped([Host(folder).initialise()])[0] for folder in folders]


def without_a_compiler(monkeypatch):
    monkeypatch.setattr(native_fmu, "installed_version", lambda library: "")


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_a_generator_that_is_data_has_the_bits_and_derivatives_of_compiled_code(
    version, tmp_path, monkeypatch
):
    """In both directions, in and after initialisation."""
    model, found = build_model("synchronous_generator_ac4a"), []
    at = model.value_references
    parameters = [
        at[p.name] for p in model.parameters if p.type == "Real" and p.name != "internal_step"
    ]
    inputs, states = ([at[v.name] for v in group] for group in (model.inputs, model.states))
    follows = [*(at[v.name] for v in model.outputs), *(at[f"der({s.name})"] for s in model.states)]
    calculated = [at[c.name] for c in model.calculated]
    rng = np.random.default_rng(1)
    for folder in ("compiled", "data"):
        place = unpacked(tmp_path / folder, model.name, version)
        assert (place / "resources" / "model.bin").exists() == (folder == "data")
        host, rng = (Host if version == "2.0" else Host3)(place), np.random.default_rng(1)
        fmu, get = host.fmu, host.fmu.getReal if version == "2.0" else host.fmu.getFloat64
        if version == "2.0":
            fmu.setupExperiment()
        fmu.enterInitializationMode()
        rows = [get([*calculated, *states, *follows])]

        def derivatives(unknowns, knowns, fmu=fmu, rng=rng):
            forward = fmu.getDirectionalDerivative(
                unknowns, knowns, rng.standard_normal(len(knowns)).tolist()
            )
            seeds = rng.standard_normal(len(unknowns)).tolist()
            return [
                forward,
                *(
                    [fmu.getAdjointDerivative(unknowns, knowns, seeds, len(knowns))]
                    if version == "3.0"
                    else []
                ),
            ]

        rows += derivatives([*calculated, *states, *follows], [*parameters, *inputs])
        fmu.exitInitializationMode()
        for k in range(5):
            fmu.doStep(k * 1e-4, 1e-4)
            rows.append(get([*states, *follows]))
        rows += derivatives(follows, [*states, *inputs])
        found.append([np.array(row) for row in rows])
        without_a_compiler(monkeypatch)
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-13 * np.abs(one).max())
    assert found[0][0].tobytes() == found[1][0].tobytes()


@pytest.mark.parametrize("name", NETWORKS)
def test_derivatives_of_a_network_agree_in_both_directions_and_with_differences(name, tmp_path):
    """Those of a phasor network go through its solution."""
    model = build_model(name)
    at, host = model.value_references, Host3(unpacked(tmp_path, name, "3.0")).initialise()
    known = [at[v.name] for v in (*model.inputs, *model.states)]
    follows = [*(at[v.name] for v in model.outputs), *(at[f"der({s.name})"] for s in model.states)]
    rng, h = np.random.default_rng(2), 1e-5
    start = host.fmu.getFloat64(known) + 0.3 * rng.standard_normal(len(known))

    def at_point(values):
        host.fmu.setFloat64(known, list(values))
        return np.array(host.fmu.getFloat64(follows))

    at_point(start)
    direction, seeds = rng.standard_normal(len(known)), rng.standard_normal(len(follows))
    forward = host.fmu.getDirectionalDerivative(follows, known, direction.tolist())
    back = host.fmu.getAdjointDerivative(follows, known, seeds.tolist(), len(known))
    assert seeds @ forward == pytest.approx(direction @ back, rel=1e-12)
    # nothing is left of them where both are asked for again
    assert host.fmu.getDirectionalDerivative(follows, known, direction.tolist()) == forward
    assert host.fmu.getAdjointDerivative(follows, known, seeds.tolist(), len(known)) == back
    difference = (at_point(start + h * direction) - at_point(start - h * direction)) / (2 * h)
    np.testing.assert_allclose(forward, difference, rtol=0, atol=1e-8 * np.abs(difference).max())
    assert np.count_nonzero(forward) > len(follows) / 2


@pytest.mark.parametrize("seed", range(2))
def test_voltages_that_are_read_alone_are_those_among_all_outputs(seed, tmp_path):
    """A network's other outputs need not be computed for them; nothing that is read later is older for it."""
    model, rng = build_model("two_area_phasor_grid"), np.random.default_rng(seed)
    at, folder = model.value_references, unpacked(tmp_path, "two_area_phasor_grid")
    every = [at[v.name] for v in (*model.outputs, *model.states)]
    rates = [at[f"der({s.name})"] for s in model.states]
    voltages = [at[v.name] for v in model.outputs if ".v_" in v.name]
    inputs = [at[v.name] for v in model.inputs]
    tunable = [at[p.name] for p in model.parameters if p.tunable and p.type == "Real"]
    by_parts, at_once = (Host(folder).initialise() for _ in range(2))
    assert voltages
    seen = set()
    for k in range(60):
        place = rng.choice([*inputs, *rng.choice(tunable, 2)])
        by_parts_had = by_parts.fmu.getReal([place])[0]
        for host in (by_parts, at_once):
            host.fmu.setReal([place], [by_parts_had * 1.01 + 1e-3 * (place in inputs)])
        asked = [voltages, voltages[:1], [*voltages, *inputs], [*rates, *voltages]][k % 4]
        answers = [by_parts.fmu.getReal(asked)]
        whole = dict(
            zip(
                [*every, *rates, *inputs],
                at_once.fmu.getReal([*every, *rates, *inputs]),
                strict=True,
            )
        )
        answers.append([whole[reference] for reference in asked])
        assert answers[0] == answers[1]
        if k % 3 == 0:
            assert by_parts.fmu.getReal(every) == [whole[reference] for reference in every]
        if k % 5 == 0:
            assert by_parts.step(k * 1e-3) == at_once.step(k * 1e-3) == OK
        seen.add(tuple(answers[0]))
    assert len(seen) > 40


DAMAGED = {
    "there is no file model.bin": lambda data, other: None,
    "is no model": lambda data, other: data[:40],
    "is not whole": lambda data, other: data[:-8],
    "the checksum of model.bin differs": lambda data, other: (
        data[:-9] + bytes([data[-9] ^ 1]) + data[-8:]
    ),
    "is of another version": lambda data, other: data[:8] + struct.pack("<I", 7) + data[12:],
    "the guid .* is not this FMU's": lambda data, other: other,
}


def test_a_model_that_is_damaged_or_anothers_gives_no_instance_and_says_why(tmp_path):
    folder, other = (unpacked(tmp_path, name) for name in NETWORKS[:2])
    file, foreign = (
        folder / "resources" / "model.bin",
        (other / "resources" / "model.bin").read_bytes(),
    )
    whole, described = (
        file.read_bytes(),
        read_description(tmp_path / "packed" / "2.0" / f"{NETWORKS[0]}.fmu"),
    )
    for why, damage in DAMAGED.items():
        file.unlink(missing_ok=True)
        if (content := damage(whole, foreign)) is not None:
            file.write_bytes(content)
        with (
            pytest.raises(ComponentError, match=f"(?s){why}"),
            LoadedComponent("one", described, folder),
        ):
            pass
    file.write_bytes(whole)
    assert Host(folder).initialise().step() == OK


def test_a_source_has_its_model_within(tmp_path):
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    plain = unpacked(tmp_path, "infinite_bus")
    members = NativeFmu(build_model("infinite_bus"), sources=True).contents(())
    assert not [name for name in members if name.startswith("resources")]
    alone = tmp_path / "sources"
    for name in ("modelDescription.xml", "sources/infinite_bus.c"):
        (alone / name).parent.mkdir(parents=True, exist_ok=True)
        (alone / name).write_bytes(members[name])
    library = alone / "binaries" / "linux64" / "infinite_bus.so"
    library.parent.mkdir(parents=True)
    command = [
        "gcc",
        "-O1",
        "-std=c11",
        "-ffp-contract=off",
        "-shared",
        "-fPIC",
        "infinite_bus.c",
        "-lm",
        "-o",
    ]
    done = subprocess.run(
        [*command, str(library)], cwd=alone / "sources", capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    ours, theirs = stepped([Host(folder).initialise() for folder in (plain, alone)])
    np.testing.assert_allclose(theirs, ours, rtol=1e-12, atol=1e-12)


def test_networks_are_not_compiled(monkeypatch):
    """Nor written as C, and their solution is not written out."""
    monkeypatch.setattr(
        native_fmu, "c_source", lambda *given: pytest.fail("a network was written as C")
    )
    for name in NETWORKS:
        assert NativeFmu(build_model(name)).digest
