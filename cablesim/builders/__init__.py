"""Builders of a scene from a case, one module for each group of keys.

Depends on: nothing of ours.
"""
