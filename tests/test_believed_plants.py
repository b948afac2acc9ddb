"""The placement study with estimators that believe something else than was simulated."""

import numpy as np
import pytest
from v_system import V_REST, v_run

import cablesim
from cablesim.sensors import SensorError
from cablesim.sensors.placement import compare_layouts, improve_layout, layout_errors, prepare_run

PAPER = [1.0, 1.3, 1.6, 1.9, 2.2]


@pytest.fixture(scope="module")
def run():
    return prepare_run(v_run(), step=0.3, rate=10.0)


def rms(found, quantity):
    return float(found.sel(quantity=quantity, statistic="rms"))


def test_truth_is_of_the_plant_and_estimates_are_of_what_is_believed(run):
    data = V_REST.model_dump(mode="json", exclude_none=True)
    data["cable"]["bending_stiffness"] *= 1.5
    wrong = prepare_run(v_run(), case=cablesim.Case.from_dict(data), step=0.3, rate=10.0)
    for name, values in run.truth.items():
        np.testing.assert_array_equal(wrong.truth[name], values)
    found, right = layout_errors(wrong, PAPER), layout_errors(run, PAPER)
    assert rms(found, "distance") > 3 * rms(right, "distance")
    assert rms(found, "distance at rest") < 0.25 * rms(found, "distance")
    assert rms(found, "straight arms") == rms(right, "straight arms")  # which believes nothing
    assert rms(found, "straight arms at rest") < 0.1 * rms(found, "straight arms")


def test_weights_come_from_the_calibration(run):
    assert np.isnan(rms(layout_errors(run, PAPER), "weights"))
    found = compare_layouts([run], {"paper": PAPER}, calibration=run).isel(layout=0, run=0)
    exact = found.sel(sensors="exact")
    assert rms(exact, "weights") < 1e-3
    assert rms(found.sel(sensors="BMX160"), "weights") > rms(exact, "weights")


def test_a_run_that_does_not_start_from_rest_has_no_offset_there(run):
    later = prepare_run(v_run().isel(time=slice(40, None)), step=0.3, rate=10.0)
    found = layout_errors(later, PAPER)
    assert found.sel(quantity=["distance at rest", "straight arms at rest"]).isnull().all()
    assert rms(found, "distance") < 0.01
    with pytest.raises(SensorError, match="The run v_rest does not start from rest"):
        improve_layout([run, later], PAPER)


def test_the_vehicle_knows_its_own_velocity(run):
    times = run.signals.time.values
    np.testing.assert_array_equal(run.vehicle_velocity[times <= 0.0], 0.0)
    speed = np.linalg.norm(run.vehicle_velocity, axis=1)
    np.testing.assert_allclose(speed[(times > 1.0) & (times < 4.0)], 0.2, atol=1e-6)
