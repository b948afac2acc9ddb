"""Integration of a residual F(t, Y, Y') = 0 in time; knows nothing of cables.

Depends on: nothing of ours.
"""

from cablesim.integrate.ida import IdaIntegrator
from cablesim.integrate.protocol import Advance, Equations, Integrator

__all__ = ["Advance", "Equations", "IdaIntegrator", "Integrator"]
