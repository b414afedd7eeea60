"""Refusals of records: those of one file are told together, not one by one as each is mended."""

from collections.abc import Iterator
from contextlib import contextmanager

from orchestrator.core.errors import InputError

_BETWEEN = "\n  "


class Refusals:
    """The errors of what was refused so far."""

    def __init__(self) -> None:
        self._found: list[InputError] = []

    @contextmanager
    def keep(self) -> Iterator[None]:
        """Keep the error of what is read inside, and go on."""
        try:
            yield
        except InputError as error:
            self._found.append(error)

    def tell(self) -> None:
        """Raise what was kept as one error, each text once; nothing where nothing was refused."""
        texts = list(dict.fromkeys(error.message for error in self._found))
        if len(texts) == 1:
            raise self._found[0]
        if texts:
            raise InputError(_BETWEEN.join(texts))
