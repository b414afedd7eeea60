"""Grid-following converters and REGFM_A1 in cases: in the place of the grid-forming converter, and beside it."""

import tomllib

import pytest
import tomli_w

import orchestrator as gfor
from tests.pages.markdown import ROOT, blocks
from tests.support.printed import eigenvalue, in_markdown, value

GUIDE = ROOT / ".docs" / "how-to" / "grid-forming-among-grid-following.md"
CASES = ROOT / "orchestrator" / "cases" / "built_in"


def changed(name, tmp_path, change):
    """A built-in case with another table, as a file of its own."""
    tables = tomllib.loads((CASES / name / "case.toml").read_text(encoding="utf-8"))
    change(tables)
    path = tmp_path / "case.toml"
    path.write_text(tomli_w.dumps(tables), encoding="utf-8")
    return gfor.load(path)


def only_gfor(tables):
    """Leave out what only other scenarios or POD controllers have."""
    tables["scenarios"] = {"gfor": tables["scenarios"]["gfor"]}
    tables.pop("reference", None)
    tables.pop("plots")


def electromechanical(scenario):
    """Eigenvalue [rad/s] of the case's named mode."""
    (mode,) = scenario.modes().named.values()
    return mode.eigenvalue


def guide_case(tmp_path):
    (case,) = (block for block in blocks(GUIDE) if block.kind == "file")
    path = tmp_path / case.path
    path.write_text(case.text, encoding="utf-8")
    return gfor.load(path)


def test_it_takes_the_place_of_the_grid_forming_converter_in_two_area(tmp_path):
    """The same power flow; but what it holds is P and Q, and the mode is no longer damped."""

    def following(tables):
        tables["components"]["gfor"]["model"] = "gfl"
        only_gfor(tables)

    found = electromechanical(changed("two_area", tmp_path, following).scenario("gfor"))
    assert found == pytest.approx(0.1219 + 3.2430j, abs=2e-4)


@pytest.mark.parametrize(
    ("model", "wanted"), [("gfl_phasor", 0.1313 + 3.2429j), ("regfm_a1_phasor", -2.0546 + 4.8508j)]
)
def test_phasor_models_take_its_place_in_two_area_rms(model, wanted, tmp_path):
    def replaced(tables):
        tables["components"]["gfor"]["model"] = model
        only_gfor(tables)

    modes = changed("two_area_rms", tmp_path, replaced).scenario("gfor").modes()
    found = [complex(row.real, row.imag) for row in modes.table().itertuples()]
    assert min(abs(value - wanted) for value in found) < 2e-3
    assert set(modes.named) == {"electromechanical"} or "fit it about equally" in modes.warnings[0]


@pytest.mark.slow
def test_units_may_have_grid_following_converters(tmp_path):
    def following(tables):
        tables["units"] |= {"converter": "gfl", "file": str(CASES / "ieee39" / "units.csv")}
        only_gfor(tables)
        tables["solver"]["record"] = ["sg*.omega", "gfor*.omega"]

    mode = electromechanical(changed("ieee39", tmp_path, following).scenario("gfor"))
    assert -100 * mode.real / abs(mode) == pytest.approx(5.4, abs=0.05)


@pytest.mark.slow
def test_the_guide_shows_what_is_computed(tmp_path):
    case = guide_case(tmp_path)
    rows = {
        row[0]: row[1:]
        for table in in_markdown(GUIDE.read_text(encoding="utf-8"))
        for row in table[1:]
    }
    assert list(rows) == [case.scenario(name).title for name in case.scenarios]
    for name in case.scenarios:
        found = electromechanical(case.scenario(name))
        shown, damping = rows[case.scenario(name).title]
        assert eigenvalue(shown) == pytest.approx(found, abs=6e-4)
        assert value(damping) == pytest.approx(-100 * found.real / abs(found), abs=6e-3)
    for mode, damping in ((1, -0.87), (2, -0.86)):
        found = electromechanical(case.scenario("following", {"gfl.reactive_power.mode": mode}))
        assert -100 * found.real / abs(found) == pytest.approx(damping, abs=6e-3)


def test_a_run_of_the_guides_case_rests_until_its_event(tmp_path):
    run = guide_case(tmp_path).scenario("mixed").run(stop=1.02)
    power = run.signal("gfl.p").values
    before = run.signal("gfl.p").time.values < 1.0
    assert abs(power[before] - 0.9).max() < 1e-9
    assert abs(power[~before] - 0.9).max() > 1e-4
