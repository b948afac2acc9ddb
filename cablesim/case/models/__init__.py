"""The models of a case file: one field for each key, with its unit and default.

Depends on: quantities.

Every model is frozen and refuses unknown keys.  Fields hold SI floats; what may be written
for them (``"4 mm"``) is said in `quantities`.
"""

from cablesim.case.models.attachments import Attachment as Attachment
from cablesim.case.models.attachments import Body as Body
from cablesim.case.models.attachments import Imu as Imu
from cablesim.case.models.attachments import Mounting as Mounting
from cablesim.case.models.cable import Cable as Cable
from cablesim.case.models.cable import Mesh as Mesh
from cablesim.case.models.cable import Refinement as Refinement
from cablesim.case.models.ends import Channel as Channel
from cablesim.case.models.ends import End as End
from cablesim.case.models.ends import Ends as Ends
from cablesim.case.models.ends import FixedEnd as FixedEnd
from cablesim.case.models.ends import FreeEnd as FreeEnd
from cablesim.case.models.ends import HarmonicEnd as HarmonicEnd
from cablesim.case.models.ends import RecordedEnd as RecordedEnd
from cablesim.case.models.ends import RovWaypointsEnd as RovWaypointsEnd
from cablesim.case.models.ends import VelocityWaypointsEnd as VelocityWaypointsEnd
from cablesim.case.models.initial import CatenaryStart as CatenaryStart
from cablesim.case.models.initial import EquilibriumStart as EquilibriumStart
from cablesim.case.models.initial import Initial as Initial
from cablesim.case.models.initial import MarkersStart as MarkersStart
from cablesim.case.models.initial import MovingStart as MovingStart
from cablesim.case.models.initial import StateStart as StateStart
from cablesim.case.models.initial import TautStart as TautStart
from cablesim.case.models.measured import Cell as Cell
from cablesim.case.models.measured import MeanOfRows as MeanOfRows
from cablesim.case.models.measured import MeasuredOrigin as MeasuredOrigin
from cablesim.case.models.part import Part as Part
from cablesim.case.models.run import Output as Output
from cablesim.case.models.run import Simulation as Simulation
from cablesim.case.models.run import SpacedMarkers as SpacedMarkers
from cablesim.case.models.water import Current as Current
from cablesim.case.models.water import MapCurrent as MapCurrent
from cablesim.case.models.water import ProfileCurrent as ProfileCurrent
from cablesim.case.models.water import UniformCurrent as UniformCurrent
from cablesim.case.models.water import Water as Water
from cablesim.case.models.winch import BuoyGapPayout as BuoyGapPayout
from cablesim.case.models.winch import ConstantLengthPayout as ConstantLengthPayout
from cablesim.case.models.winch import ConstantTensionPayout as ConstantTensionPayout
from cablesim.case.models.winch import FunctionPayout as FunctionPayout
from cablesim.case.models.winch import Payout as Payout
from cablesim.case.models.winch import RecordedPayout as RecordedPayout
from cablesim.case.models.winch import WaypointsPayout as WaypointsPayout
from cablesim.case.models.winch import Winch as Winch
