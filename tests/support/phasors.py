"""A case with phasor models instead of EMT ones."""

import shutil

from orchestrator.cases.case import BUILT_IN, load_case


def as_phasors(name, folder):
    """The built-in case of that name, made of units, with phasor models at 1 ms; its files go to the folder."""
    text = (BUILT_IN / name / "case.toml").read_text(encoding="utf-8")
    for old, new in (
        ('model = "grid"', 'model = "phasor_grid"'),
        ('generator = "synchronous_generator"', 'generator = "synchronous_generator_phasor"'),
        ('converter = "gfor"', 'converter = "gfor_phasor"'),
        ('step_size = "100 us"', 'step_size = "1 ms"'),
    ):
        assert old in text
        text = text.replace(old, new)
    shutil.copy(BUILT_IN / name / "units.csv", folder)
    (folder / "case.toml").write_text(text, encoding="utf-8")
    return load_case(folder / "case.toml")
