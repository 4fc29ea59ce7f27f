"""Exceptions and warnings of the package."""


class Error(Exception):
    """Everything that goes wrong in quell itself."""


class InputError(Error, ValueError):
    """An argument cannot be used; the message begins with its name, or with the frame, and holds the value."""


class FileError(Error, OSError):
    """A file or folder cannot be read or written; the message names it."""


class QuellWarning(UserWarning):
    """The result is less good than it could be, and why."""
