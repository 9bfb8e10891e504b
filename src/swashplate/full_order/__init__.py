"""The drive with five states: physical sets, simulation, comparison with one state."""

from swashplate.full_order.comparison import Comparison as Comparison
from swashplate.full_order.comparison import Difference as Difference
from swashplate.full_order.comparison import Lag as Lag
from swashplate.full_order.comparison import compare as compare
from swashplate.full_order.comparison import convergence as convergence
from swashplate.full_order.comparison import validity as validity
from swashplate.full_order.continuous import Modes as Modes
from swashplate.full_order.drive import FullOrderDrive as FullOrderDrive
from swashplate.full_order.drive import FullOrderSimulation as FullOrderSimulation
from swashplate.full_order.physical_set import PhysicalSet as PhysicalSet
from swashplate.full_order.physical_set import from_lumped as from_lumped
