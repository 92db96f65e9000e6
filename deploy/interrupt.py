"""To be imported first: an interrupt (Ctrl-C) ends a script with exit code 130 and without a traceback, in its imports too."""
import sys


def end(kind, problem, trace):
    if issubclass(kind, KeyboardInterrupt):  # contexts have ended what they began
        sys.exit(130)
    sys.__excepthook__(kind, problem, trace)


sys.excepthook = end
