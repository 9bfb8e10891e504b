"""A virtual test rig: a drive with known parameters, seen through the instruments of a campaign.

`run` simulates the tests and reads them with `Instruments`, of one of the `SEVERITIES` or of one's
own; `write` makes of them the files that a campaign leaves: logs, a campaign.toml and, apart, the
truth. Refinements that a fit is to find, or to miss, are parameters of the drive that is simulated.
Everything that is written says that it is virtual.

>>> from swashplate.campaign import rig
>>> tests = rig.run("hoist", seed=1)
>>> rig.write(tests, "virtual-hoist")
"""

from swashplate.campaign.rig.bench import COUNTS_PER_TURN as COUNTS_PER_TURN
from swashplate.campaign.rig.bench import VirtualRun as VirtualRun
from swashplate.campaign.rig.bench import VirtualTests as VirtualTests
from swashplate.campaign.rig.bench import run as run
from swashplate.campaign.rig.bench import write as write
from swashplate.campaign.rig.instruments import SEVERITIES as SEVERITIES
from swashplate.campaign.rig.instruments import Instruments as Instruments
from swashplate.campaign.rig.instruments import Severity as Severity
