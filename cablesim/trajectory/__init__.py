"""Trajectories: states as they come, what follows from them, the labelled dataset and its file.

Depends on: scene, mesh, physics.
"""
