"""Errors that end a case as a recorded result instead of a crash."""


class DataError(ValueError):
    """The data of one case cannot be used; the message says what is wrong, where, and the remedy."""


class NotConvergedError(ArithmeticError):
    """A numerical method ended without an answer; the message gives the reason."""
