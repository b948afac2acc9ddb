"""Pictures show the numbers of the result."""

import sys

import numpy as np
import pytest
import xarray as xr
from runs import result, with_winch

from cablesim.plot import SNAPSHOTS, PlotError, attachment_distances, plot_run, snapshot_indices


def panel(figure, label, *, axis="y"):
    """The panel with this label."""
    found = [axes for axes in figure.axes if getattr(axes, f"get_{axis}label")() == label]
    assert len(found) == 1, [axes.get_ylabel() for axes in figure.axes]
    return found[0]


def titled(figure, title):
    return next(axes for axes in figure.axes if axes.get_title() == title)


def has_line(axes, x, y):
    """Whether a line of the panel has exactly these points."""
    return any(
        np.array_equal(line.get_xdata(), x, equal_nan=True)
        and np.array_equal(line.get_ydata(), y, equal_nan=True)
        for line in axes.lines
    )


def texts(axes):
    return {text.get_text() for text in axes.texts}


def drawn(figure):
    """Draw it, so that what matplotlib finds wrong only then is found."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    FigureCanvasAgg(figure).draw()
    return figure


def shapes(dataset):
    position = dataset["position"].values
    return position[snapshot_indices(dataset["time"].values, position)]


@pytest.fixture
def buoys():
    return result("buoys")


def test_shapes_from_the_side_and_from_above(buoys):
    figure = drawn(plot_run(buoys))
    side, top = titled(figure, "side view"), titled(figure, "top view, scales differ")
    assert (side.get_xlabel(), side.get_ylabel()) == ("x [m]", "z [m]")
    assert (top.get_xlabel(), top.get_ylabel()) == ("x [m]", "y [m]")
    for shape in shapes(buoys):
        assert has_line(side, shape[:, 0], shape[:, 2])
        assert has_line(top, shape[:, 0], shape[:, 1])
    assert (side.get_aspect(), top.get_aspect()) == (1.0, "auto")
    for axes in (side, top):
        assert texts(axes) == {"A", "B", "float", "weight"}


@pytest.mark.parametrize(("width", "equal"), [(0.2, True), (0.05, False)])
def test_scales_differ_where_one_span_is_below_a_tenth_of_the_other(buoys, width, equal):
    places = buoys["position"].values
    places[..., 1] *= width * np.ptp(places[..., 0]) / np.ptp(places[..., 1])
    (top,) = [a for p in drawn(plot_run(buoys)).subfigs for a in p.axes if "top view" in a.get_title()]
    assert (top.get_aspect() == 1.0) is equal
    assert ("scales differ" in top.get_title()) is not equal
    low, high = top.get_ylim()
    assert (np.ptp(places[..., 1]) / (high - low) > 0.5) is not equal


def test_labels_do_not_cover_one_another(buoys):
    buoys["attachment_position"].values[:, 1] = buoys["attachment_position"].values[:, 0]
    figure = drawn(plot_run(buoys))
    for axes in figure.subfigs[0].axes[:2]:
        boxes = [label.get_window_extent() for label in axes.texts]
        assert len(boxes) == 4
        assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])


def test_snapshots_are_coloured_by_their_time(buoys):
    figure = drawn(plot_run(buoys))
    side = titled(figure, "side view")
    bar = panel(figure, "time [s]")
    np.testing.assert_allclose(bar.get_ylim(), (buoys["time"][0], buoys["time"][-1]))
    colours = [line.get_color() for line in side.lines if len(line.get_xdata()) == buoys.sizes["node"]]
    assert len(set(colours)) == len(shapes(buoys))


def test_attachments_are_marked_on_every_shape(buoys):
    side = titled(plot_run(buoys), "side view")
    places = buoys["attachment_position"].values
    for index in snapshot_indices(buoys["time"].values, buoys["position"].values):
        assert has_line(side, places[index, :, 0], places[index, :, 2])


def test_side_view_is_along_the_wider_axis():
    figure = drawn(plot_run(result("sway")))
    assert titled(figure, "side view").get_xlabel() == "x [m]"
    swapped = result("sway")
    swapped["position"].values[..., [0, 1]] = swapped["position"].values[..., [1, 0]]
    assert titled(plot_run(swapped), "side view").get_xlabel() == "y [m]"


def test_motion_in_a_plane_has_one_view():
    tow = result("tow")
    figure = drawn(plot_run(tow))
    axes = titled(figure, "side view (all motion is in this plane)")
    assert axes.get_xlabel() == "x [m]"
    for shape in shapes(tow):
        assert has_line(axes, shape[:, 0], shape[:, 2])
    assert not [axes for axes in figure.axes if axes.get_title() == "top view"]


def test_an_oblique_plane_is_drawn_along_itself():
    tow = result("tow")
    along = tow["position"].values[..., 0].copy()
    tow["position"].values[..., 0], tow["position"].values[..., 1] = 0.6 * along, 0.8 * along
    axes = panel(drawn(plot_run(tow)), "distance along (0.600, 0.800) [m]", axis="x")
    drawn_x = np.concatenate([line.get_xdata() for line in axes.lines])
    assert np.isclose(drawn_x.max(), along.max())


def test_a_vertical_cable_is_drawn():
    tow = result("tow").isel(time=slice(0, 1))
    figure = drawn(plot_run(tow))
    assert panel(figure, "z [m]").get_xlabel() == "x [m]"


def test_tensions_at_the_ends_and_their_range(buoys):
    axes = panel(drawn(plot_run(buoys)), "tension [N]")
    time, tension = buoys["time"].values, buoys["tension"].values
    labelled = {line.get_label(): line for line in axes.lines}
    for number, end in enumerate("ab"):
        line = labelled[f"end {end.upper()}"]
        np.testing.assert_array_equal(line.get_xdata(), time)
        np.testing.assert_array_equal(line.get_ydata(), buoys["end_tension"].values[:, number])
    assert has_line(axes, time, tension.max(axis=1))
    assert has_line(axes, time, tension.min(axis=1))
    assert axes.get_xlabel() == "time [s]"


def test_distance_between_attachments(buoys):
    axes = panel(drawn(plot_run(buoys)), "distance between attachments [m]")
    places = buoys["attachment_position"].values
    expected = np.linalg.norm(places[:, 1] - places[:, 0], axis=1)
    assert has_line(axes, buoys["time"].values, expected)


def test_no_distances_with_fewer_than_two_attachments():
    for kind in ("sway", "tow"):
        labels = [axes.get_ylabel() for axes in plot_run(result(kind)).axes]
        assert "distance between attachments [m]" not in labels


def test_three_attachments_also_have_the_distance_of_first_and_last():
    places = np.array([[[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 4.0, 0.0]]])
    dataset = xr.Dataset(
        {"attachment_position": (("time", "attachment", "axis"), places)},
        {"attachment": ["a", "b", "c"], "time": [0.0]},
    )
    assert attachment_distances(dataset) == {"a to b": [3.0], "b to c": [4.0], "a to c": [5.0]}


def test_nodes_on_the_drum_are_gaps(buoys):
    for name in ("position", "tension"):
        buoys[name][:20, -10:] = np.nan
    buoys["attachment_position"][:20, 1] = np.nan
    figure = drawn(plot_run(buoys))
    first = buoys["position"].values[0]
    assert has_line(titled(figure, "side view"), first[:, 0], first[:, 2])


@pytest.mark.parametrize("name", ["position", "attachment_position"])
def test_a_panel_says_what_it_lacks(buoys, name):
    figure = drawn(plot_run(buoys.drop_vars(name)))
    said = " ".join(text for axes in figure.axes for text in texts(axes))
    assert f"no `{name}`: add it to output.variables" in said


def test_tension_range_without_ends_and_ends_without_range(buoys):
    for name in ("tension", "end_tension"):
        axes = panel(drawn(plot_run(buoys.drop_vars(name))), "tension [N]")
        assert len(axes.lines) == 2
    axes = panel(drawn(plot_run(buoys.drop_vars(["tension", "end_tension"]))), "tension [N]")
    assert "no `tension`" in " ".join(texts(axes))


def test_one_state_has_its_tension_along_the_cable(buoys):
    figure = drawn(plot_run(buoys.isel(time=[0])))
    axes = panel(figure, "tension [N]")
    assert has_line(axes, buoys["s_segment"].values, buoys["tension"].values[0])
    assert not [axes for axes in figure.axes if axes.get_ylabel() == "time [s]"]


def test_title_says_when_a_run_stopped(buoys):
    assert plot_run(buoys).get_suptitle() == "buoys"
    buoys.attrs["status"] = "not finite"
    assert plot_run(buoys).get_suptitle() == "buoys (not finite at 4 s)"


def test_no_label_or_legend_leaves_the_picture(buoys):
    figure = drawn(plot_run(buoys))
    renderer = figure.canvas.get_renderer()
    for axes in figure.axes:
        for artist in [*axes.texts, axes.xaxis.label, axes.yaxis.label, axes.title]:
            box = artist.get_window_extent(renderer)
            assert box.x0 >= 0
            assert box.y0 >= 0
            assert box.x1 <= 1600
            assert box.y1 <= 1000


def test_panels_do_not_overlap(buoys):
    figure = drawn(plot_run(buoys))
    boxes = [axes.get_tightbbox() for axes in figure.axes]
    for number, box in enumerate(boxes):
        for other in boxes[:number]:
            assert box.x0 >= other.x1 or other.x0 >= box.x1 or box.y0 >= other.y1 or other.y0 >= box.y1


def test_snapshots_follow_the_motion():
    times = np.linspace(0, 100, 1001)
    position = np.zeros((1001, 4, 3))
    position[:, :, 0] = 1 - np.exp(-times)[:, None]
    chosen = snapshot_indices(times, position)
    assert chosen[0] == 0
    assert chosen[-1] == 1000
    assert chosen.size <= SNAPSHOTS
    assert (times[chosen] < 10).sum() >= 5
    np.testing.assert_array_equal(snapshot_indices(times[:5], position[:5]), np.arange(5))


def test_snapshots_of_a_cable_at_rest_are_even():
    times = np.linspace(0, 11, 111)
    np.testing.assert_allclose(times[snapshot_indices(times, np.ones((111, 4, 3)))], np.arange(12))


def test_foreign_data_is_refused():
    with pytest.raises(PlotError, match="is it a result of cablesim"):
        plot_run(xr.Dataset({"temperature": ("month", [1.0])}))
    with pytest.raises(PlotError, match="is it a result of cablesim"):
        plot_run(xr.Dataset({"temperature": ("time", [1.0])}))


def test_missing_matplotlib_is_explained(buoys, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(PlotError, match=r"pip install 'cablesim\[plot\]'"):
        plot_run(buoys)


def test_deployed_length_of_a_winch(buoys):
    wound = with_winch(result("buoys"))
    axes = panel(drawn(plot_run(wound)), "deployed length [m]")
    assert has_line(axes, wound["time"].values, wound["deployed_length"].values)
    assert not [axes for axes in plot_run(buoys).axes if axes.get_ylabel() == "deployed length [m]"]
