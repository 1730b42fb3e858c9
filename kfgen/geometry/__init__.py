"""What states and measured components are, beside numbers: x [+] d, a [-] b, and means, in one place.

Algorithms go through these instead of + and - wherever a number may be an angle. The numbers may be traced values,
fractions or floats. The reference has a geometry of its own.
"""

from kfgen.geometry.circle import Circle
from kfgen.geometry.line import Line
from kfgen.geometry.part import Part, heaviest, part_of
from kfgen.geometry.rotation import Rotation
from kfgen.geometry.space import Space
from kfgen.geometry.turn import Turn, turn_of

__all__ = ["Circle", "Line", "Part", "Rotation", "Space", "Turn", "heaviest", "part_of", "turn_of"]
