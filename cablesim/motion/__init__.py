"""How the ends of a cable, and the length that a winch has paid out, move in time.

Depends on: nothing of ours.

World frame, z up, SI units, angles in radians.
"""

from cablesim.motion.fit import MAXIMUM_PIECES as MAXIMUM_PIECES
from cablesim.motion.fit import POSITION_TOLERANCE as POSITION_TOLERANCE
from cablesim.motion.harmonics import harmonic as harmonic
from cablesim.motion.pieces import FOREVER as FOREVER
from cablesim.motion.pieces import Motion as Motion
from cablesim.motion.pieces import earliest_fall as earliest_fall
from cablesim.motion.pieces import evaluate_pieces as evaluate_pieces
from cablesim.motion.recordings import recorded as recorded
from cablesim.motion.recordings import recorded_length as recorded_length
from cablesim.motion.rov import Heading as Heading
from cablesim.motion.rov import rov_heading as rov_heading
from cablesim.motion.rov import rov_waypoints as rov_waypoints
from cablesim.motion.waypoints import fixed as fixed
from cablesim.motion.waypoints import payout_waypoints as payout_waypoints
from cablesim.motion.waypoints import velocity_waypoints as velocity_waypoints
