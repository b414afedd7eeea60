"""What a command line says of several devices: names, files, bindings and values."""

from pathlib import Path

import pytest

from orchestrator.cases.form.devices import devices_of
from orchestrator.core.errors import InputError


def names(*files):
    return [device.name for device in devices_of(files)]


def test_a_device_is_called_by_its_file_or_as_it_is_told():
    assert names("a/one.fmu", "box=a/one.fmu", "two.so") == ["one", "box", "two"]


def test_files_of_one_name_are_told_apart_by_as_many_folders_as_it_takes():
    assert names("a/x.fmu", "b/x.fmu", "c/other.fmu") == ["a_x", "b_x", "other"]
    assert names("a/v/x.fmu", "b/v/x.fmu") == ["a_v_x", "b_v_x"]
    # whatever their order: kept points stay with their device
    assert names("b/x.fmu", "a/x.fmu") == ["b_x", "a_x"]
    # some file systems have one folder for both
    assert names("a/X.fmu", "b/x.fmu") == ["a_X", "b_x"]


@pytest.mark.parametrize(
    "files",
    [
        ("a/x.fmu", "a/x.fmu"),
        ("a/x.fmu", "a/../a/x.fmu"),
        ("a/x.fmu", "a/x.so"),
        ("n=a.fmu", "N=b.fmu"),
        ("b.fmu", "b=a.fmu"),
    ],
)
def test_two_devices_with_one_folder_are_refused(files):
    with pytest.raises(InputError, match="give each a name of its own"):
        devices_of(files)


def test_two_devices_of_one_name_are_told_how_to_be_called():
    with pytest.raises(InputError, match=r"2 devices are called 'x'.* as in x_1=a\.fmu x_2=b\.fmu"):
        devices_of(["x=a.fmu", "x=b.fmu", "c.fmu"])


@pytest.mark.parametrize("text", ["..=x.fmu", ".hidden=x.fmu", "a:b=x.fmu", "a b=x.fmu"])
def test_a_name_that_is_no_folder_is_refused(text):
    with pytest.raises(InputError, match="cannot be called"):
        devices_of([text])


def test_a_file_whose_name_holds_the_sign_stays_whole(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("gain=2.fmu").touch()
    (device,) = devices_of(["gain=2.fmu"])
    assert (device.name, device.file) == ("gain=2", Path("gain=2.fmu"))
    assert devices_of(["k=3/x.fmu"])[0].file == Path("3/x.fmu")
    assert devices_of(["some/k=3/x.fmu"])[0].file == Path("some/k=3/x.fmu")


def test_every_device_has_its_own_binding():
    a, b, c = devices_of(["a.fmu", "b.fmu", "c.fmu"], ["c=for_c.toml", "a=for_a.toml"])
    assert (a.binding, b.binding, c.binding) == (Path("for_a.toml"), None, Path("for_c.toml"))
    (alone,) = devices_of(["a.fmu"], ["x=y.toml"])
    assert alone.binding == Path("x=y.toml")


@pytest.mark.parametrize(
    ("files", "bindings", "said"),
    [
        (["a.fmu", "b.fmu"], ["x.toml"], "does not say whose it is"),
        (["a.fmu", "b.fmu"], ["c=x.toml"], "one of a, b"),
        (["a.fmu"], ["x.toml", "y.toml"], "a has x.toml already"),
        (["a.fmu"], ["a=x.toml", "y.toml"], "already"),
    ],
)
def test_a_binding_of_nobody_or_a_second_one_is_refused(files, bindings, said):
    with pytest.raises(InputError, match=said):
        devices_of(files, bindings)


def test_a_devices_own_value_counts_before_one_of_all_wherever_it_stands():
    settings = [("b:K", 2.0), ("K", 1.0), ("T", 5.0), ("K", 3.0)]
    a, b = devices_of(["a.fmu", "b.fmu"], (), settings)
    assert a.values == {"T": 5.0, "K": 3.0}
    assert b.values == {"K": 2.0, "T": 5.0}


def test_a_value_of_a_device_that_is_not_there_is_one_error():
    with pytest.raises(
        InputError, match=r"--set three:K: there is no device 'three'; the devices are one, two"
    ):
        devices_of(["one=a.fmu", "two=b.fmu"], settings=[("three:K", 2.0)])
