"""The placement study: its errors are those of the estimators, and its search finds what is better."""

import numpy as np
import pytest
from shapes import resting
from v_system import V_REST, v_run

from cablesim.sensors import (
    SensorError,
    estimate_shape,
    imu_signals,
    shape_distance,
    truth,
)
from cablesim.sensors.placement import (
    EXACT,
    KINDS,
    Scales,
    compare_layouts,
    improve_layout,
    layout_errors,
    plot_layouts,
    prepare_run,
    score,
)

PAPER = [1.0, 1.3, 1.6, 1.9, 2.2]


@pytest.fixture(scope="module")
def run():
    return prepare_run(v_run(), step=0.05, rate=10.0)


def test_errors_are_those_of_the_estimators(run):
    read = imu_signals(v_run(), rate=10.0)
    exact = truth.distance(v_run(), 1.0, 2.2, read.time)
    expected = truth.errors_of(shape_distance(estimate_shape(read)), exact)
    found = layout_errors(run, PAPER).sel(quantity="distance")
    assert float(found.sel(statistic="rms")) == pytest.approx(expected["rms"], rel=1e-6)
    assert float(found.sel(statistic="max")) == pytest.approx(expected["max"], rel=1e-6)


def test_rest_before_a_run_changes_nothing_for_exact_sensors(run):
    shorter = prepare_run(v_run(), step=0.05, rate=10.0, rest=0.0)
    assert run.signals.sizes["time"] == shorter.signals.sizes["time"] + 100
    np.testing.assert_allclose(layout_errors(run, PAPER), layout_errors(shorter, PAPER), rtol=0.02, atol=1e-4)


def test_straight_arms_need_a_sensor_on_each_arm(run):
    found = layout_errors(run, [1.0, 1.6, 2.2]).sel(quantity="straight arms")
    assert found.isnull().all()
    assert layout_errors(run, [1.3, 1.9]).sel(quantity="straight arms", statistic="rms") > 0.1


def test_sensor_errors_make_it_worse_and_calibration_better(run):
    errors = {name: layout_errors(run, PAPER, kind).sel(statistic="rms") for name, kind in KINDS.items()}
    pull = {name: float(found.sel(quantity="pull")) for name, found in errors.items()}
    assert pull["exact"] < pull["calibrated"] < pull["BMX160"]
    assert errors["exact"].sel(quantity="turning") < errors["BMX160"].sel(quantity="turning")


def test_search_never_ends_worse_than_it_started_and_finds_what_all_layouts_hold(run):
    start = [1.0, 1.6, 2.2]
    limits = Scales()
    before = score(layout_errors(run, start), limits)
    best = improve_layout([run], start)
    assert best.score < 0.5 * before
    assert best.score == pytest.approx(score(layout_errors(run, best.places), limits))
    all_of_them = [
        score(layout_errors(run, [1.6 - away, 1.6, 1.6 + away]), limits) for away in np.arange(1, 13) * 0.05
    ]
    assert best.score == pytest.approx(min(all_of_them))  # one free distance: every choice was looked at
    assert np.allclose(np.array(best.places) + best.places[::-1], 3.2)


def test_search_without_symmetry(run):
    best = improve_layout([run], [1.1, 2.2], symmetric=False, sweeps=2)
    assert len(best.places) == 2
    assert best.score <= score(layout_errors(run, [1.1, 2.2]))


def test_comparison_and_its_picture(run, tmp_path):
    layouts = {"two": [1.3, 1.9], "the paper's": PAPER}
    compared = compare_layouts([run], layouts, {"exact": EXACT, "BMX160": KINDS["BMX160"]})
    assert compared.dims == ("layout", "run", "sensors", "quantity", "statistic")
    np.testing.assert_allclose(
        compared.sel(layout="two", run="v_rest", sensors="exact"), layout_errors(run, [1.3, 1.9])
    )
    assert str(compared.places.values[1]) == "1 1.3 1.6 1.9 2.2"
    figure = plot_layouts(compared, layouts)
    figure.savefig(tmp_path / "layouts.png")
    assert len(figure.axes) == 5


def test_refusals_repeat_what_was_given(run):
    with pytest.raises(SensorError, match=r"layout \[1\.3, 1\.31\] m has 1 places of the study"):
        layout_errors(run, [1.3, 1.31])
    with pytest.raises(SensorError, match=r"layout 1\.1 1\.6 m is not symmetric"):
        improve_layout([run], [1.1, 1.6])
    with pytest.raises(SensorError, match="holds no case"):
        prepare_run(resting(np.linspace(0.0, 1.0, 5), np.zeros((5, 3))))
    data = V_REST.model_dump(mode="json", exclude_none=True)
    data["attachments"] = data["attachments"][:1]
    data["mesh"].pop("refine")
    text = type(V_REST).from_dict(data).to_yaml()
    with pytest.raises(SensorError, match="has 1 bodies: two buoys and a ballast"):
        prepare_run(resting(np.linspace(0.0, 1.0, 5), np.zeros((5, 3))).assign_attrs(case=text))
