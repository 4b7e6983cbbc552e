"""What goes wrong because of the input, as opposed to because of a defect."""


class InputError(ValueError):
    """The user's input cannot be used.

    The message is one line that says what was expected, what was found and where; the command line
    prints it as it is and exits with status 2.
    """

    def __init__(self, message: str) -> None:
        # a message built from a library's own error may hold line breaks
        super().__init__(" ".join(str(message).split()))


class IdentifiabilityError(InputError):
    """The input is well formed, but does not determine the quantities asked for."""
