"""Controllers of the winch.

Depends on: scene.
"""

from cablesim.control.laws import BuoyGap as BuoyGap
from cablesim.control.laws import ConstantLength as ConstantLength
from cablesim.control.laws import ConstantTension as ConstantTension
from cablesim.control.measurement import Controller as Controller
from cablesim.control.measurement import Measurement as Measurement
from cablesim.control.source import ControllerLoadError as ControllerLoadError
from cablesim.control.source import check_source as check_source
from cablesim.control.user import user_controller as user_controller
