"""Every setting that tables and files of a design name is typed back: random systems, five machines and a converter."""

import csv
import json
import re

import numpy as np
import pytest

from orchestrator.studies.coordinated_design.settings import PodGroup
from orchestrator.studies.coordinated_design.study import values_of
from orchestrator.studies.pod_design.closed_loop import PodSetting
from orchestrator.studies.pod_design.lead_lag import LeadLag
from tests.studies.screening.five_machines import five_machines

REQUIRED = 60  # percent, which none of them reaches: so all that can be had is searched for


def random_system(folder, seed):
    """Lines, inertias and exciters' gains from a seed, and a converter at a bus of the ring."""
    five_machines(folder)
    random = np.random.default_rng(seed)
    raw, dyr = folder / "five.raw", folder / "five.dyr"
    raw.write_text(
        re.sub(
            r"0\.004,0\.05,", lambda _: f"0.004,{random.uniform(0.03, 0.1):.4f},", raw.read_text()
        )
    )
    text = re.sub(
        r"(0\.535 0\.06) [\d.]+",
        lambda m: f"{m[1]} {random.uniform(3.0, 7.0):.2f}",
        dyr.read_text(),
    )
    dyr.write_text(
        re.sub(r"(0\.1 10\.0) [\d.]+", lambda m: f"{m[1]} {random.uniform(50, 160):.1f}", text)
    )
    return f"bus {random.integers(11, 16)}, {random.integers(100, 260)} MVA, 60 MW, less sg1"


@pytest.mark.parametrize("seed", range(3))
def test_each_gives_its_figure_and_both_designs_are_one(gfor, tmp_path, monkeypatch, seed):
    monkeypatch.chdir(tmp_path)
    assert (
        gfor(
            "new",
            "five.raw",
            "five.dyr",
            "--converter",
            random_system(tmp_path, seed),
            "--out",
            "c.toml",
        )[0]
        == 0
    )
    (tmp_path / "one.csv").write_text("name,grid.load_11.scale\nusual,1\n")
    common = (
        "design",
        "c.toml",
        "--controller",
        "pod_p",
        "--scenario",
        "converter",
        "--damping",
        f"{REQUIRED}",
        "--gain-bounds",
        "0:400",
        "--json",
    )
    code, out, error = gfor(
        *common, "--points", "one.csv", "--rank", "1", "--workers", "1", "--out", "over.toml"
    )
    assert code == 3, error
    over = json.loads(out)
    code, out, error = gfor(*common, "--refine", "--no-margins", "--out", "refined.toml")
    assert code == 3, error
    refined = json.loads(out)

    def least(*options):
        code, printed, error = gfor(
            "modes", "c.toml", "--scenario", "converter", *options, "--json"
        )
        assert printed, (options, code, error[-1500:])
        return min(mode["damping_percent"] for mode in json.loads(printed)["scenarios"][0]["modes"])

    def typed(one, gain):
        values = {"enabled": "true", "K": gain, "T_S1": one["T_S1"], "T_S2": one["T_S2"]}
        return least(
            *(word for key, v in values.items() for word in ("--set", f"gfor.pod_p.{key}={v}"))
        )

    told = 100 * over["worst_damping_ratio"]["after"]
    assert told > least() + 0.05, "the setting is worth something"
    found = [(least("--parameters", "over.toml"), told)]
    found += [(typed(one, one["K"]), told) for one in over["settings"]]
    found += [(typed(one, one["K"]), 100 * one["worst_damping_ratio"]) for one in over["ranking"]]
    for row in csv.DictReader((tmp_path / "over_ranking.csv").read_text().splitlines()):
        found.append((typed(row, row["K"]), float(row["least_damping_percent"])))
    best = 100 * min(
        refined["achieved_damping_ratio"], refined["worst_other_mode"]["after"]["damping_ratio"]
    )
    found += [(least("--parameters", "refined.toml"), best), (typed(refined, refined["K"]), best)]
    for sweep in refined["refinement"]["sweeps"]:
        for one in (sweep["chosen"], sweep["points"][len(sweep["points"]) // 2]):
            if one["K"] not in sweep["unstable_gains"]:
                found.append((typed(sweep, one["K"]), 100 * one["least_damping_ratio"]))
    assert len(found) > 10
    assert [figure for _, figure in found] == pytest.approx(
        [figure for figure, _ in found], abs=0.1
    )
    assert best == pytest.approx(told, abs=0.3)


@pytest.mark.parametrize(("gain", "enabled"), [(0.0, False), (123.456789012, True)])
def test_a_controller_without_gain_is_switched_off(gain, enabled):
    setting = PodSetting(gain, LeadLag(T_S1=0.2, T_S2=0.05, N_S=2))
    values = values_of([PodGroup("pod_p", ("gfor1", "gfor2"), ("gfor*",), 2)], [setting])
    assert values["gfor*.pod_p.enabled"] is enabled
    if not enabled:
        assert set(values) == {"gfor*.pod_p.enabled"}, "no setting is written for nothing"
        return
    assert values["gfor*.pod_p.K"] == pytest.approx(gain, rel=1e-7)
    assert (values["gfor*.pod_p.T_S1"], values["gfor*.pod_p.T_S2"], values["gfor*.pod_p.N_S"]) == (
        0.2,
        0.05,
        2,
    )
