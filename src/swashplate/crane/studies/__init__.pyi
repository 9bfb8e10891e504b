from .assessing import SEAWAYS as SEAWAYS
from .assessing import seaways_needed as seaways_needed
from .judging import Decision as Decision
from .operating import WORKABLE as WORKABLE
from .operating import label_of as label_of
from .study import EVALUATED_TIME as EVALUATED_TIME
from .study import NO_CONTROL as NO_CONTROL
from .study import RUN_IN as RUN_IN
