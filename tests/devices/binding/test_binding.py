"""Bindings: every form, unit and base comes down to the same port, and every mistake is told with its place."""

from dataclasses import replace

import numpy as np
import pytest

from orchestrator.core.errors import BindingError, InputError
from orchestrator.devices.binding.binding import bind, bound_fmu
from orchestrator.devices.binding.draft import draft_binding
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.instance import open_component
from orchestrator.systems.coupling.master import Master
from tests.support.bindings import GFOR_RATED
from tests.support.scenarios import prepare_one

H = 1e-4
START = {"P_0": 0.6, "Q_0": 0.15, "v_0": 1.02, "theta_0": 0.3}

OURS = f"""{GFOR_RATED}[signals]
omega = {{ variable = "omega" }}
"""


@pytest.fixture
def binding(tmp_path):
    """Write a binding's text."""

    def write(text, name="vendor.toml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


def response(description, parameters=START, steps=300):
    """i, p and q of a converter whose voltage swings in magnitude and angle."""
    with open_component("box", description, isolated=False) as component:
        component.set({k: v for k, v in parameters.items() if k in description.variables})
        component.setup(0.0, None)
        component.enter_initialization_mode()
        inputs = RealBatch(component, ["v_re", "v_im"])
        names = ["i_re", "i_im", *[n for n in ("p", "q") if n in description.variables]]
        outputs = RealBatch(component, names)
        rows = []
        for k in range(steps + 1):
            v = 1.02 * (1 + 0.03 * np.sin(7 * H * k)) * np.exp(1j * (0.3 + 4.0 * H * k))
            inputs.values[:] = v.real, v.imag
            inputs.write()
            if k == 0:
                component.exit_initialization_mode()
            else:
                component.step((k - 1) * H, H)
            rows.append(outputs.read().copy())
    return np.array(rows)


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        ("converter_qd_si", 1e-12),
        ("converter_polar_si", 1e-11),
        ("converter_power_si", 1e-11),
        ("converter_abc_si", 1e-10),
    ],
)
def test_every_form_is_the_same_converter(name, tolerance, gallery):
    """Kilovolts, kiloamperes and megawatts, phases and angles against per unit without a binding."""
    plain, bound = response(bound_fmu(gallery("converter")[0])), response(bound_fmu(*gallery(name)))
    assert np.abs(plain).max() > 5  # pu on 100 MVA
    np.testing.assert_allclose(bound[:, :2], plain, rtol=0, atol=tolerance * 15)


def test_power_at_the_port_is_the_power_asked_for(gallery):
    for name in ("converter_qd_si", "converter_polar_si", "converter_power_si", "converter_abc_si"):
        first = response(bound_fmu(*gallery(name)), steps=0)[0]
        np.testing.assert_allclose(first[2:], [0.6, 0.15], atol=1e-12)


def test_another_rating_is_that_many_units_in_parallel(gallery):
    description = bound_fmu(*gallery("converter_qd_si"))
    one, three = response(description), response(description, START | {"S_n": 4500.0})
    np.testing.assert_allclose(three[:, :2], 3 * one[:, :2], rtol=1e-14)
    np.testing.assert_allclose(three[:, 2:], one[:, 2:], rtol=1e-13)


def test_a_frame_that_is_turned_and_a_current_into_the_converter(gallery, binding):
    turned = OURS.replace('S_n = { variable = "S_n" }\n', "")
    for table in ("voltage", "current"):
        turned = turned.replace(f"[{table}]", f'[{table}]\nframe_angle = "-40 deg"')
    turned = turned.replace(
        'base = "100 MVA"', 'base = "100 MVA"\ndirection = "into the converter"'
    )
    plain = response(bound_fmu(gallery("converter")[0]))
    bound = response(bind(read_description(gallery("converter")[0]), binding(turned)))
    np.testing.assert_allclose(-bound[:, :2], plain, rtol=0, atol=1e-10)


def test_a_restored_state_holds_the_conversion_as_well(gallery):
    description = bound_fmu(*gallery("converter_abc_si"))
    with open_component("box", description, isolated=False) as component:
        component.setup(0.0, None)
        component.enter_initialization_mode()
        component.set({"v_re": 1.0, "v_im": 0.0})
        component.exit_initialization_mode()
        outputs = RealBatch(component, ["i_re", "i_im"])

        def run():
            for k in range(20):
                component.set({"v_re": 0.98})
                component.step(k * H, H)
            return outputs.read().copy()

        saved = component.save_state()
        first = run()
        component.restore_state(saved)
        np.testing.assert_array_equal(run(), first)
        component.free_state(saved)


def test_our_converter_behind_a_binding_is_our_converter(fmu_path, binding):
    """In the two-area system, to the last bit, with the same compiled loop."""
    ends = []
    for bound in (False, True):
        prepared = prepare_one("two_area", "pod_pq")
        if bound:
            prepared.system.components["gfor"].description = bound_fmu(
                fmu_path("gfor"), binding(OURS)
            )
        with Master(prepared.system, prepared.schedule, prepared.step_size) as master:
            master.advance(500)
            ends.append(
                (master.y.copy(), master.components["gfor"].get(["omega", "p", "q", "pod_p.K"]))
            )
    np.testing.assert_array_equal(ends[0][0], ends[1][0])
    assert ends[0][1] == pytest.approx(ends[1][1], rel=1e-14)


# -- mistakes --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('S_n = "1500 MVA"', 'S_n = "1500 kV"', "rating: S_n: .*kV.*MVA is needed"),
        ('S_n = "1500 MVA"', 'S_n = "-3 MVA"', "S_n = -3 MVA; it must exceed 0"),
        (
            '["v_re", "v_im"]',
            '["v_re", "v_xx"]',
            "voltage: the FMU has no variable 'v_xx'; `gfor fmu info",
        ),
        (
            '["v_re", "v_im"]',
            '["v_re", "v_re"]',
            "voltage: form 'rectangular' needs 2 different variables",
        ),
        (
            '["v_re", "v_im"]',
            '["v_re", "i_im"]',
            "voltage: i_im is of causality output; input is needed",
        ),
        (
            '["v_re", "v_im"]',
            '["v_re", "v_im"]\nunit = "kV"',
            "unit = 'kV', but the FMU declares v_re in 'pu'",
        ),
        ('["v_re", "v_im"]', '["v_re", "v_im"]\nbase = "33 kV"', "V_n under"),
        ('base = "100 MVA"', 'base = "100 kV"', "base: .*MVA is needed"),
        ('base = "100 MVA"', 'bass = "100 MVA"', "current.bass: this key is unknown"),
        (
            '"rectangular"\nvariables = ["v',
            '"sideways"\nvariables = ["v',
            "voltage.form: it must be",
        ),
        ("P_0 = {", "P_1 = {", "start.P_1: there is no start value of that name; choose from S_n"),
        ('P_0 = { variable = "P_0" }', 'P_0 = { variable = "Q_0" }', "Q_0: bound more than once"),
        (
            'P_0 = { variable = "P_0"',
            'P_0 = { variable = "REQUIRED"',
            "start.P_0.*: still to be filled in: variable",
        ),
        (
            "[signals]",
            "[parameters]\nnone = 3\n[signals]",
            "parameters.none: the FMU has no parameter of that name",
        ),
        (
            "[rating]",
            '[fmu]\nguid = "{other}"\n[rating]',
            "the binding is for the FMU {other}, this one is",
        ),
    ],
)
def test_a_mistake_is_told_with_its_place(old, new, words, fmu_path, binding):
    assert old in OURS
    with pytest.raises(BindingError, match=words) as caught:
        bound_fmu(fmu_path("gfor"), binding(OURS.replace(old, new, 1)))
    assert caught.value.exit_code == 2


def test_a_binding_says_what_the_fmu_is(fmu_path, binding):
    own = read_description(fmu_path("gfor"))
    kind = {
        said: bind(own, binding(f"{said}\n{OURS}")).kind for said in ("", 'fmu.kind = "machine"')
    }
    assert list(kind.values()) == ["converter", "machine"]
    with pytest.raises(BindingError, match=r"fmu\.kind: .*'converter' or 'machine'"):
        bind(own, binding(f'fmu.kind = "engine"\n{OURS}'))


def test_all_mistakes_are_told_together(fmu_path, binding):
    text = OURS.replace('"v_re", "v_im"', '"v_re", "x"').replace(
        'variable = "omega"', 'variable = "y"'
    )
    with pytest.raises(BindingError, match="2 problems"):
        bound_fmu(fmu_path("gfor"), binding(text))


def test_what_is_in_volts_needs_to_say_which(gallery, binding):
    path, good = gallery("converter_qd_si")
    text = good.read_text(encoding="utf-8").replace('value = "phase peak"', "", 1)
    with pytest.raises(
        BindingError, match="a voltage in kV needs the key 'value', one of: line-to-line rms"
    ):
        bound_fmu(path, binding(text))


def test_a_file_that_is_not_there_or_not_toml(fmu_path, binding, tmp_path):
    with pytest.raises(InputError, match=r"`gfor fmu bind FILE\.fmu` drafts one"):
        bound_fmu(fmu_path("gfor"), tmp_path / "none.toml")
    with pytest.raises(InputError, match="not a TOML file"):
        bound_fmu(fmu_path("gfor"), binding("[rating"))


# -- drafts ----------------------------------------------------------------------------------------


def test_the_draft_for_our_own_converter_needs_no_change(fmu_path, binding):
    description = read_description(fmu_path("gfor"))
    text = draft_binding(description)
    assert "REQUIRED" not in text.partition("[fmu]")[2]
    assert (
        bind(description, binding(text)).port == bind(description, binding(OURS, "ours.toml")).port
    )


@pytest.mark.parametrize(
    ("name", "form"),
    [
        ("converter_qd_si", "dq"),
        ("converter_polar_si", "polar"),
        ("converter_abc_si", "abc"),
        ("converter_power_si", "power"),
    ],
)
def test_a_draft_marks_guesses_and_what_it_cannot_know(name, form, gallery, binding):
    description = read_description(gallery(name)[0])
    text = draft_binding(description)
    current = text.partition("[current]")[2].partition("[start")[0]
    if name != "converter_qd_si":  # q before d, or d before q, no name tells
        assert f'form = "{form}"  # GUESS' in current
    assert all(f'"{name}"' in current for name in description.outputs if name != "omega")
    if form != "abc":
        assert 'value = "REQUIRED' in text
    for start in ("P_0", "Q_0", "v_0", "theta_0"):
        assert f'[start.{start}]\nvariable = "{start}"  # GUESS' in text
    with pytest.raises(BindingError, match="still to be filled in"):
        bind(description, binding(text))


def test_a_draft_of_something_else_asks_for_everything(gallery, binding):
    description = read_description(gallery("lag")[0])
    text = draft_binding(description)
    assert text.count("REQUIRED") >= 5
    with pytest.raises(BindingError, match="still to be filled in"):
        bind(description, binding(text))


SWITCH = '"pod_p.enabled" = { variable = "pod_q.enabled" }\n'


def test_a_switch_has_a_name_of_ours(binding, fmu_path):
    """A Boolean parameter is shown under our name, and takes what is set there."""
    found = bound_fmu(fmu_path("gfor"), binding(OURS + SWITCH))
    info = found.variables["pod_p.enabled"]
    assert (info.type, info.causality, found.inner_names["pod_p.enabled"]) == (
        "Boolean",
        "parameter",
        "pod_q.enabled",
    )
    with open_component("box", found, isolated=False) as component:
        for value in (True, False):
            component.set({"pod_p.enabled": value})
            assert component.values(["pod_p.enabled"]) == {"pod_p.enabled": value}
            assert component.inner.values(["pod_q.enabled", "pod_p.enabled"]) == {
                "pod_q.enabled": value,
                "pod_p.enabled": False,
            }


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        (
            '"pod_p.enabled" = { variable = "omega" }',
            "omega is of causality output; parameter or input is needed",
        ),
        (
            '"pod_p.enabled" = { variable = "pod_p.K" }',
            "pod_p.K is of type Real; Boolean is needed here",
        ),
        (
            '"pod_p.enabled" = { variable = "pod_q.enabled", unit = "pu" }',
            "has no unit and no base; remove them",
        ),
        ('delta_p_pod = { variable = "pod_q.enabled" }', "is of type Boolean; Real is needed here"),
    ],
)
def test_a_switch_is_a_boolean_that_can_be_set(binding, fmu_path, entry, said):
    with pytest.raises(BindingError, match=said):
        bound_fmu(fmu_path("gfor"), binding(OURS + entry))


def test_a_bound_parameter_stays_a_parameter(binding, fmu_path):
    """It can be set by its name, has its start value and bounds in our unit, and is no output of the device."""
    text = OURS + 'wait = { variable = "pod_q.T_W" }\n'
    description = bind(read_description(fmu_path("gfor")), binding(text))
    found, own = (each.variables for each in (description, description.inner))
    assert (found["wait"].causality, found["wait"].variability) == ("parameter", "tunable")
    factor = description.port.signals["wait"].factor
    assert found["wait"].start_number == pytest.approx(factor * own["pod_q.T_W"].start_number)
    assert found["wait"].minimum == pytest.approx(factor * own["pod_q.T_W"].minimum)
    assert found["omega"].causality == "output"


@pytest.mark.parametrize(
    ("name", "variable", "factor"),
    [
        ("delta_p_pod", '"S_base"', 1 / 1500),
        ("pod_p.limit", '"pod_q.limit", base = "100 MVA"', 100 / 1500),
        ("pod_p.limit", '"pod_q.limit"', 1.0),
        ("wait", '"S_base"', 1.0),
    ],
)
def test_power_of_a_damping_controller_is_per_unit_of_the_rating(
    name, variable, factor, binding, fmu_path
):
    """Its output is compared with its limit: both have to have one base."""
    text = OURS + f'"{name}" = {{ variable = {variable} }}\n'
    found = bind(read_description(fmu_path("gfor")), binding(text))
    assert found.port.signals[name].factor == pytest.approx(factor)
    assert found.variables[name].unit == ("MVA" if name == "wait" else "pu")


def test_a_draft_takes_no_frequency_for_the_rating(gallery):
    description = read_description(gallery("converter")[0])
    hertz = replace(description.variables["tau"], name="f_rated", unit="Hz", start=50.0)
    others = {k: v for k, v in description.variables.items() if k != "S_n"}
    text = draft_binding(replace(description, variables={"f_rated": hertz, **others}))
    assert "f_rated" not in text.partition("[start.S_n]")[0].partition("[voltage]")[0]
