"""The MR stack to take of all that a folder holds, why, and why not the others."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mammoreg.errors import DataError
from mammoreg.geometry.frames import Laterality
from stages.cohort.readers.mr import kind as mr_kind
from stages.cohort.readers.mr.stacks import FEWEST_VOXELS, SLICE_TOLERANCE, MrStack
from stages.cohort.series import series_token

_COVERS = 0.6
_APART = 0.8
_AFTER_PLACE = 2
_ONE_BREAST_MM = 260.0
_REMEDY = "name one of them in the column mr_series, by its number or its SeriesInstanceUID"
_PLANES = ("sagittal", "coronal", "axial")


@dataclass(frozen=True)
class MrChoice:
    """A stack and the account of its choice, in words that identify nobody.

    Attributes:
        stack: the one to take.
        taken: what it is.
        left: what each of the others is, and why it was left.
        notes: what speaks against the one taken.
    """

    stack: MrStack
    taken: str
    left: tuple[tuple[str, str], ...] = ()
    notes: tuple[str, ...] = ()


def choose(stacks: Sequence[MrStack], side: Laterality | None, wanted: str = "") -> MrChoice:
    """The stack that fits best: anatomy, T1, before contrast, whole, fine.

    Args:
        stacks: all that the folder holds, at least one.
        side: of the breast; None where it does not matter.
        wanted: SeriesNumber, SeriesInstanceUID or what `series_token` makes of it; empty to choose.

    Raises:
        DataError: none fits, or several that may show the breast in different places; all are listed.
    """
    if len({stack.first.patient for stack in stacks}) > 1:
        raise DataError("holds files of several patients; name the folder of one, or use mammoreg import")
    named = [stack for stack in stacks if not wanted or _is_series(stack, wanted)]
    if not named:
        raise DataError(f"holds no MR series {series_token(wanted)}; it holds {_listed(stacks, stacks)}")
    reasons = _reasons(named, side, by_name=bool(wanted))
    usable = [stack for stack, reason in zip(named, reasons, strict=True) if not reason]
    if not usable:
        raise DataError(f"holds no MR volume that fits: {_with_reasons(named, reasons)}; {_remedy(named)}")
    ranked = sorted(usable, key=_rank(usable))
    best = ranked[0]
    _check_tie(ranked, stacks)
    left = [(stack, reason or _behind(stack, best, usable)) for stack, reason in zip(named, reasons, strict=True)]
    left += [(stack, "mr_series names another") for stack in stacks if not any(stack is one for one in named)]
    notes = (*_notes(best, usable, by_name=bool(wanted)), *_torn_off(best, stacks))
    return MrChoice(best, _text(best, stacks), _merged([(s, r) for s, r in left if s is not best], stacks), notes)


def _is_series(stack: MrStack, wanted: str) -> bool:
    names = {str(stack.first.series_number), stack.first.series, series_token(stack.first.series)}
    return wanted in names and wanted not in ("", "None")


def _reasons(stacks: Sequence[MrStack], side: Laterality | None, *, by_name: bool) -> list[str]:
    """Why each stack is out of the question; empty for those that are not."""
    reasons = [stack.fault or ("" if by_name else mr_kind.no_anatomy(stack)) for stack in stacks]
    volumes = [stack for stack, reason in zip(stacks, reasons, strict=True) if not reason]
    if side is not None:
        reasons = [
            reason or _other_breast(s, volumes, side, by_name=by_name)
            for s, reason in zip(stacks, reasons, strict=True)
        ]
    if by_name or len(volumes) == 1:
        return reasons
    return [reason or _not_t1(stack) for stack, reason in zip(stacks, reasons, strict=True)]


def _not_t1(stack: MrStack) -> str:
    return "is T2-weighted, not T1" if mr_kind.weighting(stack) == "T2" else ""


def _other_breast(stack: MrStack, volumes: Sequence[MrStack], side: Laterality, *, by_name: bool) -> str:
    """Whether a volume of one breast shows the other one: by name, or as another one lies beyond it."""
    named = mr_kind.named_side(stack)
    if named and named != side and stack.half_extent[0] < _ONE_BREAST_MM / 2.0 and not by_name:
        return "shows the other breast, its header says"
    sign = 1.0 if side == "L" else -1.0
    for other in volumes:
        reach = stack.half_extent[0] + other.half_extent[0]
        small = max(stack.half_extent[0], other.half_extent[0]) < _ONE_BREAST_MM / 2.0
        if small and sign * (other.middle[0] - stack.middle[0]) > _APART * reach:
            return "shows the other breast: another volume lies beside it on this breast's side"
    return ""


def _rank(usable: Sequence[MrStack]) -> Callable[[MrStack], tuple[object, ...]]:
    """The key by which the best stack comes first."""

    def rank(stack: MrStack) -> tuple[object, ...]:
        fine = (round(stack.largest_spacing_mm, 1), stack.moment == (), stack.moment)
        return (*_class(stack, usable), *fine, stack.first.series_number or 0, stack.phase)

    return rank


def _class(stack: MrStack, usable: Sequence[MrStack]) -> tuple[int, ...]:
    """What matters more than fineness, the best 0 everywhere."""
    weight = 0 if mr_kind.weighting(stack) == "T1" else 1
    return (
        int(mr_kind.for_biopsy(stack)),
        weight,
        _after(stack, usable),
        mr_kind.fat_and_water(stack),
        int(mr_kind.reformatted(stack)),
        int(_covers_less(stack, usable)),
    )


def _after(stack: MrStack, usable: Sequence[MrStack]) -> int:
    """0 before the contrast agent as far as known, 1 later than a series that has it, 2 with it."""
    told = mr_kind.contrast(stack)
    if told:
        return 0 if told == "before" else 2
    later = (
        other.moment and stack.moment and other.moment <= stack.moment and mr_kind.contrast(other) == "after"
        for other in usable
        if other.first.study == stack.first.study and other is not stack
    )
    return int(any(later))


def _covers_less(stack: MrStack, usable: Sequence[MrStack]) -> bool:
    largest = np.max([other.half_extent for other in usable], axis=0)
    return bool((stack.half_extent[1:] < _COVERS * largest[1:]).any())


def _behind(stack: MrStack, best: MrStack, usable: Sequence[MrStack]) -> str:
    """Why a stack that would do comes after the best."""
    words = (
        "was taken for a biopsy",
        "is not known to be T1",
        "",
        "shows fat alone or opposed phases",
        "is reformatted",
        "covers less",
    )
    mine, its = _class(stack, usable), _class(best, usable)
    place = next((n for n, (a, b) in enumerate(zip(mine, its, strict=True)) if a > b), None)
    if place == _AFTER_PLACE:
        return "with contrast agent" if mine[_AFTER_PLACE] == 2 else "taken after a series with contrast agent"
    if place is not None:
        return words[place]
    if round(stack.largest_spacing_mm, 1) > round(best.largest_spacing_mm, 1):
        return "is coarser"
    return "is as good, and later"


def _check_tie(ranked: Sequence[MrStack], stacks: Sequence[MrStack]) -> None:
    """Refuse equals of which nobody can say from here whether they show the breast in one place.

    Raises:
        DataError: there are some.
    """
    best, level = ranked[0], _class(ranked[0], ranked)
    rivals = [stack for stack in ranked[1:] if _class(stack, ranked) == level]
    other_exam = [stack for stack in rivals if stack.first.study != best.first.study]
    order = (stack for stack in rivals if _rank(ranked)(stack)[:-1] == _rank(ranked)(best)[:-1])
    if tied := other_exam or list(order):
        why = "of several examinations" if other_exam else "that nothing in their headers tells apart"
        listed = _listed([best, *tied], stacks)
        raise DataError(f"holds MR volumes {why}, each of which would do: {listed}; {_remedy([best, *tied])}")


def _notes(best: MrStack, usable: Sequence[MrStack], *, by_name: bool) -> tuple[str, ...]:
    notes = []
    if by_name and (reason := mr_kind.no_anatomy(best)):
        notes.append(f"mr_series names a {reason} by its header; no anatomy is to be expected in it")
    if mr_kind.weighting(best) == "T2":
        notes.append("the MR volume is T2-weighted by its header; the segmentation is made for T1")
    if mr_kind.for_biopsy(best):
        notes.append("the MR volume was taken for a biopsy by its header; the breast may lie between plates in it")
    if _after(best, usable):
        notes.append("the MR volume was taken with contrast agent by its header, and there is none before it")
    frames = {s.first.frame_of_reference for s in usable if _class(s, usable) == _class(best, usable)}
    if len(frames) > 1 and not by_name:
        notes.append(
            "MR series as good as the one taken lie in another frame of reference: "
            "if the marks were set on one of them, name it in the column mr_series"
        )
    if best.copies:
        notes.append(f"{best.copies} slices of the MR series are there twice; one of each is used")
    return tuple(notes)


def _torn_off(best: MrStack, stacks: Sequence[MrStack]) -> list[str]:
    """Single pictures that would be the next slice at either end: perhaps slices whose header is damaged."""
    distance = float(np.linalg.norm(best.step))
    ends = [best.first.position - best.step, best.frames[-1].position + best.step]
    lone = [frame for stack in stacks if len(stack.frames) < FEWEST_VOXELS for frame in stack.frames]
    size = (best.first.rows, best.first.columns)
    next_ones = [
        frame
        for frame in lone
        if (frame.rows, frame.columns) == size
        and min(np.abs(frame.position - end).max() for end in ends) < SLICE_TOLERANCE * distance
    ]
    if not next_ones:
        return []
    return [
        f"{len(next_ones)} single pictures would continue the MR series, but their headers say that they are of others"
    ]


def _text(stack: MrStack, stacks: Sequence[MrStack]) -> str:
    """What a stack is, in numbers of its header; no text of it, which may hold a name."""
    first = stack.first
    studies = list(dict.fromkeys(s.first.study for s in stacks))
    parts = [f"series {'without number' if first.series_number is None else first.series_number}"]
    parts += [f"examination {studies.index(first.study) + 1} of {len(studies)}"] if len(studies) > 1 else []
    parts += [f"phase {stack.phase} of {stack.phases}"] if stack.phases > 1 else []
    parts += [word for word in (mr_kind.weighting(stack), "3D" if first.three_d else "") if word]
    parts += [f"{mr_kind.contrast(stack)} contrast"] if mr_kind.contrast(stack) else []
    parts += [f"echo {first.echo_ms:g} ms"] if first.echo_ms is not None else []
    spacing = np.linalg.norm(stack.affine[:3, :3], axis=0)
    plane = _PLANES[int(np.argmax(np.abs(first.normal)))]
    size = f"{plane} {' x '.join(map(str, stack.shape))} voxels of {' x '.join(f'{s:.3g}' for s in spacing)} mm"
    return ", ".join([*parts, size])


def _merged(left: Sequence[tuple[MrStack, str]], stacks: Sequence[MrStack]) -> tuple[tuple[str, str], ...]:
    """A line a stack; the single pictures of a series share one."""
    lines: dict[tuple[str, str], None] = {}
    pictures: dict[tuple[str, int | None], int] = {}
    for stack, _ in left:
        if len(stack.frames) < FEWEST_VOXELS:
            key = (stack.first.series, stack.first.series_number)
            pictures[key] = pictures.get(key, 0) + len(stack.frames)
    for stack, reason in left:
        if len(stack.frames) < FEWEST_VOXELS:
            count = pictures[stack.first.series, stack.first.series_number]
            what = "" if mr_kind.no_anatomy(stack) == "" else f" ({mr_kind.no_anatomy(stack)})"
            lines[f"series {stack.first.series_number}, {count} single pictures{what}", "no volume"] = None
        else:
            lines[_text(stack, stacks), reason] = None
    return tuple(lines)


def _listed(some: Sequence[MrStack], stacks: Sequence[MrStack]) -> str:
    return "; ".join(f"({n}) {_text(stack, stacks)}" for n, stack in enumerate(some, 1))


def _with_reasons(stacks: Sequence[MrStack], reasons: Sequence[str]) -> str:
    merged = _merged(list(zip(stacks, reasons, strict=True)), stacks)
    return "; ".join(f"({n}) {what}: {reason}" for n, (what, reason) in enumerate(merged, 1))


def _remedy(stacks: Sequence[MrStack]) -> str:
    """What helps: another series by name, where there is one whose voxels are whole."""
    whole = any(not stack.fault for stack in stacks)
    return _REMEDY if whole else "export one complete series"
