"""The units' own linear models as judges: what would make them wrong in silence ends in the right place or in none."""

import json
from dataclasses import replace

import numpy as np
import pytest

import orchestrator as gfor_api
from orchestrator.core.file_hashes import sha256_of
from orchestrator.studies.oscillations.models import OWN_MODEL, UnitModels
from orchestrator.studies.oscillations.reading import measurements_of
from orchestrator.studies.oscillations.unit_models import unlike
from orchestrator.studies.oscillations.verdict import locate
from tests.studies.oscillations.test_planted import TIMES, at, late, turned
from tests.studies.oscillations.test_reading import csv
from tests.support.forced_records import model, record, sine, times_of, unit_models_of

NOISE = {"loads": 5e-4, "measuring": 5e-5}


def source_of(case, *references, **further):
    return answer(case, *references, **further).source


def answer(case, *references, frequency=0.8, models=None, **further):
    inputs = {reference: sine(TIMES, frequency, 0.02) for reference in references}
    found = locate(
        record(case, inputs, times=TIMES, **further), models or unit_models_of(model(case))
    )
    return at(found, frequency)


@pytest.mark.parametrize("frequency", [0.3, 0.5817])
@pytest.mark.parametrize(
    "reference", ["sg1.exciter.delta_V_ref", "sg2.exciter.delta_V_ref", "gfor.droop.delta_U_ref"]
)
def test_where_energy_flow_fails_the_models_find_the_unit(reference, frequency):
    assert (
        source_of("two_area", reference, frequency=frequency, **NOISE)
        == reference.partition(".")[0]
    )


@pytest.mark.parametrize(("case", "load"), [("two_area", "grid.load_3"), ("ieee39", "grid.load_4")])
def test_a_load_that_swings_is_no_unit(case, load):
    assert source_of(case, f"{load}.scale", **NOISE) == load


def test_a_unit_that_is_not_observed_is_named_with_what_stands_at_its_bus():
    half = sorted(set(model("ieee39").buses))[1::2]
    assert (
        source_of("ieee39", "sg33.governor.delta_P_ref", without=half, **NOISE) == "sg33 or gfor33"
    )
    # one bus cannot tell
    assert source_of("two_area", "sg2.governor.delta_P_ref", without=("bus_3",)) is None


@pytest.mark.parametrize("without", [(), ("bus_30",), ("bus_37",)])
def test_two_sources_are_not_one(without):
    drives = "sg33.governor.delta_P_ref", "gfor37.droop.delta_U_ref"
    assert source_of("ieee39", *drives, without=without) is None


@pytest.mark.parametrize("unit", ["gfor", "sg1", "all"])
@pytest.mark.parametrize(("p", "q"), [(True, True), (True, False), (False, True)])
def test_wrong_signs(unit, p, q):
    for reference in ("gfor.droop.delta_P_ref", "sg1.exciter.delta_V_ref"):
        assert source_of("two_area", reference, change=turned(unit, p, q)) in (
            None,
            reference.partition(".")[0],
        )


def test_a_clock_that_is_off():
    for seconds, signals in (
        (1e-3, ("v", "angle", "p", "q")),
        (1e-3, ("p", "q")),
        (0.03, ("angle",)),
    ):
        for unit in ("sg1", "sg2"):
            found = source_of(
                "two_area", "sg1.exciter.delta_V_ref", change=late(unit, seconds, signals)
            )
            assert found in ((None, "sg1") if seconds > 1e-3 else ("sg1",))


def worse(models, size, seed):
    """Models whose elements are off by some part."""
    rng = np.random.default_rng(seed)

    def off(response):
        factors = 1 + size * rng.standard_normal((2, 2))

        def changed(s):
            whole = response(s)
            return whole * np.tile(factors, (len(whole) // 2, 1))[:, : whole.shape[1]]

        return changed

    units = {
        n: replace(u, admittance=off(u.admittance), reach=off(u.reach))
        for n, u in models.units.items()
    }
    return UnitModels(units, models.buses, {name: off(load) for name, load in models.loads.items()})


def test_models_that_are_a_fifth_off_name_no_other_unit():
    models = unit_models_of(model("two_area"))
    found = [
        (
            answer("two_area", r, models=worse(models, 0.2, seed), **NOISE).drives,
            r.partition(".")[0],
        )
        for seed, r in enumerate(model("two_area").references)
    ]
    assert all(name in (None, unit) for name, unit in found)
    assert sum(name == unit for name, unit in found) >= 3


def test_a_machine_at_another_operating_point_is_not_judged_by_its_model():
    models = unit_models_of(model("two_area"))
    elsewhere = {
        name: replace(unit, current=1.2 * unit.current) for name, unit in models.units.items()
    }
    measured = record("two_area", {"sg1.governor.delta_P_ref": sine(TIMES, 0.8, 0.02)}, times=TIMES)
    found = at(locate(measured, replace(models, units=elsewhere)), 0.8)
    own = next(o for o in found.opinions if o.method == OWN_MODEL)
    assert not own.applies
    assert (found.drives, found.source) == ("sg1", None)  # the other methods agree


def test_a_swing_that_only_the_machine_itself_shows_is_found_in_the_noise_of_loads():
    """In the mean of all signals, and in the voltages, it drowns."""
    inputs = {"sg38.governor.delta_P_ref": sine(TIMES, 0.4, 0.006)}
    measured = record("ieee39", inputs, times=TIMES, loads=2e-3, measuring=5e-5)
    found = at(locate(measured, unit_models_of(model("ieee39"))), 0.4)
    assert found.drives == "sg38"
    assert found.found.clear < 4
    assert "the rest being noise" in found.reason


def test_noise_of_a_load_that_explains_the_voltages_forces_nothing():
    measured = record("two_area", {}, times=times_of(60.0), loads=5e-3, measuring=5e-5, seed=5062)
    found = locate(measured, unit_models_of(model("two_area")))
    assert all(x.evidence.kind != "forced" and x.drives is None for x in found)


def test_noise_alone_has_no_source():
    for name in ("two_area", "ieee39"):
        found = locate(
            record(name, {}, loads=0.002, measuring=5e-5, times=TIMES), unit_models_of(model(name))
        )
        assert all(x.source is None for x in found)


@pytest.fixture(scope="module")
def run():
    scenario = gfor_api.load("two_area_rms").scenario("gfor", force="sg1.exciter.V_ref 0.8 Hz 2 %")
    return scenario.run(stop=20.0)


def test_a_run_is_compared_with_the_models_of_its_own_case(run, gfor, tmp_path):
    (found,) = run.source()
    assert found.opinions[0].method == OWN_MODEL
    assert found.source == "sg1"
    run.save(tmp_path)
    code, out, _ = gfor("signal", "source", tmp_path / "gfor", "--json")
    (one,) = json.loads(out)["oscillations"]
    assert (code, one["source"], one["methods"][0]["method"]) == (0, "sg1", OWN_MODEL)
    other = gfor_api.source(run.dataset, scenario=gfor_api.load("two_area_rms").scenario("pod_p"))
    assert other.remarks[-1].endswith("what differs: the scenario ('gfor', not 'pod_p')")
    assert not any("what differs" in remark for remark in run.source().remarks)
    assert not any(
        "--case" in remark or "judge nothing" in remark for remark in run.source().remarks
    )
    buses = run.dataset.rename(
        {name: name.replace("sg", "place") for name in run.dataset if name.startswith("sg")}
    )
    scenario = gfor_api.load("two_area_rms").scenario("gfor")
    remark = gfor_api.source(
        buses.drop_vars([n for n in buses if n.startswith("gfor")]), scenario=scenario
    ).remarks[0]
    assert (
        remark
        == "the case's models judge nothing: no signal is named after its units, gfor, sg1, sg2"
    )
    foreign = run.dataset.assign_attrs(case_file="name = 'mine'", inputs='{"mine.toml": "1a"}')
    first = gfor_api.source(foreign).remarks[0]
    assert first.endswith("the units' models decide: give --case mine.toml --scenario gfor")


def test_a_run_with_values_of_its_own_is_judged_by_models_with_them(tmp_path):
    """And beside models with other values, or of another case, the remark names what differs."""
    case = gfor_api.load("two_area_rms")
    run = case.scenario("gfor", {"gfor.P_0": 0.3}, force="sg1.exciter.V_ref 0.8 Hz 2 %").run(
        stop=20.0
    )
    run.save(tmp_path)
    (found,) = (sources := gfor_api.source(tmp_path / "gfor"))
    assert (found.source, sources.remarks) == ("sg1", ())
    for name, differs in (("two_area_rms", "gfor.P_0"), ("two_area", "the case file, gfor.P_0")):
        other = gfor_api.source(tmp_path / "gfor", scenario=gfor_api.load(name).scenario("gfor"))
        assert other.remarks[-1].endswith(f"what differs: {differs}")


def test_a_file_of_the_case_that_was_edited_since_the_run_is_told():
    prepared = gfor_api.load("kundur").scenario("gfor").prepared
    (name,) = (path.name for path in prepared.case.directory.glob("*.csv"))
    seen = sha256_of(prepared.case.directory / name)
    assert unlike({"inputs": json.dumps({name: seen, "gone.raw": "1a"})}, prepared) == ""
    assert unlike({"inputs": json.dumps({name: "1a"})}, prepared) == name


def test_a_table_of_phasors_is_compared_with_a_case(run, gfor, tmp_path):
    file = csv(tmp_path / "pmu.csv", measurements_of(run.dataset, "run"))
    file.write_text(file.read_text().replace("sg1.", "SG1."))  # as people write names
    given = ("--case", "two_area_rms", "--scenario", "gfor")
    code, out, _ = gfor("signal", "source", file, *given, "--json")
    (one,) = json.loads(out)["oscillations"]
    assert (code, one["source"], one["methods"][0]["method"]) == (0, "SG1", OWN_MODEL)
    code, out, _ = gfor(
        "signal", "source", file, "--case", "kundur", "--scenario", "gfor", "--json"
    )
    (other,) = json.loads(out)["oscillations"]
    assert "is not what the case has there" in other["reason"]
    assert other["methods"][-1]["applies"] is False
    own, text = tmp_path / "own.toml", gfor_api.load("two_area_rms").file.text
    own.write_text(text.replace('"5000 MVA",', '"5000 MVA", "machine.H" = 30.0,'))
    code, out, err = gfor("signal", "source", file, "--case", own, "--scenario", "gfor", "--json")
    assert err.count("question: ") == len(json.loads(out)["questions"]) == 1
    code, _, error = gfor("signal", "source", file, "--scenario", "gfor")
    assert code == 2
    assert "--case" in error
