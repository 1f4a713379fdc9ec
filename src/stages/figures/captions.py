"""Title and caption of each picture of a case."""

from typing import NamedTuple


class Caption(NamedTuple):
    """What stands beside a picture."""

    title: str
    text: str


CAPTIONS = {
    "overview": Caption(
        "Lesion localisation",
        "Per view the mammogram, the projection of the MR volume deformed by the model, and slices of the "
        "undeformed MR volume through each lesion's predicted place. Solid: the lesion as marked in that image. "
        "Dashed: in the mammogram and the projection the lesion predicted from the MR volume alone, in the MR "
        "slices the lesion predicted from the mammograms alone. Several lesions have each a colour. One view does "
        "not determine the depth: the lesion lies somewhere on the dotted beam, and the cross is only its middle.",
    ),
    "landmarks": Caption(
        "Landmarks in the mammogram",
        "Circles: places marked in the mammogram. Crosses: the same landmarks predicted from the MR volume. Lines "
        "join what belongs together.",
    ),
    "landmarks_3d": Caption(
        "Landmarks between the plates",
        "Circles: places marked in the second MR volume. Crosses: the same landmarks carried from the undeformed "
        "volume. The grey line is the silhouette of the body in the second volume.",
    ),
    "outlines": Caption(
        "Outlines before and after",
        "Solid vermillion: the breast's outline in the image, faint where it is not skin and not used. Left: the "
        "undeformed breast and the volume-preserving scaling. Right: between the plates, and with updated boundary "
        "conditions.",
    ),
    "mesh": Caption(
        "Deformed mesh",
        "The hexahedral mesh before compression and between the plates, which end at the image's chest-wall edge. "
        "Colour: length of the displacement; rigid motion is part of it.",
    ),
    "segmentation": Caption(
        "Segmentation and mesh",
        "Border of the breast, of the gland and of the mesh in the MR volume; slices through the nipple.",
    ),
}
