"""A table that is handed out with a result, and which nobody can change by mistake."""

from typing import Any, NoReturn, TypeVar

Key = TypeVar("Key")
Entry = TypeVar("Entry")


class ReadOnlyTable(dict[Key, Entry]):
    """A dict that refuses to be changed; ``dict(table)`` is a copy that can be.

    Other than a `types.MappingProxyType` it can be pickled, copied and written as JSON."""

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError("this belongs to a result and cannot be changed; change a copy: dict(...)")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self),)
