"""FMPy's judgement of structured names by their forms is that of the names themselves."""

from types import SimpleNamespace

import pytest

from orchestrator.devices.fmi import validation

LEGAL = ("a", "machine.X_d", "a1.b_2[3,4].c", "der(machine.omega)", "der(a,2)", "'q r'.b", "der.x")
ILLEGAL = ("3a", "a.3", "a..b", "a b", "x[]", "x[1,]", "x[a]", "'q", "a'b'", "a[12][3]", "é", "")
OF_DERIVATIVES = ("der(a.b,x)", "xder(a)", "der(der(a))", "der(")


def described(*names):
    variables = [SimpleNamespace(name=name, sourceline=k) for k, name in enumerate(names)]
    return SimpleNamespace(variableNamingConvention="structured", modelVariables=variables)


def lines(problems):
    return [int(problem.partition("(line ")[2].partition(")")[0]) for problem in problems]


@pytest.mark.parametrize("of", [str, validation.form_of_name])
def test_a_form_is_as_legal_as_its_name(of):
    names = (*LEGAL, *ILLEGAL, *OF_DERIVATIVES)
    problems = validation._judge_names(described(*map(of, names)))
    assert lines(problems) == [*range(len(LEGAL), len(names))]


def test_each_illegal_name_is_told_in_fmpys_words():
    of_all = described("x.a", "x[a]", "y.b", "z[b]")
    assert validation._names_by_forms(of_all) == validation._judge_names(of_all)
    assert lines(validation._names_by_forms(of_all)) == [1, 3]
    assert validation._names_by_forms(described("x.a", "z.c")) == []
