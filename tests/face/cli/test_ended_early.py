"""A scenario that was cut short lies under its whole name: everything that reads it says so."""

import json
import warnings

import pytest
import xarray as xr

import orchestrator as gfor_api
from orchestrator.face.cli import main
from orchestrator.face.cli import run as command
from orchestrator.output.results.manifest import ResultsWarning
from orchestrator.systems.coupling.observers import Progress

pytestmark = pytest.mark.slow  # both, or the runs would be made twice

WORDS = ("run", "infinite_bus", "--scenario", "dip", "--stop", "3")


class Stops(Progress):
    """Ctrl-C as it arrives between two steps."""

    def observe(self, run):
        if run.time > 2.5:
            raise KeyboardInterrupt


@pytest.fixture(scope="module")
def folders(undrawn, tmp_path_factory):
    """A whole run, and one that ended early; they are read only."""
    whole, cut = (tmp_path_factory.mktemp(name) for name in ("whole", "cut"))
    assert main([*WORDS, "--out", str(whole)]) == 0
    with pytest.MonkeyPatch.context() as planted:
        planted.setattr(command, "Progress", Stops)
        assert main([*WORDS, "--out", str(cut)]) == 130
    return whole, cut


def test_everything_that_reads_it_says_so(gfor, folders):
    whole, cut = folders
    with xr.open_dataset(cut / "dip" / "trajectory.nc") as data:
        assert data.attrs["ended_early"].startswith("interrupted at t = 2.6")
    about = json.loads((cut / "dip" / "manifest.json").read_text(encoding="utf-8"))
    assert about["ended_early"].startswith("interrupted at t = 2.6")
    with xr.open_dataset(whole / "dip" / "trajectory.nc") as data:
        assert "ended_early" not in data.attrs
    assert "ended_early" not in json.loads(
        (whole / "dip" / "manifest.json").read_text(encoding="utf-8")
    )
    early = "its run ended early, at t = 2.6"
    for words in (
        ("signal", "identify", cut / "dip", "gfor.omega", "--start", "1.2"),
        ("signal", "compare", whole / "dip", cut / "dip"),
        ("report", cut),
    ):
        code, _, error = gfor(*words)
        assert code == 0, error
        assert early in " ".join(error.split()), words
    assert "ends at t = 3 s, and" in " ".join(
        gfor("signal", "compare", whole / "dip", cut / "dip")[2].split()
    )
    for words in (
        ("signal", "identify", whole / "dip", "gfor.omega", "--start", "1.2"),
        ("signal", "compare", whole / "dip", whole / "dip"),
        ("report", whole),
    ):
        code, _, error = gfor(*words)
        assert (code, error) == (0, "")


def test_in_python(folders):
    whole, cut = folders
    with pytest.warns(ResultsWarning, match="ended early"):
        gfor_api.identify(cut / "dip", "gfor.omega", start=1.2)
    with (
        pytest.warns(ResultsWarning, match="ended early"),
        pytest.warns(ResultsWarning, match="ends at t = 3 s"),
    ):
        gfor_api.compare(whole / "dip", cut / "dip")
    scenario = gfor_api.load("infinite_bus").scenario("dip")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run = scenario.run(stop=3.0, observers=[Stops(lambda *_: None)])
    with pytest.warns(ResultsWarning, match="dip: its run ended early"):
        gfor_api.identify(run, "gfor.omega", start=1.2)
