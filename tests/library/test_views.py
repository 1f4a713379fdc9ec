"""Views beyond CC and MLO: a breast pressed at their angles, and what the registration recovers of it."""

from functools import cache

import numpy as np
import pytest

import mammoreg
from tests.library import pressed_torso as torso

STARTS = {"CC": 0.0, "MLO": 45.0, "ML": 90.0, "LM": -90.0, "LMO": -135.0, "FB": 180.0, "XCCL": 0.0}


@cache
def breast() -> mammoreg.Breast:
    return mammoreg.Breast.of_mr(torso.mr(), "R", elements=5)


@cache
def registered(view: str) -> mammoreg.RegisteredView:
    truth = torso.truth(view)
    image = mammoreg.Mammogram(truth.pixels, view, torso.PIXEL_MM, thickness_mm=torso.GAPS[view])
    return mammoreg.register(breast(), image)


def marks(view: str, place: np.ndarray) -> "mammoreg.registration.Mark":
    column, row = torso.truth(view).shown(place[None])[0]
    return registered(view).mark((column, row), 10.0)


if __name__ == "__main__":
    import sys, time
    for v in sys.argv[1:]:
        t=time.time()
        r = registered(v)
        px = r.to_mammogram(torso.LESIONS); tr = torso.truth(v).shown(torso.LESIONS)
        e = np.linalg.norm(px-tr,axis=1)*torso.PIXEL_MM/r.geometry.middle_magnification
        print(v, "angle", r.geometry.angle_deg, "true", torso.ANGLES[v], "errors mm", e.round(1), "s", round(time.time()-t,1), flush=True)
    done=[v for v in sys.argv[1:]]
    for i,a in enumerate(done):
        for b in done[i+1:]:
            es=[]
            for p in torso.LESIONS:
                f=mammoreg.locate([marks(a,p),marks(b,p)])
                es.append((round(float(np.linalg.norm(f.point-p)),1), round(f.beam_gap_mm,1), f.region is not None))
            print(a,b,es, flush=True)
