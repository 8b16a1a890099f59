"""What every test file takes for granted."""

import signal

# A shell lets what it starts in the background ignore Ctrl-C, and children inherit that; tests press it.
signal.signal(signal.SIGINT, signal.default_int_handler)
