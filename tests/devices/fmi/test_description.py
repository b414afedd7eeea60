"""Reading an FMU's file: everything it declares, and every way in which a file can be unusable."""

import re
import shutil
import zipfile
from dataclasses import replace

import fmpy
import pytest

from fmus.toolchain.catalogue import build_model
from orchestrator.core.errors import FmuFileError, InputError
from orchestrator.devices.fmi import archive
from orchestrator.devices.fmi.archive import extract
from orchestrator.devices.fmi.description import VariableInfo, read_declared, read_description
from orchestrator.devices.sandbox import wine
from orchestrator.face.cli import main
from orchestrator.output.report import fmu_variables

XML = "modelDescription.xml"


@pytest.fixture
def rewritten(fmu_path, tmp_path):
    """Build an FMU from the converter's, with its model description or its list of files changed."""

    def write(change=None, keep=lambda name: True):
        target = tmp_path / "changed.fmu"
        with zipfile.ZipFile(fmu_path("gfor")) as good, zipfile.ZipFile(target, "w") as bad:
            for name in filter(keep, good.namelist()):
                content = good.read(name)
                if name == XML and change is not None:
                    changed = change(content.decode())
                    assert changed != content.decode()
                    content = changed.encode()
                bad.writestr(name, content)
        return target

    return write


def refused(path, *words):
    """The error names the file, then says each of the words, in that order."""
    with pytest.raises(FmuFileError) as caught:
        read_description(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: ")
    assert re.search(".*".join(words), text, re.DOTALL), text
    assert isinstance(caught.value, InputError)  # nothing was run: exit code 2
    assert caught.value.exit_code == 2


def test_a_missing_file(tmp_path):
    refused(tmp_path / "none.fmu", "there is no such file", "give the path of an .fmu")


def test_a_folder(tmp_path):
    refused(tmp_path, "it is a folder", "give the path")


def test_a_file_that_is_not_a_zip_archive(tmp_path):
    path = tmp_path / "text.fmu"
    path.write_text("this is text")
    refused(path, "is not an FMU", "zip archive", "export it again")


def test_an_archive_that_was_cut_off(fmu_path, tmp_path):
    path = tmp_path / "half.fmu"
    content = fmu_path("gfor").read_bytes()
    path.write_bytes(content[: len(content) // 2])
    refused(path, "is not an FMU", "export it again")


def test_an_archive_with_damaged_contents(fmu_path, tmp_path):
    path = tmp_path / "damaged.fmu"
    content = bytearray(fmu_path("gfor").read_bytes())
    with zipfile.ZipFile(fmu_path("gfor")) as archive:
        start = archive.getinfo(XML).header_offset + 30 + len(XML)
    content[start + 100 : start + 110] = bytes(10)
    path.write_bytes(content)
    refused(path, "export it again")


def test_an_archive_without_a_model_description(rewritten):
    refused(
        rewritten(keep=lambda name: name != XML),
        "no modelDescription.xml at its top",
        "export it again",
    )


def test_a_model_description_that_is_not_xml(rewritten):
    refused(
        rewritten(lambda text: text[: len(text) // 2]),
        "modelDescription.xml is not XML",
        "line",
        "export it again",
    )


def test_a_model_description_that_is_something_else(rewritten):
    refused(rewritten(lambda _: "<html/>"), "FMI unknown", "FMI 2.0 and 3.0")


@pytest.mark.parametrize("version", ["1.0", "3.1"])
def test_another_fmi_version(version, rewritten):
    path = rewritten(lambda text: text.replace('fmiVersion="2.0"', f'fmiVersion="{version}"'))
    refused(
        path,
        f"FMI {re.escape(version)}",
        "co-simulation of FMI 2.0 and 3.0",
        "ask for one of these",
    )


def test_model_exchange_only(rewritten):
    exchange = '<ModelExchange modelIdentifier="gfor" />'
    path = rewritten(lambda text: re.sub(r"<CoSimulation .*?/>", exchange, text, flags=re.DOTALL))
    refused(path, "not an FMU for co-simulation", "Model Exchange only", "ask for that export")


@pytest.mark.parametrize(
    "command", [["fmu", "info"], ["fmu", "bind"], ["fmu", "check"], ["fmu", "admittance"]]
)
def test_two_variables_of_one_name_are_refused_by_every_command(
    command, rewritten, capsys, tmp_path
):
    path = rewritten(lambda text: text.replace(' name="i_re"', ' name="i_im"'))
    refused(path, r"two variables are named 'i_im' \(valueReference \d+ and \d+\)", "unique names")
    more = ["--out", str(tmp_path / "out")] if command[1] in ("bind", "admittance") else []
    assert main([*command, str(path), *more]) != 0
    captured = capsys.readouterr()
    assert "two variables are named 'i_im'" in " ".join((captured.out + captured.err).split())


def test_what_runs_nothing_needs_no_binary_of_this_platform(rewritten, capsys, tmp_path):
    path = rewritten(keep=lambda name: not name.startswith("binaries/"))
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("binaries/win32/gfor.dll", b"")
        archive.writestr("sources/gfor.c", b"")
    assert read_declared(path).platforms == ("win32",)  # sources are no platform
    assert main(["fmu", "bind", str(path), "--out", str(tmp_path / "gfor.toml")]) == 0
    assert "[voltage]" in (tmp_path / "gfor.toml").read_text(encoding="utf-8")
    assert main(["fmu", "info", str(path)]) == 0
    assert "It cannot run here" in capsys.readouterr().out
    refused(path, "no binary for this platform", "only for: win32")


def test_an_archive_with_backslashes_is_called_what_it_is_and_shown(fmu_path, tmp_path, capsys):
    path = tmp_path / "windows.fmu"
    with zipfile.ZipFile(fmu_path("gfor")) as good, zipfile.ZipFile(path, "w") as bad:
        for name in good.namelist():
            bad.writestr(name.replace("/", "\\"), good.read(name))
    refused(path, "backslashes between folders", "pack it again")
    assert read_declared(path).platforms == read_description(fmu_path("gfor")).platforms
    with pytest.raises(FmuFileError, match="backslashes between folders"):
        extract(path, tmp_path / "unpacked")
    assert not (tmp_path / "unpacked").exists()
    assert main(["fmu", "info", str(path)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "It cannot run here: its archive has backslashes" in said
    assert "trust" not in said
    assert main(["fmu", "check", str(path)]) != 0
    assert "backslashes between folders" in " ".join(capsys.readouterr().out.split())


def test_many_variables_are_listed_without_a_table(rewritten, monkeypatch, capsys):
    monkeypatch.setattr(fmu_variables, "_MOST_IN_A_TABLE", 3)
    assert main(["fmu", "info", str(rewritten(lambda text: text + "\n"))]) == 0
    lines = capsys.readouterr().out.splitlines()
    (row,) = [line.split() for line in lines if line.startswith("S_n ")]
    assert row[:3] == ["S_n", "MVA", "1500.0"]


@pytest.mark.parametrize("identifier", ["watertank-c", "3_tanks", "tank.v2"])
def test_identifiers_as_tools_write_them(identifier, rewritten):
    path = rewritten(
        lambda text: text.replace('modelIdentifier="gfor"', f'modelIdentifier="{identifier}"')
    )
    assert read_description(path).model_identifier == identifier


def test_a_constant_parameter_as_tools_write_it(rewritten):
    """FMPy has no ``initial`` for it and would refuse the whole file."""
    path = rewritten(
        lambda text: re.sub(
            r'(<ScalarVariable name="S_n"[^>]*variability=)"[a-z]*"', r'\1"constant"', text
        )
    )
    found = read_description(path).variables["S_n"]
    assert (found.causality, found.variability) == ("parameter", "constant")


def test_a_derivative_of_nothing(rewritten):
    path = rewritten(lambda text: re.sub(r' derivative="\d+"', "", text, count=1))
    refused(
        path,
        "ModelStructure/Derivatives lists 'der",
        "does not say which state it is the derivative of",
    )


def test_no_binary_for_this_platform(rewritten, monkeypatch):
    """Without Wine; with it, the one for Windows is run."""

    def missing():
        raise wine.NoWineError(wine.MISSING)

    monkeypatch.setattr(wine, "find_wine", missing)
    path = rewritten(keep=lambda name: not name.startswith(f"binaries/{fmpy.platform}/"))
    words = ("no binary for this platform", fmpy.platform, "only for", f"{fmpy.platform} build")
    refused(path, *words, "or run that for Windows", "install it")


def test_no_binary_at_all(rewritten):
    path = rewritten(keep=lambda name: not name.startswith("binaries/"))
    refused(path, "no binary for this platform", "only for: none")


def test_a_model_description_that_contradicts_itself(rewritten):
    path = rewritten(lambda text: re.sub(r'derivative="\d+"', 'derivative="99999"', text, count=1))
    refused(path, "modelDescription.xml cannot be read", "fmpy validate")


@pytest.mark.parametrize(
    ("variable", "start", "rule"),
    [
        ("S_n", "1,5", "type Real takes a number"),
        ("pod_p.N_S", "2.5", "type Integer takes a whole number"),
        ("pod_p.enabled", "on", "type Boolean takes true, false, 1 or 0"),
    ],
)
def test_a_malformed_start_value(rewritten, variable, start, rule):
    path = rewritten(lambda text: start_of(variable, start, text))
    refused(
        path, f"'{variable}' has the start value '{start}'", rule, "correct modelDescription.xml"
    )


def start_of(variable, start, text):
    """The description with another start value of a variable."""
    return re.sub(
        rf'(<ScalarVariable name="{re.escape(variable)}".*?start=")[^"]*',
        rf"\g<1>{start}",
        text,
        count=1,
        flags=re.DOTALL,
    )


# -- a good one --------------------------------------------------------------------------------


def test_the_converter_is_read_as_it_was_declared(fmu_path):
    model, description = build_model("gfor"), read_description(fmu_path("gfor"))
    assert description.path == fmu_path("gfor")
    assert description.model_name == description.model_identifier == "gfor"
    assert re.fullmatch(r"\{[0-9a-f-]{36}\}", description.guid)
    assert description.inputs == ("v_re", "v_im")
    assert description.outputs == tuple(o.name for o in model.outputs)
    assert description.states == tuple(s.name for s in model.states)
    assert description.parameters == tuple(p.name for p in model.parameters)
    assert description.states_are_settable
    assert description.can_save_state
    assert fmpy.platform in description.platforms
    for variable in model.variables:
        info = description.variables[variable.name]
        assert info.reference == model.value_references[variable.name]
        assert info.description == variable.text
        if info.type == "Real":
            assert info.unit == variable.unit


def test_bounds_types_and_variability_of_parameters(fmu_path):
    variables = read_description(fmu_path("gfor")).variables
    K, N_S, enabled = (variables[f"pod_p.{name}"] for name in ("K", "N_S", "enabled"))
    assert (K.type, K.variability, K.minimum, K.maximum, K.start) == (
        "Real",
        "tunable",
        0.0,
        1e5,
        200.0,
    )
    assert (N_S.type, N_S.variability, N_S.minimum, N_S.maximum, N_S.start) == (
        "Integer",
        "fixed",
        0,
        3,
        2,
    )
    assert (enabled.type, enabled.causality, enabled.start) == ("Boolean", "parameter", False)
    assert type(N_S.start) is int
    assert variables["theta_0"].minimum is None


def test_a_boolean_that_starts_at_1_is_true(rewritten):
    path = rewritten(lambda text: start_of("pod_p.enabled", "1", text))
    assert read_description(path).variables["pod_p.enabled"].start is True


def test_direct_feedthrough(fmu_path):
    converter = read_description(fmu_path("gfor"))
    assert converter.feedthrough("i_re") == ()  # its current is a state
    assert converter.feedthrough("p") == ("v_re", "v_im")
    grid = read_description(fmu_path("two_area_grid"))
    assert grid.feedthrough("bus_2.v_re") == ("sg1.i_re", "gfor.i_re")
    assert set(grid.feedthrough("bus_3.v")) == {"sg2.i_re", "sg2.i_im"}


def test_undeclared_dependencies_mean_all_inputs(rewritten):
    path = rewritten(lambda text: re.sub(r' dependencies="[^"]*"', "", text))
    description = read_description(path)
    assert description.output_dependencies["i_re"] is None
    assert description.feedthrough("i_re") == ("v_re", "v_im")


def test_states_are_settable_only_where_it_is_declared(rewritten):
    path = rewritten(
        lambda text: re.sub(r"<VendorAnnotations>.*</VendorAnnotations>", "", text, flags=re.DOTALL)
    )
    description = read_description(path)
    assert not description.states_are_settable
    assert description.states == read_description(path).states != ()


def test_state_saving_is_read_from_its_capability_flag(rewritten):
    path = rewritten(
        lambda text: text.replace('canGetAndSetFMUstate="true"', 'canGetAndSetFMUstate="false"')
    )
    assert not read_description(path).can_save_state


def test_a_path_may_be_given_as_text(fmu_path):
    assert read_description(str(fmu_path("gfor"))) == read_description(fmu_path("gfor"))


@pytest.mark.parametrize(
    ("start", "number"), [(None, 0.0), ("a.json", 0.0), (True, 1.0), (False, 0.0), (2, 2.0)]
)
def test_a_start_value_as_a_number(start, number):
    assert (
        VariableInfo("x", 0, "Real", "parameter", "fixed", "", start, None, None, "").start_number
        == number
    )


def test_names_and_texts_that_steer_a_terminal_are_written_out(rewritten, capsys):
    """XML allows line ends by their numbers, and the second set of control characters as they are."""
    hostile = "&#10;stable&#13;\x9b2K\u202e"
    shown = "\\nstable\\r\\x9b2K\\u202e"

    def change(text):
        text = text.replace('modelName="', f'modelName="{hostile}', 1)
        text = re.sub(r'( description=")', rf"\1{hostile}", text)
        return text.replace('name="pod_p.K"', f'name="pod_p.K{hostile}"')

    found = read_description(rewritten(change))
    assert found.model_name.startswith(shown)
    assert found.title.startswith(shown)
    assert f"pod_p.K{shown}" in found.variables
    assert found.variables[f"pod_p.K{shown}"].description.startswith(shown)
    assert main(["fmu", "info", str(found.path)]) == 0
    said = capsys.readouterr().out
    assert not re.search("[\r\x9b\u202e]", said)
    assert "\nstable" not in said


def test_a_description_is_judged_once_and_again_where_it_changed(rewritten, monkeypatch):
    """A study reads its device's file for every point, and a certificate a copy of it."""
    path = rewritten(lambda text: text.replace("<fmiModelDescription", "<fmiModelDescription ", 1))
    first = read_declared(path)

    def parser():
        raise AssertionError("it was judged before")

    with monkeypatch.context() as patch:
        patch.setattr(archive.expat, "ParserCreate", parser)
        assert read_declared(path) is first
        copy = read_declared(shutil.copy(path, path.with_name("copy.fmu")))
    assert copy == replace(first, path=path.with_name("copy.fmu"))
    rewritten(lambda text: f"<!DOCTYPE x>{text.partition('?>')[2]}")
    refused(path, "document type")
