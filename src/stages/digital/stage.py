"""Stage `digital`: the files of one digital patient, as a hospital would hand them in, and her truth."""

from typing import Literal

import numpy as np
from pydantic import Field

from mammoreg.errors import DataError
from mammoreg.geometry import ViewGeometry, Volume, breast_to_lps, breast_to_plate
from mammoreg.imaging.views import View as Mammogram
from mammoreg.phantom.compression import Pressed
from mammoreg.phantom.mammogram import Exposure, Pectoral, presented, project
from mammoreg.phantom.mri import T1, T1_FAT_SUPPRESSED, Acquisition, acquire
from mammoreg.phantom.patient import HEADER_ANGLE_DEG, Patient, View
from mammoreg.phantom.shape import Array as Points
from mammoreg.phantom.skin_points import skin_points
from mammoreg.phantom.warp import Deformed
from stages.digital.dicom import mammogram_dicom, mr_dicom, nifti, points_tsv, stored_mask
from stages.engine.contract import Array, Fields, Inputs, SettingsModel, Stage, Subject, Value
from stages.views import SECOND_VOLUME

MR_MM, PIXEL_MM, ROWS, COLUMNS = 1.4, 0.2, 1300, 900
SOURCE_DETECTOR_MM, SUPPORT_DETECTOR_MM = 650.0, 15.0
OFF_CENTRE_MM, BEHIND_EDGE_MM = 8.0, 12.0
HEADER_THICKNESS_OFF_MM = 2.0
LANDMARKS, VOLUNTEER_LANDMARKS, SURFACE_POINTS = 30, 17, 16
EXPOSURE = Exposure(photons=4.0e4, scatter=0.35, scatter_mm=10.0, blur_mm=0.15, equalisation=0.6)
NOISE, FAT_SUPPRESSED_NOISE, BIAS = 22.0, 14.0, 0.5


class DigitalPatient(SettingsModel):
    """One patient of the embedded cohort."""

    seed: int = Field(ge=0, description="Seed of everything about her.")
    kind: Literal["clinical", "volunteer"] = Field(
        "clinical", description="clinical: mammograms; volunteer: a second MR volume between the plates."
    )
    fat_suppressed: bool = Field(False, description="Whether the MR volume is fat-suppressed.")
    both_breasts: bool = Field(False, description="Whether the MR volume shows both breasts.")
    mr_form: Literal["nifti", "sagittal_nifti", "dicom"] = Field(
        "nifti", description="Form of the MR volume: NIfTI, NIfTI of sagittal planes, or a folder with a DICOM series."
    )
    monochrome1: bool = Field(False, description="Whether the mammograms are stored inverted (MONOCHROME1).")
    views: tuple[Mammogram, ...] = Field(("CC", "MLO"), description="Mammograms of a clinical patient.")
    unseen_views: tuple[Mammogram, ...] = Field((), description="Views without a visible lesion.")


class Settings(SettingsModel):
    """The embedded cohort; its cases are those of config/digital/cases.tsv."""

    patients: dict[str, DigitalPatient] = Field(
        default={
            "clinical1": DigitalPatient(seed=20271, both_breasts=True),
            "clinical2": DigitalPatient(seed=20272, fat_suppressed=True, monochrome1=True, unseen_views=("MLO",)),
            "clinical3": DigitalPatient(seed=20273, mr_form="dicom"),
            "clinical4": DigitalPatient(seed=20274, mr_form="sagittal_nifti"),
            "clinical5": DigitalPatient(seed=20275, fat_suppressed=True),
            "clinical6": DigitalPatient(seed=20276),
            "volunteer1": DigitalPatient(seed=20277, kind="volunteer"),
        },
        description="Patients by case.",
    )


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Draw the patient, press her, take the images; all files lie beside the artefact, which holds the truth."""
    if subject.case not in settings.patients:
        raise DataError(f"digital.patients has no {subject.case!r}; it has {', '.join(settings.patients)}")
    chosen = settings.patients[subject.case]
    if chosen.kind == "volunteer":
        return Making(
            subject, chosen, Patient.draw(chosen.seed, (SECOND_VOLUME,), True, VOLUNTEER_LANDMARKS)
        ).volunteer()
    return Making(subject, chosen, Patient.draw(chosen.seed, chosen.views, False, LANDMARKS)).clinical()


def mr_files(volume: Volume, chosen: DigitalPatient, subject: Subject) -> dict[str, bytes]:
    """A breast-frame MR volume in the patient's form, by file name."""
    if chosen.mr_form == "dicom":
        slices = mr_dicom(volume, subject)
        return {f"mr/{number:03d}.dcm": content for number, content in enumerate(slices, 1)}
    return {"mr.nii.gz": nifti(volume, subject.laterality, sagittal=chosen.mr_form == "sagittal_nifti")}


class Making:
    """Files and truth of one patient as they come about."""

    def __init__(self, subject: Subject, chosen: DigitalPatient, patient: Patient) -> None:
        self.subject, self.chosen, self.patient = subject, chosen, patient
        self.files: dict[str, bytes] = {}
        self.arrays: dict[str, Array] = {}
        self.values: dict[str, Value] = {"seed": chosen.seed}
        contrast, noise = (T1_FAT_SUPPRESSED, FAT_SUPPRESSED_NOISE) if chosen.fat_suppressed else (T1, NOISE)
        self.acquisition = Acquisition(contrast, noise, BIAS)
        self.names = [f"P{n + 1:02d}" for n in range(len(patient.landmarks))]

    def clinical(self) -> Fields:
        """MR with lesion and landmarks, mammograms with theirs."""
        self._undeformed_mr()
        lesion = self.patient.lesion
        assert lesion is not None
        grid = self.patient.mr_grid(MR_MM, self.chosen.both_breasts)
        centres = grid.centres(np.ones(grid.shape, dtype=bool))
        mask = (lesion.share(centres) > 0.5).reshape(grid.shape)
        sagittal = self.chosen.mr_form == "sagittal_nifti"
        volume = grid.with_data(mask.astype(np.uint8))
        self.files["mr_lesion.nii.gz"] = nifti(volume, self.subject.laterality, sagittal)
        self._note("lesion_centre", lesion.centre[None], "mm", "centre of the lesion, undeformed")
        for number, view in enumerate(self.chosen.views):
            self._mammogram(view, number)
        return Fields(self.arrays, {}, self.values, self.files)

    def volunteer(self) -> Fields:
        """MR before and between the plates, with landmarks and points of the skin in both."""
        self._undeformed_mr()
        pressed, deformed = self.patient.pressed(SECOND_VOLUME)
        self._note_press(SECOND_VOLUME, pressed, deformed, None)
        grid = self.patient.mr_grid(MR_MM, False)
        origins = deformed.tabulated(grid.origin - MR_MM, grid.to_world(np.array(grid.shape)))
        data = acquire(grid, origins.at, self.acquisition, self.patient.stream(2))
        self.files["mr_compressed.nii.gz"] = nifti(grid.with_data(data), self.subject.laterality)
        self._points_file("mr_compressed_landmarks.tsv", self.names, deformed.forward(self.patient.landmarks))
        nodes = skin_points(self.patient.mesh, SURFACE_POINTS)
        names = [f"S{n + 1:02d}" for n in range(len(nodes))]
        self._points_file("mr_surface_points.tsv", names, self.patient.mesh.points[nodes])
        self._points_file("mr_compressed_surface_points.tsv", names, deformed.deformed[nodes])
        return Fields(self.arrays, {}, self.values, self.files)

    def _undeformed_mr(self) -> None:
        patient = self.patient
        grid = patient.mr_grid(MR_MM, self.chosen.both_breasts)
        data = acquire(grid, patient.tissue_of_both_sides, self.acquisition, patient.stream(1))
        self.files |= mr_files(grid.with_data(data), self.chosen, self.subject)
        self._points_file("mr_landmarks.tsv", self.names, patient.landmarks)
        self._note("nipple", patient.shape.nipple[None], "mm", "tip of the nipple, undeformed")
        self._note("nodes", patient.mesh.points, "mm", "nodes of the truth's mesh, undeformed")
        self.arrays["hexes"] = Array(patient.mesh.hexes, "1", "corners of its elements, VTK order in the breast frame")

    def _mammogram(self, view: Mammogram, number: int) -> None:
        patient, random = self.patient, self.patient.stream(20 + number)
        pressed, deformed = patient.pressed(view)
        imaged = pressed.deformed[:, 1] < patient.placements[view].edge_p_mm + BEHIND_EDGE_MM
        low, high = pressed.deformed[imaged].min(axis=0), pressed.deformed[imaged].max(axis=0)
        middle = 0.5 * (low[0] + high[0]) + float(random.uniform(-OFF_CENTRE_MM, OFF_CENTRE_MM))
        geometry = view_geometry(patient, view, pressed, middle)
        self._note_press(view, pressed, deformed, middle)
        pectoral = Pectoral(low[0], 40.0, 0.7 * (high[0] - low[0]), 0.6) if view == "MLO" else None
        origins = deformed.tabulated(*_around(deformed.deformed[imaged]))
        image = project(geometry, origins.at, (low[0] - 2.0, high[0] + 2.0), low[1] - 10.0, pectoral)
        pixels = presented(image, EXPOSURE, PIXEL_MM, random)
        thickness = round(pressed.gap_mm + random.uniform(-HEADER_THICKNESS_OFF_MM, HEADER_THICKNESS_OFF_MM))
        name = view.lower()
        self.files[f"{name}.dcm"] = mammogram_dicom(
            pixels, self.subject, view, geometry, thickness, pressed.force_n, self.chosen.monochrome1
        )
        if view not in self.chosen.unseen_views:
            self.files[f"{name}_lesion.png"] = stored_mask(image.lesion_mask, self.subject.laterality)
        self._pixels_file(f"{name}_landmarks.tsv", geometry, deformed.forward(patient.landmarks))

    def _pixels_file(self, name: str, geometry: ViewGeometry, places: Points) -> None:
        """Landmarks that the image shows, in stored pixels."""
        pixel = geometry.project(breast_to_plate(places, geometry.angle_deg))
        shown = ((pixel > -0.5) & (pixel < [COLUMNS - 0.5, ROWS - 0.5])).all(axis=1)
        if self.subject.laterality == "R":
            pixel[:, 0] = COLUMNS - 1 - pixel[:, 0]
        names = [self.names[k] for k in np.flatnonzero(shown)]
        self.files[name] = points_tsv(names, pixel[shown], ("column", "row"))

    def _points_file(self, name: str, names: list[str], points: Points) -> None:
        self.files[name] = points_tsv(names, breast_to_lps(points, self.subject.laterality), ("x", "y", "z"))

    def _note(self, name: str, points: Points, units: str, meaning: str) -> None:
        self.arrays[name] = Array(breast_to_lps(points, self.subject.laterality), units, f"{meaning} (LPS)")

    def _note_press(self, view: View, pressed: Pressed, deformed: Deformed, middle_mm: float | None) -> None:
        """Truth about a compression."""
        placement = self.patient.placements[view]
        self.values[view] = {
            "angle_deg": placement.angle_deg,
            "header_angle_deg": HEADER_ANGLE_DEG[view],
            "edge_p_mm": placement.edge_p_mm,
            "middle_mm": middle_mm,
            "height_mm": pressed.height_mm,
            "thickness_mm": pressed.gap_mm,
            "uncompressed_mm": pressed.uncompressed_mm,
            "pull_mm": placement.pull_mm,
            "lift": placement.lift,
            "force_n": pressed.force_n,
            "min_det_f": pressed.min_det_f,
            "penetration_mm": pressed.penetration_mm,
            "volume_change": pressed.volume_change,
            "iterations": pressed.iterations,
        }
        self._note(f"{view}/nodes", deformed.deformed, "mm", "nodes of the truth's mesh between the plates")
        self._note(f"{view}/landmarks", deformed.forward(self.patient.landmarks), "mm", "landmarks between the plates")
        self._note(f"{view}/nipple", deformed.nipple[None], "mm", "tip of the nipple between the plates")
        if self.patient.lesion is not None:
            centre = deformed.forward(self.patient.lesion.centre[None])
            self._note(f"{view}/lesion_centre", centre, "mm", "centre of the lesion between the plates")


def view_geometry(patient: Patient, view: View, pressed: Pressed, middle: float) -> ViewGeometry:
    """True geometry of a mammogram whose middle row lies at a medial plate coordinate in mm."""
    placement = patient.placements[view]
    return ViewGeometry(
        placement.angle_deg,
        placement.edge_p_mm,
        middle,
        pressed.height_mm,
        pressed.gap_mm,
        SOURCE_DETECTOR_MM,
        SUPPORT_DETECTOR_MM,
        PIXEL_MM,
        ROWS,
        COLUMNS,
    )


def _around(nodes: Points) -> tuple[Points, Points]:
    """Corners of a box with room for the nipple."""
    return nodes.min(axis=0) - np.array([8.0, 14.0, 8.0]), nodes.max(axis=0) + 8.0


STAGE = Stage(name="digital", schema=2, inputs=(), settings=Settings, run=run, folder=".")
