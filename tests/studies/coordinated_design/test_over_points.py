"""One setting for many operating points: the search beside a scan, and the mistakes that the verdict must see."""

import json
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import scipy.linalg

from orchestrator.cases.case import load_case
from orchestrator.core.errors import InputError
from orchestrator.linear.spectra.continuation import ModesMeetError
from orchestrator.linear.spectra.modes import damping_ratio
from orchestrator.studies.coordinated_design import following, open_loops, point, study
from orchestrator.studies.coordinated_design.following import with_followed_names
from orchestrator.studies.coordinated_design.objective import Aim, RatedPoint, growth
from orchestrator.studies.coordinated_design.open_loops import PodPlace
from orchestrator.studies.coordinated_design.point import PointsRecord
from orchestrator.studies.coordinated_design.search import SettingSearch, ranked
from orchestrator.studies.coordinated_design.settings import SettingSpace
from orchestrator.studies.coordinated_design.study import (
    PointsDesignRequest,
    design_over_points,
    modes_at,
    plan_points_design,
    values_of,
)
from orchestrator.studies.coordinated_design.words import remarks, verdict_sentence
from orchestrator.studies.pod_design.closed_loop import PodSetting
from orchestrator.studies.pod_design.lead_lag import lead_lag_turning
from orchestrator.studies.points.executor import Serial
from orchestrator.studies.points.points import Work
from orchestrator.studies.points.store import PointStore
from tests.studies.screening.five_machines import five_machines

LINES = "name,grid.X_L,load\nshort,0.05,1\nusual,0.1,1\nlight,0.1,0.97\nlong,0.5,1\n"
ENDS = "name,grid.X_L,load\nshort,0.05,1\nlong,0.5,1\n"
P, Q = PodPlace("gfor", "pod_p"), PodPlace("gfor", "pod_q")


@pytest.fixture(scope="module")
def case():
    return load_case("two_area")


@pytest.fixture
def points(tmp_path):
    path = tmp_path / "points.csv"
    path.write_text(LINES)
    return path


@pytest.fixture
def planned(case, points):
    def plan(*controllers, outages=None, **wanted):
        return plan_points_design(
            case, PointsDesignRequest(points, controllers, outages, ranked=0, **wanted)
        )

    return plan


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """Points with open loops are computed once for all tests that leave the product as it is."""
    return PointStore(tmp_path_factory.mktemp("kept"))


@pytest.fixture
def own_store(tmp_path):
    return PointStore(tmp_path / "kept")


def rated_of(plan, found, largest=400.0):
    own = dict.fromkeys(plan.candidates, largest)
    return [
        RatedPoint(k, one.loops, plan.aim, own)
        for k, one in enumerate(found)
        if one.loops is not None
    ]


def near(values, low=0.5, high=30.0):
    """Eigenvalues of the upper half with a size in a range [rad/s], in one order."""
    chosen = [complex(z) for z in values if z.imag > 0.3 and low < abs(z) < high]
    return np.array(sorted(chosen, key=lambda z: (round(z.imag, 4), z.real)))


@pytest.mark.parametrize("name", ["two_area", "two_area_rms"])
def test_a_closed_loop_is_that_of_the_fmus(name, points, own_store, monkeypatch):
    """Gain and lead/lag laid over the measured loops give the eigenvalues that the FMUs have with these parameters.

    Phasor converters know the communication step, and their POD-Q acts on an output at once.
    """
    plan = plan_points_design(
        load_case(name), PointsDesignRequest(points, ("pod_p", "pod_q"), ranked=0)
    )
    setting = {
        P: PodSetting(90.0, lead_lag_turning(-40.0, 4.0, 2)),
        Q: PodSetting(150.0, lead_lag_turning(25.0, 3.0, 2)),
    }
    opened = modes_at(plan, plan.off, plan.candidates, Work(Serial(), own_store))
    closed = modes_at(
        plan, study.values_of(plan.groups, list(setting.values())), (), Work(Serial(), own_store)
    )
    for before, after in zip(opened, closed, strict=True):
        expected = near(after.values)
        assert len(expected) >= 4
        assert near(before.loops.eigenvalues(setting)) == pytest.approx(expected, rel=1e-6)
    whole = opened[0].loops
    monkeypatch.setattr(open_loops, "REDUCED", 10)
    reduced = open_loops.OpenLoops.of(whole.A, whole.U, whole.V, whole.places, whole.names)
    assert len(reduced.A) + len(reduced.rest) == len(whole.A) > len(reduced.A)
    exact, rough = (near(loops.eigenvalues(setting), 2.0, 8.0) for loops in (whole, reduced))
    assert rough == pytest.approx(exact, rel=2e-2)


def test_kept_points_are_those_that_were_computed(planned, own_store):
    plan = planned("pod_p")
    first = modes_at(plan, plan.off, plan.candidates, Work(Serial(), own_store))
    again = modes_at(plan, plan.off, plan.candidates, Work(Serial(), own_store))
    for one, other in zip(first, again, strict=True):
        assert np.array_equal(one.values, other.values)
        assert np.array_equal(one.loops.U, other.loops.U)
        assert replace(one, values=other.values, loops=None) == replace(other, loops=None)
    assert PointsRecord.restored({"points": [{}]}, {}) is None


@pytest.mark.slow
def test_the_design_is_not_worse_than_a_scan(planned, points, store):
    """The search against all combinations of turn, centre and gain on a grid, over all points."""
    points.write_text(ENDS)
    plan = planned("pod_p")
    rated = rated_of(plan, modes_at(plan, plan.off, plan.candidates, Work(Serial(), store)))
    space = SettingSpace(plan.groups, (0.0, 400.0), 3.6)
    search = SettingSearch(space, rated)
    grid = product(np.linspace(-120, 120, 17), (0.5, 1.0, 2.0, 4.0), np.geomspace(5, 400, 12))
    scanned = [search.tried(space.vector([turn], [centre], [gain])) for turn, centre, gain in grid]
    best = max((one.worth.worst for one in scanned if one.worth.allowed), default=-1.0)
    found = search.best()
    without = search.tried(space.vector([0.0], [1.0], [0.0]))
    assert found.worth.allowed
    assert found.worth.worst >= best - 1e-4
    assert found.worth.worst > without.worth.worst + 0.15
    assert found.steps > 0


@pytest.mark.slow
def test_two_controllers_are_not_worse_than_one(planned, points, store):
    points.write_text("name,grid.X_L\nlong,0.5\n")
    both, one = planned("pod_p", "pod_q"), planned("pod_p")
    found = {}
    for plan in (one, both):
        rated = rated_of(plan, modes_at(plan, plan.off, plan.candidates, Work(Serial(), store)))
        found[len(plan.groups)] = SettingSearch(
            SettingSpace(plan.groups, (0.0, 400.0), 3.6), rated
        ).best(starts=1)
    assert found[2].worth.worst >= found[1].worth.worst - 1e-4


@pytest.mark.slow
def test_the_wanted_damping_is_reached_with_the_least_gain(planned, points, store):
    points.write_text(ENDS)
    plan = planned("pod_p", outages="gfor", damping=0.15)
    design = design_over_points(plan, Work(Serial(), store))
    verdict = design.verdict
    moved = [one for one in verdict.known if one.outage.name == "intact"]
    assert min(one.target.damping_ratio for one in moved) == pytest.approx(0.15, abs=3e-4)
    assert min(one.target.damping_ratio for one in moved) >= 0.15
    assert 0 < design.settings[0].gain < 100
    # With the converter out of service nothing moves the mode: it limits, and is named.
    assert verdict.limiting.outage.name == "gfor"
    assert verdict.limiting.unmoved
    assert verdict.worst == pytest.approx(verdict.limiting.target_before.damping_ratio, rel=1e-6)
    assert verdict.met is False
    assert "NOT REACHED: 15 %" in verdict_sentence(verdict)
    assert "hardly move" in verdict_sentence(verdict)
    assert not verdict.astray


def chosen(monkeypatch, x):
    """Has the search give a vector, whatever it is worth."""
    monkeypatch.setattr(SettingSearch, "best", lambda self: self.tried(np.array(x)))


def test_a_point_that_a_nominal_design_destabilises_is_seen(case, tmp_path, store, monkeypatch):
    """At the short line alone the setting stands; over the long line it makes the system grow."""
    space = {}

    def nominal(search):
        space["of"] = search._space
        return search.tried(search._space.vector([-120.0], [2.0], [1000.0]))

    monkeypatch.setattr(SettingSearch, "best", nominal)
    monkeypatch.setattr(study, "_frequency", lambda points: 3.6)
    verdicts = {}
    for name, rows in (("nominal", "short,0.02\n"), ("all", "short,0.02\nlong,0.6\n")):
        path = tmp_path / f"{name}.csv"
        path.write_text(f"name,grid.X_L\n{rows}")
        request = PointsDesignRequest(
            path, ("pod_p",), gain_bounds=(0.0, 4000.0), ranked=0, least_damping=0.0
        )
        verdicts[name] = design_over_points(
            plan_points_design(case, request), Work(Serial(), store)
        ).verdict
    assert verdicts["nominal"].stable is True
    assert verdicts["all"].stable is False
    assert [one.point.name for one in verdicts["all"].unstable] == ["long"]
    assert verdicts["all"].met is False
    assert "UNSTABLE at 1 of 2, the first: long, intact" in verdict_sentence(verdicts["all"])


def test_a_wrong_sign_of_a_loop_is_seen(planned, points, own_store, monkeypatch):
    """The search believes its models; the verdict does not, at two points."""
    points.write_text("name,grid.X_L\nshort,0.05\nusual,0.1\n")
    measured = point.measure

    def wrong(*arguments):
        loops = measured(*arguments)
        return replace(loops, U=-loops.U)

    monkeypatch.setattr(point, "measure", wrong)
    chosen(monkeypatch, [0.0, 0.0, 0.15])
    design = design_over_points(planned("pod_p", damping=0.12), Work(Serial(), own_store))
    verdict = design.verdict
    assert verdict.astray
    assert any("the search was led astray" in text for text in remarks(verdict))
    for one in verdict.known:
        setting = {P: design.settings[0]}
        assert one.target.damping_ratio == pytest.approx(one.worth.worst)
        believed = min(
            damping_ratio(z) for z in near(one.before.loops.eigenvalues(setting), 0.7, 12.0)
        )
        assert abs(believed - one.worth.worst) > 0.01


@pytest.mark.parametrize("blind", [True, False])
def test_harm_that_the_search_did_not_show_is_told(case, tmp_path, own_store, monkeypatch, blind):
    """Where the loops' models lack the mode that grows, the least damping alone shows nothing."""
    measured = point.measure
    if blind:
        monkeypatch.setattr(
            point, "measure", lambda *given: replace(measured(*given), U=0 * measured(*given).U)
        )
    monkeypatch.setattr(
        SettingSearch,
        "best",
        lambda search: search.tried(search._space.vector([-120.0], [2.0], [1000.0])),
    )
    monkeypatch.setattr(study, "_frequency", lambda points: 3.6)
    path = tmp_path / "long.csv"
    path.write_text("name,grid.X_L\nlong,0.6\n")
    request = PointsDesignRequest(
        path, ("pod_p",), gain_bounds=(0.0, 4000.0), ranked=0, least_damping=0.0
    )
    verdict = design_over_points(
        plan_points_design(case, request), Work(Serial(), own_store)
    ).verdict
    assert verdict.stable is False
    assert len(verdict.unforeseen) == blind
    assert (
        any(
            "its linear models showed no harm to other modes, and there is" in t
            for t in remarks(verdict)
        )
        is blind
    )


def test_a_fast_mode_that_a_lead_drives_stays_in_a_reduced_system(monkeypatch):
    """A mode at 48 Hz that the gain alone moves by 0.1 % grows by the gain with 200 times the lead on top."""
    slow, fast = 2 * np.pi * 1.2, 2 * np.pi * 48
    blocks = [np.array([[-0.1 * w, w], [-w, -0.1 * w]]) for w in (slow, fast)]
    A = scipy.linalg.block_diag(*blocks, np.diag(-np.arange(1.0, 9.0)))
    U, V = np.zeros((len(A), 1)), np.zeros((1, len(A)))
    U[:, 0], V[0] = 0.0002, 0.0002
    U[2, 0], V[0, 2] = 0.035, 0.035
    names = tuple(f"x{k}" for k in range(len(A)))
    setting = {P: PodSetting(400.0, lead_lag_turning(120.0, 8.0, 2))}
    whole = open_loops.OpenLoops(A, U, V, np.zeros((1, 1)), (P,), names).eigenvalues(setting)
    assert growth(whole) > 1.0
    monkeypatch.setattr(open_loops, "REDUCED", 5)
    reduced = open_loops.OpenLoops.of(A, U, V, (P,), names)
    assert len(reduced.A) < len(A)
    assert growth(reduced.eigenvalues(setting)) == pytest.approx(growth(whole), rel=0.05)
    monkeypatch.setattr(open_loops, "LEAD", 1.0)
    assert growth(open_loops.OpenLoops.of(A, U, V, (P,), names).eigenvalues(setting)) == 0.0


def test_points_without_modes_leave_the_verdict_not_known(planned, store, monkeypatch):
    """All else is fine, but the only line's outage cuts the system in two."""
    chosen(monkeypatch, [0.03, 0.7, 0.19])
    verdict = design_over_points(
        planned("pod_p", outages="L", damping=0.1), Work(Serial(), store)
    ).verdict
    assert verdict.met is None
    assert verdict.stable is None
    assert len(verdict.failed) == 4
    assert "4 of 8 have no modes (4 islanding)" in verdict_sentence(verdict)
    assert "bus_2 cut off" in " ".join(remarks(verdict))
    told = []
    work = Work(Serial(), store, lambda done, total: told.append((done, total)))
    fine = design_over_points(planned("pod_p", damping=0.1), work).verdict
    assert fine.met is True
    assert {total for _, total in told} == {
        4
    }  # the points that were given, though each is computed twice
    assert told == sorted(told)
    assert told[-1] == (4, 4)
    assert "REACHED: 10 % at all 4 points" in verdict_sentence(fine)


def test_a_mode_that_is_pushed_down_is_harm(planned, store):
    """Other modes are held to what they had in their band of frequencies."""
    plan = planned("pod_p", modes=("electromechanical",), least_damping=0.05)
    found = modes_at(plan, plan.off, plan.candidates, Work(Serial(), store))
    rated = rated_of(plan, found, 1e5)
    weak, strong = (
        {P: PodSetting(gain, lead_lag_turning(turn, 7.2, 2))}
        for gain, turn in ((20.0, 0.0), (2000.0, -120.0))
    )
    assert all(one.worth(weak).allowed for one in rated)
    harmed = [growth(one.loops.eigenvalues(strong)) > 0 for one in rated]
    assert any(harmed)
    assert all(
        not one.worth(strong).allowed for one, grows in zip(rated, harmed, strict=True) if grows
    )


def test_a_name_follows_its_mode_from_the_loops_that_are_open(planned, points, store):
    """By hand: tiny steps of the gain, and at each the nearest eigenvalue. What shapes say with the setting counts for
    nothing."""
    points.write_text("name,grid.X_L,load\nshort,0.05,1\nlonger,0.3,1\n")
    plan = planned("pod_p", modes=("electromechanical",))
    before = modes_at(plan, plan.off, plan.candidates, Work(Serial(), store))
    gain = 250.0
    setting = {P: PodSetting(gain, lead_lag_turning(40.0, 4.5, 2))}
    values = values_of(plan.groups, list(setting.values()))
    after = modes_at(plan, values, (), Work(Serial(), store))
    lying = [replace(one, named={"electromechanical": one.swinging[-1]}) for one in after]
    found = with_followed_names(["electromechanical"], before, after, setting)
    borne = 0
    for first, last, other, lie in zip(before, found, after, lying, strict=True):
        assert (
            with_followed_names(["electromechanical"], [first], [lie], setting) == [last]
            or last.named == {}
        )
        assert with_followed_names([], [first], [other], setting) == [other]
        if "electromechanical" not in first.named:
            assert last.named == {}
        elif "electromechanical" in last.named:
            borne += 1
            value = first.values[first.named["electromechanical"]]
            for k in np.linspace(1e-6, gain, 250):
                values = first.loops.eigenvalues({P: replace(setting[P], gain=k)})
                value = values[np.abs(values - value).argmin()]
            assert last.values[last.named["electromechanical"]] == pytest.approx(value, rel=1e-3)
    assert borne >= 1


@pytest.mark.slow
def test_a_name_that_cannot_be_followed_is_borne_by_none(planned, points, store, monkeypatch):
    """The verdict counts all modes there, and says so."""
    points.write_text("name,grid.X_L\nshort,0.05\n")

    def meets(*_):
        raise ModesMeetError(-0.5 + 4j, 0.3, 1.0)

    monkeypatch.setattr(following, "follow_along", meets)
    chosen(monkeypatch, [0.03, 0.7, 0.19])
    plan = planned("pod_p", modes=("electromechanical",), damping=0.1)
    verdict = design_over_points(plan, Work(Serial(), store)).verdict
    assert all(one.unnamed for one in verdict.known)
    assert (
        "its mode meets another one while the gains grow, so all modes from 0.1 to 2 Hz count"
        in " ".join(remarks(verdict))
    )


def test_a_mode_that_is_named_counts_alone(planned, points, store):
    points.write_text(LINES.replace("long,0.5", "long,0.7"))
    plan = planned("pod_p", modes=("electromechanical",))
    found = modes_at(plan, plan.off, plan.candidates, Work(Serial(), store))
    for one in found:
        named = RatedPoint(0, one.loops, plan.aim, {P: 400.0}).worth({}).worst
        every = RatedPoint(0, one.loops, Aim((), 0.05), {P: 400.0}).worth({}).worst
        assert every <= named + 1e-12
        if "electromechanical" in one.named:
            assert named == pytest.approx(
                damping_ratio(complex(one.values[one.named["electromechanical"]]))
            )
        else:  # two modes fit the name about equally, so that all count
            assert named == every
    assert ["electromechanical" in one.named for one in found] == [True, True, True, False]


def test_sensitivities_of_a_step_are_those_of_the_eigenvalues(planned, store):
    plan = planned("pod_p", "pod_q")
    rated = rated_of(plan, modes_at(plan, plan.off, plan.candidates, Work(Serial(), store)))
    space = SettingSpace(plan.groups, (0.0, 400.0), 3.6)
    search, x, h = SettingSearch(space, rated), np.array([-0.1, 0.3, 0.1, 0.2, -0.2, 0.3]), 1e-4
    for mode, slopes in search._rows(rated[1], x):
        for k in range(len(x)):
            ends = []
            for sign in (1, -1):
                moved = x.copy()
                moved[k] += sign * h
                values = rated[1].loops.eigenvalues(space.setting(moved))
                ends.append(damping_ratio(complex(values[np.argmin(np.abs(values - mode.value))])))
            assert slopes[k] == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-2, abs=1e-4)


def test_converters_are_ranked_by_what_a_controller_there_gives(planned, store):
    plan = planned("pod_p", "pod_q")
    found = modes_at(plan, plan.off, plan.candidates, Work(Serial(), store))[:1]
    stages = dict.fromkeys(plan.candidates, 2)
    first, second = ranked(plan.candidates, stages, rated_of(plan, found), 400.0, 3.6, 0)
    assert (first.place, second.place) == (P, Q)
    assert first.worst is None
    assert first.shift == pytest.approx(abs(rated_of(plan, found)[0].residues()[P]))


def test_a_system_too_large_for_all_eigenvalues_is_told_what_goes_instead(
    planned, own_store, monkeypatch
):
    monkeypatch.setattr(point, "_MOST_STATES", 10)
    plan = planned("pod_p")
    (found, *_) = modes_at(plan, plan.off, plan.candidates, Work(Serial(), own_store))
    assert "computes all eigenvalues at each, of at most 10 states" in found.text
    assert found.text.endswith("`gfor design CASE --controller pod_p`")


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        ({"modes": ("swing",)}, "the case names no mode 'swing'"),
        ({"components": ("gfor", "gf*")}, "gfor is in two of the patterns"),
        ({"components": ("sg1",)}, "--component sg1"),
        ({"gain_bounds": (0.0, 1e9)}, "--gain-bounds"),
        ({"scenario": "pod"}, "there is no scenario 'pod'"),
    ],
)
def test_a_wrong_wish_is_refused(planned, wanted, said):
    with pytest.raises(InputError, match="(?s)" + said.replace("*", r"\*")):
        planned("pod_p", **wanted)


def test_a_column_for_what_is_designed_is_refused(case, tmp_path):
    path = tmp_path / "points.csv"
    path.write_text("name,gfor.pod_p.K\na,100\n")
    with pytest.raises(InputError, match=r"gfor\.pod_p\.K sets what is to be designed"):
        plan_points_design(case, PointsDesignRequest(path))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--outages", "L"), "--outages belongs to a design over operating points"),
        (("--controller", "pod_q"), "--controller is given 2 times"),
        (
            ("--points", "points.csv", "--refine"),
            "--refine belongs to a design for one operating point",
        ),
        (("--points", "points.csv", "--damping-increment", "5"), "--damping-increment belongs"),
    ],
)
def test_options_of_the_other_design_are_refused(gfor, options, said):
    code, _, error = gfor("design", "two_area", "--controller", "pod_p", *options)
    assert code == 2
    assert said in " ".join(error.split())


@pytest.mark.slow
def test_the_command_writes_what_other_commands_take(gfor, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "two.csv").write_text("name,grid.X_L\nshort,0.05\nusual,0.1\n")
    common = (
        "design",
        "two_area",
        "--controller",
        "pod_p",
        "--points",
        "two.csv",
        "--workers",
        "1",
    )
    code, out, error = gfor(
        *common, "--damping", "20", "--json", "--out", "mine.toml", "--fail-unstable"
    )
    assert (code, error) == (0, "")
    found = json.loads(out)
    assert found["met"] is True
    assert found["limiting"]["point"] in ("short", "usual")
    kept = json.loads((tmp_path / "mine.json").read_text())
    assert kept.pop("made")["command"].startswith("gfor design two_area")
    assert kept == found
    assert len((tmp_path / "mine.csv").read_text().splitlines()) == 3
    assert "gfor,pod_p," in (tmp_path / "mine_ranking.csv").read_text()
    worst = []
    for line in ("0.05", "0.1"):
        _, printed, _ = gfor(
            "modes",
            "two_area",
            "--scenario",
            "gfor",
            "--parameters",
            "mine.toml",
            "--set",
            f"grid.X_L={line}",
            "--json",
        )
        worst.append(
            min(mode["damping_percent"] for mode in json.loads(printed)["scenarios"][0]["modes"])
        )
    assert min(worst) == pytest.approx(100 * found["worst_damping_ratio"]["after"], abs=0.1)
    chosen(monkeypatch, [0.03, 0.7, 0.19])
    code, out, _ = gfor(
        *common, "--outages", "L", "--gain-bounds", "0:100", "--rank", "0", "--fail-unstable"
    )
    assert code == 1
    assert "have no modes (2 islanding)" in " ".join(out.split())


@pytest.mark.slow
def test_every_setting_that_is_named_gives_its_figure_when_it_is_typed_in(
    gfor, tmp_path, monkeypatch
):
    """Those of the ranking too: the least damping of all modes, not that of the mode that a controller moves well."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "one.csv").write_text("name,grid.X_L\nusual,0.1\n")
    code, out, _ = gfor(
        "design",
        "two_area_rms",
        "--controller",
        "pod_p",
        "--controller",
        "pod_q",
        "--points",
        "one.csv",
        "--rank",
        "2",
        "--damping",
        "80",
        "--json",
        "--workers",
        "1",
    )
    found = json.loads(out)
    assert code == 3
    assert found["met"] is False
    assert found["verdict"].startswith("NOT REACHED: 80 %")
    assert "CANNOT be had" not in found["verdict"], "of two settings no grid was compared"
    alone = [[(one["controller"], one)] for one in found["ranking"]]
    figures = [one["worst_damping_ratio"] for one in found["ranking"]] + [
        found["worst_damping_ratio"]["after"]
    ]
    assert len(alone) == 2
    for settings, figure in zip(
        [*alone, [(s["controller"], s) for s in found["settings"]]], figures, strict=True
    ):
        options = []
        for controller, one in settings:
            values = {"enabled": "true", **{name: one[name] for name in ("K", "T_S1", "T_S2")}}
            options += [
                word
                for key, v in values.items()
                for word in ("--set", f"gfor.{controller}.{key}={v}")
            ]
        _, printed, _ = gfor(
            "modes",
            "two_area_rms",
            "--scenario",
            "gfor",
            "--set",
            "grid.X_L=0.1",
            *options,
            "--step",
            "1 ms",
            "--json",
        )
        modes = json.loads(printed)["scenarios"][0]["modes"]
        expected = min(mode["damping_percent"] for mode in modes)  # of the step map
        assert 100 * figure == pytest.approx(expected, abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("models", ["phasor", "emt"])
def test_settings_named_of_a_network_file_give_their_figures_when_they_are_typed_in(
    gfor, tmp_path, monkeypatch, models
):
    """Five machines of RAW and DYR with a converter of 150 MVA; three of their swings lie close together. The file of
    parameters is typed back as well as the settings of the ranking."""
    monkeypatch.chdir(tmp_path)
    five_machines(tmp_path)
    assert gfor(
        "new",
        "five.raw",
        "five.dyr",
        "--converter",
        "bus 12, 150 MVA, 60 MW, less sg1",
        "--out",
        "case.toml",
    )[0] in (0, None)
    (tmp_path / "one.csv").write_text("name,grid.load_11.scale\nusual,1\n")
    kind = ("--set", f"models={models}")
    code, out, error = gfor(
        "design",
        "case.toml",
        "--controller",
        "pod_p",
        "--points",
        "one.csv",
        "--scenario",
        "converter",
        *kind,
        "--rank",
        "1",
        "--damping",
        "60",
        "--json",
        "--workers",
        "1",
        "--out",
        "best.toml",
    )
    assert code == 3, error
    found = json.loads(out)
    (alone,) = found["ranking"]

    def least(*options):
        _, printed, _ = gfor(
            "modes", "case.toml", "--scenario", "converter", *kind, *options, "--json"
        )
        return min(mode["damping_percent"] for mode in json.loads(printed)["scenarios"][0]["modes"])

    values = {"enabled": "true", **{name: alone[name] for name in ("K", "T_S1", "T_S2")}}
    typed = [word for key, v in values.items() for word in ("--set", f"gfor.pod_p.{key}={v}")]
    assert least(*typed) == pytest.approx(100 * alone["worst_damping_ratio"], abs=0.2)
    told = 100 * found["worst_damping_ratio"]["after"]
    assert least("--parameters", "best.toml") == pytest.approx(told, abs=0.2)
    assert told > least() + 0.05, "the setting is worth something"


def test_that_a_damping_cannot_be_had_needs_a_grid(planned, points, store, monkeypatch):
    """Without one only the best that was found is said; and a search that was cut short is helped by the grid.

    At one point: a grid's settings are the same for any number of them."""
    points.write_text("name,grid.X_L\nusual,0.1\n")
    monkeypatch.setattr(
        SettingSearch,
        "best",
        lambda search: search.tried(search._space.vector([90.0], [3.0], [5.0])),
    )
    plan = planned("pod_p", damping=0.8)
    helped = design_over_points(plan, Work(Serial(), store)).verdict
    assert "CANNOT be had with K ≤ 400 pu: best" in verdict_sentence(helped)
    monkeypatch.setattr(SettingSearch, "over_grid", lambda search, found: (found, 0))
    alone = design_over_points(plan, Work(Serial(), store)).verdict
    assert "CANNOT" not in verdict_sentence(alone)
    assert "no grid of settings was compared" in verdict_sentence(alone)
    assert helped.worst > alone.worst + 0.05


@pytest.mark.slow
def test_a_design_for_one_point_finds_what_a_design_over_that_point_finds(
    gfor, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "one.csv").write_text("name,grid.X_L\nusual,0.1\n")
    common = (
        "design",
        "two_area_rms",
        "--controller",
        "pod_p",
        "--damping",
        "70",
        "--gain-bounds",
        "0:400",
        "--json",
    )
    code, out, _ = gfor(
        *common, "--refine", "--no-margins", "--set", "grid.X_L=0.1", "--step", "1 ms"
    )
    refined = json.loads(out)
    assert (code, refined["met"]) == (3, False)
    code, out, _ = gfor(*common, "--points", "one.csv", "--workers", "1")
    over = json.loads(out)
    assert code == 3
    least = refined["worst_other_mode"]["after"]["damping_ratio"], refined["achieved_damping_ratio"]
    assert min(least) == pytest.approx(over["worst_damping_ratio"]["after"], abs=0.003)
    (setting,) = over["settings"]
    assert refined["K"] == pytest.approx(setting["K"], rel=0.05)
    assert "CANNOT be had with K ≤ 400 pu" in over["verdict"]
    for sweep in refined["refinement"]["sweeps"]:
        assert len(sweep["points"]) >= 9
        assert all(
            p["least_damping_ratio"] <= p["damping_ratio"] + 1e-9
            for p in sweep["points"] + [sweep["chosen"]]
        )
