"""Exported tables and polylines hold the numbers of the result, read back by other means."""

import base64
import csv
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import xarray as xr
from runs import result

from cablesim.export import ExportError, export_csv, export_vtk


@pytest.fixture
def dataset():
    return result("buoys")


@pytest.fixture
def half_deployed(dataset):
    """The last ten nodes are on the drum at the first three times."""
    for name, first in (("position", -10), ("velocity", -10), ("tension", -10)):
        dataset[name][:3, first:] = np.nan
    return dataset


def read_csv(file):
    with file.open(newline="") as stream:
        header, *rows = csv.reader(stream)
    return header, rows


def column(file, name):
    header, rows = read_csv(file)
    return np.array([float(row[header.index(name)] or "nan") for row in rows])


# CSV --------------------------------------------------------------------------------------------


def test_one_table_for_each_set_of_dimensions(dataset, tmp_path):
    files = export_csv(dataset, tmp_path / "tables")
    names = {file.name for file in files}
    assert names == {"time.csv", "nodes.csv", "segments.csv", "ends.csv", "attachments.csv", "markers.csv"}


def test_every_variable_is_in_a_table_with_its_unit(dataset, tmp_path):
    headers = {name for file in export_csv(dataset, tmp_path) for name in read_csv(file)[0]}
    for name, variable in dataset.data_vars.items():
        stems = [f"{name}_{axis}" for axis in "xyz"] if "axis" in variable.dims else [name]
        assert {f"{stem} [{variable.attrs['units']}]" for stem in stems} <= headers


def test_nodes_to_the_last_digit(dataset, tmp_path):
    export_csv(dataset, tmp_path)
    shape = (dataset.sizes["time"], dataset.sizes["node"])
    file = tmp_path / "nodes.csv"
    assert read_csv(file)[0][:3] == ["time [s]", "node", "s [m]"]
    for index, axis in enumerate("xyz"):
        read = column(file, f"position_{axis} [m]").reshape(shape)
        np.testing.assert_array_equal(read, dataset["position"].values[..., index])
    expected = np.broadcast_to(dataset["s"].values, shape)
    np.testing.assert_array_equal(column(file, "s [m]").reshape(shape), expected)
    expected = np.broadcast_to(dataset["time"].values[:, None], shape)
    np.testing.assert_array_equal(column(file, "time [s]").reshape(shape), expected)
    np.testing.assert_array_equal(column(file, "node").reshape(shape)[-1], np.arange(shape[1]))


def test_segments_and_markers(dataset, tmp_path):
    export_csv(dataset, tmp_path)
    tension = column(tmp_path / "segments.csv", "tension [N]")
    np.testing.assert_array_equal(tension, dataset["tension"].values.ravel())
    place = column(tmp_path / "markers.csv", "marker_position_z [m]")
    np.testing.assert_array_equal(place, dataset["marker_position"].values[..., 2].ravel())
    np.testing.assert_array_equal(column(tmp_path / "markers.csv", "marker_s [m]")[:5], dataset["marker_s"])


def test_attachments_and_ends_by_name(dataset, tmp_path):
    export_csv(dataset, tmp_path)
    header, rows = read_csv(tmp_path / "attachments.csv")
    assert [row[header.index("attachment")] for row in rows[:4]] == ["float", "weight"] * 2
    header, rows = read_csv(tmp_path / "ends.csv")
    assert [row[header.index("end")] for row in rows[:4]] == ["a", "b"] * 2
    assert float(rows[3][header.index("end_tension [N]")]) == dataset["end_tension"].values[1, 1]


def test_energies_against_time(dataset, tmp_path):
    export_csv(dataset, tmp_path)
    energy = column(tmp_path / "time.csv", "kinetic_energy [J]")
    np.testing.assert_array_equal(energy, dataset["kinetic_energy"])


def test_nodes_on_the_drum_are_empty_cells(half_deployed, tmp_path):
    export_csv(half_deployed, tmp_path)
    read = column(tmp_path / "nodes.csv", "position_x [m]")
    np.testing.assert_array_equal(read, half_deployed["position"].values[..., 0].ravel())


def test_only_what_was_kept(dataset, tmp_path):
    files = export_csv(dataset[["tension"]], tmp_path)
    assert [file.name for file in files] == ["segments.csv"]


def test_nothing_to_export(tmp_path):
    with pytest.raises(ExportError, match=r"is it a result of cablesim\?"):
        export_csv(xr.Dataset({"temperature": ("month", [1.0, 2.0])}), tmp_path / "tables")
    assert not (tmp_path / "tables").exists()


# VTK --------------------------------------------------------------------------------------------


def data_array(root, path):
    """Decode an inline binary DataArray as VTK's file format description says."""
    element = root.find(path)
    assert element.get("format") == "binary"
    assert root.get("byte_order") == "LittleEndian"
    assert root.get("header_type") == "UInt64"
    raw = base64.b64decode(element.text)
    size = int(np.frombuffer(raw[:8], "<u8")[0])
    assert len(raw) == 8 + size
    values = np.frombuffer(raw[8:], {"Float64": "<f8", "Int64": "<i8"}[element.get("type")])
    components = int(element.get("NumberOfComponents", 1))
    return values.reshape(-1, components) if components > 1 else values


def lines_of(root):
    connectivity = data_array(root, ".//Lines/DataArray[@Name='connectivity']")
    offsets = data_array(root, ".//Lines/DataArray[@Name='offsets']")
    np.testing.assert_array_equal(offsets, 2 * np.arange(1, offsets.size + 1))
    return connectivity.reshape(-1, 2)


def test_points_lines_and_data(dataset, tmp_path):
    _, *files = export_vtk(dataset, tmp_path / "vtk")
    assert len(files) == dataset.sizes["time"]
    for index in (0, 7, len(files) - 1):
        root = ET.parse(files[index]).getroot()
        state = dataset.isel(time=index)
        piece = root.find(".//Piece")
        assert int(piece.get("NumberOfPoints")) == state.sizes["node"]
        assert int(piece.get("NumberOfLines")) == state.sizes["segment"]
        np.testing.assert_array_equal(data_array(root, ".//Points/DataArray"), state["position"])
        np.testing.assert_array_equal(
            data_array(root, ".//PointData/DataArray[@Name='velocity']"), state["velocity"]
        )
        np.testing.assert_array_equal(data_array(root, ".//PointData/DataArray[@Name='s']"), state["s"])
        np.testing.assert_array_equal(
            data_array(root, ".//CellData/DataArray[@Name='tension']"), state["tension"]
        )
        segments = np.arange(state.sizes["segment"])
        np.testing.assert_array_equal(lines_of(root), np.stack([segments, segments + 1], axis=1))


def test_collection_names_every_file_with_its_time(dataset, tmp_path):
    collection, *files = export_vtk(dataset, tmp_path, name="a & b")
    entries = ET.parse(collection).getroot().findall(".//DataSet")
    assert [entry.get("file") for entry in entries] == [file.name for file in files]
    assert [float(entry.get("timestep")) for entry in entries] == dataset["time"].values.tolist()
    assert files == sorted(files)


def test_nodes_on_the_drum_are_left_out(half_deployed, tmp_path):
    _, first, *_ = export_vtk(half_deployed, tmp_path)
    root = ET.parse(first).getroot()
    nodes = half_deployed.sizes["node"] - 10
    assert data_array(root, ".//Points/DataArray").shape == (nodes, 3)
    tension = data_array(root, ".//CellData/DataArray[@Name='tension']")
    np.testing.assert_array_equal(tension, half_deployed["tension"].values[0, : nodes - 1])
    assert lines_of(root).max() == nodes - 1
    assert np.isfinite(tension).all()


def test_a_hole_in_the_cable_makes_two_pieces(dataset, tmp_path):
    dataset["position"][0, 5] = np.nan
    _, first, *_ = export_vtk(dataset, tmp_path)
    root = ET.parse(first).getroot()
    lines = lines_of(root)
    assert len(lines) == dataset.sizes["segment"] - 2
    assert [4, 5] not in lines.tolist()
    points = data_array(root, ".//Points/DataArray")
    lengths = np.linalg.norm(points[lines[:, 1]] - points[lines[:, 0]], axis=1)
    assert lengths.max() < 1.01 * np.diff(dataset["s"]).max()


def test_positions_alone_are_enough(dataset, tmp_path):
    _, first, *_ = export_vtk(dataset[["position"]], tmp_path)
    root = ET.parse(first).getroot()
    assert root.find(".//CellData/DataArray") is None
    np.testing.assert_array_equal(data_array(root, ".//Points/DataArray"), dataset["position"][0])


def test_without_positions_it_says_how_to_get_them(dataset, tmp_path):
    with pytest.raises(ExportError, match="no `position`: add it to output"):
        export_vtk(dataset[["tension"]], tmp_path / "vtk")
    assert not (tmp_path / "vtk").exists()
