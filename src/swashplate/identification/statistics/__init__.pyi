from .determination import weak_unknowns as weak_unknowns
from .effects import effect_of_fixed as effect_of_fixed
from .effects import slopes_by as slopes_by
from .experiment_design import advice_table as advice_table
from .experiment_design import best_tests_table as best_tests_table
from .experiment_design import default_maneuvers as default_maneuvers
from .experiment_design import sequential_plan as sequential_plan
from .intervals import unseen_limits as unseen_limits
