"""Velocity of the sensor from closing speeds of echoes, of which only some are direct.

The likelihood of a velocity is that of a mixture (MLESAC: Torr and Zisserman, "MLESAC: A new robust estimator with
application to estimating image geometry", 2000): an echo is direct, with an error of its own standard deviation, or its
closing speed is uniform over the unambiguous span.
"""

import numpy as np
from numba import njit

#: Prior standard deviation of the velocity, m/s, above any walking speed: it keeps the fit regular where all echoes
#: come from one direction.
_UNKNOWN_SPEED = 10.0
#: Minimum number of echoes that determine a velocity.
MIN_ECHOES = 4


@njit(cache=True)
def _wrap(residual, span):
    return residual - span * np.rint(residual / span)


@njit(cache=True)
def _variance(u, spread, power, v, noise):
    """Variance of the difference between an echo's closing speed and that of a static echo from its direction."""
    speed_noise, power_noise, azimuth_noise, _, _ = noise
    # u_x is not measured: it follows from u_y and u_z, and so do its errors. The measured u_z is a mean over the
    # elevation pairs; the remaining u_z^2 is distributed like the square of a Gaussian.
    slope_y = v[1] - v[0] * u[1] / u[0]
    slope_z = v[2] - v[0] * u[2] / u[0]
    variance = speed_noise**2 + power_noise**2 / power + (slope_y * azimuth_noise) ** 2
    return variance + 0.5 * spread * (slope_z**2 + spread * (v[0] / u[0]) ** 2)


@njit(cache=True)
def fit_velocity(echoes, odds, random, noise, guess, span):
    """Fit a velocity to direct echoes among others.

    Args:
        echoes: (echo, >= 5) closing speed (m/s), u_y, u_z, variance of u_z, power over the median.
        odds: (echo,) prior odds that an echo is direct.
        random: (hypothesis, 2) uniform in [0, 1), by which pairs of echoes are drawn in proportion to their odds.
        noise: standard deviations of a strong echo's speed, of a weak one's (m/s), of u_y, of u_z over all echoes, and
            of the vertical speed (m/s).
        guess: m/s, standard deviation of the velocity of a pair.
        span: m/s, unambiguous span of closing speeds.

    Returns:
        velocity (2,) m/s, its covariance (2, 2), and the number of echoes that agree with it.
    """
    count = len(echoes)
    unknown = np.array([[1.0, 0.0], [0.0, 1.0]])
    if count < MIN_ECHOES:
        return np.zeros(2), unknown, 0
    speed, spread, power = echoes[:, 0], echoes[:, 3], echoes[:, 4]
    elevation, climb = noise[3], noise[4]
    u = np.empty((count, 3))
    u[:, 1], u[:, 2] = echoes[:, 1], echoes[:, 2] * elevation**2 / (elevation**2 + spread)
    u[:, 0] = np.sqrt(np.maximum(1 - u[:, 1] ** 2 - u[:, 2] ** 2 - spread, 0.02))

    # Likelihood of a direct echo over that of another one, whose speed is uniform over the span, times the standard
    # deviation, without residual.
    ratio = odds * span / np.sqrt(2 * np.pi)
    shares = np.cumsum(odds) / max(np.sum(odds), 1e-30)
    shares[-1] = 1.0
    limit = max(1.5 * span / 2, 1.2 * np.abs(speed).max())
    best, score = np.zeros(3), -1.0
    for h in range(len(random) + 1):
        v = np.zeros(3)  # the first hypothesis is standing still
        if h:
            i, j = np.searchsorted(shares, random[h - 1, 0]), np.searchsorted(shares, random[h - 1, 1])
            det = u[i, 0] * u[j, 1] - u[j, 0] * u[i, 1]
            if abs(det) < 0.15:
                continue
            v[0] = (speed[i] * u[j, 1] - speed[j] * u[i, 1]) / det
            v[1] = (u[i, 0] * speed[j] - u[j, 0] * speed[i]) / det
            if v[0] ** 2 + v[1] ** 2 > limit**2:
                continue
        product, total = 1.0, 0.0
        for k in range(count):
            variance = _variance(u[k], spread[k], power[k], v, noise) + (climb * u[k, 2]) ** 2 + guess**2
            e = _wrap(speed[k] - v[0] * u[k, 0] - v[1] * u[k, 1], span)
            if e * e < 16 * variance:
                product *= 1 + ratio[k] / np.sqrt(variance) * np.exp(-0.5 * e * e / variance)
                if product > 1e100:  # fewer logarithms
                    product, total = 1.0, total + np.log(product)
        total += np.log(product)
        if total > score:
            best, score = v, total

    v = best.copy()
    normal = np.zeros((3, 3))
    scale, inliers = 1.0, 0
    for iteration in range(8):
        normal[:] = 0.0
        normal[0, 0] = normal[1, 1] = 1 / _UNKNOWN_SPEED**2
        normal[2, 2] = 1 / climb**2
        right = np.zeros(3)
        squares, weights, inliers = 0.0, 0.0, 0
        # Start with a wide residual scale and halve it in each iteration: otherwise a few strong echoes hold the fit at
        # the coarse velocity of a pair, which has no vertical speed.
        coarse = (2 * guess * 0.5**iteration) ** 2
        for k in range(count):
            variance = coarse + _variance(u[k], spread[k], power[k], v, noise)
            if iteration == 0:
                variance += (climb * u[k, 2]) ** 2
            predicted = v[0] * u[k, 0] + v[1] * u[k, 1] + v[2] * u[k, 2]
            e = _wrap(speed[k] - predicted, span)
            z = e * e / variance
            likely = ratio[k] / np.sqrt(variance) * np.exp(-0.5 * min(z, 60.0))
            w = likely / (1 + likely)  # probability that the echo is direct
            inliers += z < 9
            squares += w * z
            weights += w
            for a in range(3):
                right[a] += w / variance * u[k, a] * (e + predicted)
                for b in range(3):
                    normal[a, b] += w / variance * u[k, a] * u[k, b]
        v = np.linalg.solve(normal, right)
        scale = max(squares / max(weights - 2, 1.0), 1.0)
    covariance = np.linalg.inv(normal)[:2, :2] * scale
    # With few inliers, or few of all echoes, the fit may follow something else altogether.
    share = inliers / count
    covariance *= 1 + (0.5 / max(share, 0.05)) ** 4 + (8 / max(inliers, 1)) ** 4
    return v[:2].copy(), covariance.copy(), inliers
