"""How a part is written as percent: with a space before the sign, as in all texts for people."""

import ast

from tests.support.source_files import product_files

CELLS = {
    "output.report.html.chapters.runs",
    "output.report.short_texts",
    "studies.immittance.view",
    "studies.interactions.view",
    "studies.runs.tables",
    "studies.signals.ambient",
    "studies.validation.words",
}
"""Modules with narrow columns of tables, in which the sign follows the number."""


def formats(source):
    """Lines in which a number is formatted with its sign of percent."""
    for node in source.of(ast.JoinedStr, ast.Constant):
        if isinstance(node, ast.JoinedStr):
            specs = [one.format_spec for one in node.values if isinstance(one, ast.FormattedValue)]
            if any(ast.unparse(one).endswith("%'") for one in specs if one is not None):
                yield node.lineno
        elif isinstance(node.value, str) and "%}" in node.value:
            yield node.lineno


def test_a_sentence_has_a_space_before_the_sign_of_percent():
    """Causes explained "77%" of an error, which is "77 %" elsewhere."""
    found = {}
    for source in product_files("orchestrator"):
        if lines := sorted({*formats(source)}):
            found[source.module.removeprefix("orchestrator.")] = lines
    assert {*found} == CELLS, found
    assert len(found["studies.validation.words"]) == 1
