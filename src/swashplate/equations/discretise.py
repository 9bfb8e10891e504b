"""Continuous equations on the grid: a right-hand side as the step of a model, by a named method."""

from collections.abc import Callable
from typing import Any, Literal, NamedTuple, get_args, get_type_hints

from swashplate.equations.equation import equation_of_text
from swashplate.equations.model import Equation, arguments_of
from swashplate.equations.syntax import is_named_tuple, plain
from swashplate.errors import InputError

Method = Literal["euler", "heun", "midpoint", "rk4"]


class Tableau(NamedTuple):
    """Explicit Runge-Kutta method (Hairer, Nørsett and Wanner 1993, II.1)."""

    stages: tuple[tuple[float, ...], ...]
    """Of each slope behind the first, the weights of those before it."""
    weights: tuple[float, ...]
    """Of the slopes, in the step."""


TABLEAUS: dict[str, Tableau] = {
    "euler": Tableau((), (1.0,)),
    "heun": Tableau(((1.0,),), (0.5, 0.5)),
    "midpoint": Tableau(((0.5,),), (0.0, 1.0)),
    "rk4": Tableau(((0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
}


def discretised(
    rates: Equation, method: Method = "rk4", *, substeps: int = 1, project: Equation | None = None
) -> Equation:
    """Step of a model whose equation gives the rates of change of its state.

    Parameters
    ----------
    rates : equation
        d(state)/dt of ``state`` and of inputs, ``p``, ``k``, ``options`` and ``given`` as a step
        has them. It returns the type of the state, each number in its unit per second.
    method : {"euler", "heun", "midpoint", "rk4"}
        Explicit Runge-Kutta method, of order 1, 2, 2 and 4.
    substeps : int
        Steps of the method from one sample to the next, of equal length.
    project : equation, optional
        Of the same arguments: the state within its bounds, such as end stops, done to the state at
        the end of each sub-step.

    Returns
    -------
    equation
        The `step` of a `Model`; `source` shows its text. Derivatives are those of this step, not
        of the differential equation.

    Raises
    ------
    InputError
        For another method, fewer sub-steps than 1, or equations that cannot be a right-hand side.

    Notes
    -----
    Inputs are held over the step at what their taps give at its beginning. An input that is
    straight between samples keeps the method's order on a finer grid only, or with a tap that has
    a delay of a step at least: ``Tap("command", "delay", ahead=1.0, hold="mean")`` is its mean over
    the step.
    """
    if method not in TABLEAUS:
        raise InputError(f"There is no method '{method}'; there are {', '.join(get_args(Method))}.")
    if type(substeps) is not int or substeps < 1:
        raise InputError(f"substeps is {substeps!r}, but must be a whole number, at least 1.")
    kind = _state_of(rates)
    names: dict[str, Any] = {"rates": rates, "project": project}
    hints = get_type_hints(plain(rates), include_extras=True)
    if project is not None:
        if _state_of(project) is not kind:
            raise InputError(
                f"{plain(project).__name__} must return a {kind.__name__}, as "
                f"{plain(rates).__name__} does."
            )
        hints = {**get_type_hints(plain(project), include_extras=True), **hints}
    del hints["return"]
    names |= {f"{name}_type": hint for name, hint in hints.items()}
    arguments = [f"{name}: {name}_type" for name in hints]

    def state(weights: tuple[float, ...]) -> str:
        """Text of the state at the beginning of a sub-step, moved by weighted slopes."""
        moves = [
            f" + sub_step * slope_{j + 1}"
            if weight == 1.0
            else f" + sub_step * {weight!r} * slope_{j + 1}"
            for j, weight in enumerate(weights)
            if weight != 0.0
        ]
        return _built(
            kind, names, lambda path: f"state{path}" + "".join(f"{each}{path}" for each in moves)
        )

    def call(word: str, equation: Equation, at: str) -> str:
        given = [at if name == "state" else name for name in arguments_of(equation)]
        return f"{word}({', '.join(given)})"

    tableau = TABLEAUS[method]
    lines = [f"slope_1 = {call('rates', rates, 'state')}"]
    for i, row in enumerate(tableau.stages):
        lines.append(f"slope_{i + 2} = {call('rates', rates, state(row))}")
    lines.append(f"state = {state(tableau.weights)}")
    if project is not None:
        lines.append(f"state = {call('project', project, 'state')}")
    name = f"{plain(rates).__name__}_{method}"
    text = [
        f"def {name}({', '.join([*arguments, 'h: float'])}) -> state_type:",
        f'    """Step of {plain(rates).__name__}: {method}, {substeps} a sample."""',
        f"    sub_step = h / {float(substeps)!r}",
        f"    for _ in range({substeps}):",
        *(f"        {line}" for line in lines),
        "    return state",
        "",
    ]
    made: Equation = equation_of_text("\n".join(text), name, names)
    return made


def _state_of(equation: Equation) -> type[Any]:
    """Type of the state that an equation takes and returns."""
    name, arguments = plain(equation).__name__, arguments_of(equation)
    hints: dict[str, type[Any]] = get_type_hints(plain(equation))
    kind = hints.get("return")
    if kind is None or not is_named_tuple(kind) or hints.get("state") is not kind:
        raise InputError(
            f"{name} must take the state and return its type, as in 'def {name}(state: State, ...) "
            "-> State'."
        )
    for each in ("h", "signals"):
        if each in arguments:
            raise InputError(
                f"{name} asks for '{each}', which is known at samples only: a rate of change "
                "depends on the state at any instant."
            )
    for each in arguments:
        if each == "sub_step" or each.startswith("slope_"):
            raise InputError(f"{name}: the name '{each}' is taken; call the argument otherwise.")
    return kind


def _built(
    kind: type[Any], names: dict[str, Any], number: Callable[[str], str], path: str = ""
) -> str:
    """Text of a nested named tuple, its numbers written by their paths."""
    hints = get_type_hints(kind)
    word = f"{kind.__name__}_at{path.replace('.', '_')}"
    names[word] = kind
    items = [
        _built(hints[field], names, number, f"{path}.{field}")
        if is_named_tuple(hints[field])
        else number(f"{path}.{field}")
        for field in kind._fields
    ]
    return f"{word}({', '.join(items)})"
