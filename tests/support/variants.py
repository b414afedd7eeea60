"""Built-in cases with parts of their text replaced."""

import shutil

from orchestrator.cases.case import BUILT_IN, load_case


def changed(name, folder, *replacements):
    """The built-in case of that name, made of units, with pairs of old and new text; its files go to the folder."""
    text = (BUILT_IN / name / "case.toml").read_text(encoding="utf-8")
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    shutil.copy(BUILT_IN / name / "units.csv", folder)
    (folder / "case.toml").write_text(text, encoding="utf-8")
    return load_case(folder / "case.toml")


def as_phasors(name, folder):
    """The case with phasor models at 1 ms."""
    return changed(
        name,
        folder,
        ('model = "grid"', 'model = "phasor_grid"'),
        ('generator = "synchronous_generator"', 'generator = "synchronous_generator_phasor"'),
        ('converter = "gfor"', 'converter = "gfor_phasor"'),
        ('step_size = "100 us"', 'step_size = "1 ms"'),
    )


def with_load_model(name, folder, keys):
    """The case with ``[network.load_model]`` and these keys."""
    return changed(
        name, folder, ("[network.loads]", f"[network.load_model]\n{keys}\n\n[network.loads]")
    )
