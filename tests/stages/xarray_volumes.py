"""An artefact's volumes as xarray, which knows nothing of this project, opens them."""

import numpy as np
import xarray

from stages.engine.artefact import Artefact


def check_volumes(artefact: Artefact, names: set[str]) -> None:
    """Every volume opens under its name as a netCDF-4 group: same samples, places in mm, the axes' meaning."""
    assert set(artefact.volume_names()) == names
    for name in names:
        with xarray.open_dataset(artefact.path, group=f"volumes/{name}", engine="netcdf4") as dataset:
            found = dataset[name.rpartition("/")[2]]
            volume = artefact.volume(name, frame=found.attrs["frame"])
            assert found.dims == ("x", "y", "z")
            assert found.attrs["long_name"]
            np.testing.assert_array_equal(found.values, volume.data)
            last = [float(dataset[axis][-1]) for axis in "xyz"]
            np.testing.assert_allclose(last, volume.to_world(np.array(volume.shape) - 1), atol=1e-9)
            assert {dataset[axis].attrs["units"] for axis in "xyz"} == {"mm"}
