"""Robots that btr has never seen, simulated by MuJoCo with something hidden; see `foreign_robots.py`."""
