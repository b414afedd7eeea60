"""The table of stability against the grid's strength in the leaflet of the grid-following converter.

``python -m tests.pages.stability_table`` writes it.
"""

from tests.pages.markdown import ROOT
from tests.support.weak_grid import least_stable

PAGE = ROOT / "fmus" / "grid_following" / "README.md"
RATIOS = (50, 20, 10, 5, 3, 2, 1.5, 1.3, 1.1)
COLUMNS = {
    "`gfl`, P and Q": ("gfl", {}),
    "P and voltage": ("gfl", {"reactive_power.mode": 1}),
    "Q-V droop": ("gfl", {"reactive_power.mode": 2}),
    "P and voltage, PLL 30 Hz": ("gfl", {"reactive_power.mode": 1, "pll.f_0": 30.0}),
    "`gfor`": ("gfor", {}),
    "`gfor`, τ_P = 20 ms": ("gfor", {"droop.tau_P": 0.02}),
}
BEGIN, END = "<!-- stability -->", "<!-- /stability -->"


def section() -> str:
    """The generated part of the page, markers included."""
    rows = [f"| SCR | {' | '.join(COLUMNS)} |", "|---" * (len(COLUMNS) + 1) + "|"]
    for ratio in RATIOS:
        cells = [_cell(least_stable(model, ratio, **values)) for model, values in COLUMNS.values()]
        rows.append(f"| {ratio} | {' | '.join(cells)} |")
    return "\n".join([BEGIN, *rows, END])


def _cell(mode: complex) -> str:
    text = f"{mode.real:+.1f}".replace("-", "−")
    if abs(mode.imag) > 0.5:
        text += f" ± j{abs(mode.imag):.0f}"
    return f"**{text}**" if mode.real > 0 else text


def main() -> None:
    text = PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    after = rest.partition(END)[2] if END in rest else rest
    PAGE.write_text(before + section() + after, encoding="utf-8")


if __name__ == "__main__":
    main()
