"""Integration of a residual F(t, Y, Y') = 0 in time; knows nothing of cables.

Depends on: nothing of ours.
"""

from cablesim.integrate.ida import IdaIntegrator
from cablesim.integrate.protocol import Equations, Integrator, Outcome

__all__ = ["Equations", "IdaIntegrator", "Integrator", "Outcome"]
