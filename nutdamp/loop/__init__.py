"""The closed loop: a sensor that sees the motion, a law that fires by it, and the flight of both.

`sensor` makes signals and estimates of them, `law` says when to fire and for how long, `run` flies event by event,
`stability` tells whether a firing takes away more nutation than grows meanwhile.
"""
