"""Runs, tables of phasors and the contest's folders, with what is wrong in them."""

import json
import re
from dataclasses import replace
from html import escape

import numpy as np
import pytest

from orchestrator import source
from orchestrator.core.errors import InputError
from orchestrator.studies.oscillations.measurements import Site
from orchestrator.studies.oscillations.reading import _table, contest_cases, read_contest
from orchestrator.studies.oscillations.signs import other_powers, turned_signs
from orchestrator.studies.oscillations.verdict import locate
from orchestrator.studies.oscillations.view import Sources
from tests.support.forced_records import model, record, sine, times_of, unit_models_of
from tests.support.scenarios import prepare_one

TIMES = times_of(40.0)


@pytest.fixture(scope="module")
def measured():
    return record("two_area", {"sg1.governor.delta_P_ref": sine(TIMES, 0.8, 0.02)}, times=TIMES)


def csv(
    path, measured, *, units=("pu", "deg", "MW", "Mvar"), scale=(1, 57.29577951308232, 100, 100)
):
    columns = {"time [s]": measured.times}
    for place in measured.places:
        signals = {"vm": "v", "va": "angle", "p": "p", "q": "q"}
        for (what, signal), unit, factor in zip(signals.items(), units, scale, strict=True):
            columns[f"{place.name}.{what} [{unit}]"] = factor * getattr(place, signal)
    np.savetxt(
        path,
        np.column_stack(list(columns.values())),
        delimiter=",",
        header=",".join(columns),
        comments="",
    )
    return path


def test_phasors_in_csv(gfor, tmp_path, measured):
    code, out, _ = gfor("signal", "source", csv(tmp_path / "pmu.csv", measured), "--json")
    found = json.loads(out)
    assert code == 0
    (one,) = found["oscillations"]
    assert (one["drives"], one["source"]) == ("sg1", None)  # without a case it may not be alone
    assert one["kind"] == "forced"
    assert one["frequency_hz"] == pytest.approx(0.8, abs=2e-3)
    assert {m["method"] for m in one["methods"]} == {
        "dissipating energy flow",
        "dynamic-mode participation",
        "Q-V phase",
    }


def test_degrees_that_are_labelled_rad_are_remarked(gfor, tmp_path, measured):
    """Every second bus 9 degrees ahead, written as 9 rad; radians, wrapped or not, are not remarked."""
    ahead = tuple(replace(place, angle=place.angle + np.deg2rad(9.0)) for place in measured.places)
    turned = replace(measured, places=ahead)
    for scale, remarked in ((57.29577951308232, True), (1.0, False)):
        units, scales = ("pu", "rad", "MW", "Mvar"), (1, scale, 100, 100)
        path = csv(tmp_path / "pmu.csv", turned, units=units, scale=scales)
        _, out, _ = gfor("signal", "source", path, "--json")
        remarks = " ".join(json.loads(out)["remarks"])
        assert ("are they in degrees? Write [deg]" in remarks) == remarked


def test_a_power_with_the_sign_turned_beside_the_case_is_remarked(measured):
    prepared = prepare_one("two_area", "gfor")
    assert not turned_signs(measured, prepared)
    places = tuple(
        replace(place, p=-place.p, q=-place.q) if place.name == "sg1" else place
        for place in measured.places
    )
    (remark,) = turned_signs(replace(measured, places=places), prepared).values()
    power = prepared.power_flow.powers["sg1"].real * prepared.system.components["sg1"].number("S_n")
    assert remark.startswith("sg1: its P is -")
    assert f"{power:+.4g} MW in the case" in remark


def asked_of(gfor, path):
    """Remarks on a record beside the case that it is of."""
    _, out, _ = gfor("signal", "source", path, "--case", "two_area", "--scenario", "gfor", "--json")
    return json.loads(out)["remarks"]


def test_units_that_the_case_contradicts_are_asked_about(gfor, tmp_path, measured):
    """MW in columns of kW, kW in columns of MW, and small radians in columns of degrees, which jump nowhere."""
    degrees = 57.29577951308232
    honest = asked_of(gfor, csv(tmp_path / "honest.csv", measured))
    assert not any("?" in remark for remark in honest)
    for units, powers, words in (
        (("kW", "kvar"), 100, "a 1000th of it: is the column labelled kW and in MW?"),
        (("MW", "Mvar"), 1e5, "1000 times as much: is the column labelled MW and in kW?"),
    ):
        path = csv(
            tmp_path / "p.csv",
            measured,
            units=("pu", "deg", *units),
            scale=(1, degrees, powers, powers),
        )
        asked = [remark for remark in asked_of(gfor, path) if words in remark]
        assert {remark.partition(":")[0] for remark in asked} == {"sg1", "sg2", "gfor"}
    path = csv(tmp_path / "angles.csv", measured, scale=(1, 1.0, 100, 100))
    (asked,) = [remark for remark in asked_of(gfor, path) if "57.3 times" in remark]
    assert "are columns labelled [deg] in radians? Then write [rad] behind their names" in asked
    assert "0.1 degrees in the record and to 5.74 in the case" in asked


def test_a_whole_record_has_no_remark(tmp_path, measured):
    assert not source(csv(tmp_path / "pmu.csv", measured)).remarks


@pytest.mark.parametrize(
    ("old", "new", "remarks"),
    [
        (
            "sg1.vm",
            "sg1.vmm",
            ["the column 'sg1.vmm' is not used: is 'sg1.vm' meant?", "sg1: left out, without .vm"],
        ),
        (
            "sg1.q",
            "sg1.mvar",
            ["the column 'sg1.mvar' is not used: is 'sg1.q' meant?", "sg1: left out, without .q"],
        ),
        (
            "sg1.va",
            "sgl.va",
            [
                "sg1: left out, without .va; is 'sgl' meant?",
                "sgl: left out, without .vm and .p and .q; is 'sg1' meant?",
            ],
        ),
        (
            "sg1.p",
            "frequency",
            [
                "1 columns are not used, as their names do not end in .vm, .va, .im, .ia, .p or .q: 'frequency'",
                "sg1: left out, without .p",
            ],
        ),
    ],
)
def test_a_column_that_is_not_used_is_named(tmp_path, measured, old, new, remarks):
    """Without one signal a place is not there, and that is said."""
    path = csv(tmp_path / "pmu.csv", measured)
    path.write_text(path.read_text().replace(f",{old} [", f",{new} [", 1))
    found = source(path)
    assert "sg1" not in found.places
    assert list(found.remarks) == remarks


def test_a_bus_whose_voltage_a_line_uses_is_not_left_out(tmp_path, measured):
    path = csv(tmp_path / "pmu.csv", measured)
    text = path.read_text().replace("sg1.p [", "sg1->hub.p [").replace("sg1.q [", "sg1->hub.q [")
    path.write_text(text)
    found = source(path)
    assert "sg1->hub" in found.places
    assert not found.remarks


@pytest.mark.parametrize(
    ("change", "meaning"),
    [
        (lambda s: s.conjugate(), "is the sign of its Q turned?"),
        (lambda s: complex(s.imag, s.real), "are its P and Q exchanged?"),
        (lambda s: 100 * s, "is it in MW where pu are written?"),
        (lambda s: 1.3 * s, "is the record of another hour"),
    ],
)
def test_a_unit_that_its_model_does_not_judge_is_named(measured, change, meaning):
    """A unit of the case that feeds 3 + 1j on 100 MVA, beside a record that has another power of it."""
    whole, wanted = unit_models_of(model("two_area")), 3.0 + 1.0j
    assert not other_powers(measured, whole)
    unit = whole.units["sg1"]
    other = replace(unit, current=np.conj(wanted / unit.voltage))
    models = replace(whole, units={**whole.units, "sg1": other})

    def changed(place):
        power = change(wanted)
        return replace(place, p=place.p * 0 + power.real, q=place.q * 0 + power.imag)

    places = tuple(changed(p) if p.name == "sg1" else p for p in measured.places)
    (remark,) = other_powers(replace(measured, places=places), models)
    assert remark.startswith("sg1: its own model does not judge it, since its power is ")
    assert "+300 MW, +100 Mvar in the case" in remark
    assert meaning in remark
    assert not other_powers(replace(measured, places=places), models, {"sg1"})


def test_the_page_shows_where_energy_flows(gfor, tmp_path, measured):
    """A line is an arrow from the bus that feeds to the one beyond, whichever way it was measured."""
    fed = next(x for x in measured.places if x.name == "sg1")
    for sign in (
        1,
        -1,
    ):  # all that sg1 feeds leaves its bus; the other way round, all comes from beyond
        away = Site(
            "line", "branch", fed.bus, fed.v, fed.angle, -sign * fed.p, -sign * fed.q, "<beyond>"
        )
        page = Sources(
            replaced := replace(measured, places=(*measured.places, away)), locate(replaced)
        ).html()
        arrow = f"{fed.bus} → <beyond>" if sign > 0 else f"<beyond> → {fed.bus}"
        assert escape(f"{arrow}: 100 %") in page
    code, _, _ = gfor(
        "signal", "source", csv(tmp_path / "pmu.csv", measured), "--html", tmp_path / "page.html"
    )
    text = (tmp_path / "page.html").read_text()
    assert code == 0
    assert all(
        part in text
        for part in ("map of energy flows", "Amplitude over the time", "Mean power of all signals")
    )
    assert re.search(r'<b class="bad">[\d.]+ Hz: a forced oscillation, sg1 drives it</b>', text)


def test_the_first_screen_is_the_answer(gfor, tmp_path, measured):
    code, out, _ = gfor("signal", "source", csv(tmp_path / "pmu.csv", measured), "--details")
    assert code == 0
    assert "forced" in out
    assert "sg1 feeds 100 % of it" in out
    assert "hold the references of sg1" in out


@pytest.mark.parametrize(
    ("units", "said"),
    [
        (("pu", "", "MW", "Mvar"), "deg"),
        (("pu", "deg", "MW", "pu"), "some powers are in pu"),
        (("pu", "deg", "m", "Mvar"), "MW or pu"),
    ],
)
def test_units_that_do_not_fit_are_refused(gfor, tmp_path, measured, units, said):
    code, _, error = gfor("signal", "source", csv(tmp_path / "pmu.csv", measured, units=units))
    assert code == 2
    assert said in error


def test_a_record_without_phasors_is_told_what_it_needs(gfor, tmp_path):
    file = tmp_path / "f.csv"
    file.write_text("time,f\n" + "".join(f"{0.02 * k},50\n" for k in range(100)))
    code, _, error = gfor("signal", "source", file)
    assert code == 2
    assert "NORTH.vm [pu]" in error


def contest(folder, measured, *, double=True):
    """A case as the contest has it: voltages, and the current of one line at each bus; a discontinuity twice."""
    folder.mkdir(parents=True)
    rows = (
        np.sort(np.r_[0 : len(measured.times), 300]) if double else np.arange(len(measured.times))
    )
    kept = {}
    for number, place in enumerate(p for p in measured.places if p.name != "gfor"):
        bus = f"{100 + number}|{place.name.upper()}    20.0"
        current = np.conj((place.p + 1j * place.q) / (place.v * np.exp(1j * place.angle)))
        line = f"{bus}|200|HUB       400.|1"
        wrapped = np.rad2deg(np.angle(np.exp(1j * place.angle)))
        for name, column, values in (
            ("BusVolMag", bus, place.v),
            ("BusVolAng", bus, wrapped),
            ("LinCurMag", line, np.abs(current)),
            ("LinCurAng", line, np.rad2deg(np.angle(current))),
        ):
            kept.setdefault(name, {})[column] = values[rows]
    for name, columns in kept.items():
        header = " ".join(f"'{column}'" for column in ("Time", *columns))
        table = np.column_stack([measured.times[rows], *columns.values()])
        np.savetxt(folder / f"{name}.txt", table, header=header, comments="")
    return folder


def test_a_folder_of_the_contest(gfor, tmp_path, measured):
    for case in ("Case1", "Case2", "Case10"):
        contest(tmp_path / "cases" / case, measured)
    code, out, _ = gfor("signal", "source", "--contest", tmp_path / "cases", "--json")
    assert code == 0
    found = json.loads(out)
    assert [one["record"] for one in found] == ["Case1", "Case2", "Case10"]
    for one in found:
        assert "written twice" in one["remarks"][0]
        assert one["oscillations"][0]["drives"] == "100|SG1 20.0"


def test_what_is_no_case_of_the_contest(tmp_path, measured):
    with pytest.raises(InputError, match="neither it nor a folder in it"):
        contest_cases(tmp_path)
    folder = contest(tmp_path / "Case1", measured)
    lines = (folder / "LinCurAng.txt").read_text().splitlines()
    (folder / "LinCurAng.txt").write_text("\n".join(lines[:-1]))
    with pytest.raises(InputError, match="times are not those"):
        read_contest(folder)
    (folder / "BusVolMag.txt").write_text("'Time' '1|A'\n0 1 2\n")
    with pytest.raises(InputError, match="2 names in quotes stand above 3 columns"):
        read_contest(folder)


def test_neither_or_both_are_refused(gfor, tmp_path):
    assert gfor("source")[0] == 2
    assert gfor("signal", "source", tmp_path, "--contest", tmp_path)[0] == 2


@pytest.mark.parametrize(
    ("part", "rule"),
    [
        (("--start", "50"), "start = 50.0: the record of {} ends at t = "),
        (("--start", "20", "--stop", "10"), "stop = 10.0: it must come after start"),
        (("--start", "10.001", "--stop", "10.002"), "0 samples"),
    ],
)
def test_a_part_of_a_record_without_samples(gfor, tmp_path, measured, part, rule):
    path = csv(tmp_path / "pmu.csv", measured)
    code, _, err = gfor("signal", "source", path, *part)
    assert code == 2
    assert err.count("error:") == 1
    assert rule.format(path) in err


def test_a_table_of_the_contest_may_have_one_column(tmp_path):
    path = tmp_path / "one.txt"
    path.write_text("'Time' '1|A'\n0 1\n0.1 2\n", encoding="utf-8")
    times, columns = _table(path)
    assert (times.tolist(), {n: x.tolist() for n, x in columns.items()}) == (
        [0.0, 0.1],
        {"1|A": [1.0, 2.0]},
    )
    path.write_text("'Time'\n0\n0.1\n", encoding="utf-8")
    with pytest.raises(InputError, match="1 names in quotes"):
        _table(path)
