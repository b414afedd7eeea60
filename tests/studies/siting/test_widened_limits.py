"""An outage beyond a limit of an exciter or a governor is looked at with the limit widened, as in a screening."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.studies.siting.study import SiteRequest, find_sites
from orchestrator.studies.siting.view import as_json, remarks
from tests.cases.new.test_widened_limits import new_case

OUTAGE = "sg3"


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    case = load_case(new_case(tmp_path_factory.mktemp("site"), exciter="0.05 -5.0 0.9 /"))

    def sites(values):
        request = SiteRequest("pod_p", scenario="base", values=values, outages=OUTAGE, confirm=0)
        return find_sites(case, request)

    return sites


def test_an_outage_is_computed_with_the_limit_widened_and_told(found):
    """The modes are those of the same limits typed."""
    result = found({})
    assert not result.not_judged
    intact, outage = result.situations
    assert not intact.widenings
    assert outage.widenings
    typed = found({one.name: one.taken for one in outage.widenings})
    assert not any(at.widenings for at in typed.situations)
    assert [seen.mode.eigenvalue for seen in outage.modes] == pytest.approx(
        [seen.mode.eigenvalue for seen in typed.situations[1].modes], rel=1e-6
    )
    (said,) = (text for text in remarks(result) if "widened" in text)
    assert said.startswith(f"outage {OUTAGE}: ")
    assert all(str(one) in said for one in outage.widenings)
    (shown,) = as_json(result)["outages"]
    assert [one["name"] for one in shown["widened_limits"]] == [
        one.name for one in outage.widenings
    ]
