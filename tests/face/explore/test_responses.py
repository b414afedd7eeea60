"""What the page is told of a run while it goes on."""

from types import SimpleNamespace

from orchestrator.face.explore.responses import Streamed
from tests.support.scenarios import bare_scenario


def test_a_streamed_signal_is_the_variable_the_difference_or_the_magnitude():
    prepared = bare_scenario(stop_time=0.2, step_size=0.1)
    said = []
    names = ["gfor.p", "gfor.p - sg1.p", "|gfor.i|"]
    streamed = Streamed(SimpleNamespace(prepared=prepared), names, said.append)
    values = {"p": 0.9, "i_re": 0.3, "i_im": -0.4}
    gfor = SimpleNamespace(get=lambda asked: {name: values[name] for name in asked})
    sg1 = SimpleNamespace(get=lambda asked: dict.fromkeys(asked, 0.5))
    run = SimpleNamespace(time=0.1, components={"gfor": gfor, "sg1": sg1})
    streamed.observe(run)
    streamed.end(run)
    assert said == [
        {
            "time": [0.1],
            "signals": {names[0]: [0.9], names[1]: [0.4], names[2]: [0.5]},
            "until": 0.2,
        }
    ]
