"""Operating points times outages: the numbers, what is named, and what must not be lost."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

from orchestrator.cases.case import load_case
from orchestrator.core.errors import InputError
from orchestrator.face.cli import main
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.linearization import Blocks, continuous
from orchestrator.linear.spectra.mode_tracking import ModeSet
from orchestrator.linear.spectra.modes import find_modes, least_damped_first
from orchestrator.studies.modes.modes import compute_modes
from orchestrator.studies.operating_points.bench import PointBench, without_references
from orchestrator.studies.operating_points.item import Item, Status
from orchestrator.studies.operating_points.outages import read_outages
from orchestrator.studies.operating_points.point_columns import Elements
from orchestrator.studies.operating_points.points_file import questions_about, read_points
from orchestrator.studies.operating_points.preparation import ItemPreparation
from orchestrator.studies.points.dask_cluster import DaskCluster
from orchestrator.studies.points.executor import Serial
from orchestrator.studies.points.points import Work
from orchestrator.studies.points.store import PointStore
from orchestrator.studies.screening import modes, study
from orchestrator.studies.screening.request import ScreeningRequest
from orchestrator.studies.screening.study import Shard, plan_screening, run_screening
from orchestrator.studies.screening.summary import Summary, duration

DAY = "time,hours,grid.X_L,load\na,2,0.1,1\nb,1,0.12,0.99\nc,1,0.15,1.01\nd,3,0.2,1\ne,1,0.1,\n"


@pytest.fixture(scope="module")
def two_area():
    case = load_case("two_area")
    (prepared,) = case.prepare(["gfor"])
    return case, prepared, Elements.of(prepared)


@pytest.fixture
def day(tmp_path):
    path = tmp_path / "day.csv"
    path.write_text(DAY)
    return path


def screened(plan, folder, shard=None):
    return run_screening(plan, Work(Serial(), PointStore(folder)), shard=shard)


def test_modes_are_those_of_the_system_without_a_step(two_area, day, tmp_path):
    case, _, _ = two_area
    result = screened(
        plan_screening(case, ScreeningRequest(day, None, "gfor")), tmp_path / "points"
    )
    for item, line in zip(result.items, (0.1, 0.12, 0.15, 0.2), strict=False):
        values = {"grid.X_L": line} | {
            f"grid.{load}.scale": float(
                DAY.splitlines()[1 + "abcd".index(item.point.name)].split(",")[3]
            )
            for load in ("load_2", "load_3")
        }
        (prepared,) = case.prepare(["gfor"], values)
        expected = [
            m.eigenvalue
            for m in find_modes(compute_modes(prepared).system)
            if m.damping_ratio <= 0.2
        ]
        found = item.record.eigenvalues[list(item.record.critical)]
        assert found == pytest.approx(expected, rel=1e-6)
        assert item.record.counted


def test_durations_add_up(two_area, day, tmp_path):
    result = screened(
        plan_screening(two_area[0], ScreeningRequest(day, None, "gfor")), tmp_path / "points"
    )
    (mode,) = Summary(result).modes
    hours, percent = duration(mode)
    assert hours[-1] == 8
    assert list(percent) == sorted(percent)
    assert mode.worst.damping == percent[0] == min(one.damping for one in mode.at)


def test_the_worst_mode_is_moved_by_the_converter(two_area, day, tmp_path):
    result = screened(
        plan_screening(two_area[0], ScreeningRequest(day, None, "gfor")), tmp_path / "points"
    )
    (mode,) = Summary(result).modes
    ((name, through_p, _),) = mode.worst.ranking()
    assert name == "gfor"
    assert abs(through_p) > 0


def test_a_residue_is_the_shift_by_unit_gain(two_area, tmp_path):
    """A small proportional controller from omega to the P reference moves the eigenvalue by residue × gain."""
    case, prepared, _ = two_area
    path = tmp_path / "one.csv"
    path.write_text("name\nonly\n")
    result = screened(
        plan_screening(case, ScreeningRequest(path, None, "gfor")), tmp_path / "points"
    )
    record = result.items[0].record
    k = record.critical[0]
    with PointBench() as bench:
        master = bench.master(prepared)
        models = {name: bench.linearized(name) for name in master.components}
        c = models["gfor"]
        m = len(c.inputs) - 2
        gain = 1e-4
        closed = c.A_c + gain * np.outer(c.B_c[:, m], c.C_o[0])
        narrow = {name: without_references(model) for name, model in models.items()}
        narrow["gfor"] = replace(narrow["gfor"], A_c=closed)
        moved = find_modes(continuous(Blocks(master, known=narrow, without_step=True)), 0.1, 2.0)
    value = record.eigenvalues[k]
    nearest = min((mode.eigenvalue for mode in moved), key=lambda z: abs(z - value))
    assert (nearest - value) / gain == pytest.approx(record.residues["gfor"][0, k], rel=1e-2)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("grid.X_L\n0.1\n", "column 'time' or 'name' is missing"),
        ("time,grid.X_L\n", "it has no row"),
        ("time,grid.X_L\na,0.1\na,0.2\n", "line 3: time = 'a' stands in"),
        ("time,grid.X_L\na,high\n", "line 2: X_L"),
        ("time,grid.X_L\na,-1\n", "line 2: X_L = -1"),
        ("time,grid.X_M\na,1\n", "line 1: column 'grid.X_M'"),
        ("time,gfor9.P_mw\na,1\n", "line 1: column 'gfor9.P_mw'"),
        ("time,load\na,0\n", "line 2: load = 0; it must exceed 0"),
        ("time,hours\na,-1\n", "line 2: hours = '-1'"),
        ("time,gfor.in_service\na,maybe\n", "line 2: gfor.in_service = 'maybe'"),
        (
            "time,gfor.in_service,gfor.P_mw\na,0,5\n",
            "line 2: gfor.P_mw = 5, but gfor is out of service",
        ),
        ("time,gfor.P_mw,gfor.P_0\na,5,0.1\n", "both set gfor.P_0"),
        ("time,load,grid.load_2.scale\na,1,2\n", "both scale load_2"),
        ("time,load,g*.load_2.scale\na,1,2\n", "both scale load_2"),
        ("time,gfor.P_mw,gf*.P_0\na,5,0.1\n", "both set gfor.P_0"),
        ("time,sg2.in_service\na,0\n", "all units at the slack bus"),
        ("name,load,load\na,1,2\n", "line 1: the column 'load' stands twice"),
        (
            "name,sg1.in_service,sg1.connected\na,1,false\n",
            "line 2: the columns sg1.in_service and sg1.connected both",
        ),
        (
            "name,sg*.connected,sg1.in_service\na,true,0\n",
            "line 2: the columns sg1.in_service and sg*.connected both",
        ),
        (
            "name,L.in_service,grid.L.connected\na,1,false\n",
            "line 2: the columns L.in_service and grid.L.connected both",
        ),
        ("name;load\na;1\n", "line 1: its columns are separated by semicolons"),
        ("name\tload\na\t1\n", "line 1: its columns are separated by tabs"),
        ("time,load\na,1,2\n", "more cells than the first line has columns"),
    ],
)
def test_a_mistake_is_named_with_its_line(two_area, tmp_path, gfor, text, said):
    path = tmp_path / "points.csv"
    path.write_text(text)
    code, _, error = gfor(
        "screen", "two_area", "--scenario", "gfor", "--points", path, "--out", tmp_path / "out"
    )
    assert code == 2
    assert said in error.replace("\n", " ")
    assert "Traceback" not in error


def test_a_pattern_sets_what_the_names_that_it_fits_would_set(two_area, tmp_path):
    """The power of a unit is shared out by the rating that another column gives it."""
    _, prepared, elements = two_area
    path, points = tmp_path / "points.csv", []
    for unit in ("sg1", "s?1"):
        path.write_text(f"name,{unit}.S_n,sg1.P_mw\na,1500 MVA,600\n")
        points.append(read_points(path, prepared, elements)[0].values)
    assert points[0] == points[1]
    assert points[1]["sg1.P_0"] == 0.4


def test_powers_are_shared_and_loads_draw_what_is_said(two_area, tmp_path):
    _, prepared, elements = two_area
    path = tmp_path / "points.csv"
    path.write_text(
        "name,bus_2.P_mw,load,load_2.P_mw,sg1.in_service\nboth,1500,0.5,1000,1\none,1500,0.5,1000,0\n"
    )
    both, one = read_points(path, prepared, elements)
    assert both.values["sg1.P_0"] == both.values["gfor.P_0"] == 0.5
    assert one.values["gfor.P_0"] == 1.0
    assert "sg1.P_0" not in one.values
    assert both.values["grid.load_2.scale"] * both.values["grid.load_2.P"] == 1000
    assert both.values["grid.load_3.scale"] == 0.5


@pytest.fixture
def windy(two_area, monkeypatch):
    """The two areas, in which load_3 feeds 220 MW."""
    _, prepared, elements = two_area
    plan = prepared.system.components["grid"]
    fed = replace(plan, parameters=plan.parameters | {"load_3.P": -220.0})
    monkeypatch.setitem(prepared.system.components, "grid", fed)
    return prepared, elements


def test_a_factor_of_loads_leaves_static_generation_and_asks(windy, tmp_path):
    prepared, elements = windy
    path = tmp_path / "points.csv"
    path.write_text("name,load,generation\na,0.7,0.7\n")
    (point,) = read_points(path, prepared, elements)
    assert point.values["grid.load_2.scale"] == 0.7
    assert "grid.load_3.scale" not in point.values
    (found,) = [one for one in questions(path, prepared, elements) if "column 'load'" in one]
    assert "does not scale static generation, loads that feed: load_3 (220 MW)" in found
    for factor in (1, 0.7):  # the remedies that are printed
        path.write_text(f"name,load,generation,static\na,0.7,0.7,{factor}\n")
        assert not [one for one in questions(path, prepared, elements) if "static" in one]
        (point,) = read_points(path, prepared, elements)
        assert (point.values["grid.load_2.scale"], point.values["grid.load_3.scale"]) == (
            0.7,
            factor,
        )


def test_no_factor_of_loads_scales_a_dc_line(windy, tmp_path):
    """A load in the place of a converter has the power that the line's controls hold, whatever the hour."""
    prepared, elements = windy
    linked = replace(prepared, device_loads=("load_3",))
    path = tmp_path / "points.csv"
    path.write_text("name,load,generation\na,0.7,0.7\n")
    assert not [one for one in questions(path, linked, elements) if "column 'load'" in one]
    path.write_text("name,load,generation,static\na,0.7,0.7,0.5\n")
    (point,) = read_points(path, linked, elements)
    assert point.values["grid.load_2.scale"] == 0.7
    assert "grid.load_3.scale" not in point.values


def test_an_hour_without_wind_keeps_the_trace_that_a_voltage_needs(windy, tmp_path):
    prepared, elements = windy
    variables = prepared.system.components["grid"].description.variables
    assert variables["load_3.scale"].minimum == 1e-6
    path = tmp_path / "points.csv"
    path.write_text("name,static\na,0\n")
    (point,) = read_points(path, prepared, elements)
    assert point.values["grid.load_3.scale"] == 1e-6
    path.write_text("name,static,load_3.P_mw\na,0,-200\n")
    with pytest.raises(InputError, match="the load is switched off"):
        read_points(path, prepared, elements)
    path.write_text("name,static\na,-1\n")
    with pytest.raises(InputError, match="it must exceed 0"):
        read_points(path, prepared, elements)


def test_without_static_generation_nothing_is_asked_of_it(two_area, tmp_path):
    _, prepared, elements = two_area
    path = tmp_path / "points.csv"
    path.write_text("name,load,generation\na,0.7,0.7\n")
    assert not questions(path, prepared, elements)


def questions(path, prepared, elements):
    return [
        str(one)
        for one in questions_about(path, read_points(path, prepared, elements), prepared, elements)
    ]


@pytest.mark.parametrize(
    ("columns", "cells", "left"),
    [
        ("load", "0.9", "less"),
        ("load_2.P_mw", "2000", "less"),
        ("load_3.in_service", "0", "less"),
        ("sg1.in_service", "0", "more"),
        ("load,generation", "0.9,1", ""),
        ("load,generation", "0.9,1.00", ""),
        ("load,generation", "0.9, ", "less"),
        ("sg1.connected", "false", "more"),
        ("load,sg1.P_mw", "0.9,800", ""),
        ("load,sg1.P_mw", "0.9,1350", "less"),
        ("load,sg1.S_n", "0.9,1490", "less"),
        ("load,generation", "0.9,0.9", ""),
        ("load,generation", "0.9,1.1", "less"),
        ("load", "0.99", ""),
        ("sg1.P_mw", "600", ""),
    ],
)
def test_a_load_that_only_the_slack_follows_is_asked_about(
    two_area, tmp_path, columns, cells, left
):
    _, prepared, elements = two_area
    path = tmp_path / "points.csv"
    path.write_text(f"name,{columns}\nas it is{',' * cells.count(',')},\nother,{cells}\n")
    found = questions(path, prepared, elements)
    assert len(found) == bool(left)
    if left:
        assert f"at other the slack ({', '.join(elements.balancing)}) feeds " in found[0]
        assert f" MW {left}, as the other units' powers do not follow" in found[0]


def test_powers_that_look_like_pu_are_asked_about(two_area, tmp_path):
    _, prepared, elements = two_area
    path = tmp_path / "points.csv"
    for units, asked in ((1.0, []), (0.01, ["sg1.P_mw", "load_2.P_mw"])):
        path.write_text(
            f"name,sg1.P_mw,load_2.P_mw,load\na,{900 * units},{1100 * units},0.9\nb,0,,1\n"
        )
        found = questions(path, prepared, elements)
        assert len(found) == len(asked)
        assert all(
            name in text and "in pu?" in text for name, text in zip(asked, found, strict=True)
        )


@pytest.mark.parametrize("column", ["sg2.P_mw", "{slack}.P_mw", "sg[2].P_0"])
def test_a_power_of_the_slacks_unit_is_asked_about(two_area, tmp_path, column):
    _, prepared, elements = two_area
    path = tmp_path / "points.csv"
    power = 0.7 if column.endswith("P_0") else 700
    path.write_text(
        f"name,{column.format(slack=elements.slack)},sg1.P_mw,load\na,{power},900,1\nb,,,1\n"
    )
    (found,) = questions(path, prepared, elements)
    assert (
        f"cannot act on {', '.join(elements.balancing)}: {elements.slack} is the slack and feeds what is left"
        in found
    )
    point, _ = read_points(path, prepared, elements)
    assert not {f"{unit}.P_0" for unit in elements.balancing} & {*point.values}, (
        "asked once, and not at each point again"
    )
    assert "sg1.P_0" in point.values
    path.write_text("name,sg2.P_mw,generation\na,,0.9\n")
    assert not questions(path, prepared, elements), "an empty column gives no power"
    (point,) = read_points(path, prepared, elements)
    assert {name for name in point.values if name.endswith(".P_0")} == {
        f"{unit}.P_0" for unit in elements.units if unit not in elements.balancing
    }


def test_a_spreadsheets_mark_is_no_part_of_a_name(two_area, tmp_path):
    _, prepared, elements = two_area
    path = tmp_path / "points.csv"
    path.write_text("name,load\nonly,0.9\n", encoding="utf-8-sig")
    (point,) = read_points(path, prepared, elements)
    assert (point.name, point.values["grid.load_2.scale"]) == ("only", 0.9)


def test_one_switch_in_each_row_is_enough(two_area, tmp_path):
    _, prepared, elements = two_area
    path = tmp_path / "points.csv"
    path.write_text("name,sg1.in_service,sg1.connected\na,0,\nb,,false\n")
    a, b = read_points(path, prepared, elements)
    assert (a.out, b.values) == (("sg1",), {"sg1.connected": False})


def test_outages_are_elements(two_area):
    _, _, elements = two_area
    assert [o.name for o in read_outages("n-1", elements)] == ["intact", "L", "sg1", "sg2", "gfor"]
    assert read_outages("L+gfor", elements)[1].elements == ("L", "gfor")


def test_a_unit_and_its_transformer_are_one_outage(tmp_path):
    """The loss of either has the modes of the other's; N-1 names the unit, its transformer in brackets, and takes
    what it names."""
    files = Path(__file__).parents[3] / ".docs" / "tutorials" / "psse"
    for name in ("areas.raw", "areas.dyr"):
        shutil.copy(files / name, tmp_path)
    (tmp_path / "case.toml").write_text(
        'name = "areas"\n[solver]\nstep_size = "5 ms"\n[power_flow]\ngrid = "grid"\n[components.grid]\n'
        'model = "phasor_grid"\n[network]\nraw = "areas.raw"\n[units]\ndyr = "areas.dyr"\n'
        'generator = "synchronous_generator_phasor"\nconverter = "gfor_phasor"\n'
    )
    case = load_case(tmp_path / "case.toml")
    elements = Elements.of(case.prepare()[0])
    names = [outage.name for outage in read_outages("n-1", elements)]
    assert names[-4:] == [
        f"sg{n} (line_{bus}_{n})" for n, bus in ((1, 5), (2, 6), (3, 11), (4, 10))
    ]
    typed = [read_outages(text, elements)[1] for text in (names[-4], "sg1+line_5_1")]
    assert [one.elements for one in typed] == [("sg1", "line_5_1")] * 2
    with pytest.raises(InputError, match="is named twice"):
        read_outages(f"n-1,{names[-4]}", elements)
    assert len(names) == 1 + 8 + 4
    assert [o.name for o in read_outages("sg4, line_10_4", elements)] == [
        "intact",
        "sg4",
        "line_10_4",
    ]
    preparation = ItemPreparation(case, "areas", ())
    either = [("sg2",), ("line_6_2",), ("sg2", "line_6_2")]
    flows = [
        preparation.prepared(
            Item(0, 1, {"grid.load_7.P": 700.0, "grid.load_9.P": 1400.0}, out, out)
        ).scenario
        for out in either
    ]
    assert flows[0].power_flow.voltages == pytest.approx(flows[2].power_flow.voltages)
    assert flows[1].power_flow.voltages == pytest.approx(flows[2].power_flow.voltages)
    assert all("sg2" not in flow.system.components for flow in flows)
    # |v| that an exciter takes at once is curved where v_im = 0, and no limit
    with PointBench() as bench:
        bench.master(case.prepare((), {"sg*.exciter.T_R": 0.0})[0])
        assert bench.linear_model().doubts == ()


@pytest.mark.parametrize(
    ("text", "said"), [("sg9", "'sg9'"), ("L,L", "named twice"), ("units,sg1", "named twice")]
)
def test_a_wrong_outage_is_refused(gfor, day, tmp_path, text, said):
    code, _, error = gfor(
        "screen", "two_area", "--points", day, "--outages", text, "--out", tmp_path / "out"
    )
    assert code == 2
    assert said in error


def test_what_is_not_computed_is_named_and_counted(gfor, day, tmp_path):
    """The only line splits the system; without a unit, the line can carry what the others share at two points only."""
    options = (
        "--scenario",
        "gfor",
        "--points",
        day,
        "--outages",
        "L,sg1",
        "--workers",
        "1",
        "--out",
        tmp_path / "out",
    )
    code, out, _ = gfor("screen", "two_area", *options, "--json", "--fail-unstable")
    found = json.loads(out)
    assert code == 1
    assert found["stable"] is None
    assert found["counts"] == {"computed": 7, "islanding": 5, "no power flow": 3}
    assert "2600 MW of load" in found["failures"][0]["why"]
    rows = (tmp_path / "out" / "items.csv").read_text().splitlines()
    assert len(rows) == 1 + 15


def test_an_error_of_ours_is_no_failure_of_an_fmu(gfor, day, tmp_path, monkeypatch):
    """The points beside it are computed, the place is named, and the command does not end as if all were well."""
    linearized = PointBench.linearized

    def slip(bench, name):
        if name == "gfor" and bench.perturbed > 4:
            raise IndexError("boolean index did not match")
        return linearized(bench, name)

    monkeypatch.setattr(PointBench, "linearized", slip)
    options = ("--scenario", "gfor", "--points", day, "--workers", "1", "--out", tmp_path / "out")
    code, out, error = gfor("screen", "two_area", *options)
    said = " ".join(error.split())
    assert code == 1
    assert "internal error: 3 of 5:" in said
    assert "IndexError at studies/operating_points/bench.py, line" in said
    assert "please report it" in said
    assert "FMU failed" not in out + error


def test_parts_merged_are_the_whole_to_the_last_bit(gfor, day, tmp_path, monkeypatch):
    monkeypatch.setattr(study, "STRETCH", 2)
    common = ("screen", "two_area", "--scenario", "gfor", "--points", day, "--workers", "1")
    assert gfor(*common, "--out", tmp_path / "whole")[0] == 0
    parts = [tmp_path / f"part{k}" for k in (1, 2)]
    for k, part in enumerate(parts, start=1):
        assert gfor(*common, "--shard", f"{k}/2", "--out", part)[0] == 0
        assert not (part / "items.csv").exists()
    code, out, _ = gfor(
        *common, "--out", tmp_path / "merged", "--merge", parts[0], "--merge", parts[1]
    )
    assert code == 0
    assert "0 items computed, 5 were there already" in " ".join(out.split())
    for name in ("items.csv", "modes.csv", "screening.json"):
        assert (tmp_path / "merged" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


@pytest.mark.parametrize(
    ("count", "lengths"),
    [(1, [1]), (12, [12]), (21, [10, 11]), (96, [48, 48]), (100, [33, 33, 34])],
)
def test_two_cores_have_work(count, lengths):
    """Stretches are of one length, whoever computes them, and none is lost."""
    items = [study.Item(k, 0, {}, (), ()) for k in range(count)]
    parts = list(study._stretches(items))
    assert list(map(len, parts)) == lengths
    assert [item for part in parts for item in part] == items


def test_a_part_without_a_stretch_is_merged(gfor, day, tmp_path):
    """Up to 12 points with outages form one stretch, so the second part of two has nothing to compute."""
    common = ("screen", "two_area", "--scenario", "gfor", "--points", day, "--workers", "1")
    parts = [tmp_path / f"part{k}" for k in (1, 2)]
    for k, part in enumerate(parts, start=1):
        assert gfor(*common, "--shard", f"{k}/2", "--out", part)[0] == 0
    code, out, _ = gfor(
        *common, "--out", tmp_path / "merged", "--merge", parts[0], "--merge", parts[1]
    )
    assert code == 0
    assert "0 items computed, 5 were there already" in " ".join(out.split())


def test_modes_are_followed_over_stretches(two_area, day, tmp_path, monkeypatch):
    monkeypatch.setattr(study, "STRETCH", 2)
    result = screened(
        plan_screening(two_area[0], ScreeningRequest(day, None, "gfor")), tmp_path / "points"
    )
    assert len(result.plan.tasks) == 3
    assert len(Summary(result).modes) == 1


def test_a_unit_out_of_service_leaves_no_modes(two_area, tmp_path):
    """Left in the model, a machine that feeds nothing would swing alone."""
    case, _, _ = two_area
    path = tmp_path / "points.csv"
    path.write_text("name,gfor.in_service,grid.load_2.P\nout,0,1250 MW\n")
    result = screened(
        plan_screening(case, ScreeningRequest(path, None, "gfor")), tmp_path / "points"
    )
    (prepared,) = case.prepare(["base"])
    expected = compute_modes(prepared)
    (item,) = result.items
    assert item.record.stable is False
    assert not any(name == "gfor" for name in item.record.shares)
    found = item.record.eigenvalues[item.record.critical[0]]
    (reference,) = [m.eigenvalue for m in find_modes(expected.system) if m.damping_ratio <= 0.2]
    assert found == pytest.approx(reference, rel=1e-5)


def test_an_unstable_point_fails_where_asked(gfor, tmp_path):
    path = tmp_path / "points.csv"
    path.write_text("name,gfor.in_service,grid.load_2.P\nin,1,\nout,0,1250 MW\n")
    options = ("--scenario", "gfor", "--points", path, "--workers", "1", "--out", tmp_path / "out")
    code, out, _ = gfor("screen", "two_area", *options, "--fail-unstable")
    assert code == 1
    assert out.startswith("UNSTABLE: at 1 of 2 points and outages; worst: out, intact")
    assert "Least damping [%]" in out
    assert gfor("screen", "two_area", *options)[0] == 0
    path.write_text("name,gfor.in_service\nin,1\n")
    code, out, _ = gfor("screen", "two_area", *options)
    assert code == 0
    assert "Least damping [%]" not in out  # of one item the headline and the modes say all


def test_reset_fmus_are_as_new(two_area):
    case, first, _ = two_area
    (second,) = case.prepare(["gfor"], {"grid.X_L": 0.3})
    with PointBench() as bench:
        bench.master(first)
        used = {name: bench.linearized(name).A_c for name in bench.master(second).components}
    with PointBench() as bench:
        fresh = {name: bench.linearized(name).A_c for name in bench.master(second).components}
    assert all(np.array_equal(used[name], fresh[name]) for name in fresh)


def test_only_fmus_of_ours_serve_the_next_point(two_area, monkeypatch):
    """Exports of a well-known tool stand still after fmi2Reset."""
    _, prepared, _ = two_area
    with PointBench() as bench:
        first = bench.master(prepared)
        assert bench.master(prepared) is first
        monkeypatch.setattr(
            "orchestrator.studies.operating_points.bench.is_ours",
            lambda path: "gfor" not in path.name,
        )
        assert bench.master(prepared) is not first


def test_equal_components_are_linearised_once(two_area):
    _, prepared, _ = two_area
    with PointBench() as bench:
        for _ in range(2):
            for name in bench.master(prepared).components:
                bench.linearized(name)
        assert (bench.perturbed, bench.reused) == (4, 4)


@pytest.mark.parametrize("text", ["0/2", "3/2", "1", "a/b"])
def test_a_wrong_part_is_refused(gfor, day, text):
    code, _, error = gfor("screen", "two_area", "--points", day, "--shard", text)
    assert code == 2
    assert "no part of a whole" in error


def test_parts_cover_the_whole():
    parts = [Shard.parse(f"{k}/3") for k in (1, 2, 3)]
    assert [[part.has(k) for part in parts].count(True) for k in range(10)] == [1] * 10


def test_a_folder_without_points_cannot_be_merged(day, tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    options = [
        "--points",
        str(day),
        "--merge",
        str(tmp_path / "empty"),
        "--out",
        str(tmp_path / "out"),
    ]
    assert main(["screen", "two_area", *options]) == 2
    assert "no points are kept there" in capsys.readouterr().err


def test_a_one_closes_what_the_case_has_open(two_area, tmp_path, monkeypatch):
    """Line and unit; what is closed already gets no value, and a load off by its scale needs that."""
    case, prepared, elements = two_area
    (opened,) = case.prepare(
        ["gfor"], {"grid.gfor.connected": False, "gfor.connected": False, "grid.load_2.P": 1250.0}
    )
    path = tmp_path / "points.csv"
    path.write_text("name,gfor.in_service,L.in_service\na,1,1\nb,0,1\nc,,\n")
    a, b, c = read_points(path, opened, elements)
    assert (a.values, a.out) == ({"grid.gfor.connected": True, "gfor.connected": True}, ())
    assert (b.values, b.out) == ({}, ("gfor",))
    assert (c.values, c.out) == ({}, ())
    assert read_points(path, prepared, elements)[0].values == {}
    plan = prepared.system.components["grid"]
    dark = replace(plan, parameters=plan.parameters | {"load_2.scale": 0.0})
    monkeypatch.setitem(prepared.system.components, "grid", dark)
    path.write_text("name,load_2.in_service\na,1\n")
    with pytest.raises(InputError, match="scale of 0"):
        read_points(path, prepared, elements)


def test_a_stretch_whose_end_fails_is_counted_at_its_last_point(
    two_area, day, tmp_path, monkeypatch
):
    """Growth that only the count sees must not be lost behind items without modes."""
    monkeypatch.setattr(modes, "DENSE", 0)
    monkeypatch.setattr(study, "FEW", 0)
    result = screened(
        plan_screening(two_area[0], ScreeningRequest(day, "L", "gfor")), tmp_path / "points"
    )
    assert result.items[-1].record.status is Status.ISLANDING
    computed = [item.record for item in result.items if item.record.status is Status.COMPUTED]
    assert computed[0].counted
    assert computed[-1].counted
    assert {record.zeros for record in computed if record.counted} == {1}


@pytest.mark.parametrize(
    ("few", "fewest", "most", "between"),
    [(0, 0, 4000, False), (500, 0, 4000, True), (500, 0, 5, False), (500, 24, 5, True)],
)
def test_growth_is_counted_everywhere_where_points_are_few(
    few, fewest, most, between, two_area, day, tmp_path, monkeypatch
):
    """Of many points, fewer of a large system, those between a stretch's ends are followed: no verdict is stable."""
    monkeypatch.setattr(modes, "DENSE", 0)
    for name, value in {"FEW": few, "FEWEST": fewest, "MOST_COUNTED": most}.items():
        monkeypatch.setattr(study, name, value)
    result = screened(
        plan_screening(two_area[0], ScreeningRequest(day, None, "gfor")), tmp_path / "points"
    )
    done = [item.record for item in result.items if item.record.status is Status.COMPUTED]
    assert len(done) == len(result.items) > 2
    assert [one.counted for one in done] == [True, *[between] * (len(done) - 2), True]
    assert Summary(result).stable is (True if between else None)


@pytest.mark.parametrize("clocks", [0, 1, 3, 7])
@pytest.mark.parametrize("others", [(3.0, 5.0, 40.0), (3.0, 5.0, 40.0, 60.0, 80.0, 100.0)])
def test_slow_growth_beside_zero_and_second_zeros_are_found(clocks, others):
    """Both hide from the count of what grows faster than 0.002 1/s, and must hide neither behind many clocks nor
    behind an imaginary part of rounding.
    """
    blocks = [
        np.diag([0.0, 0.0, 1e-3 + 5e-4, -1.0]),
        *([[-w / 5, w], [-w, -w / 5]] for w in others),
    ]
    A = scipy.linalg.block_diag(*blocks, np.zeros((clocks, clocks)))
    A[:3, 3] = 0.5, 0.2, 0.5  # what nothing drives would be a clock
    model = LinearModel.from_matrix(A, tuple(f"x{k}" for k in range(len(A))), None)
    known = ModeSet(
        np.zeros(0, complex),
        np.zeros((0, len(A)), complex),
        np.zeros((0, len(A)), complex),
        model.names,
    )
    assert modes._near_zero(model, known) == (2, 1)


def test_a_part_ends_as_the_whole_does(gfor, day, tmp_path, monkeypatch):
    monkeypatch.setattr(study, "STRETCH", 6)
    common = (
        "screen",
        "two_area",
        "--scenario",
        "gfor",
        "--points",
        day,
        "--workers",
        "1",
        "--outages",
        "L",
    )
    codes = {}
    for part in ("1/2", "3/3"):
        for option in ((), ("--fail-unstable",)):
            out = tmp_path / (part.replace("/", "_") + str(len(option)))
            codes[part, *option] = gfor(*common, "--shard", part, "--out", out, *option)[0]
    assert codes == {
        ("1/2",): 0,
        ("1/2", "--fail-unstable"): 1,
        ("3/3",): 0,
        ("3/3", "--fail-unstable"): 0,
    }


@pytest.mark.slow
def test_a_dask_cluster_screens_what_one_process_does(two_area, day, tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(study, "STRETCH", 2)
    plan = plan_screening(two_area[0], ScreeningRequest(day, None, "gfor"))
    alone = screened(plan, tmp_path / "alone")
    # a worker in a thread, which is sent everything; `tests/studies/sweep/test_sweep.py` has one in a process
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol="tcp", dashboard_address=None
    ) as cluster:
        together = run_screening(
            plan, Work(DaskCluster(cluster.scheduler_address), PointStore(tmp_path / "together"))
        )
    assert together.computed == alone.computed == 5
    for one, other in zip(alone.items, together.items, strict=True):
        assert one.record.eigenvalues.tobytes() == other.record.eigenvalues.tobytes()
        assert one.trajectories == other.trajectories


def test_a_stabiliser_whose_limits_lie_within_the_perturbation_is_linear_nearer_by():
    """Planted: a lead so steep that the usual perturbation of a speed runs into both limits of its output."""
    case, steep = load_case("brazil7"), {"sg*.pss.T_1": 9.0, "sg*.pss.T_2": 0.005}
    (prepared,) = case.prepare(["pss"], steep)
    found = compute_modes(prepared)
    assert "linear for small changes only" in " ".join(found.warnings)
    with PointBench() as bench:
        bench.master(prepared)
        least = least_damped_first(find_modes(bench.linear_model().model))[0]
    assert least.eigenvalue == pytest.approx(
        least_damped_first(found.modes)[0].eigenvalue, rel=5e-3
    )
