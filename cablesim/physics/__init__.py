"""The discrete equations of the cable: state layout, residual and analytic Jacobian.

Depends on: scene, mesh.  Never on an integrator.
"""
