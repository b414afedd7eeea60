"""Networks of CGMES: the voltages of pypowsybl's own load flow and of pandapower, and what is refused."""

import cmath
import math
import re
import shutil
import zipfile
from types import SimpleNamespace

import pytest

from fmus.toolchain.extras import MissingLibraryError
from orchestrator.cases.form.schema import NetworkTable
from orchestrator.cases.networks.cgmes.files import load_cgmes
from orchestrator.cases.networks.cgmes.network import convert, read_cgmes
from orchestrator.cases.networks.conversion import import_network
from orchestrator.cases.networks.data import network_data
from orchestrator.cases.networks.element_names import BranchName
from orchestrator.core.errors import InputError
from orchestrator.core.foreign_files import one_line
from tests.cases.networks.psse.test_raw import pandapowers
from tests.cases.networks.test_network_sources import solved
from tests.support.pandapower_networks import pandapower_network


@pytest.fixture(scope="module")
def powsybl():
    return pytest.importorskip("pypowsybl", reason="pypowsybl is not installed")


@pytest.fixture(scope="module")
def ieee14(powsybl, tmp_path_factory):
    """The IEEE 14-bus system as CGMES."""
    path = tmp_path_factory.mktemp("cgmes") / "ieee14.zip"
    powsybl.network.create_ieee14().save(str(path), format="CGMES")
    return path


def flows(powsybl, network, slack):
    """pypowsybl's voltages [pu] of its own load flow, without any control but generators' voltages."""
    loadflow = powsybl.loadflow
    parameters = loadflow.Parameters(
        distributed_slack=False,
        use_reactive_limits=False,
        transformer_voltage_control_on=False,
        phase_shifter_regulation_on=False,
        shunt_compensator_voltage_control_on=False,
        provider_parameters={
            "newtonRaphsonConvEpsPerEq": "1e-10",
            "slackBusSelectionMode": "NAME",
            "slackBusesIds": slack,
        },
    )
    (result,) = loadflow.run_ac(network, parameters)
    assert result.status == loadflow.ComponentStatus.CONVERGED
    nominal = network.get_voltage_levels().nominal_v
    return {
        bus: cmath.rect(row.v_mag / nominal[row.voltage_level_id], math.radians(row.v_angle))
        for bus, row in network.get_buses().iterrows()
    }


def compare(powsybl, network, ids, slack):
    """Our voltages and pypowsybl's; ``ids``: our bus → pypowsybl's."""
    imported = import_network(convert("model", network).tables)
    ours, theirs = solved(with_slack(imported, slack)).voltages, flows(powsybl, network, ids[slack])
    turn = cmath.phase(theirs[ids[slack]]) - cmath.phase(ours[slack])
    assert {*ids} <= {*ours}
    for bus, bus_id in ids.items():
        assert ours[bus] * cmath.exp(1j * turn) == pytest.approx(theirs[bus_id], abs=1e-9)


def with_slack(data, slack):
    """The elements of a network with a slack bus."""
    names = ("buses", "lines", "loads", "shunts", "generation")
    return SimpleNamespace(**{name: getattr(data, name) for name in names}, slack=slack)


@pytest.mark.parametrize("name", ["case14", "case39"])
def test_pandapowers_networks_as_cgmes_have_its_voltages(name, powsybl, tmp_path):
    """From pandapower to pypowsybl, to CGMES, to our network: voltages to 1e-6 pu."""
    net = pandapower_network(name)
    powsybl.network.convert_from_pandapower(net).save(str(tmp_path / "model.zip"), format="CGMES")
    data = network_data(NetworkTable(cgmes="model.zip"), tmp_path)
    wanted = pandapowers(net)
    slack = f"bus_{net.ext_grid.bus.iloc[0] + 1}"
    ours = solved(with_slack(data, slack)).voltages
    turn = cmath.phase(wanted[slack]) - cmath.phase(ours[slack])
    assert {*ours} == {*wanted}
    for bus, v in ours.items():
        assert v * cmath.exp(1j * turn) == pytest.approx(wanted[bus], abs=1e-6)


@pytest.mark.parametrize("name", ["ieee9", "ieee14", "ieee57"])
def test_factory_networks_as_cgmes_have_pypowsybls_voltages(name, powsybl, tmp_path):
    """Both read the same file."""
    path = tmp_path / f"{name}.zip"
    getattr(powsybl.network, f"create_{name}")().save(str(path), format="CGMES")
    network = powsybl.network.load(str(path))
    ids = bus_ids(network)
    compare(powsybl, network, ids, strongest(network, ids))


@pytest.mark.parametrize(
    ("name", "lines"), [("ieee30", 3), ("ieee57", 0), ("ieee118", 2), ("ieee300", 22)]
)
def test_factory_networks_as_cgmes_have_the_voltages_from_before_the_export(
    name, lines, powsybl, tmp_path
):
    """But for the charging of lines between two nominal voltages, which differs between their ends, and CGMES has one
    for both: it is put back here. Without, pypowsybl finds no solution of its own export of 30, 118 and 300 buses.
    """
    network = getattr(powsybl.network, f"create_{name}")()
    network.save(str(tmp_path / "model.zip"), format="CGMES")
    read = load_cgmes(tmp_path / "model.zip")
    ends = ["g1", "b1", "g2", "b2"]
    before, after = (n.get_lines(all_attributes=True)[ends] for n in (network, read))
    lost = before[((before - after.loc[before.index]).abs() > 1e-9).any(axis=1)]
    voltage = network.get_voltage_levels().nominal_v
    table = network.get_lines(all_attributes=True).loc[lost.index]
    assert len(lost) == lines
    assert (
        voltage[table.voltage_level1_id].values != voltage[table.voltage_level2_id].values
    ).all()
    read.update_lines(lost)
    data = import_network(convert("model", read).tables)
    ids = bus_ids(network)
    ids = (
        ids
        if len(ids) == len(data.buses)
        else {f"bus_{bus}": bus for bus in network.get_buses().index}
    )
    (slack_id,) = network.get_extensions("slackTerminal").bus_id
    slack = next(bus for bus, bus_id in ids.items() if bus_id == slack_id)
    ours, theirs = solved(with_slack(data, slack)).voltages, flows(powsybl, network, slack_id)
    turn = cmath.phase(theirs[slack_id]) - cmath.phase(ours[slack])
    # a star point with a negative reactance, which is merged
    assert {*ids} - {*ours} <= {"bus_VL1201_0"}
    assert max(abs(v * cmath.exp(1j * turn) - theirs[ids[bus]]) for bus, v in ours.items()) < 1e-9


def test_loads_of_both_signs_at_a_bus_are_two_elements(powsybl):
    network = powsybl.network.create_ieee14()
    (level,) = network.get_loads().loc[["B4-L"]].voltage_level_id
    network.create_loads(id="W", voltage_level_id=level, bus_id="B4", p0=-60.0, q0=5.0, name="wind")
    before = {
        x.name: x
        for x in import_network(convert("m", powsybl.network.create_ieee14()).tables).loads
    }
    loads = {x.name: x for x in import_network(convert("model", network).tables).loads}
    (name,) = loads.keys() - before.keys()
    drawing = loads[name.replace("static_", "load_")]
    assert (loads[name].p_mw, loads[name].q_mvar) == (-60, 5)
    assert drawing.p_mw == before[drawing.name].p_mw


def test_a_rating_below_1_mva_is_one_and_none_is_unknown(powsybl):
    network = powsybl.network.create_ieee14()
    network.update_generators(id=["B1-G", "B2-G"], rated_s=[0.4, math.nan])
    assert [*convert("m", network).ratings.values()] == [0.4]


def test_names_that_steer_a_terminal_forge_no_line(ieee14, tmp_path):
    """Names of every element with an end of a line and an escape: nothing of them reaches what is printed raw."""
    hostile = "&#10;error: forged &#27;[31m"
    with zipfile.ZipFile(ieee14) as old, zipfile.ZipFile(tmp_path / "model.zip", "w") as new:
        for name in old.namelist():
            text = old.read(name).decode()
            # XML 1.0 cannot hold an escape character, so its other spelling stands in names
            text = text.replace(
                "</cim:IdentifiedObject.name>", f"{hostile}</cim:IdentifiedObject.name>"
            )
            new.writestr(name, text.replace("&#27;", "\u202e"))
    data = network_data(NetworkTable(cgmes="model.zip"), tmp_path)
    names = [*data.buses, *(x.name for x in (*data.lines, *data.loads, *data.shunts))]
    assert len(data.buses) == 14
    for text in (*names, *map(str, data.changes), *data.titles.values()):
        assert text == one_line(text), repr(text)


def test_a_line_between_two_nominal_voltages_is_said(powsybl, tmp_path):
    """Its charging is the same at both ends in CGMES, which a transformer that was written as a line has not."""
    path = tmp_path / "model.zip"
    powsybl.network.create_ieee30().save(str(path), format="CGMES")
    said = {change.text: change.place for change in read_cgmes(path).changes}
    (text,) = (text for text in said if text.startswith("line between two nominal voltages"))
    assert said[text].endswith("elements L9-11-1, L9-10-1, L12-13-1")


@pytest.mark.parametrize(
    ("name", "misfit"),
    [
        ("ieee14", r"Mvar at bus_9_LV, .* Mvar at bus_7_ZV; look at"),
        ("ieee57", "^$"),
        ("micro_grid_nl_network", "^$"),
    ],
)
def test_voltages_of_sv_that_the_data_do_not_have_are_questioned(
    name, misfit, powsybl, tmp_path, monkeypatch
):
    """pypowsybl's export of 14 buses has lost charging at 7 and 9; that of 57 has all; boundaries have loads."""
    network = getattr(powsybl.network, f"create_{name}")()
    powsybl.loadflow.run_ac(
        network, powsybl.loadflow.Parameters(distributed_slack=False, use_reactive_limits=False)
    )
    if name.startswith("ieee"):
        network.save(str(tmp_path / "model.zip"), format="CGMES")
        network = powsybl.network.load(str(tmp_path / "model.zip"))
    monkeypatch.setattr(
        "orchestrator.cases.networks.data.read_cgmes", lambda *_: convert("model", network)
    )
    assert re.search(misfit, network_data(NetworkTable(cgmes="model.zip"), tmp_path).misfit)


def strongest(network, ids):
    power = generation(network)
    return max(ids, key=lambda bus: power.get(ids[bus], 0.0))


def generation(network):
    return network.get_generators().groupby("bus_id").target_p.sum().to_dict()


def bus_ids(network):
    """Our name of a bus → pypowsybl's id, where a bus is one topological node."""
    nodes = network.get_bus_breaker_view_buses()
    return {
        f"bus_{re.sub('^bus_', '', re.sub(r'[^A-Za-z0-9]+', '_', row['name'] or node), flags=re.I)}": row.bus_id
        for node, row in nodes.iterrows()
    }


def test_three_windings_phase_shifter_and_boundaries(powsybl):
    """ENTSO-E's micro grid of Belgium: 220/400/110/21/10.5 kV, one transformer of three windings, a phase shifter, five
    lines to a boundary. Its remote voltage control is made a local one, as ours holds SV's voltage there.
    """
    network = powsybl.network.create_micro_grid_be_network()
    remote = next(
        name
        for name, row in network.get_generators(all_attributes=True).iterrows()
        if row.regulated_element_id != name
    )
    bus = network.get_generators().bus_id[remote]
    nominal = network.get_voltage_levels().nominal_v[network.get_buses().voltage_level_id[bus]]
    network.update_generators(id=remote, regulated_element_id=remote, target_v=1.02 * nominal)
    ids = bus_ids(network)
    model = convert("model", network)
    said = {change.text: change.place for change in model.changes}
    own = list(network.get_3_windings_transformers().name)
    assert [x.name for x in model.tables.branch_names].count(own[0]) == 3
    assert {*import_network(model.tables).branch_names.values()} >= {BranchName(own[0])}
    compare(powsybl, network, ids, strongest(network, ids))
    assert said["line to a boundary: what it exchanges there is a load"].count(",") == 5
    assert "control of a phase tap changer: held at its position" in said
    assert "phase tap changer: at SSH's position, which is not that of SV's solution" in said


def test_remote_voltage_control_is_said(powsybl):
    said = [
        change.text
        for change in convert("m", powsybl.network.create_micro_grid_be_network()).changes
    ]
    assert "voltage control of another bus: its own is held at SV's voltage" in said


def test_what_the_network_does_not_have_is_refused_by_name(powsybl):
    network = powsybl.network.create_four_substations_node_breaker_network()
    with pytest.raises(
        InputError,
        match=r"model: .*static var compensator \(SVC\); hvdc line \(HVDC1, HVDC2\); .*leave_out",
    ):
        convert("model", network)
    allowed = ("static var compensator", "hvdc line")
    with pytest.raises(
        InputError, match=r"2 parts of the network with generators .* leave_out = \['island'\]"
    ):
        convert("model", network, allowed)
    found = convert("model", network, (*allowed, "island"))
    said = {change.text: change.place for change in found.changes}
    assert "hvdc line: left out, as leave_out says" in said
    assert "bus: left out, as leave_out says" in said


# -- files -----------------------------------------------------------------------------------------


def test_a_folder_and_a_zip_of_zips_are_the_same_model(ieee14, tmp_path):
    folder, nested = tmp_path / "folder", tmp_path / "nested.zip"
    with zipfile.ZipFile(ieee14) as archive:
        archive.extractall(folder)
    shutil.copy(ieee14, tmp_path / "inner.zip")
    with zipfile.ZipFile(nested, "w") as archive:
        archive.write(tmp_path / "inner.zip", "inner.zip")
    wanted = read_cgmes(ieee14).tables
    for path in (folder, nested):
        assert (read_cgmes(path).tables.branch == wanted.branch).all()


@pytest.mark.parametrize(
    ("profile", "words"),
    [
        ("_SV", r"the profile SV is missing among .*_EQ.xml.*; export the solved model"),
        ("_SSH", "the profile SSH is"),
    ],
)
def test_a_missing_profile_is_named(profile, words, ieee14, tmp_path):
    with zipfile.ZipFile(ieee14) as archive:
        archive.extractall(tmp_path)
    next(tmp_path.glob(f"*{profile}.xml")).unlink()
    with pytest.raises(InputError, match=words):
        load_cgmes(tmp_path)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"not a zip", "it is no zip archive that can be read: .*; export the model once more"),
        (None, "it holds no .xml"),
    ],
)
def test_a_file_of_another_kind(content, words, tmp_path):
    path = tmp_path / "model.zip"
    if content is None:
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("readme.txt", "nothing")
    else:
        path.write_bytes(content)
    with pytest.raises(InputError, match=words):
        load_cgmes(path)
    with pytest.raises(InputError, match="there is no such file; give a zip or a folder"):
        load_cgmes(tmp_path / "none.zip")


def test_xml_that_is_broken_is_one_error(ieee14, tmp_path):
    with zipfile.ZipFile(ieee14) as archive:
        archive.extractall(tmp_path)
    equipment = next(tmp_path.glob("*_EQ.xml"))
    equipment.write_text(equipment.read_text()[:20000])
    with pytest.raises(
        InputError, match=r"pypowsybl cannot read it as CGMES: .*; check the export"
    ):
        load_cgmes(tmp_path)


def test_without_pypowsybl_the_extra_is_named(tmp_path, monkeypatch):
    path = tmp_path / "model.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for profile in ("EQ", "SSH", "TP", "SV"):
            archive.writestr(f"model_{profile}.xml", "<rdf/>")
    monkeypatch.setattr("fmus.toolchain.extras.find_spec", lambda name: None)
    with pytest.raises(
        MissingLibraryError, match=r"reading the CGMES model model.zip needs .*gfor-cosim\[cgmes\]"
    ):
        load_cgmes(path)


def test_names_to_leave_out_are_those_of_cgmes(tmp_path):
    with pytest.raises(
        InputError, match=r"leave_out: 'facts device' is unknown for CGMES; choose from static var"
    ):
        read_cgmes(tmp_path, ["facts device"])
