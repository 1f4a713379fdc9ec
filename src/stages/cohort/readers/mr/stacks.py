"""MR pictures put together to stacks: one volume each, with what is wrong with it."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from stages.cohort.readers import dicom_headers as dicom
from stages.cohort.readers import header_values
from stages.cohort.readers.mr.frames import MrFrame

FEWEST_VOXELS = 8
"""Fewer a side are no volume."""
SLICE_TOLERANCE = 0.05
"""Slice distances may differ by this share."""
_SAME_DIRECTION = 2e-3
_SAME_PLACE_MM = 0.02
_SAME_PIXEL = 1e-3
_OFF_LINE_MM = 0.1
_SAGITTAL = 0.8
_SLAB_GAP = 2.5
_SLABS_ALIKE = 1.25
"""Two slabs of sagittal slices, one a breast, have about as many slices."""
_GAP = 1.8
"""A distance of so many slice thicknesses, with numbers left out between, is a slice left out."""


@dataclass(frozen=True)
class MrStack:
    """Pictures of one volume, in the order of their places.

    Attributes:
        frames: at least one.
        phase, phases: which of how many at the same places, counting from 1.
        fault: why it is no whole volume, empty where it is one.
        copies: pictures left out because they are there twice.
    """

    frames: tuple[MrFrame, ...]
    phase: int = 1
    phases: int = 1
    fault: str = ""
    copies: int = 0

    @cached_property
    def first(self) -> MrFrame:
        """The picture at one end, whose header stands for all."""
        return self.frames[0]

    @cached_property
    def shape(self) -> tuple[int, int, int]:
        """Voxels along a row, along a column, and across."""
        return self.first.columns, self.first.rows, len(self.frames)

    @cached_property
    def step(self) -> NDArray[np.float64]:
        """From one slice to the next (3,), LPS mm."""
        ends = self.frames[-1].position - self.first.position
        return np.asarray(ends / max(len(self.frames) - 1, 1))

    @cached_property
    def affine(self) -> NDArray[np.float64]:
        """From voxel indices to LPS, mm (4, 4)."""
        between_rows, between_columns = self.first.pixel_mm
        along_row, along_column = self.first.axes
        affine = np.eye(4)
        columns = [along_row * between_columns, along_column * between_rows, self.step, self.first.position]
        affine[:3] = np.column_stack(columns)
        return affine

    @cached_property
    def middle(self) -> NDArray[np.float64]:
        """Centre (3,), LPS mm."""
        return self.affine[:3, :3] @ ((np.array(self.shape) - 1) / 2.0) + self.first.position

    @cached_property
    def half_extent(self) -> NDArray[np.float64]:
        """Half of what it spans along x, y, z (3,), mm."""
        return np.asarray(np.abs(self.affine[:3, :3]) @ ((np.array(self.shape) - 1) / 2.0))

    @cached_property
    def largest_spacing_mm(self) -> float:
        """The coarsest of the three spacings."""
        return float(np.linalg.norm(self.affine[:3, :3], axis=0).max())

    @cached_property
    def moment(self) -> tuple[str | float, ...]:
        """When it was taken, to be compared within a study; empty where no header says so."""
        times = [str(frame.order["time"]) for frame in self.frames if "time" in frame.order]
        return (min(times),) if times else ()


def stacks_of(frames: Iterable[MrFrame]) -> list[MrStack]:
    """All stacks, those of a series together and in the order of the series' numbers."""
    groups: dict[tuple[object, ...], list[MrFrame]] = defaultdict(list)
    for frame in frames:
        groups[_acquisition(frame)].append(frame)
    found = [
        stack
        for group in groups.values()
        for parallel in _by_direction(group)
        for slab in _slabs(parallel)
        for stack in _phases(*_without_copies(slab))
    ]
    numbers: dict[str, set[int | None]] = defaultdict(set)
    for frame in (frame for stack in found for frame in stack.frames):
        numbers[frame.series].add(frame.instance_number)
    checked = [replace(stack, fault=stack.fault or _fault(stack, numbers[stack.first.series])) for stack in found]
    return sorted(checked, key=lambda s: (s.first.series_number or 0, s.first.series, s.phase, -len(s.frames)))


def _acquisition(frame: MrFrame) -> tuple[object, ...]:
    """What pictures of one volume have in common, places and phases apart."""
    echo, b_value = (None if v is None else round(v, 2) for v in (frame.echo_ms, frame.b_value))
    identity = (frame.patient, frame.study, frame.series, frame.frame_of_reference, frame.stack)
    return (*identity, frame.kind, frame.grey, echo, b_value)


def _by_direction(frames: Sequence[MrFrame]) -> list[list[MrFrame]]:
    """Pictures that lie parallel to each other."""
    found: list[list[MrFrame]] = []
    for frame in frames:
        near = (group for group in found if np.abs(group[0].axes - frame.axes).max() < _SAME_DIRECTION)
        group = next(near, None)
        if group is None:
            found.append([frame])
        else:
            group.append(frame)
    return found


def _slabs(frames: Sequence[MrFrame]) -> list[list[MrFrame]]:
    """The two slabs of sagittal pictures of both breasts that leave out what lies between; else all of them."""
    ordered = sorted(frames, key=lambda f: f.along)
    places = sorted({round(frame.along, 2) for frame in frames})
    steps = np.diff(places)
    wide: Sequence[int] = np.flatnonzero(steps > _SLAB_GAP * np.median(steps)).tolist() if len(steps) else []
    if abs(ordered[0].normal[0]) < _SAGITTAL or len(wide) != 1:
        return [ordered]
    one, other = wide[0] + 1, len(places) - wide[0] - 1
    if min(one, other) < FEWEST_VOXELS or max(one, other) > _SLABS_ALIKE * min(one, other):
        return [ordered]
    border = (places[wide[0]] + places[wide[0] + 1]) / 2.0
    return [[f for f in ordered if f.along < border], [f for f in ordered if f.along > border]]


def _without_copies(frames: Sequence[MrFrame]) -> tuple[list[MrFrame], int]:
    """The pictures without those that are there twice under one identifier, and how many those were."""
    kept: dict[object, MrFrame] = {}
    for frame in frames:
        # Some who take names out give all files of a series one identifier.
        told = (*np.round(frame.position, 2).tolist(), frame.instance_number, *frame.order.values())
        kept.setdefault((frame.instance or frame.file, frame.index, *told), frame)
    return list(kept.values()), len(frames) - len(kept)


def _phases(frames: list[MrFrame], copies: int) -> list[MrStack]:
    """The volumes of pictures that may show the same places several times."""
    frames = sorted(frames, key=lambda f: (f.along, f.instance_number or 0))
    parts = _split(frames)
    if parts is None and len(unlike := _unlike(frames)) < len(frames):
        copies, parts = copies + len(frames) - len(unlike), _split(unlike)
    if parts is None:
        several = "places are taken several times, and nothing in the headers tells the volumes apart"
        return [MrStack(tuple(frames), fault=several, copies=copies)]
    most = max(map(len, parts))
    return [
        MrStack(
            tuple(part),
            phase=number,
            phases=len(parts),
            fault=f"has {len(part)} slices, another phase of its series {most}" if len(part) < most else "",
            copies=copies,
        )
        for number, part in enumerate(parts, 1)
    ]


def _split(frames: Sequence[MrFrame]) -> list[list[MrFrame]] | None:
    """Pictures by phase, in the order of time; None where they cannot be told apart."""
    places = _places(frames)
    most = max(Counter(places).values())
    if most == 1:
        return [list(frames)]
    for name in ("temporal position", "acquisition", "trigger time", "time"):
        if all(name in frame.order for frame in frames):
            keys = [frame.order[name] for frame in frames]
            parts = [[f for f, key in zip(frames, keys, strict=True) if key == wanted] for wanted in sorted(set(keys))]
            if len(parts) == most and all(max(Counter(_places(part)).values()) == 1 for part in parts):
                return parts
    # Ordered by place and number: the first taken at each place make the first volume.
    if all(frame.instance_number is not None for frame in frames) and set(Counter(places).values()) == {most}:
        return [list(frames[part::most]) for part in range(most)]
    return None


def _places(frames: Sequence[MrFrame]) -> list[int]:
    """For each picture, ordered along the normal, the number of its place."""
    along = np.array([frame.along for frame in frames])
    return [0, *np.cumsum(np.diff(along) > _SAME_PLACE_MM).tolist()]


def _unlike(frames: Sequence[MrFrame]) -> list[MrFrame]:
    """The pictures without those that equal, sample by sample, another one at their place."""
    kept: dict[tuple[int, bytes | int], MrFrame] = {}
    places = _places(frames)
    several = {place for place, count in Counter(places).items() if count > 1}
    for number, (frame, place) in enumerate(zip(frames, places, strict=True)):
        content = _stored(frame) if place in several else None
        kept.setdefault((place, content or number), frame)
    return list(kept.values())


def _stored(frame: MrFrame) -> bytes | None:
    """The stored samples of a classic file; None for a frame among others."""
    header = dicom.read_dicom(frame.file, pixels=True)
    if header is None or header_values.items(header, "PerFrameFunctionalGroupsSequence"):
        return None
    pixels = header.get("PixelData")
    return pixels if isinstance(pixels, bytes) else None


def _fault(stack: MrStack, numbers: set[int | None]) -> str:
    """Why a stack is no whole volume; empty where it is one."""
    if not stack.first.grey:
        return "holds colour pictures"
    if len({(f.rows, f.columns) for f in stack.frames}) > 1:
        return "the slices differ in size"
    pixels = np.array([f.pixel_mm for f in stack.frames])
    if np.ptp(pixels, axis=0).max() > _SAME_PIXEL * pixels.min():
        return f"PixelSpacing changes within it, {pixels.min():.3g} to {pixels.max():.3g} mm"
    if min(stack.shape) < FEWEST_VOXELS:
        return f"{' x '.join(map(str, stack.shape))} voxels are no volume"
    return _uneven(stack) or _gaps(stack, numbers)


def _uneven(stack: MrStack) -> str:
    places = np.array([frame.position for frame in stack.frames])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    middle = float(np.median(steps))
    if np.abs(steps - middle).max() > SLICE_TOLERANCE * middle:
        return f"slices lie {steps.min():.2f} to {steps.max():.2f} mm apart; one is missing, or volumes are mixed"
    line = places[0] + np.arange(len(places))[:, None] * stack.step
    if np.abs(line - places).max() > max(_OFF_LINE_MM, SLICE_TOLERANCE * middle):
        return "the slices do not lie behind each other on a straight line"
    return ""


def _gaps(stack: MrStack, numbers: set[int | None]) -> str:
    """Slices missing at even distances: what the header says of the distance, and numbers left out."""
    first, distance = stack.first, float(np.linalg.norm(stack.step))
    thickness, between = first.thickness_mm or 0.0, abs(first.between_mm or 0.0)
    # Some scanners write the gap in place of the distance.
    if abs(distance - between) <= SLICE_TOLERANCE * distance or (
        between < thickness and abs(distance - between - thickness) <= SLICE_TOLERANCE * distance
    ):
        return ""
    share = distance / between if between > 0.0 else 0.0
    if share > 1.5 and abs(share - round(share)) < 2 * SLICE_TOLERANCE:
        return (
            f"slices lie {distance:.2f} mm apart, SpacingBetweenSlices is {between:g} mm: "
            f"{round(share) - 1} of {round(share)} slices are missing"
        )
    if thickness > 0.0 and distance > _GAP * thickness and _numbers_left_out(stack, numbers):
        return f"slices of {thickness:g} mm lie {distance:.2f} mm apart and numbers between them are missing"
    return ""


def _numbers_left_out(stack: MrStack, numbers: set[int | None]) -> bool:
    own = sorted(f.instance_number for f in stack.frames if f.instance_number is not None)
    steps = {b - a for a, b in pairwise(own)}
    if len(own) < len(stack.frames) or len(steps) != 1 or steps & {0, 1}:
        return False
    between = set(range(own[0], own[-1])) - set(own)
    return not between & numbers
