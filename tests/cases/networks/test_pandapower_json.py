"""A pandapower file runs no code, whichever version of pandapower reads it, and loses none of its figures."""

import json
import warnings
from functools import cache

import pandas as pd
import pytest

from orchestrator.cases.networks.pandapower_json import network_text
from orchestrator.cases.networks.sources import read_pandapower
from orchestrator.core.errors import InputError
from tests.support.late import LateLibrary

pp, networks = LateLibrary("pandapower"), LateLibrary("pandapower.networks")
control = LateLibrary("pandapower.control")
characteristic = LateLibrary("pandapower.control.util.characteristic")


@cache
def written(change):
    net = networks.case9()
    change(net)
    return pp.to_json(net)


def unchanged(net):
    """The network as pandapower has it."""


def saved(folder, change=unchanged):
    path = folder / "net.json"
    path.write_text(written(change), encoding="utf-8")
    return path


def read(path):
    return network_text(path, path.read_bytes())


COMMAND = {"_module": "os", "_class": "system", "_object": "touch {}"}
IMPORT = {"_module": "antigravity", "_class": "fly"}
FUNCTION = {"_module": "pandapower.toolbox", "_class": "function", "_object": "clear_result_tables"}


def in_the_network(net, foreign):
    net["_object"]["name"] = foreign


def in_a_cell(net, foreign):
    bus = net["_object"]["bus"]
    table = json.loads(bus["_object"])
    table["data"][0][0] = foreign
    bus["_object"] = json.dumps(table)


def in_a_text(net, foreign):
    net["_object"] = json.dumps({**net["_object"], "profiles": {"a": [foreign]}})


def as_a_key_of_a_table(net, foreign):
    net["_object"]["bus"]["dtype"] = foreign


def in_place_of_the_network(net, foreign):
    net.clear()
    net.update(foreign)


PLACES = (in_the_network, in_a_cell, in_a_text, as_a_key_of_a_table, in_place_of_the_network)


@pytest.mark.parametrize("foreign", [COMMAND, IMPORT, FUNCTION], ids=["call", "import", "function"])
@pytest.mark.parametrize("plant", PLACES)
def test_no_file_has_anything_imported_or_called(tmp_path, plant, foreign):
    """pandapower 3.1.1 ran the command, and 3.5.6 still imports the module."""
    path, mark = saved(tmp_path), tmp_path / "ran"
    foreign = json.loads(json.dumps(foreign).replace("{}", str(mark)))
    net = json.loads(path.read_text(encoding="utf-8"))
    plant(net, foreign)
    path.write_text(json.dumps(net), encoding="utf-8")
    with pytest.raises(InputError, match="runs no code of a file: remove that object") as raised:
        read_pandapower(path.name, tmp_path)
    assert repr(foreign["_module"]) in str(raised.value)
    assert not mark.exists()


def test_a_table_that_is_read_from_another_file_is_refused(tmp_path):
    path = saved(tmp_path)
    net = json.loads(path.read_text(encoding="utf-8"))
    net["_object"]["bus"]["_object"] = "/etc/buses.json"
    path.write_text(json.dumps(net), encoding="utf-8")
    with pytest.raises(InputError, match="it is no network saved with"):
        read(path)


def test_deep_brackets_are_one_error(tmp_path):
    path = tmp_path / "net.json"
    path.write_text("[" * 200_000, encoding="utf-8")
    with pytest.raises(InputError, match="brackets nest too deeply"):
        read(path)


def with_a_characteristic(net):
    characteristic.SplineCharacteristic(net, [0, 1, 2], [1.0, 2.0, 3.0])


def test_every_figure_of_a_network_stays(tmp_path):
    path = saved(tmp_path, with_a_characteristic)
    text = path.read_text(encoding="utf-8")
    assert '345.0,\\"b' in text
    path.write_text(text.replace('345.0,\\"b', '345.30000000000001,\\"b'), encoding="utf-8")
    plain, whole = pp.from_json_string(read(path), convert=True), pp.from_json(str(path))
    assert set(plain) == set(whole)
    for name, table in whole.items():
        if isinstance(table, pd.DataFrame) and name != "characteristic":
            pd.testing.assert_frame_equal(plain[name], table, check_exact=True)
    assert (plain.bus.vn_kv == 345.30000000000001).all()
    assert list(plain.characteristic.object[0].x_vals) == [0, 1, 2]


def test_a_controller_which_no_power_flow_reads_is_left_out(tmp_path):
    path = saved(tmp_path, control.basic_controller.Controller)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        net = pp.from_json_string(read(path), convert=True)
    assert len(net.controller) == 0
    (tmp_path / "other").mkdir()
    plain = saved(tmp_path / "other")
    read_plain = read_pandapower(plain.name, plain.parent)
    assert (read_pandapower(path.name, tmp_path).branch == read_plain.branch).all()
