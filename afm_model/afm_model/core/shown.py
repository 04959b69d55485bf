"""Text of others as it is shown: in a message, in a log, in a terminal."""


def shown(text: object) -> str:
    """Return text on one line, with control characters and what is not Unicode as escapes.

    A request, a file or a name may hold line ends, which would look like lines of a log, and the escapes of a terminal.
    """
    line = str(text)
    return line if line.isprintable() else "".join(each if each.isprintable() else repr(each)[1:-1] for each in line)
