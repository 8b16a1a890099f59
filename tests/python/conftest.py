"""Settings of all tests."""

import signal

# Background processes of a shell ignore Ctrl-C, and children inherit that; the tests send Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)
