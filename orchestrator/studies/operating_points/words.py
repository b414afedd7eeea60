"""Numbers of operating points with outages, in words."""

ONE_ITEM = "the one operating point"


def all_items(total: int, every: str = "all") -> str:
    """Return ``all 12 points and outages``; of a single one that it is one."""
    return ONE_ITEM if total == 1 else f"{every} {total} points and outages"


def counted_items(number: int, total: int, planned: int | None = None) -> str:
    """Return ``3 of 12 points and outages``; of a single one, if no more were planned, that it is one."""
    single = number == total == 1 and planned in (None, 1)
    return ONE_ITEM if single else f"{number} of {total} points and outages"
