"""What the first sentence on a design says beside the target, and how it spells options."""

from types import SimpleNamespace

import pytest

from orchestrator.core.options import Option
from orchestrator.core.spelling import parts_of
from orchestrator.studies.pod_design.sheet import verdict

REST = "; least damped of all then 8.71 % at 1.527 Hz"


@pytest.mark.parametrize(
    ("other", "met", "broken", "said"),
    [
        (0.0871, True, None, REST),
        (0.0871, False, "it harms another", "; but it harms another"),
        (0.12, True, None, ""),
        (None, True, None, ""),
    ],
)
def test_a_mode_below_what_is_asked_is_told_with_met(other, met, broken, said):
    worst = None if other is None else SimpleNamespace(damping_ratio=other, frequency_hz=1.527)
    design = SimpleNamespace(
        achieved_damping=0.1044,
        required_damping=0.1,
        initial=-0.1 + 4j,
        before=SimpleNamespace(worst=None),
        after=SimpleNamespace(other_named=None),
        broken=broken,
        met=met,
        worst_other=worst,
        damping_met=True,
        spoilt=None,
        thin_margin=None,
        refinement=None,
        gain_is_swept=False,
        final=None,
        designed=None,
        active_bound=None,
    )
    assert verdict(design) == f"the target has 10.44 % of damping, 10.00 % are required{said}"


def test_a_requirement_that_is_missed_names_the_keyword_to_python_and_the_option_to_a_terminal():
    design = SimpleNamespace(
        achieved_damping=0.05,
        required_damping=0.1,
        initial=-0.1 + 4j,
        before=SimpleNamespace(worst=None),
        after=SimpleNamespace(other_named=None),
        broken=None,
        met=False,
        worst_other=None,
        damping_met=False,
        refinement=None,
        gain_is_swept=False,
        other_gain=None,
    )
    said = verdict(design)
    assert said.endswith("; use --refine")
    assert parts_of(said)[-1] == Option.REFINE
    assert Option.REFINE.python == "refine"


@pytest.mark.parametrize(("damping", "told"), [(0.0728, True), (0.2, False)])
def test_a_target_that_is_not_the_least_damped_mode_is_told(damping, told):
    least = SimpleNamespace(damping_ratio=damping, frequency_hz=1.234)
    design = SimpleNamespace(
        achieved_damping=0.3,
        required_damping=0.2,
        mode_name="inter-area",
        initial=-0.5756 + 4.5373j,
        before=SimpleNamespace(worst=least),
        after=SimpleNamespace(other_named=None),
        broken=None,
        met=True,
        worst_other=None,
        damping_met=True,
        spoilt=None,
        thin_margin=None,
        refinement=None,
        gain_is_swept=False,
        final=None,
        designed=None,
        active_bound=None,
    )
    words = "the target, inter-area, is not the least damped mode, which has 7.28 % at 1.234 Hz without the controller"
    assert (words in verdict(design)) is told
