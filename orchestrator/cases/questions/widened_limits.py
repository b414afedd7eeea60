"""The question about limits of exciters and governors that the case widens to its operating point."""

from orchestrator.cases.draft import Draft
from orchestrator.cases.questions.plausibility import is_meant
from orchestrator.core.errors import Problem, QuestionTopic
from orchestrator.core.question_kinds import answer

_SINGLE = 3  # limits that are answered one by one; more are answered by what they are


def widened_questions(draft: Draft) -> list[Problem]:
    """Ask about all limits that are widened, but for those that are meant or that a value by name overrides."""
    meant = draft.given.case.meant
    open_ = [
        name
        for name, (_, where) in draft.found.widened.items()
        if draft.places[name] == where and not is_meant(name, meant)
    ]
    if not open_:
        return []
    told = ", ".join(_widening(draft, name) for name in open_)
    variables = dict.fromkeys(name.partition(".")[2] for name in open_)
    answers = open_ if len(open_) <= _SINGLE else [f"*.{variable}" for variable in variables]
    text = (
        f"the operating point lies beyond limits of the dynamics data, which are widened: {told}; PSS/E would start "
        "with suspect initial conditions and drift to the limit, GridPACK and PowerWorld widen it; correct the record, "
        f"the voltage or the power, and remove the line here; if it is meant, say so at the top of the case: "
        f"{answer(answers)}"
    )
    about = open_[0].partition(".")[0]
    topic = QuestionTopic("a limit that is widened", about, tuple(answers))
    return [Problem(draft.given.place("units", "widened_limits"), text, topic=topic)]


def _widening(draft: Draft, name: str) -> str:
    component, _, variable = name.partition(".")
    given, _ = draft.found.widened[name]
    taken = draft.system.components[component].number(variable)
    return f"{name} from {given:g} to {taken:g}"
