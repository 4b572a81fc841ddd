"""Elementary functions whose bits are the same on every machine: sin, cos, atan2, exp, log, angle wrapping.

A machine's mathematics library may choose another rounding for another processor; these use only +, -, *, / and sqrt,
which IEEE 754 fixes. Ranges are reduced as by Cody and Waite; the polynomials are the minimax ones of FDLIBM (Sun
Microsystems, 1993). Measured against exact values: sin and cos within 2.3e-16 absolute for |angle| < 1e5 rad, atan2,
exp and log within 2.5e-16 relative.
"""

from __future__ import annotations

import numpy as np

from parcours.kernels import kernel

PI = 3.141592653589793
TAU = 6.283185307179586

HALF_PI_HIGH = 1.5707963267341256  # the first 33 bits of pi/2: k * high is exact for |k| < 2**20
HALF_PI_LOW = 6.077100506506192e-11
_LN2_HIGH = 6.93147180369123816490e-01
_LN2_LOW = 1.90821492927058770002e-10


@kernel
def sin_cos_near_zero(r: float) -> tuple[float, float]:
    """Return (sin r, cos r) for |r| <= pi/4 and a little more."""
    z = r * r
    s = r + r * z * (
        -1.66666666666666324348e-01
        + z
        * (
            8.33333333332248946124e-03
            + z
            * (
                -1.98412698298579493134e-04
                + z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10))
            )
        )
    )
    c = (
        1.0
        - 0.5 * z
        + z
        * z
        * (
            4.16666666666666019037e-02
            + z
            * (
                -1.38888888888741095749e-03
                + z
                * (
                    2.48015872894767294178e-05
                    + z
                    * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))
                )
            )
        )
    )
    return s, c


@kernel
def sin_cos(x: float) -> tuple[float, float]:
    """Return (sin x, cos x), x in radians.

    >>> s, c = sin_cos(0.5)
    >>> round(s, 15), round(c, 15)
    (0.479425538604203, 0.877582561890373)
    """
    turns = np.floor(x * 0.6366197723675814 + 0.5)
    r = (x - turns * HALF_PI_HIGH) - turns * HALF_PI_LOW
    s, c = sin_cos_near_zero(r)
    quadrant = int(turns) & 3
    # Choices, no branch: which quadrant it is cannot be foretold, and a loop over it is compiled to several angles.
    is_odd = quadrant & 1 == 1
    along, across = (c if is_odd else s), (s if is_odd else c)
    return -along if quadrant >= 2 else along, -across if (quadrant + 1) & 2 == 2 else across


@kernel
def atan2(y: float, x: float) -> float:
    """Return the angle of the vector (x, y) in (-pi, pi]; 0 for the null vector.

    >>> atan2(1.0, -1.0) == 3 * PI / 4
    True
    """
    # No branch, only choices between numbers: a loop over it is compiled to several angles at once.
    ax, ay = abs(x), abs(y)
    shallow = ay <= ax
    low, high = (ay if shallow else ax), (ax if shallow else ay)
    wide, middle = low > 0.6875 * high, low > 0.4375 * high
    over = low - high if wide else (2.0 * low - high if middle else low)
    under = low + high if wide else (2.0 * high + low if middle else high)
    base = 0.7853981633974483 if wide else (0.4636476090008061 if middle else 0.0)
    q = over / (under if under != 0.0 else 1.0)
    z = q * q
    w = z * z
    odd = z * (
        3.33333333333329318027e-01
        + w
        * (
            1.42857142725034663711e-01
            + w
            * (
                9.09088713343650656196e-02
                + w * (6.66107313738753120669e-02 + w * (4.97687799461593236017e-02 + w * 1.62858201153657823623e-02))
            )
        )
    )
    even = w * (
        -1.99999999998764832476e-01
        + w
        * (
            -1.11111104054623557880e-01
            + w * (-7.69187620504482999495e-02 + w * (-5.83357013379057348645e-02 + w * -3.65315727442169155270e-02))
        )
    )
    angle = base + (q - q * (odd + even))
    angle = angle if shallow else 1.5707963267948966 - angle
    angle = PI - angle if x < 0.0 else angle
    return -angle if y < 0.0 else angle


@kernel
def wrap(angle: float) -> float:
    """Return the angle brought into [-pi, pi), but for rounding (3e-13 rad at 1e5 rad).

    >>> wrap(3 * PI) == -PI
    True
    """
    if -3.14 < angle < 3.14:
        return angle  # what the division below comes to, too
    return float(angle - TAU * np.floor((angle + PI) / TAU))


@kernel
def exp_near_zero(x: float) -> tuple[float, float]:
    """Return (y, k) such that e**x is y * 2**k: k whole, y between sqrt(1/2) and sqrt(2), but for rounding."""
    k = np.floor(x * 1.4426950408889634 + 0.5)
    high = x - k * _LN2_HIGH
    low = k * _LN2_LOW
    r = high - low
    t = r * r
    c = r - t * (
        1.66666666666666019037e-01
        + t
        * (
            -2.77777777770155933842e-03
            + t * (6.61375632143793436117e-05 + t * (-1.65339022054652515390e-06 + t * 4.13813679705723846039e-08))
        )
    )
    return 1.0 - ((low - (r * c) / (2.0 - c)) - high), k


@kernel
def exp(x: float) -> float:
    """Return e**x for |x| < 700.

    >>> round(exp(1.0), 14)
    2.71828182845905
    """
    y, k = exp_near_zero(x)
    power = 2.0 if k > 0.0 else 0.5
    left = int(abs(k))
    while left > 0:  # times 2**k, which is exact
        if left & 1 == 1:
            y *= power
        power *= power
        left >>= 1
    return float(y)


@kernel
def log(x: float) -> float:
    """Return the natural logarithm of x, for x in (1e-300, 1e300).

    >>> round(log(10.0), 14)
    2.30258509299405
    """
    k = 0.0
    while x > 1.4142135623730951:
        x *= 0.5
        k += 1.0
    while x < 0.7071067811865476:
        x *= 2.0
        k -= 1.0
    f = x - 1.0
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    t1 = w * (3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01))
    t2 = z * (
        6.666666666666735130e-01
        + w * (2.857142874366239149e-01 + w * (1.818357216161805012e-01 + w * 1.479819860511658591e-01))
    )
    half = 0.5 * f * f
    return k * _LN2_HIGH - ((half - (s * (half + t1 + t2) + k * _LN2_LOW)) - f)
