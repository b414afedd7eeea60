"""Tutorials are notebooks: they run, they show what the page shows, and their text says what they compute."""

import re

import pytest

from tests.pages.markdown import ROOT, name_of
from tests.pages.notebooks import NOTEBOOKS, execute, nbformat, shown_text

MODE = 'named["electromechanical"]'
CLAIMS = {
    "paper": [
        "f'grows with {electromechanical[\"base\"].eigenvalue.real:.3f} 1/s'",
        "f'The converter brings {electromechanical[\"gfor\"].damping_percent:.1f} % of damping'",
        "f'POD-P {electromechanical[\"pod_p\"].damping_percent:.1f} %'",
        "f'POD-Q\\n{electromechanical[\"pod_q\"].damping_percent:.1f} %'",
        "f'both together {electromechanical[\"pod_pq\"].damping_percent:.1f} %'",
    ],
    "pod-design": [
        f"f'{{without.{MODE}.frequency_hz:.3f}} Hz with {{without.{MODE}.damping_percent:.1f}} % of damping'",
        "f'T_S1 = {design.parameters[\"gfor.pod_p.T_S1\"]:.3f} s'",
        "f'T_S2 = {design.parameters[\"gfor.pod_p.T_S2\"]:.3f} s'",
        "f'raise it to K = {design.parameters[\"gfor.pod_p.K\"]:.0f} pu'",
        f"f'really gives: {{designed.{MODE}.damping_percent:.1f}} %'",
        "f'requirement of {design.table().required_percent.iloc[-1]:.1f} % is met' if design.met else 'not met'",
        "f'needs K = {refined.parameters[\"gfor.pod_p.K\"]:.0f} pu only' if refined.met else 'not met'",
    ],
    "psse": [
        'f\'{modes["base"].named["inter-area"].frequency_hz:.2f} Hz with \''
        'f\'{modes["base"].named["inter-area"].damping_percent:.1f} % of damping\'',
        'f\'slows to {modes["outage"].named["inter-area"].frequency_hz:.2f} Hz\'',
        'f\'to {modes["gfor"].named["inter-area"].damping_percent:.1f} % with both circuits\'',
        'f\'to {modes["outage_gfor"].named["inter-area"].damping_percent:.2f} % with one\'',
        "f'gives {damping[\"outage_gfor\"]:.1f} % with the outage'",
        "f'same setting gives {damping[\"gfor\"]:.1f} %' if dv < 1e-5 and da < 1e-4 else 'another power flow'",
    ],
    "recorder": [
        'f\'with a gain of about {causes["with"].iloc[0]["pod_p.K"]:.0f} pu\'',
        "f'explains {100 * causes[\"share\"].iloc[0]:.1f} % of the squared error'",
        "f'K = {fitted[\"pod_p.K\"]:.1f} pu'",
        "'the limits are met' if final.verdict == 'met' else final.verdict",
    ],
    "vendor-fmu": [
        "f'asks {len(report.table())} questions'",
        f"f'{{plain.{MODE}.damping_percent:.1f}} % of damping as delivered'",
        f"f'{{pod_p.{MODE}.damping_percent:.1f}} % with POD-P'",
        'f\'gives {max(map(float, __import__("re").findall(r"[0-9.]+(?= pu)", remark)))} pu\'',
    ],
    "your-network": [
        'f\'at {rows["as it is"]["frequency [Hz]"]:.2f} Hz with {rows["as it is"]["damping [%]"]:.1f} % of damping\'',
        'f\'adds {case.scenario("pod_p").modes().named["inter-machine"].damping_percent'
        ' - rows["as it is"]["damping [%]"]:.1f} points only\'',
        'f\'slows the mode to {rows["longer tie"]["frequency [Hz]"]:.2f} Hz\'',
        'f\'to {rows["longer tie"]["damping [%]"]:.1f} %\'',
    ],
}
"""What the text of each notebook says of its figures, as expressions in the notebook's own names."""

_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_LARGEST = 150_000
"""Bytes of a notebook: outputs are small enough to be read as a difference between two commits."""


def test_every_tutorial_is_a_notebook_with_claims():
    assert {path.stem for path in NOTEBOOKS} == set(CLAIMS)
    assert not list((ROOT / ".docs" / "tutorials").glob("*.md"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=name_of)
def test_a_notebook_is_kept_as_a_reader_can_use_it(path):
    """Executed from top to bottom, with pictures, without errors, and without a trace of the machine."""
    notebook, text = nbformat.read(path, as_version=4), path.read_text(encoding="utf-8")
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    outputs = [output for cell in code for output in cell.outputs]
    drawn = [cell.id for cell in code if ".plot(" in cell.source]
    assert drawn
    assert drawn == [
        cell.id for cell in code if any("image/png" in o.get("data", {}) for o in cell.outputs)
    ]
    assert not [o for o in outputs if o.output_type == "error" or o.get("name") == "stderr"]
    assert not re.search(r"/tmp/|/home/|/root/|/work/|site-packages|object at 0x", text)
    assert "execution" not in text.replace("execution_count", ""), "times of execution"
    assert len(text) < _LARGEST


def test_every_cell_that_draws_shows_its_picture(tmp_path):
    """Also the second one: the backend of notebooks sets itself up with the first figure."""
    path = tmp_path / "small.ipynb"
    cells = [
        nbformat.v4.new_code_cell(
            "from orchestrator.output.report.notebook import new_axes\nnew_axes().plot([0, 1]);"
        )
    ]
    cells += [nbformat.v4.new_code_cell("new_axes().plot([1, 0]);") for _ in range(2)]
    path.write_text(nbformat.writes(nbformat.v4.new_notebook(cells=cells)), encoding="utf-8")
    executed = execute(path, tmp_path)
    assert [
        ["image/png" in o.get("data", {}) for o in cell.outputs] for cell in executed.cells
    ] == 3 * [[True]]


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.parametrize("path", NOTEBOOKS, ids=name_of)
def test_a_notebook_computes_what_it_shows_and_says(path, tmp_path):
    kept = nbformat.read(path, as_version=4)
    claims = CLAIMS[path.stem]
    executed = execute(
        path, tmp_path, "print('\\n'.join(repr(claim) for claim in [" + ", ".join(claims) + "]))"
    )
    fresh = dict(shown_text(executed))
    for cell, shown in shown_text(kept):
        assert alike(shown, fresh[cell]), (
            f"{path.name}, cell {cell} showed\n{shown}\nand shows\n{fresh[cell]}"
        )
    prose = "\n".join(cell.source for cell in kept.cells if cell.cell_type == "markdown")
    said = [eval(line) for line in shown_text(executed)[-1][1].splitlines()]
    assert len(said) == len(claims)
    assert [claim for claim in said if claim not in prose] == []


def alike(a: str, b: str) -> bool:
    """Whether two outputs have the same words, and numbers that differ by one unit of their last digit at most."""
    if " ".join(_NUMBER.sub("#", a).split()) != " ".join(_NUMBER.sub("#", b).split()):
        return False
    return all(near(x, y) for x, y in zip(_NUMBER.findall(a), _NUMBER.findall(b), strict=True))


_IN_FULL = 15
"""Digits from which on a number is printed in full: the last of them are rounding errors of a machine's arithmetic."""
_ROUNDING = 1e-9
"""Part of a number that such errors may make, after a fit or an eigenvalue."""


def near(a: str, b: str) -> bool:
    """Whether two printed numbers may come from the same figure, rounded on two machines."""
    mantissa, _, exponent = a.partition("e")
    unit = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    apart, size = abs(float(a) - float(b)), max(abs(float(a)), abs(float(b)))
    in_full = min(sum(map(str.isdigit, text)) for text in (a, b)) >= _IN_FULL
    return apart <= 1.01 * unit or size < 1e-6 or (in_full and apart <= _ROUNDING * size)


@pytest.mark.parametrize(
    ("a", "b", "same"),
    [
        ("K = 68.1 pu", "K = 68.2 pu", True),
        ("K = 68.1 pu", "K = 68.3 pu", False),
        ("K = 68.1 pu", "K = 68.1 s", False),
        ("residual 1.1e-16", "residual 2.4e-13", True),
        ("residual 1.1e-16", "residual 2.4e-3", False),
        ("shift 1.10e-03", "shift 1.11e-03", True),
        ("shift 1.10e-03", "shift 1.13e-03", False),
        ("{'K': 120.01552675683519}", "{'K': 120.01552675683337}", True),
        ("{'K': 120.01552675683519}", "{'K': 120.01553675683337}", False),
    ],
)
def test_what_counts_as_the_same_output(a, b, same):
    assert alike(a, b) is same
