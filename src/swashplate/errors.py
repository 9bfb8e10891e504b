"""What goes wrong, said in one sentence that names what is wrong and what would be right."""


class SwashplateError(ValueError):
    """Base of all errors that a user can cause and mend."""


class InputError(SwashplateError):
    """A record, maneuver, option or argument that cannot be simulated."""


class ParameterError(SwashplateError):
    """A parameter that is missing, unknown or breaks a rule."""


class DomainError(SwashplateError):
    """A simulation that left the range in which the model's equations hold."""


class FileError(SwashplateError):
    """A file that cannot be read or written."""


class EquationError(SwashplateError):
    """An equation that uses what equations may not, or that cannot be differentiated."""
