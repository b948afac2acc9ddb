"""Material coordinates as indices: ``run.position.sel(s=1.2, method="nearest")``.

Depends on: nothing of ours.
"""

from __future__ import annotations

import xarray as xr

_ALONG = {"s": "node", "s_segment": "segment", "marker_s": "marker"}


def with_material_indices(dataset: xr.Dataset) -> xr.Dataset:
    """Let material coordinates select nodes, segments and markers; files do not keep indices."""
    for name, dimension in _ALONG.items():
        if name in dataset.coords and dataset[name].dims == (dimension,):
            dataset = dataset.set_xindex(name)
    return dataset
