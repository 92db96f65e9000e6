"""The line with which a server says that its session is open; what it says of the scene before may have the same words."""
import re

LINE = r"^session '.*' is open( again)?(, waiting for people| after tick [0-9]+)$"


def is_open(line):
    return re.search(LINE, line) is not None
