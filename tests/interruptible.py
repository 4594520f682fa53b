"""Importing this lets Ctrl-C end what is started from here. What a script starts in the background ignores it, and so
would every program that it starts."""

import signal

signal.signal(signal.SIGINT, signal.default_int_handler)
