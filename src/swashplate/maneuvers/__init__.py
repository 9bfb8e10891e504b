"""Maneuvers: the voltage that a joystick commands over time, for tests of a drive.

`step`, `ramp`, `sine`, `stairs`, `chirp`, `multisine`, `recorded` and `rest` make one; `+` puts one
after another, a factor scales it, `superpose` adds voltages.

Most take three keywords, all in seconds: `start`, the rest before the command; `settle`, how long
the cubic return to (0 V, 0 V/s) lasts at the end, None or 0 for none; `length`, the whole. Every
function raises InputError, one sentence, for a number that is not finite or out of its range. What
goes beyond the ±10 V of a joystick is for the simulation to refuse.

No voltage exceeds the maneuver's `amplitude`, at any instant: that of a step, sine, chirp or
multisine, a ramp's `limit`, the largest of stairs and recorded voltages; of maneuvers one after
another it is the largest, of superposed ones the sum. The return starts with the slope that the
command ends with. Where the cubic would then leave the amplitude, as after a fast sine, it starts
with the steepest slope of that sign with which it stays within, at the amplitude itself with none.
"""

from swashplate.maneuvers.pieces import Maneuver as Maneuver
from swashplate.maneuvers.pieces import sampled as sampled
from swashplate.maneuvers.pieces import superpose as superpose
from swashplate.maneuvers.shapes import chirp as chirp
from swashplate.maneuvers.shapes import multisine as multisine
from swashplate.maneuvers.shapes import parse as parse
from swashplate.maneuvers.shapes import ramp as ramp
from swashplate.maneuvers.shapes import recorded as recorded
from swashplate.maneuvers.shapes import rest as rest
from swashplate.maneuvers.shapes import sine as sine
from swashplate.maneuvers.shapes import source_tests as source_tests
from swashplate.maneuvers.shapes import stairs as stairs
from swashplate.maneuvers.shapes import step as step
