"""What can go wrong, in one line each.

Every message names the thing by the user's own name for it, gives the numbers, and says what to do.
The command line prints the message alone and leaves with `exit_code`.
"""


class NcgenError(Exception):
    """Anything ncgen refuses to do. `exit_code` is what the command line returns."""

    exit_code = 2


class ModelError(NcgenError):
    """The description of the mechanism is wrong or contradicts itself."""


class DomainError(ModelError):
    """A term of the model is not a number where it is needed: the message names its owner and the time."""


class CompileError(NcgenError):
    """A compiler was found but did not accept the sources; `log` is what it printed."""

    exit_code = 3

    def __init__(self, message: str, log: str = ""):
        super().__init__(message)
        self.log = log


class ConvergenceError(NcgenError):
    """An iteration did not reach its tolerance; `history` holds the norms of the residual."""

    exit_code = 4

    def __init__(self, message: str, history: tuple[float, ...] = ()):
        super().__init__(message)
        self.history = history


class SingularError(NcgenError):
    """A position or a matrix is singular where the calculation needs it not to be."""

    exit_code = 4


class Interrupted(KeyboardInterrupt):
    """A run was stopped by Ctrl-C; `run` is the trajectory up to there."""

    def __init__(self, run):
        super().__init__(f"{run.name}: stopped at t = {run.t[-1]:.6g} s")
        self.run = run
