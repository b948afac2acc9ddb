"""The labelled dataset of a run, in the world frame and the paper's language.

Depends on: history, quantities, variables, attributes, coordinates.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cablesim.mesh import Mesh
from cablesim.physics.model import CableModel
from cablesim.physics.needs import describe_needs
from cablesim.plausibility import ATTRIBUTE
from cablesim.plausibility.after import check_run
from cablesim.scene import Output, Scene
from cablesim.trajectory.attributes import global_attributes
from cablesim.trajectory.coordinates import with_material_indices
from cablesim.trajectory.history import History
from cablesim.trajectory.quantities import Quantities
from cablesim.trajectory.variables import VARIABLES, Variable

Array = NDArray[np.float64]


def build_dataset(
    scene: Scene, mesh: Mesh, model: CableModel, history: History, attributes: Mapping[str, object]
) -> xr.Dataset:
    """Dataset of a run.

    Parameters
    ----------
    scene, mesh, model
        What was simulated; for a winch the mesh and the model of the whole cable.
    history : History
        States at the output times.
    attributes : dict
        Status and statistics of the run, kept as attributes.

    Returns
    -------
    xarray.Dataset
        The variables that the scene's output asks for.
    """
    quantities = Quantities(scene, mesh, model, history)
    wanted = scene.output.variables or tuple(VARIABLES)
    data = {}
    for name in wanted:
        variable = VARIABLES[name]
        if variable.needed(scene):
            values = getattr(quantities, name)
            if scene.winch is not None:
                values = _without_drum(values, variable.dimensions, history.segments)
            data[name] = (variable.dimensions, _rounded(values, scene.output), _described(variable))
    skipped = describe_needs(model.features)
    odd = (*scene.warnings, *check_run(quantities))
    noted = {ATTRIBUTE: "\n".join(odd), **attributes} if odd else attributes
    given = global_attributes(scene, history.times, skipped, noted)
    return with_material_indices(xr.Dataset(data, _coordinates(scene, mesh, history), given))


def _rounded(values: Array, output: Output) -> Array:
    """Values in the precision that is asked for; counts stay whole numbers."""
    single = output.precision == "single" and values.dtype.kind == "f"
    return values.astype(np.float32) if single else values


def _described(variable: Variable) -> dict[str, str]:
    return {
        "units": variable.units,
        "long_name": variable.long_name,
        "coverage_content_type": "modelResult",
    }


def _without_drum(values: Array, dimensions: tuple[str, ...], segments: NDArray[np.int64]) -> Array:
    """NaN for what is on the drum; the last slot is that of the winch, and of the segment that ends there."""
    if "node" in dimensions:
        slots = np.arange(values.shape[1])
        on_drum = (slots >= segments[:, None]) & (slots < slots[-1])
    elif "segment" in dimensions:
        slots = np.arange(values.shape[1])
        values = values.copy()
        values[:, -1] = values[np.arange(len(values)), segments - 1]
        on_drum = (slots >= segments[:, None] - 1) & (slots < slots[-1])
    else:
        return values
    return np.where(on_drum.reshape(on_drum.shape + (1,) * (values.ndim - 2)), np.nan, values)


def _coordinates(scene: Scene, mesh: Mesh, history: History) -> dict[str, tuple[str, object, dict[str, str]]]:
    middle = 0.5 * (mesh.nodes[1:] + mesh.nodes[:-1])
    material = "unstretched material coordinate from end A"
    coordinates: dict[str, tuple[str, object, dict[str, str]]] = {
        "time": ("time", history.times, {"units": "s", "long_name": "time since the start of the run"}),
        "s": ("node", mesh.nodes, {"units": "m", "long_name": f"{material}, nodes"}),
        "s_segment": ("segment", middle, {"units": "m", "long_name": f"{material}, middle of segments"}),
        "axis": ("axis", ["x", "y", "z"], {"long_name": "axis of the world frame, z up"}),
        "end": ("end", ["a", "b"], {"long_name": "end of the cable"}),
    }
    if scene.attachments:
        names = [attachment.name for attachment in scene.attachments]
        coordinates["attachment"] = ("attachment", names, {"long_name": "name of the attachment"})
    if scene.output.markers.size:
        marker_attributes = {"units": "m", "long_name": f"{material}, markers"}
        coordinates["marker_s"] = ("marker", scene.output.markers, marker_attributes)
    for _, _, attributes in coordinates.values():
        attributes["coverage_content_type"] = "coordinate"
    return coordinates
