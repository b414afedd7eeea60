"""Mistakes of dynamics data, which stop the reading: records that lack, fit no machine or have no part of ours."""

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

from fmus.grid_following.dyr_approximation import FIELDS, MODEL
from fmus.wecc_renewable.dyr_records import FIRST_GENERATION, OF_FIRST_GENERATION, PLANT_RECORDS
from orchestrator.cases.form.remedies import (
    APPROXIMATING,
    replacement_of,
    replacements_of,
    without_models,
)
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord
from orchestrator.cases.networks.psse.dyr_unit_records import RECORDS_OF_UNITS
from orchestrator.cases.networks.psse.machine_model import (
    KINDS_OF_CONVERTERS,
    OF_PLANTS,
    ON_SHAFT,
)
from orchestrator.core.errors import InputError, few, number_of

OF_NO_ORDER = dict.fromkeys(("REGFM_C1", "REGFMC1", "REGFMC1U"), "regfm_c1_phasor")
"""Models of converters whose records cannot be read, as nobody tells the order of their fields, and what they are
here."""

LEAST_STRANGE = (
    2  # machines that one file has alone, in each, from which on the files may be of two networks
)
_NAMED = 8  # buses that one problem names

WITHOUT_RECORD = "machine without record"
"""What ``dyr_leave_out`` names so that machines without any record feed their power as a constant current, and
``replace`` so that converters of the case stand there."""


def count_repeats(problems: Sequence[str], first: Mapping[str, str]) -> Iterator[str]:
    """The problems, each once: of those with a place of a first record, how many more there are."""
    for text, count in Counter(problems).items():
        more = f" and {count - 1} more" if count > 1 else ""
        yield f"{first[text]}{more}: {text}" if text in first else text


def records_unfit(
    parts: Mapping[tuple[int, str], Mapping[str, str]],
    replaced: Collection[tuple[int, str]],
    labels: Mapping[tuple[int, str], str],
    recorded: Collection[tuple[int, str]],
    powers: Mapping[tuple[int, str], float],
    names: Mapping[tuple[int, str], Mapping[str, str]],
) -> Iterator[str]:
    """Machines whose records are too many or too few.

    ``labels``: of their units; ``recorded``: machines that have records at all; ``powers``: of all machines [MW];
    ``names``: PSS/E's of the records, by the kind of part."""
    for (bus, name), own in parts.items():
        if (bus, name) not in replaced:
            machine, unit = f"machine {name!r} at bus {bus}", labels[bus, name]
            of_first = [*_of_first_generation(machine, {*names[bus, name].values()}, unit)]
            yield from of_first or _incomplete(machine, own, unit)
        others = ", ".join(kind for kind in own if kind not in KINDS_OF_CONVERTERS)
        if "converter" in own and others:
            yield f"machine {name!r} at bus {bus} is a converter, and has records of its {others}; remove them"
    bare = [key for key in without_machine(parts) if key not in replaced]
    partly = [key for key in bare if key in recorded]
    alone = [key for key in bare if key not in recorded]
    if alone:
        yield _without_records(alone, labels, powers, may_be_static=True)
    if partly:
        yield _without_records(partly, labels, powers, may_be_static=False)


def share_of_power(part: float, total: float) -> str:
    """Tell how much of the machines' power some of them feed, both in MW; "" where there is none to be a part of."""
    return f"{part:.0f} of {total:.0f} MW ({100 * part / total:.1f} %)" if total > 0 else ""


def _without_records(
    bare: Sequence[tuple[int, str]],
    labels: Mapping[tuple[int, str], str],
    powers: Mapping[tuple[int, str], float],
    *,
    may_be_static: bool,
) -> str:
    """Return the problem of all machines without a record: one cause, with remedies as they are typed.

    ``may_be_static``: whether they have no records of controls either."""
    (bus, name), *others = bare
    share = share_of_power(sum(powers[key] for key in bare), sum(powers.values()))
    feeding = f", {'which feed' if others else 'which feeds'} {share}" * bool(share)
    begin = f"machine {name!r} at bus {bus} has no record of a machine{feeding}; add one"
    if others:
        named = few((f"{name!r} at bus {bus}" for bus, name in bare), _NAMED)
        begin = f"{len(bare)} machines have no record of a machine ({named}){feeding}; add them"
    replaced = [labels[key] for key in bare]
    if may_be_static:
        whose = "the power of each" if others else "its power"
        begin += (
            f", or write {without_models([WITHOUT_RECORD])}, and {whose} in the RAW file is a constant current "
            "(static generation)"
        )
        if others:
            return (
                f"{begin}, or write {replacements_of([WITHOUT_RECORD])}, and a converter of ours stands in the place "
                "of each"
            )
    return f"{begin}, or write {replacements_of(replaced)}, and a converter of ours stands there"


def _incomplete(machine: str, own: Mapping[str, str], unit: str) -> Iterator[str]:
    """Yield what the records of one of WECC's plants lack; ``unit``: the label of its unit."""
    needs = own.get("converter") in _converters_of_plants()
    beside = {*KINDS_OF_CONVERTERS} - {"converter", "electrical"}
    lonely = [kind for kind in ON_SHAFT if kind in own and "shaft" not in own]
    if lonely:
        named = [name for name in _second_generation() if PLANT_RECORDS[name].kind in lonely]
        yield (
            f"{machine} has records of a wind turbine's {few(lonely, _NAMED)} and no WTDTA1, its shaft; add it, or "
            f"write {without_models(named)}, and the shaft turns at rated speed"
        )
    if needs == ("electrical" in own) and (needs or not beside & {*own}):
        return
    there = " and ".join(kind for kind in KINDS_OF_CONVERTERS if kind in own)
    wanted = "electrical" if needs else "converter"
    *first, last = (name for name in _second_generation() if PLANT_RECORDS[name].kind == wanted)
    missing = f"{', '.join(first)} or {last}"
    yield (
        f"{machine} has records of its {there} and no {missing}: together they are a plant of WECC's generic models; "
        f"add it, or write {replacement_of(unit)}, and a converter of ours stands there"
    )


def _second_generation() -> list[str]:
    """Records of plants that are of no turbine of the first generation."""
    return [name for name in PLANT_RECORDS if name not in OF_FIRST_GENERATION]


def _of_first_generation(machine: str, names: Collection[str], unit: str) -> Iterator[str]:
    """Yield what is wrong with the records of a turbine of the first generation."""
    for needed, more in FIRST_GENERATION:
        own = {*names} & {*needed, *more}
        others = ({*names} & {*PLANT_RECORDS}) - own
        if own and (others or not {*needed} <= own):
            *first, last = needed
            beside = f", with {' or '.join(more)} or without it," if more else ""
            yield (
                f"{machine} has records {', '.join(sorted(own | others))}: {', '.join(first)} and {last} go together"
                f"{beside} and with no other record of a plant; correct them, or write {replacement_of(unit)}, and a "
                "converter of ours stands there"
            )
            return


def going_with_shafts(
    unread: Sequence[DynamicRecord], records: Mapping[tuple[int, str], Sequence[DynamicRecord]]
) -> Iterator[str]:
    """Yield what has to go with a shaft that cannot be read and is left out: the records that act on it.

    ``records``: of each machine, all of them."""
    shafts = [one for one in unread if RECORDS_OF_UNITS[one.name].kind == "shaft"]
    beside = {one.name for shaft in shafts for one in records[shaft.bus, shaft.machine]}
    acting = [name for name in beside & {*PLANT_RECORDS} if PLANT_RECORDS[name].kind in ON_SHAFT]
    if acting:
        shaft = shafts[0].name
        yield (
            f"to leave out {shaft}, leave out what acts on its shaft as well: write "
            f"{without_models(sorted([shaft, *acting]))}, and the shaft turns at rated speed"
        )


def _converters_of_plants() -> set[str]:
    """Parts of the records of converters that need a control."""
    return {record.part for record in PLANT_RECORDS.values() if record.kind == "converter"}


def exciter_without_field(
    exciters: Sequence[DynamicRecord], records: Sequence[DynamicRecord]
) -> InputError:
    """Return the error of exciters at classical machines.

    ``records``: of all machines: a model that none of the others has goes by its name alone."""
    first, *others = exciters
    elsewhere = {one.name for one in records if one not in exciters}
    names = [
        f"{one.name} at {one.bus}" if one.name in elsewhere or not others else one.name
        for one in exciters
    ]
    more = f" (and {number_of(len(others), 'more exciter')})" if others else ""
    leaving_out = without_models([*dict.fromkeys(names)])
    return InputError.at(
        first.place,
        f"{first.name} of machine {first.machine!r} at bus {first.bus}{more} acts on nothing: the machine's record is "
        "GENCLS, a constant emf without a field winding, which takes no field voltage in PSS/E either (OpenIPSL's "
        "GENCLS, verified against PSS/E, has no such input); give the machine a record with a field winding, such as "
        f"GENSAL or GENROU, remove the exciter's, or write {leaving_out}",
    )


def without_machine(
    parts: Mapping[tuple[int, str], Mapping[str, str]],
) -> list[tuple[int, str]]:
    """Machines in service with neither a machine's record nor a converter's."""
    return [key for key, own in parts.items() if not {"machine", "converter"} & {*own}]


def other_network(
    strange: Sequence[DynamicRecord],
    records: Sequence[DynamicRecord],
    bare: Sequence[tuple[int, str]],
    machines: int,
) -> str:
    """One problem for two files that do not belong together, with what each has alone."""
    places = dict.fromkeys((record.bus, record.machine) for record in strange)

    def names_of(keys: Iterable[tuple[int, str]]) -> str:
        return few((f"{bus} {name!r}" for bus, name in keys), _NAMED)

    known = sum(record.name in RECORDS_OF_UNITS for record in records)
    return (
        f"{strange[0].file} and the RAW file do not belong together, as it seems: {len(strange)} of {known} records of "
        f"machines stand at buses or identifiers that the RAW file has no generator at ({names_of(places)}; first "
        f"{strange[0].name} in line {strange[0].line}), and {len(bare)} of {machines} machines have no record "
        f"({names_of(bare)}): give the DYR file of this network; if it is that one, correct these buses, "
        "or remove the records"
    )


def slips(strange: Sequence[DynamicRecord]) -> Iterator[str]:
    """Yield one problem with the machines that the RAW file lacks, where another machine has no record: a slip."""
    own = [
        record
        for record in strange
        if RECORDS_OF_UNITS[record.name].kind in ("machine", "converter")
    ]
    if own:
        named = (
            f"{record.name} of machine {record.machine!r} at bus {record.bus}" for record in own
        )
        yield (
            f"{own[0].place}: the RAW file does not have {few(named, _NAMED)}; if one of them is meant for a machine "
            "without a record, correct its bus or identifier"
        )


_FAMILIES = ("REGC", "REEC", "REPC", "WTG", "WT4", "WT3", "PVGU", "PVEU", "PLNTB")
"""How the names of grid-following converters and their controls begin."""


def remedy_for(name: str, unit: str, *, approximate: bool) -> str:
    """Return what to do about a record that no part stands for; empty where it is of no grid-following converter.

    ``unit``: label of its machine's unit."""
    model = OF_NO_ORDER.get(name)
    if model is not None:
        return (
            f", of whose fields no public source has the order; write {replacement_of(unit)} and "
            f'converter = "{model}", with its values in converter_parameters, and that model stands there'
        )
    if not name.startswith(_FAMILIES) and name not in OF_PLANTS:
        return ""
    if name in OF_PLANTS:
        return (
            f", the controller of a plant; write {without_models([name])}, and the references of its "
            "converter are constant"
        )
    if approximate or name not in FIELDS:
        return f", a grid-following converter; write {replacement_of(unit)}, and a converter of ours stands there"
    return (
        f", a grid-following converter; write {APPROXIMATING} for {MODEL} in its place, with a list of what that "
        f"leaves out, or {replacement_of(unit)}, and a converter of ours stands there"
    )


# -- WECC's grid-following converters as the phasor converter, at the user's word --------------------
