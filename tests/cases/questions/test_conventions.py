"""``[conventions]``: the same RAW and DYR files as other programs read them, against ANDES' eigenvalues."""

from types import SimpleNamespace

import numpy as np
import pytest

import orchestrator as gfor
from orchestrator.cases.form.schema import ConventionsTable
from orchestrator.cases.settings.assignment import EMF, TORQUE, assign_conventions
from orchestrator.core.errors import CaseError
from tests.studies.screening.five_machines import five_machines

IN_ANDES = (
    -0.927208 + 7.621295j,
    -1.038623 + 8.421924j,
    -1.020135 + 8.781521j,
    -0.995953 + 9.229679j,
)
"""Swings of `five_machines`, loads as impedances, as ANDES 2.0.0 computed them from the same files [rad/s]."""

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:question")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("conventions")
    five_machines(place)
    return place


def swings(folder, conventions, **values):
    text = (folder / "five.toml").read_text(encoding="utf-8")
    case = folder / "chosen.toml"
    case.write_text(
        text.replace("[units]", f"[conventions]\n{conventions}\n[units]"), encoding="utf-8"
    )
    modes = gfor.load(case).scenario("base", values).modes().result.modes
    found = np.array([mode.eigenvalue for mode in modes])
    return _swings_of(found)


def _swings_of(found):
    found = found[(found.imag > 1) & (found.imag < 20) & (-found.real < 0.3 * np.abs(found))]
    return found[np.argsort(found.imag)]


def damping(eigenvalues):
    return -100 * eigenvalues.real / np.abs(eigenvalues)


def test_like_andes_is_andes(folder):
    ours = swings(folder, 'like = "andes"')
    np.testing.assert_allclose(damping(ours), damping(np.array(IN_ANDES)), atol=0.02)
    np.testing.assert_allclose(ours.imag, np.imag(IN_ANDES), rtol=3e-4)


@pytest.mark.parametrize(
    ("convention", "classical", "wound"),
    [
        ({"like": "psse"}, True, False),
        ({"like": "andes"}, True, True),
        ({"like": "exact"}, False, False),
        ({"like": "psse", "governor_gives": "power"}, False, False),
    ],
)
def test_the_classical_machine_has_a_constant_torque_in_pss_e(convention, classical, wound):
    machines = {"one": "classical", "other": "genrou"}
    own = {TORQUE: None, EMF: None}
    draft = SimpleNamespace(
        given=SimpleNamespace(
            case=SimpleNamespace(conventions=ConventionsTable(**convention)), place=lambda key: key
        ),
        tables={name: SimpleNamespace(machine=machine) for name, machine in machines.items()},
        system=SimpleNamespace(
            components={
                name: SimpleNamespace(
                    description=SimpleNamespace(parameters=own, kind="machine"), parameters={}
                )
                for name in machines
            }
        ),
        places={},
    )
    assign_conventions(draft)
    given = {name: plan.parameters[TORQUE] for name, plan in draft.system.components.items()}
    assert given == {"one": classical, "other": wound}


def test_each_assumption_alone_and_an_override_by_name(folder):
    exact, psse = swings(folder, 'like = "exact"'), swings(folder, 'like = "psse"')
    torque = swings(folder, 'governor_gives = "torque"')
    both = swings(folder, 'speed_in_emf = false\ngovernor_gives = "torque"')
    np.testing.assert_array_equal(both, swings(folder, 'like = "andes"'))
    np.testing.assert_array_equal(psse, swings(folder, 'like = "powerfactory"'))
    assert np.all(damping(exact) - damping(psse) > 0.1)
    assert np.all(damping(exact) - damping(torque) > 0.25)
    named = swings(folder, 'like = "andes"', **{"sg*.governor.output_is_torque": False})
    np.testing.assert_array_equal(named, psse)


def test_machines_with_stator_transients_and_other_programs_are_refused(folder):
    text = (
        (folder / "five.toml")
        .read_text(encoding="utf-8")
        .replace("_phasor", "")
        .replace('"phasor_grid"', '"grid"')
    )
    text = text.replace('raw = "five.raw"', 'raw = "five.raw"\nstray_B = 0.05')
    for like, words in (
        ("psse", "its emf has the speed in it"),
        ("eurostag", "'psse', 'powerfactory' or 'andes'"),
    ):
        case = folder / "emt.toml"
        case.write_text(
            text.replace("[units]", f'[conventions]\nlike = "{like}"\n[units]'), encoding="utf-8"
        )
        with pytest.raises(CaseError, match=words):
            gfor.load(case).scenario("base")


@pytest.mark.nightly
def test_andes_still_has_them(folder):
    andes = pytest.importorskip("andes", reason="ANDES is not installed")
    andes.config_logger(40)
    system = andes.load(
        str(folder / "five.raw"),
        addfile=str(folder / "five.dyr"),
        setup=False,
        no_output=True,
        default_config=True,
    )
    for name in ("p2p", "p2i", "p2z", "q2q", "q2i", "q2z"):
        setattr(system.PQ.config, name, 1.0 if name.endswith("z") else 0.0)
    system.setup()
    system.PFlow.run()
    system.TDS.config.criteria = 0
    system.TDS.init()
    system.EIG.run()
    np.testing.assert_allclose(
        _swings_of(np.array([complex(z) for z in system.EIG.mu])), IN_ANDES, atol=1e-5
    )
