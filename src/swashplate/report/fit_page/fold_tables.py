"""Tables of a cross-validation: folds, held-out errors, spread of the estimates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from swashplate.errors import InputError
from swashplate.identification.assessment import Assessment
from swashplate.identification.cross_validation import CrossValidation
from swashplate.identification.validation import pooled, with_speeds
from swashplate.report.fit_page.numbers import NONE, fixed, percent, plain, unit_text
from swashplate.report.fit_page.verdict import rmse_words


class FoldRow(NamedTuple):
    """One fold."""

    number: str
    held: str
    state: str
    fits: str
    """Fit % of each channel."""


class HeldOutRow(NamedTuple):
    """A channel over all folds."""

    channel: str
    fit: str
    rmse: str
    fitted: str
    """RMSE of the fit to all runs."""
    ratio: str
    r_squared: str
    samples: str


class SpreadRow(NamedTuple):
    """An unknown over the folds."""

    name: str
    unit: str
    estimate: str
    """Of the fit to all runs."""
    error: str
    """Jackknife standard error, of the estimate."""
    quoted: str
    """Standard error that the fit quotes, of the estimate."""
    low: str
    high: str
    folds: str


class FoldTables(NamedTuple):
    """What the section on folds shows."""

    folds: tuple[FoldRow, ...]
    held_out: tuple[HeldOutRow, ...]
    spreads: tuple[SpreadRow, ...]
    remarks: tuple[str, ...]


def fold_tables(found: CrossValidation, assessments: Sequence[Assessment]) -> FoldTables:
    """The tables of a cross-validation beside the fit to all runs."""
    whole = pooled(with_speeds(each for stage in assessments for each in stage.runs))
    held_out = []
    for name, measures in found.measures.items():
        reference, unit = whole.get(name), found.units[name]
        held_out.append(
            HeldOutRow(
                name,
                fixed(measures.fit_percent, 2),
                rmse_words(unit, measures),
                NONE if reference is None else rmse_words(unit, reference),
                NONE
                if reference is None or not reference.rmse
                else f"{measures.rmse / reference.rmse:.2f}",
                fixed(measures.r_squared, 5),
                f"{measures.samples:,}",
            )
        )
    return FoldTables(
        tuple(_fold_row(found, number) for number in range(len(found.folds))),
        tuple(held_out),
        _spreads(found, assessments),
        found.sentences(),
    )


def _fold_row(found: CrossValidation, place: int) -> FoldRow:
    fold = found.folds[place]
    state = "not fitted" if fold.failure else "converged" if fold.converged else "not converged"
    if fold.lost:
        state = f"{state}; loses {', '.join(fold.lost)}"
    one = CrossValidation(found.seed, 1, (fold,)).measures
    fits = ", ".join(f"{name} {fixed(each.fit_percent, 2)} %" for name, each in one.items())
    return FoldRow(str(fold.number + 1), ", ".join(fold.held), state, fits or NONE)


def _spreads(found: CrossValidation, assessments: Sequence[Assessment]) -> tuple[SpreadRow, ...]:
    values = {
        (each.stage.stage.name, name): value
        for each in assessments
        for name, value in each.stage.values.items()
    }
    errors = _quoted(assessments)
    rows = []
    for each in found.spreads:
        key = (each.stage, each.name)
        value = values.get(key, each.mean)
        quoted = errors.get(key)
        rows.append(
            SpreadRow(
                each.name,
                unit_text(each.unit),
                plain(value),
                NONE if each.error is None else f"±{percent(each.error, value)}",
                NONE if quoted is None else f"±{percent(quoted, value)}",
                plain(each.lowest),
                plain(each.highest),
                str(each.folds),
            )
        )
    return tuple(rows)


def _quoted(assessments: Sequence[Assessment]) -> dict[tuple[str, str], float | None]:
    """Standard errors that the fit quotes, by stage and name, of the stages that have some."""
    errors: dict[tuple[str, str], float | None] = {}
    for each in assessments:
        try:
            found = each.uncertainty.estimates
        except InputError:  # the verdict says why there are none
            continue
        errors |= {(each.stage.stage.name, one.name): one.standard_error for one in found}
    return errors
