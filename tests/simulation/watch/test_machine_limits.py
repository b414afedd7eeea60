"""Limits of machines: those that act are told with component, limit, beginning and duration, and no others."""

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.studies.runs.run import run_scenario
from tests.support.scenarios import prepare_one

PARTS = {
    "exciter": ("st1a", "st4b", "ac4a", "dc1a"),
    "governor": ("hygov", "gast", "ieeeg1", "tgov1"),
}


def run(tmp_path=None, scenario="pss", stop=4.0, **overrides):
    case = load_case("k2a")
    file = "k2a"
    if tmp_path is not None:  # other parts in place of those of the case
        text = case.path.read_text(encoding="utf-8")
        for part in ("exciter", "governor", "pss"):
            text = "\n".join(line for line in text.splitlines() if not line.startswith(f"{part}."))
        text = text.replace('stabilizer = "pss1a"', 'stabilizer = "pss2b"').replace(
            "meant = ", "# meant = ", 1
        )
        text = text.replace("record = [", 'record = ["sg*.E_fd", "sg*.v_t", ')
        (tmp_path / "units.csv").write_bytes((case.path.parent / "units.csv").read_bytes())
        file = tmp_path / "case.toml"
        file.write_text(text, encoding="utf-8")
        overrides |= {
            f"sg{k}__{part}": name
            for part, names in PARTS.items()
            for k, name in enumerate(names, 1)
        }
    changed = {name.replace("__", "."): value for name, value in overrides.items()}
    ready = prepare_one(file, scenario, changed, stop_time=stop)
    result = run_scenario(ready)
    return {
        (f.component, f.variable): f for f in result.findings if f.kind == "active_limit"
    }, result.dataset


def test_a_ceiling_and_a_valve_are_told_as_they_act():
    found, data = run(scenario="no_pss", sg1__governor__V_MAX=0.79, sg2__exciter__E_MAX=2.3)
    ceiling = found["sg2", "exciter.amplifier"]
    assert ceiling.message.startswith(
        "the ceiling of the exciter of sg2 (exciter.E_MAX) acts from t = 1.0"
    )
    assert 1.0 < ceiling.figures["duration_s"] <= 3.0
    valve = found["sg1", "governor.valve"]
    assert (valve.until, "(governor.V_MAX)" in valve.message) == (None, True)
    assert not any(variable.startswith("pss") for _, variable in found)  # they are off
    assert "sg1.p" in data


def test_both_limits_of_a_stabiliser_are_one_finding():
    found, _ = run()
    text = found["sg3", "pss.lead_lag_2"].message
    assert "the output limit of the stabiliser of sg3 (pss.V_STMAX for 0." in text
    assert ", pss.V_STMIN for 0." in text
    assert not any(variable.startswith("governor") for _, variable in found)


@pytest.mark.parametrize(("limit", "acts"), [(3.0, True), (30.0, False)])
def test_a_ceiling_that_is_far_off_is_silent(limit, acts):
    found, _ = run(
        scenario="no_pss", stop=2.0, **{f"sg{k}__exciter__E_MAX": limit for k in range(1, 5)}
    )
    assert any(variable.startswith("exciter") for _, variable in found) is acts


@pytest.mark.slow
def test_every_part_has_its_limits(tmp_path):
    """Durations are those of the recorded signals; with limits far off nothing is told."""
    tight = {"sg1__exciter__V_RMAX": 2.5, "sg2__exciter__V_RMAX": 0.45, "sg3__exciter__V_RMAX": 2.5}
    tight |= {
        "sg4__exciter__V_RMAX": 3.0,
        "sg1__governor__VELM": 1e-4,
        "sg2__governor__V_MIN": 0.775,
    }
    found, data = run(
        tmp_path,
        **tight,
        sg3__governor__U_o=1e-4,
        sg3__governor__U_c=-1e-4,
        sg4__governor__V_MAX=0.79,
    )
    names = {
        component: {v for c, v in found if c == component}
        for component in ("sg1", "sg2", "sg3", "sg4")
    }
    assert {"E_fd", "der(governor.gate)"} <= names["sg1"]
    assert {"exciter.bridge", "governor.valve"} <= names["sg2"]
    assert {"E_fd", "der(governor.gate)"} <= names["sg3"]
    assert {"exciter.amplifier"} <= names["sg4"]
    assert {"pss.lead_lag_3"} <= set.union(*names.values())
    E_fd, v_t = (data[f"sg1.{name}"].values for name in ("E_fd", "v_t"))
    at = E_fd >= 2.5 * v_t * (1 - 1e-3)
    assert found["sg1", "E_fd"].figures["duration_s"] == pytest.approx(
        0.005 * np.count_nonzero(at), abs=0.011
    )
    at = data["sg3.E_fd"].values >= 2.5 * (1 - 1e-9)
    assert found["sg3", "E_fd"].figures["duration_s"] == pytest.approx(
        0.005 * np.count_nonzero(at), abs=0.011
    )
