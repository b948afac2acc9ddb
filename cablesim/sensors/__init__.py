"""Inertial sensors on the cable: what they read, what their readings tell, where to put them.

Depends on: case, scene, export; works on the dataset of a run.

`truth` has what estimates are compared with, `placement` what compares places of sensors.
"""

from cablesim.sensors import truth as truth
from cablesim.sensors.distance import rigid_arm_distance as rigid_arm_distance
from cablesim.sensors.distance import weigh_tangents as weigh_tangents
from cablesim.sensors.distance import weighted_distance as weighted_distance
from cablesim.sensors.errors import BMX160 as BMX160
from cablesim.sensors.errors import AxisErrors as AxisErrors
from cablesim.sensors.errors import ImuErrors as ImuErrors
from cablesim.sensors.errors import OrientationErrors as OrientationErrors
from cablesim.sensors.errors import add_errors as add_errors
from cablesim.sensors.errors import calibrated as calibrated
from cablesim.sensors.estimators import angle_curvature as angle_curvature
from cablesim.sensors.estimators import pair_curvature as pair_curvature
from cablesim.sensors.estimators import tangent_angles as tangent_angles
from cablesim.sensors.estimators import turning_angles as turning_angles
from cablesim.sensors.estimators import vehicle_heading as vehicle_heading
from cablesim.sensors.imu import imu_signals as imu_signals
from cablesim.sensors.logs import export_imu_csv as export_imu_csv
from cablesim.sensors.logs import read_imu_csv as read_imu_csv
from cablesim.sensors.problems import SensorError as SensorError
from cablesim.sensors.problems import SensorWarning as SensorWarning
from cablesim.sensors.pull import fit_phase_relation as fit_phase_relation
from cablesim.sensors.pull import outer_force as outer_force
from cablesim.sensors.pull import phase_lag as phase_lag
from cablesim.sensors.shape import estimate_shape as estimate_shape
from cablesim.sensors.shape import opening_at_rest as opening_at_rest
from cablesim.sensors.shape import shape_curvature as shape_curvature
from cablesim.sensors.shape import shape_distance as shape_distance
from cablesim.sensors.shape import tangents as tangents
