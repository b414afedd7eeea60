"""Every figure of a study of interactions, as JSON, table and page, is one of its systems' own."""

from orchestrator.linear.spectra.modes import damping_percent
from orchestrator.studies.interactions.places import by_group
from orchestrator.studies.interactions.view import _figures, pairs_table
from tests.studies.interactions.park import park
from tests.support.figures import foreign_in_json, foreign_in_text


def own_figures():
    """The systems' modes, and what is computed of them: sums over a vendor's converters, and falls from one system to
    another, here from eigenvalues that were followed."""
    result, judgement = park().result, park().judgement
    modes = [mode for record in result.records.values() for mode in record.modes]
    modes += [record.growing for record in result.records.values() if record.growing]
    shares = [[mode.components, by_group(mode.components, result.plan.groups)] for mode in modes]
    shown = [pair.mode for pair in judgement.pairs if pair.mode]
    followed = [(one.together.eigenvalue, *one.alone, one.neither) for one in shown]
    known = [[x for x in each if x is not None] for each in followed]
    falls = [
        min(map(damping_percent, each[1 : 1 + len([x for x in one.alone if x is not None])]))
        - damping_percent(each[0])
        for one, each in zip(shown, known, strict=True)
    ]
    request = result.plan.request
    return {
        "eigenvalues": [mode.eigenvalue for mode in modes],
        "shares": shares,
        "followed": known,
        "falls_points": falls,
        "asked": [request.threshold, *request.frequencies],
        "of_the_whole_spectrum": [record.stability for record in result.records.values()],
    }


def test_of_the_json():
    said = park().as_json()
    kept = {key: value for key, value in said.items() if key not in {"subject", "basis"}}
    assert foreign_in_json(kept, own_figures()) == []


def test_a_unit_and_a_sign_are_seen():
    said = park().as_json()["pairs"][0]
    for key, factor in (("falls_by_points", 100), ("mode_hz", 6.283185), ("falls_by_points", -1)):
        wrong = said | {key: factor * said[key]}
        assert foreign_in_json(wrong, own_figures()) == [(f".{key}", wrong[key])]


def test_of_the_tables():
    source, tables = own_figures(), (pairs_table(park().judgement),)
    for table in tables:
        for column in table.shown_columns[1:]:
            for row in table.rows:
                cell = column.cell(row)
                assert foreign_in_text(cell, source, column.heading) == [], column.heading
    for column in _figures(lambda system: system):
        for system in park().judgement.systems.values():
            cell = column.cell(system) if column.heading else ""
            text = getattr(cell, "text", cell)
            assert foreign_in_text(text, source, column.heading) == [], column.heading
