"""Questions of one kind in one line: the first of them, how many more there are, and about what."""

from collections.abc import Iterable, Iterator, Mapping, Sequence

from orchestrator.core.errors import Problem, QuestionTopic, few

_LEAST = 3  # questions of a kind from which one line stands for them
_SHOWN = 4  # names of the others


def answer(variables: Sequence[str]) -> str:
    """Return the line of a case file that says of variables that their values are meant."""
    quoted = ", ".join(f'"{name}"' for name in variables)
    return f"meant = [{quoted}]"


def by_kind(questions: Mapping[str, Problem], command: str = "") -> dict[str, str]:
    """Return lines by the first question that they are for: each kind of which there are several has one line.

    Parameters
    ----------
    questions
        The questions by their texts, as they are shown. One without a topic is the only one of its kind.
    command
        Lists all of them; it is not named where it is empty."""
    kinds: dict[str, list[str]] = {}
    for text, question in questions.items():
        kind = question.topic.kind if question.topic else text
        kinds.setdefault(kind, []).append(text)
    lines = dict[str, str]()
    for texts in kinds.values():
        of_kind = {text: questions[text].topic for text in texts}
        for first, line in _lines(of_kind, command):
            lines[first] = _with_short_place(line, questions[first], command)
    return lines


def questions_below(questions: Iterable[Problem]) -> list[str]:
    """Return a line that tells beside an answer how many questions stand below it, and about what; none without any.

    A verdict rests on the values that are questioned, and a reader of its line may read no further."""
    about = {
        str(one): next(iter(one.topic.variables), one.place) if one.topic else one.place
        for one in questions
    }
    if not about:
        return []
    number = f"{len(about)} question{'s' if len(about) > 1 else ''} below"
    names = [name for name in dict.fromkeys(about.values()) if name]
    return [f"{number}: {few(names, _SHOWN)}" if names else number]


def besides(problems: Sequence[Problem], questions: Sequence[Problem]) -> list[Problem]:
    """Return questions beside problems, one of each kind: unusual data may be the reason of the failure."""
    kind = problems[0].kind  # a question besides is of no kind of its own
    by_text: dict[str, Problem] = {}
    for question in questions:
        by_text.setdefault(question.text, question)
    return [
        Problem(
            by_text[first].place_in_short or by_text[first].place,
            f"questioned besides: {line}",
            kind,
            besides=True,
        )
        for first, line in by_kind(by_text).items()
    ]


def _with_short_place(line: str, question: Problem, command: str) -> str:
    """Have a line name the first of many records that its question lists, and the command that lists all."""
    if not question.place_in_short or question.place not in line:
        return line
    listed = f" [{command} lists all of them]" if command else ""
    return line.replace(question.place, question.place_in_short, 1) + listed


def _lines(topics: Mapping[str, QuestionTopic | None], command: str) -> Iterator[tuple[str, str]]:
    texts, known = [*topics], [topic for topic in topics.values() if topic]
    if len(known) < _LEAST:
        yield from zip(texts, texts, strict=True)
        return
    others = [topic.about for topic in known[1:] if topic.about]
    about = f" ({few(dict.fromkeys(others), _SHOWN)})" if others else ""
    listed = f"; {command} lists all" if command else ""
    more = f"[and {len(texts) - 1} more of this kind{about}{listed}]"
    yield texts[0], f"{_with_answer_for_all(texts[0], known)} {more}"


def _with_answer_for_all(text: str, topics: Sequence[QuestionTopic]) -> str:
    """Have a question name the answer to all of its kind, where all are about the same variable of a component."""
    variables = {name.partition(".")[2] for topic in topics for name in topic.variables}
    if len(variables) != 1:
        return text
    return text.replace(answer(topics[0].variables), answer([f"*.{variables.pop()}"]))
