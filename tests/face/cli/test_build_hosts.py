"""``gfor build --for``: the FMU that suits a host."""

import re
import zipfile
from pathlib import Path

import pytest

from fmus.toolchain.catalogue import model_names
from fmus.toolchain.compiler import TARGETS
from orchestrator.devices.fmi.description import read_description
from orchestrator.face.cli import build as command
from orchestrator.face.cli.build import ENDINGS, HOSTS, with_port

PAGE = Path(__file__).parents[3] / ".docs" / "how-to" / "use-in-another-tool.md"


@pytest.fixture
def built(gfor, monkeypatch, tmp_path):
    """What a command would have built, without compiling."""

    def tried(*words):
        made = []
        monkeypatch.setattr(
            command, "build", lambda model, *_, **how: made.append((model.name, how)) or "built"
        )
        code, _, error = gfor("fmu", "build", *words, "--dest", tmp_path)
        return code, made, " ".join(error.split())

    return tried


@pytest.mark.parametrize("name", HOSTS)
def test_a_host_gets_what_its_row_says(name, built):
    host = HOSTS[name]
    code, ((model, how),), error = built("gfor", "--for", name)
    assert code == 0
    assert model == "gfor" + ENDINGS[host.port]
    assert (how["native"], how["fmi"], how["platforms"]) == (
        host.native,
        host.fmi,
        list(host.platforms),
    )
    assert f"for {name}: {host.kind}, FMI {host.fmi}, " in error
    assert host.source in error
    assert "--native" not in error


def test_a_model_without_the_port_and_one_that_names_its_own_stay(built):
    assert with_port("external_grid", "abc", model_names()) == "external_grid"
    assert with_port("gfor_phasor", "abc", model_names()) == "gfor_phasor"
    _, made, error = built("gfor", "static_generation", "gfor_abc", "--for", "powerfactory")
    assert [model for model, _ in made] == ["gfor_phasor", "static_generation_phasor", "gfor_abc"]
    assert "port: phasor" in error


def test_all_models_are_built_where_all_are_asked_for(built):
    code, made, _ = built("--all", "--for", "fmpy")
    assert code == 0
    assert len(made) > 20
    assert len({model for model, _ in made}) == len(made)
    assert built()[:2] == (2, [])


@pytest.mark.parametrize("words", [("--native",), ("--fmi", "2.0"), ("--platform", "win64")])
def test_what_the_table_chooses_cannot_be_given_too(words, built):
    code, made, error = built("gfor", "--for", "plecs", *words)
    assert (code, made) == (2, [])
    assert f"--for plecs chooses that by itself: leave out {words[0]}, or --for" in error


def test_the_default_ends_with_what_its_host_needs(built):
    code, ((model, how),), error = built("infinite_bus")
    assert (code, model, how["native"]) == (0, "infinite_bus", False)
    _, needs, last = error.partition("A Python-backed FMU needs a host that is a program in Python")
    assert needs
    assert "--native" in last
    code, _, error = built("infinite_bus", "--for", "fmpy")
    assert (code, "--native" in error) == (0, False)


@pytest.mark.slow
def test_an_fmu_for_a_host_is_what_was_said(gfor, tmp_path):
    code, out, error = gfor("fmu", "build", "gfor", "--for", "libcosim", "--dest", tmp_path)
    assert code == 0, error
    assert out == f"{tmp_path / 'gfor.fmu'}\n"
    with zipfile.ZipFile(tmp_path / "gfor.fmu") as archive:
        names = archive.namelist()
    assert {name.split("/")[1] for name in names if name.startswith("binaries/")} == {
        "linux64",
        "win64",
    }
    assert not [name for name in names if name.endswith(".py")]
    assert read_description(tmp_path / "gfor.fmu").title


def test_the_page_has_the_table():
    rows = [
        [cell.strip() for cell in line.strip("| \n").split("|")]
        for line in PAGE.read_text().splitlines()
    ]
    shown = {row[0].strip("`"): row[1:] for row in rows if len(row) == 7 and row[0].startswith("`")}
    sources = {
        name: "here" if host.source == "here" else f"<{host.source}>"
        for name, host in HOSTS.items()
    }
    assert shown == {
        name: [host.kind, host.fmi, host.port, ", ".join(host.platforms), host.why, sources[name]]
        for name, host in HOSTS.items()
    }


def test_rows_can_be_built_and_have_sources():
    for host in HOSTS.values():
        assert set(host.platforms) <= set(TARGETS)
        # pythonfmu's wrapper has no binary for macOS
        assert host.native or "darwin64" not in host.platforms
        assert host.source == "here" or re.match(r"https://\S+$", host.source)
