"""Pictures of pixels without a place in the patient: masks as PNG, grey values as TIFF."""

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray


def mask_png(mask: NDArray[Any]) -> bytes:
    """A mask as a grey PNG: 255 inside, 0 outside."""
    from PIL import Image

    packed = io.BytesIO()
    Image.fromarray(np.where(mask, 255, 0).astype(np.uint8)).save(packed, format="PNG")
    return packed.getvalue()


def grey_tiff(image: NDArray[Any]) -> bytes:
    """Grey values (rows, columns) as a compressed TIFF of 32-bit floats."""
    from PIL import Image

    packed = io.BytesIO()
    Image.fromarray(np.asarray(image, dtype=np.float32)).save(packed, format="TIFF", compression="tiff_adobe_deflate")
    return packed.getvalue()
