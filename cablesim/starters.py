"""Commented case files to start from, for `cablesim new`.

Depends on: nothing of ours.
"""

from __future__ import annotations

import json

SWAY = """\
# A rope hangs between two points and one of them is moved sideways. Change what you need.
# Every number may carry a unit ("5 mm", "10 kN", "2 min"); a bare number is in SI units.
# z is up; the cable runs from end A (s = 0) to end B (s = length).
#   cablesim validate {file}    is it right?
#   cablesim info {file}        what will be computed?
#   cablesim run {file}         compute it
name: {name}
description: A rope in water, one end moved 2 m sideways.

water:
  density: 1000 kg/m^3 # 1025 for sea water, 0 for vacuum
  # current: {{kind: uniform, velocity: [0.2, 0, 0]}} # m/s along x, y, z

cable:
  length: 3 m # unstretched
  diameter: 5 mm # on which drag acts
  mass_per_length: 55 g/m # dry
  # wet_weight: 0.35 N/m # in water; without it, it follows from mass and diameter
  axial_stiffness: 10 kN # EA
  # bending_stiffness: 1e-3 N m^2 # EI; without it the cable does not resist bending
  drag_normal: 1.2 # on the diameter
  drag_tangential: 0.01 # on the circumference

mesh:
  segment_length: 5 cm

# attachments: # point bodies on the cable
#   - {{kind: buoy, name: float, at: 1.5 m, mass: 20 g, volume: 60 cm^3, drag_area: 9 cm^2}}

ends:
  a:
    motion: fixed
    position: [0, 0, 0]
  b:
    motion: velocity_waypoints
    position: [1.5, 0, 0] # at t = 0
    waypoints: # t [s], velocity along x, y, z [m/s], linear in between
      - [0.0, 0, 0.0, 0]
      - [0.5, 0, 0.5, 0]
      - [4.0, 0, 0.5, 0]
      - [4.5, 0, 0.0, 0]

initial:
  shape: equilibrium # the rest shape of all this; others: taut, catenary, markers, state

simulation:
  duration: 10 s
  relative_tolerance: 5e-6 # smaller: more accurate, slower

output:
  interval: 20 ms
  # variables: [position, tension] # without it everything is kept
  # markers: {{count: 16}} # places along the cable whose positions are kept
"""

TOW = """\
# A ship takes up speed and tows a cable with a body at its free end. Change what you need.
# Every number may carry a unit ("8 mm", "2 knot", "3 min"); a bare number is in SI units.
# z is up; the cable runs from end A (s = 0) to end B (s = length).
name: {name}
description: A ship tows 100 m of cable with a body at its end, from rest to 2 m/s.

water:
  density: 1025 kg/m^3

cable:
  length: 100 m # unstretched
  diameter: 8 mm # on which drag acts
  mass_per_length: 0.25 kg/m # dry
  axial_stiffness: 3000 kN # EA
  drag_normal: 1.5 # on the diameter
  drag_tangential: 0.01 # on the circumference

mesh:
  segment_length: 1 m

attachments:
  - kind: body
    name: depressor
    at: 100 m # at the free end
    mass: 10 kg # dry
    volume: 1274 cm^3 # displaced
    drag_area: 67 cm^2 # drag coefficient times area
    added_mass: 0.5 # per displaced mass

ends:
  a: # the ship
    motion: velocity_waypoints
    position: [0, 0, 0]
    waypoints: # t [s], velocity along x, y, z [m/s], linear in between, the last one holds
      - [0, 0, 0, 0]
      - [20, 2, 0, 0]
  b:
    motion: free

initial:
  shape: taut # straight
  direction: [0, 0, -1] # from A to B: hanging down

simulation:
  duration: 180 s

output:
  interval: 0.5 s
"""

BUOYS = """\
# A neutral tether that bends, between a vehicle and a vessel, with a buoy and a ballast, in a current
# that changes with depth. Change what you need.
# Every number may carry a unit ("4 mm", "10 kN"); a bare number is in SI units.
# z is up; the cable runs from end A (s = 0) to end B (s = length).
name: {name}
description: A tether with a buoy and a ballast between a vehicle and a heaving vessel.

water:
  density: 1025 kg/m^3
  current:
    kind: profile
    heights: [-10, -5, 0]
    velocities: # m/s along x, y, z at each height
      - [0.05, 0.00, 0]
      - [0.10, 0.05, 0]
      - [0.20, 0.10, 0]

cable:
  length: 15 m # unstretched
  diameter: 8 mm # on which drag acts
  mass_per_length: 52 g/m # dry
  wet_weight: 0 N/m # neutral
  axial_stiffness: 20 kN # EA
  bending_stiffness: 0.05 N m^2 # EI
  drag_normal: 1.2 # on the diameter
  drag_tangential: 0.01 # on the circumference

mesh:
  segment_length: 20 cm
  refine: # shorter segments where the cable bends most
    - {{around: float, within: 40 cm, segment_length: 5 cm}}
    - {{around: weight, within: 40 cm, segment_length: 5 cm}}

attachments:
  - {{kind: buoy, name: float, at: 4 m, mass: 50 g, volume: 250 cm^3, drag_area: 20 cm^2}}
  - {{kind: ballast, name: weight, at: 8 m, mass: 400 g, volume: 50 cm^3, drag_area: 10 cm^2}}

ends:
  a: # the vehicle
    motion: fixed
    position: [6, 0, -8]
  b: # the vessel
    motion: harmonic
    position: [0, 0, 0]
    amplitude: [0, 0, 0.3 m]
    period: 6 s
    ramp: 6 s # the motion grows during this time

initial:
  shape: equilibrium

simulation:
  duration: 60 s

output:
  interval: 0.1 s
"""

WINCH = """\
# A tether between a vehicle that moves away and a winch that pays it out. Change what you need.
# Every number may carry a unit ("4 mm", "10 kN"); a bare number is in SI units.
# z is up; the cable runs from end A (s = 0, the vehicle) to end B (the winch).
name: {name}
description: A vehicle moves away and a winch pays out.

water:
  density: 1025 kg/m^3

cable:
  length: 30 m # all of it, what is on the drum included
  diameter: 8 mm # on which drag acts
  mass_per_length: 60 g/m # dry
  axial_stiffness: 20 kN # EA

mesh:
  segment_length: 20 cm

winch: # at end B
  deployed_length: 8 m # between A and B at t = 0
  maximum_speed: 1 m/s
  maximum_acceleration: 1 m/s^2
  minimum_length: 2 m # the run stops there
  payout:
    kind: waypoints
    waypoints: [[0, 0], [3, 0.3], [28, 0.3], [30, 0]] # t [s], speed [m/s], > 0: cable goes out
    # Instead a controller, asked every period with measurements that are delay old, may drive it:
    #   payout: {{kind: constant_tension, tension: 2 N, proportional: 0.02, period: 50 ms, delay: 100 ms}}
    # (a taut cable is stiff: with more it snatches), constant_length, buoy_gap, or your own Python,
    #   payout: {{kind: function, function: my_winch.py:command}}

# attachments: # counted from end A; those beyond the deployed length are on the drum
#   - {{kind: buoy, name: float, at: 12 m, mass: 50 g, volume: 250 cm^3, drag_area: 20 cm^2}}

ends:
  a: # the vehicle
    motion: rov_waypoints
    position: [6, 0, -4]
    heading: 0 deg # along +x
    channels: [surge, yaw]
    waypoints: # t [s], surge [m/s], yaw rate [rad/s]
      - [0, 0, 0]
      - [2, 0.3, 0]
      - [15, 0.3, 0]
      - [20, 0.3, 0.1]
      - [28, 0.3, 0]
      - [30, 0, 0]
  b: # the winch; may move as well: harmonic for a heaving vessel
    motion: fixed
    position: [0, 0, 0]

initial:
  shape: equilibrium

simulation:
  duration: 40 s

output:
  interval: 0.1 s
"""

STARTERS = {"sway": SWAY, "tow": TOW, "buoys": BUOYS, "winch": WINCH}
"""Name -> text with the places ``{name}`` and ``{file}``."""


def starter_text(kind: str, file: str, name: str) -> str:
    """Text of a starter case for a file.

    Parameters
    ----------
    kind : str
        One of `STARTERS`.
    file, name : str
        File name for the comments, and name of the case.

    Raises
    ------
    KeyError
        If there is no such starter.
    """
    return STARTERS[kind].format(file=file, name=json.dumps(name, ensure_ascii=False))
