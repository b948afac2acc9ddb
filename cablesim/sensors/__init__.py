"""Inertial sensors on the cable: what they read, what their readings tell, where to put them.

Depends on: case, scene, export; works on the dataset of a run.
"""

from cablesim.sensors.errors import BMX160 as BMX160
from cablesim.sensors.errors import AxisErrors as AxisErrors
from cablesim.sensors.errors import ImuErrors as ImuErrors
from cablesim.sensors.errors import OrientationErrors as OrientationErrors
from cablesim.sensors.errors import add_errors as add_errors
from cablesim.sensors.errors import without_offsets as without_offsets
from cablesim.sensors.imu import EARTH_FIELD as EARTH_FIELD
from cablesim.sensors.imu import imu_dataset as imu_dataset
from cablesim.sensors.imu import imu_signals as imu_signals
from cablesim.sensors.interpolation import SensorError as SensorError
from cablesim.sensors.logs import export_imu_csv as export_imu_csv
from cablesim.sensors.logs import read_imu_csv as read_imu_csv
