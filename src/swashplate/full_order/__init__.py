"""The drive with five states: physical sets, simulation, comparison with one state."""

from swashplate.full_order.drive import SIGNAL_UNITS as SIGNAL_UNITS
from swashplate.full_order.drive import SIGNALS as SIGNALS
from swashplate.full_order.drive import TABLE_MANEUVERS as TABLE_MANEUVERS
from swashplate.full_order.drive import FullOrderDrive as FullOrderDrive
from swashplate.full_order.drive import FullOrderSimulation as FullOrderSimulation
from swashplate.full_order.drive import Modes as Modes
from swashplate.full_order.drive import OrderComparison as OrderComparison
from swashplate.full_order.drive import compare as compare
from swashplate.full_order.drive import validity as validity
from swashplate.full_order.drive import validity_table as validity_table
from swashplate.full_order.drive import validity_verdict as validity_verdict
from swashplate.full_order.physical_set import QUANTITIES as QUANTITIES
from swashplate.full_order.physical_set import PhysicalSet as PhysicalSet
from swashplate.full_order.physical_set import from_lumped as from_lumped
