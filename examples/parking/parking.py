"""A car backs towards a wall in one dimension and brakes when its sensor says that it must.

Planted weakness: the controller knows neither the delay of its sensor nor ice, on which the brakes do a tenth.
"""

MARGIN = 0.3  # [m] it wants to keep
BRAKES = {"dry": 6.0, "wet": 3.0, "ice": 0.6}  # [m/s^2] that they do
TRUSTED = 3.0  # [m/s^2] that the controller trusts them to do
STEP = 0.01  # [s]


def drive(gap, speed, ground, delay):
    """Yield time [s], gap [m] and speed [m/s] until the car stands or touches the wall."""
    seen = [gap] * (1 + round(delay / STEP))  # the sensor shows the first of these
    time, braking = 0.0, False
    while speed > 0.0 and gap > 0.0:
        yield time, gap, speed
        braking = braking or seen.pop(0) <= speed**2 / (2.0 * TRUSTED) + MARGIN
        slower = max(speed - BRAKES[ground] * STEP, 0.0) if braking else speed
        gap, speed, time = gap - STEP * (speed + slower) / 2.0, slower, time + STEP
        seen.append(gap)
    yield time, gap, speed


def simulate(gap, speed, ground, delay):
    """Return the facts of one case."""
    *_, (_, left, impact) = drive(gap, speed, ground, delay)
    return {"hit": left <= 0.0, "impact": impact, "left": max(left, 0.0)}


def trace(gap, speed, ground, delay):
    """Return what a replay shows."""
    return ("time", "gap", "speed"), list(drive(gap, speed, ground, delay))
