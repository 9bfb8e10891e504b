"""Whether a machine is late behind its current: a delay and a lag that the named drive has not.

Between the current and the spool a pilot stage, a long line or a slow bus may lie. A drive without
them is made to follow by its other numbers, and a controller that is designed by it swings. So both
are in question after each fit of a whole drive, and become free if they are more than little.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swashplate.errors import DomainError
from swashplate.identification.estimation.setup import FitSetup, Free, Stage
from swashplate.identification.estimation.stages import smooth, stage_problem
from swashplate.identification.estimation.unknowns import Prior
from swashplate.identification.stage_fit import StageFit
from swashplate.parameters import ParameterSet

LATE = ("solenoid_delay", "solenoid_lag")
USUAL = {"solenoid_delay": 0.05, "solenoid_lag": 0.1}
"""Standard deviation of each beforehand, about 0: proportional valves take 10 to 60 ms, and of what
follows them, which may be as slow as the pump, the lag is all that stands for it. [s]"""
FIRST = {"solenoid_delay": 0.003, "solenoid_lag": 0.03}
"""Where the search begins of a drive that was read off its logs. [s]"""
LARGEST_FIRST = 0.03
"""At most where any other begins. [s]"""
LARGEST = 0.5
"""[s]"""
MATTERS = 0.003
"""Sum of both below which neither is of use to anybody. [s]"""
EXPLAINS = 0.002
"""Part of the cost that they must explain, others following: next to nothing is chance."""


def is_whole_drive(setup: FitSetup) -> bool:
    """Whether the setup of a drive takes the whole of it by its priors."""
    (stage, *others) = setup.stages
    return not others and stage.has_spreads and stage.part == "chain"


def is_in_question(setup: FitSetup, nominal: ParameterSet) -> bool:
    """Whether a setup takes the whole of a drive by its priors, and nobody stated a lateness."""
    return is_whole_drive(setup) and not any(
        name in setup.stages[0].free or nominal.numbers.get(name) for name in LATE
    )


def with_lateness(setup: FitSetup) -> FitSetup:
    """The setup with a delay and a lag between current and spool, known to be near 0."""
    free = {
        name: Free(bounds=(0.0, LARGEST), prior=Prior(0.0, usual)) for name, usual in USUAL.items()
    }
    (stage,) = setup.stages
    late = stage.model_copy(update={"free": {**stage.free, **free}})
    return setup.model_copy(update={"stages": (late,)})


def lateness_of(stage_fit: StageFit, nominal: ParameterSet) -> dict[str, float]:
    """Delay and lag that the runs ask for, to begin a search at; none if they ask for none. [s]

    By one step of Gauss and Newton from where the fit ended, of all numbers with both beside them:
    their sum must matter, and the step must take a part of the cost away.
    """
    late: Stage = with_lateness(FitSetup(stages=(stage_fit.stage,))).stages[0]
    runs = stage_fit.problem.experiments
    problem = stage_problem(late, smooth(nominal), runs, threads=stage_fit.problem.threads)
    fitted = stage_fit.problem.unknowns
    worths = [unknown.worth for unknown in fitted if unknown.prior is not None]
    usual = float(np.median(worths)) if worths else 1.0
    worth_of = {unknown.label: unknown.worth for unknown in fitted}
    items = tuple(replace(u, worth=worth_of.get(u.label, usual)) for u in problem.unknowns)
    problem = replace(problem, unknowns=replace(problem.unknowns, items=items))
    start = problem.unknowns.vector_of(fitted.values(stage_fit.solution.vector))
    try:
        residuals, jacobian = problem.evaluate(start)
    except DomainError:
        return {}
    step = np.linalg.lstsq(jacobian, -residuals, rcond=1e-10)[0]
    squares = float(residuals @ residuals)
    left = float(np.sum((residuals + jacobian @ step) ** 2))
    numbers = [problem.unknowns.index(name) for name in LATE]
    sizes = step[numbers] * problem.unknowns.scales[numbers]
    if sizes.sum() < MATTERS or left > (1.0 - EXPLAINS) * squares:
        return {}
    # a search that begins at a bound stays there
    begin = np.clip(sizes, MATTERS, LARGEST_FIRST).tolist()
    return dict(zip(LATE, begin, strict=True))
