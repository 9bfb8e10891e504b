"""Residuals of a drive under an observed record, and their derivatives by columns."""

from collections.abc import Sequence

import numpy as np

from swashplate import ParameterSet
from swashplate.equations.marching.jacobian import Jacobian, Triangle
from swashplate.equations.marching.observation import ObservedRecord, Own
from swashplate.simulation.residuals import made_ready, wanted_columns

NOTHING = Own()


def residuals(parameters: ParameterSet, observed: ObservedRecord, own: Own = NOTHING) -> np.ndarray:
    return made_ready(parameters, observed, (), own).residuals(observed)


def jacobian(
    parameters: ParameterSet,
    observed: ObservedRecord,
    columns: Sequence[str],
    own: Own = NOTHING,
    out: np.ndarray | None = None,
) -> Jacobian:
    found = made_ready(parameters, observed, columns, own).jacobian(observed, out)
    return found._replace(names=(*wanted_columns(tuple(columns)), *observed.own_columns))


def triangle(
    parameters: ParameterSet, observed: ObservedRecord, columns: Sequence[str], own: Own = NOTHING
) -> Triangle:
    found = made_ready(parameters, observed, columns, own).triangle(observed)
    return found._replace(names=(*wanted_columns(tuple(columns)), *observed.own_columns))
