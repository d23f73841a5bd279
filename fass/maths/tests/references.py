#!/usr/bin/env python3
"""Prints references.txt: arguments and the true values of functions, by series in 90 digits.

Each row has a function, its arguments and the value, all as the bits of doubles. The value is
two of them: the nearest double, and the nearest to what that leaves.
"""

import random
import struct
from decimal import Decimal as D, getcontext

getcontext().prec = 90


def series(first, ratio):
    """Sums terms, of which each is the one before times `ratio(n)`, until they vanish."""
    total, term, n = D(0), first, 0
    while abs(term) > D(10) ** -88 * max(abs(total), D(10) ** -400):
        total += term
        n += 1
        term *= ratio(n)
    return total


def arctan(x):
    if abs(x) > D("0.05"):
        return 2 * arctan(x / (1 + (1 + x * x).sqrt()))
    return series(x, lambda n: -x * x * (2 * n - 1) / (2 * n + 1))


PI = 16 * arctan(D(1) / 5) - 4 * arctan(D(1) / 239)


def sin(x):
    x -= (x / (2 * PI)).to_integral_value() * 2 * PI
    return series(x, lambda n: -x * x / ((2 * n) * (2 * n + 1)))


def cos(x):
    x -= (x / (2 * PI)).to_integral_value() * 2 * PI
    return series(D(1), lambda n: -x * x / ((2 * n - 1) * (2 * n)))


def arctan2(y, x):
    if x == 0:
        return PI / 2 if y > 0 else -PI / 2
    angle = arctan(y / x)
    return angle if x > 0 else angle + (PI if y >= 0 else -PI)


def root(x):
    return ((1 - x) * (1 + x)).sqrt()


FUNCTIONS = {
    "sin": sin,
    "cos": cos,
    "tan": lambda x: sin(x) / cos(x),
    "atan": arctan,
    "asin": lambda x: arctan2(x, root(x)),
    "acos": lambda x: arctan2(root(x), x),
    "atan2": arctan2,
}


def bits(x):
    return struct.pack(">d", x).hex()


def row(name, *arguments):
    value = FUNCTIONS[name](*map(D, arguments))
    high = float(value)
    print(name, *map(bits, (*arguments, high, float(value - D(high)))))


draw = random.Random(17)
for name in ("sin", "cos", "tan"):
    # Next to multiples of a quarter turn little is left of the argument.
    for n in (1, 2, 3, 4, 7, 100, 355, 12345, 600000):
        row(name, float(n * PI / 2))
    for size in (1e-300, 1e-9, 1e-3, 0.1, 0.785, 1.0, 3.0, 100.0, 1e4, 1e6):
        for _ in range(12):
            row(name, draw.uniform(-size, size))
for name in ("asin", "acos"):
    for _ in range(100):
        row(name, draw.uniform(-1, 1))
    for x in (1e-9, 0.5, 0.999999, -0.999999, 1 - 2.0**-53):
        row(name, x)
for size in (1e-300, 1e-5, 0.1, 1.0, 10.0, 1e5, 1e200):
    for _ in range(15):
        row("atan", draw.uniform(-size, size))
        row("atan2", draw.uniform(-size, size), draw.uniform(-1, 1))
