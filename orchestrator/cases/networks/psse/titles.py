"""Titles between the sections of a RAW file: the section that each means, however its program spells it.

PSS/E, its converter (``rawd33``), PowerWorld, PowSyBl and PowerModels each write titles of their own.  The sections are
those of the data formats that PowSyBl's and MATPOWER's readers document."""

import re

# (words of which all stand in the title, section), the more telling first: a title such as "TRANSFORMER IMPEDANCE
# CORRECTION" has the words of two sections
_MEANINGS: tuple[tuple[tuple[str, ...], str], ...] = (
    (("substation",), "substation"),
    (("correction",), "impedance correction"),
    (("rating", "set"), "switching device rating set"),
    (("switching", "device"), "system switching device"),
    (("load", "type"), "load type"),
    (("interface", "element"), "interface element"),
    (("interface",), "interface"),
    (("adjustment",), "transformer adjustment"),
    (("multi", "section"), "multi-section line"),
    (("multisection",), "multi-section line"),
    (("multi", "terminal"), "multi-terminal dc"),
    (("multiterminal",), "multi-terminal dc"),
    (("vsc",), "vsc dc line"),
    (("voltage", "source"), "vsc dc line"),
    (("two", "terminal"), "two-terminal dc"),
    (("dc",), "two-terminal dc"),
    (("facts",), "facts device"),
    (("induction",), "induction machine"),
    (("gne",), "gne"),
    (("generic", "network"), "gne"),
    (("transfer",), "inter-area transfer"),
    (("transaction",), "inter-area transfer"),
    (("area", "interchange"), "area"),
    (("inter", "area"), "inter-area transfer"),
    (("interarea",), "inter-area transfer"),
    (("droop",), "voltage droop control"),
    (("system", "wide"), "system-wide"),
    (("switched", "shunt"), "switched shunt"),
    (("shunt",), "fixed shunt"),
    (("non", "transformer"), "branch"),
    (("nontransformer",), "branch"),
    (("transformer",), "transformer"),
    (("generator",), "generator"),
    (("unit",), "generator"),
    (("owner",), "owner"),
    (("zone",), "zone"),
    (("area",), "area"),
    (("branch",), "branch"),
    (("line",), "branch"),
    (("load",), "load"),
    (("bus",), "bus"),
)


def section_of(title: str) -> str:
    """The section that a title means; the title itself in small letters if it means none that is known."""
    words = re.findall(r"[a-z]+", title.lower())
    singular = {*words, *(word.removesuffix("s") for word in words)}
    if "buses" in words:
        singular.add("bus")
    return next(
        (section for wanted, section in _MEANINGS if singular.issuperset(wanted)), " ".join(words)
    )
