"""Rest shapes and other initial states, consistent with the discrete equations.

Depends on: scene, mesh, physics.

A ladder, and the report says which rung was used: straight, arc or elastic catenary give a first
shape; Newton on the static residual follows it to the full load; dynamic relaxation is last.
"""

from cablesim.statics.catenary import elastic_catenary as elastic_catenary
from cablesim.statics.outcome import InitialState as InitialState
from cablesim.statics.outcome import Rung as Rung
from cablesim.statics.outcome import StaticsError as StaticsError
from cablesim.statics.start import find_initial_state as find_initial_state
