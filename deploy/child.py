"""Programs that a script starts, and that do not outlive it."""
import ctypes
import os
import signal

LIBC = ctypes.CDLL(None)
SCRIPT = os.getpid()
PR_SET_PDEATHSIG = 1


def die_with_the_script():
    """In a child before it becomes another program: the system kills it when the script ends, however it ends."""
    LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != SCRIPT:
        os._exit(1)
