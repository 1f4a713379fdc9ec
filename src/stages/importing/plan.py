"""Which MR volume goes with which mammograms: rows of the tables to be, and an account of all that was found."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from mammoreg.errors import DataError
from mammoreg.geometry.frames import Laterality
from stages.cohort.readers.mr.choice import MrChoice, choose
from stages.cohort.readers.mr.stacks import MrStack, stacks_of
from stages.importing.found import Found, Patient
from stages.importing.mammograms import RULE, FoundImage, best_first, found_image

SIDES: tuple[Laterality, Laterality] = ("R", "L")
FARTHEST_DAYS = 365


@dataclass(frozen=True)
class Breast:
    """One row of cases.tsv to be, and its rows of views.tsv.

    Attributes:
        case: its id, from the patient's number in this import, the examination's if there are several, and the side.
        patient, exam: pseudonyms; `exam` empty where there is one.
        stack: its MR volume.
        images: its mammograms by view.
    """

    case: str
    patient: str
    exam: str
    side: Laterality
    stack: MrStack
    images: Mapping[str, FoundImage]


@dataclass(frozen=True)
class Entry:
    """A line of the account: what was found, for which cases it is used, and why it is used or left."""

    patient: str
    what: str
    used_for: str
    why: str
    files: tuple[str, ...] = ()


@dataclass
class Plan:
    """What an import comes to."""

    breasts: list[Breast] = field(default_factory=list)
    entries: list[Entry] = field(default_factory=list)


def plan(found: Found) -> Plan:
    """Pair MR volumes and mammograms by patient and side."""
    result = Plan()
    for number, patient in enumerate(found.patients, 1):
        _add_patient(result, f"p{number}", patient)
    for path, reason in found.unread:
        result.entries.append(Entry("", "a file", "", f"left: {reason}", (str(path),)))
    return result


def _add_patient(result: Plan, name: str, patient: Patient) -> None:
    images = [found_image(path, header) for path, header in patient.images]
    exams = _exams(patient)
    breasts: list[Breast] = []
    reasons: dict[int, str] = {}
    for number, exam in enumerate(exams, 1):
        label = f"e{number}" if len(exams) > 1 else ""
        mine = [image for image in images if _nearest(image, exams, patient) is exam]
        for side, choice in exam.choices.items():
            taken = _views(mine, side, exam, patient, reasons)
            if taken:
                breasts.append(Breast(f"{name}{label}{side}", name, label, side, choice.stack, taken))
    result.breasts += breasts
    for exam in exams:
        result.entries += _mr_entries(name, exam, breasts)
    result.entries += [_image_entry(name, image, breasts, reasons, bool(exams)) for image in images]
    if patient.unplaced:
        result.entries.append(Entry(name, f"{patient.unplaced} MR pictures", "", "left: their headers give no place"))
    for modality, count in sorted(patient.others.items()):
        result.entries.append(
            Entry(name, f"{modality}, {count} file{'' if count == 1 else 's'}", "", "left: neither MR nor mammogram")
        )


@dataclass(frozen=True)
class _Exam:
    """MR of one examination: its stacks, the choice for each side that has one, and the faults of the others."""

    study: str
    stacks: tuple[MrStack, ...]
    choices: Mapping[Laterality, MrChoice]
    faults: Mapping[Laterality, str]


def _exams(patient: Patient) -> list[_Exam]:
    """Examinations with MR, in the order of time."""
    groups: dict[str, list[MrStack]] = defaultdict(list)
    for stack in stacks_of(patient.frames):
        groups[stack.first.study].append(stack)
    found = []
    for study, stacks in groups.items():
        choices: dict[Laterality, MrChoice] = {}
        faults: dict[Laterality, str] = {}
        for side in SIDES:
            try:
                choices[side] = choose(stacks, side)
            except DataError as error:
                faults[side] = str(error)
        found.append(_Exam(study, tuple(stacks), choices, faults))
    return sorted(found, key=lambda exam: (patient.days.get(exam.study, 0), exam.study))


def _days_apart(image: FoundImage, exam: _Exam, patient: Patient) -> int | None:
    days = patient.days.get(image.study), patient.days.get(exam.study)
    return None if days[0] is None or days[1] is None else abs(days[0] - days[1])


def _nearest(image: FoundImage, exams: Sequence[_Exam], patient: Patient) -> _Exam | None:
    """The MR examination to which an image is nearest in time, the first one where no date is given."""
    usable = [exam for exam in exams if exam.choices]
    return min(usable, key=lambda exam: _days_apart(image, exam, patient) or 0) if usable else None


def _views(
    images: Sequence[FoundImage], side: Laterality, exam: _Exam, patient: Patient, reasons: dict[int, str]
) -> dict[str, FoundImage]:
    """The image of each view of a breast, of the day nearest to the MR; why others were left goes into `reasons`."""
    usable = [image for image in images if image.side == side and not image.refused]
    if not usable:
        return {}
    days: dict[int, list[FoundImage]] = defaultdict(list)
    for image in usable:
        days[_days_apart(image, exam, patient) or 0].append(image)
    nearest = min(days, key=lambda apart: (apart, -len({image.view for image in days[apart]})))
    for apart, others in days.items():
        if apart != nearest:
            reasons.update({id(image): f"left: {apart} days from the MR, others {nearest}" for image in others})
    taken: dict[str, FoundImage] = {}
    for view in dict.fromkeys(image.view for image in days[nearest]):
        assert view is not None
        first, *rest = best_first([image for image in days[nearest] if image.view == view])
        taken[view] = first
        several = f", the better of {len(rest) + 1} by the rule: {RULE}" if rest else ""
        far = f", though {nearest} days from the MR" if nearest > FARTHEST_DAYS else ""
        reasons[id(first)] = f"taken{several}{far}" + "".join(f"; {flag}" for flag in first.flags)
        reasons.update({id(image): "left: another image of this view is better by the rule" for image in rest})
    return taken


def _mr_entries(name: str, exam: _Exam, breasts: Sequence[Breast]) -> list[Entry]:
    """A line for each MR volume that is taken, for each that is not, and for each breast that has no row."""
    used: dict[int, tuple[MrChoice, list[str]]] = {}
    entries: list[Entry] = []
    for side, choice in exam.choices.items():
        cases = [breast.case for breast in breasts if breast.side == side and breast.stack is choice.stack]
        used.setdefault(id(choice.stack), (choice, []))[1].extend(cases)
        if not cases:
            entries.append(Entry(name, f"{side} breast", "", "left: has MR and no mammogram that can be used"))
    entries += [Entry(name, f"{side} breast", "", f"left: its MR {fault}") for side, fault in exam.faults.items()]
    taken = []
    for choice, cases in used.values():
        files = tuple(dict.fromkeys(str(frame.file) for frame in choice.stack.frames))
        why = "; ".join(["taken" if cases else "left: no mammogram that can be used", *choice.notes])
        taken.append(Entry(name, f"MR {choice.taken}", " ".join(cases), why, files))
    others = {what: why for choice, _ in used.values() for what, why in choice.left}
    named = {entry.what for entry in taken}
    left = [Entry(name, f"MR {what}", "", f"left: {why}") for what, why in others.items() if f"MR {what}" not in named]
    return [*taken, *left, *entries]


def _image_entry(
    name: str, image: FoundImage, breasts: Sequence[Breast], reasons: Mapping[int, str], has_mr: bool
) -> Entry:
    cases = [breast.case for breast in breasts for taken in breast.images.values() if taken is image]
    without = "left: no MR volume of this breast that fits" if has_mr else "left: no MR of this patient"
    why = f"left: {image.refused}" if image.refused else reasons.get(id(image), without)
    return Entry(name, image.what, " ".join(cases), why, (str(image.path),))
