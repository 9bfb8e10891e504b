"""Reading log files: one format a module, columns by name, nothing read that is not asked for.

`open_log` looks into a file, `Log.read` reads columns of it, `read_series` a signal over time in
SI. A file that is damaged or hostile ends in one sentence, and nothing half-read is returned.
"""

from swashplate.logs.dialect import TextOptions as TextOptions
from swashplate.logs.log import SUFFIXES as SUFFIXES
from swashplate.logs.log import Column as Column
from swashplate.logs.log import Log as Log
from swashplate.logs.log import Series as Series
from swashplate.logs.log import check_duration as check_duration
from swashplate.logs.log import check_stamps as check_stamps
from swashplate.logs.log import open_as as open_as
from swashplate.logs.log import open_log as open_log
from swashplate.logs.log import read_series as read_series
from swashplate.logs.log import unit_of as unit_of
from swashplate.logs.subprocess_reader import in_parts as in_parts
