"""Recorded positions and lengths from CSV, netCDF or a Qualisys QTM export.

Depends on: nothing of ours.

A marker that was lost (empty cells in CSV, fill values in netCDF, empty or 0 0 0 in a QTM export)
leaves a gap in time, which is logged.
Anything else that is not a finite number is refused, with its place in the file.
"""

from cablesim.recording.read import read_columns as read_columns
from cablesim.recording.read import read_lengths as read_lengths
from cablesim.recording.read import read_markers as read_markers
from cablesim.recording.read import read_recording as read_recording
from cablesim.recording.read import rotate_to_vertical as rotate_to_vertical
from cablesim.recording.source import RecordingError as RecordingError
