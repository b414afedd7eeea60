"""A draft reads from the descriptions what the declarations do not say, and marks it as a guess."""

import re
from dataclasses import replace

import pytest

from orchestrator.devices.binding.binding import bind
from orchestrator.devices.binding.draft import draft_binding
from orchestrator.devices.binding.hints import kind_of_current, kind_of_voltage, likely_unit
from orchestrator.devices.fmi.description import read_description
from tests.devices.acceptance.gallery.build import build
from tests.devices.acceptance.gallery.members import converter

TEXTS = {
    "vq": "Voltage at the terminals, phase peak [kV]",
    "vd": "Voltage at the terminals, phase peak [kV]",
    "iq": "Current drawn, peak [kA]",
    "id": "Current drawn, peak [kA]",
    "P_0": "Active power consumed at start [MW]",
    "Q_0": "Reactive power consumed at start [Mvar]",
    "v_0": "Grid voltage at start, line to line, rms [kV]",
    "theta_0": "Grid voltage angle at start [deg]",
    "omega": "Frequency [Hz]",
}
NAMES = {
    "P_0": "Pcons",
    "Q_0": "Qcons",
    "v_0": "Umag",
    "theta_0": "turn",
    "omega": "freq",
    "S_n": "size",
}


def described(folder, texts=TEXTS):
    """The converter as an exporter without units would have it: odd names, and all in the descriptions."""

    def change(text):
        text = re.sub(
            rb' unit="[^"]*"',
            b"",
            re.sub(rb"<UnitDefinitions>.*</UnitDefinitions>", b"", text, flags=re.S),
        )
        for name, words in texts.items():
            text = text.replace(
                f'name="{name}"'.encode(), f'name="{name}" description="{words}"'.encode()
            )
        for name, odd in NAMES.items():
            text = text.replace(f'name="{name}"'.encode(), f'name="{odd}"'.encode())
        return text

    source = replace(converter("odd", "qd"), change=change)
    return read_description(build(source, folder))


def test_units_values_direction_and_starts_come_from_the_descriptions(tmp_path):
    text = draft_binding(described(tmp_path))
    voltage, _, rest = text.partition("[current]")
    current, _, rest = rest.partition("# Where")
    starts, _, signals = rest.partition("[signals.omega]")
    assert 'unit = "kV"  # GUESS' in voltage
    assert 'value = "phase peak"  # GUESS' in voltage
    assert 'unit = "kA"  # GUESS' in current
    assert 'value = "peak"  # GUESS' in current
    assert 'direction = "into the converter"  # GUESS' in current
    assert re.search(r'\[start\.P_0\]\nvariable = "Pcons".*\nunit = "MW".*\nsign = -1', starts)
    assert re.search(r'\[start\.Q_0\]\nvariable = "Qcons".*\nunit = "Mvar".*\nsign = -1', starts)
    assert re.search(
        r'\[start\.v_0\]\nvariable = "Umag".*\nunit = "kV".*\nvalue = "line-to-line rms"', starts
    )
    assert re.search(r'\[start\.theta_0\]\nvariable = "turn".*\nunit = "deg"', starts)
    assert re.search(r'variable = "freq".*\nunit = "Hz"', signals)
    assert 'V_n = "REQUIRED' in voltage


def test_filled_in_the_draft_can_be_bound(tmp_path):
    fmu = described(tmp_path)
    text = re.sub(r'S_n = "REQUIRED[^"]*"', 'S_n = "1500 MVA"', draft_binding(fmu))
    path = tmp_path / "odd.toml"
    path.write_text(re.sub(r'V_n = "REQUIRED[^"]*"', 'V_n = "230 kV"', text), encoding="utf-8")
    assert set(bind(fmu, path).port.start) == {"P_0", "Q_0", "v_0", "theta_0"}


def test_a_draft_names_the_fmu_from_its_own_folder(tmp_path):
    (tmp_path / "fmus").mkdir()
    fmu = described(tmp_path / "fmus")
    assert f'file = "fmus/{fmu.path.name}"' in draft_binding(fmu, tmp_path)
    assert f'file = "{fmu.path.resolve().as_posix()}"' in draft_binding(fmu, tmp_path / "elsewhere")


def test_what_no_description_says_is_to_be_filled_in(tmp_path):
    text = draft_binding(described(tmp_path, {"vq": "Voltage [kV]", "vd": "Voltage [kV]"}))
    assert 'value = "REQUIRED: line-to-line rms' in text
    assert text.count('unit = "REQUIRED') >= 2
    assert 'direction = "into the grid"' in text
    assert "sign = -1" not in text
    assert "# [start.P_0]" in text


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("phase peak [kV]", "phase peak"),
        ("Line-to-line RMS voltage", "line-to-line rms"),
        ("phase-to-phase amplitude", "line-to-line peak"),
        ("phase rms", "phase rms"),
        ("peak of the year, rms of the phase", ""),
        ("voltage [kV]", ""),
        ("rms", ""),
    ],
)
def test_the_kind_of_a_voltage(text, kind):
    assert kind_of_voltage(text) == kind


@pytest.mark.parametrize(
    ("text", "kind"), [("Current, peak", "peak"), ("rms current [A]", "rms"), ("speak up", "")]
)
def test_the_kind_of_a_current(text, kind):
    assert kind_of_current(text) == kind


def test_a_declared_unit_counts_before_a_description(tmp_path):
    fmu = read_description(build(converter("plain"), tmp_path))
    info = replace(fmu.variables["v_re"], description="Voltage [kV]")
    assert likely_unit(info) == "pu"
    assert likely_unit(replace(info, unit="")) == "kV"
    assert likely_unit(replace(info, unit="", description="see [7] of the manual")) == ""
