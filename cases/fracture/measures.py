"""Cracks in results: which points are cracked, where they lie, when and how fast a tip came."""
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

# Damage of the points next to a straight crack is 0.399 with three spacings
CRACKED = 0.35


def spacing_of(results):
    """The distance of the points of a lattice [m]."""
    first = results.points[results.layer == 0][:, 0]
    return float(np.diff(np.unique(np.round(first, 9))).min())


def crack(results, output=-1, threshold=CRACKED, start=None):
    """Positions (n, 2) of the cracked points of the bodies; with `start` only of those that steps of
    at most 1.5 spacings join with the one nearest to it.
    """
    inside = (results.layer == 0) & (np.asarray(results.field("damage", output)) > threshold)
    x = results.points[inside, :2]
    if start is None or len(x) == 0:
        return x
    tree = cKDTree(x)
    pairs = tree.query_pairs(1.5 * spacing_of(results), output_type="ndarray")
    links = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(x), len(x)))
    _, part = connected_components(links, directed=False)
    return x[part == part[tree.query(start)[1]]]


def bands(x, spacing):
    """The columns along x that cracked points cross, and the number of bands in each: sets of rows
    with more than three spacings of whole material between them.
    """
    column = np.round(x[:, 0] / spacing - 0.5).astype(int)
    row = np.round(x[:, 1] / spacing - 0.5).astype(int)
    columns = np.unique(column)
    number = [1 + int(np.sum(np.diff(np.unique(row[column == c])) > 4)) for c in columns]
    return (columns + 0.5) * spacing, np.array(number)


def branching_place(x, spacing, ahead=10):
    """Where a crack along x splits: the first column from which on `ahead` columns in a row have two
    bands or more [m]; None if it does not.
    """
    places, number = bands(x, spacing)
    for i in range(len(places) - ahead):
        if np.all(number[i:i + ahead] >= 2):
            return float(places[i])
    return None


def time_at(tip, projection):
    """When the tip first came that far [s], linear between rows."""
    reached = np.flatnonzero(tip.projection >= projection)
    if len(reached) == 0:
        return np.nan
    i = int(reached[0])
    if i == 0:
        return float(tip.time[0])
    part = (projection - tip.projection[i - 1]) / (tip.projection[i] - tip.projection[i - 1])
    return float(tip.time[i - 1] + part * (tip.time[i] - tip.time[i - 1]))


def speed_between(tip, first, last):
    """Mean speed of a tip between two projections [m/s], by least squares over the rows."""
    inside = (tip.projection >= first) & (tip.projection <= last)
    if np.isnan(time_at(tip, last)) or inside.sum() < 3:
        return np.nan
    inside &= tip.time <= time_at(tip, last)
    return float(np.polyfit(tip.time[inside], tip.projection[inside], 1)[0])


def fastest(tip, way, last):
    """The largest mean speed over a way of growth [m/s], up to a projection: of all pairs of rows
    the first of which has come that much less far.
    """
    rows = np.flatnonzero(np.diff(np.asarray(tip.projection), prepend=-np.inf) > 0)
    place, time = np.asarray(tip.projection)[rows], np.asarray(tip.time)[rows]
    best = 0.0
    for i in np.flatnonzero(place <= last):
        back = np.flatnonzero(place <= place[i] - way)
        if len(back) > 1:
            j = int(back[-1])
            best = max(best, (place[i] - place[j]) / (time[i] - time[j]))
    return float(best)


def asymmetry(results, output=-1):
    """The part of the cracked points whose mirror image about y = 0 is not cracked."""
    x = crack(results, output)
    distance, _ = cKDTree(x).query(x * [1.0, -1.0])
    return float(np.mean(distance > 0.1 * spacing_of(results)))


def slope_angle(x, about):
    """Direction of a set of points as seen from a place, by least squares [degrees from the x axis]."""
    d = x - np.asarray(about)
    _, _, axes = np.linalg.svd(d, full_matrices=False)
    a = axes[0] * np.sign(np.sum(d @ axes[0]))
    return float(np.degrees(np.arctan2(a[1], a[0])))


def rayleigh_speed(young, nu, density, plane):
    """Longitudinal, shear and Rayleigh speed in the plane [m/s], the last by Rayleigh's equation."""
    mu = young / (2 * (1 + nu))
    longitudinal = young / (1 - nu**2) if plane == "stress" else \
        young * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    cp, cs = np.sqrt(longitudinal / density), np.sqrt(mu / density)
    low, high = 0.5, 0.9999
    equation = lambda r: (2 - r**2)**2 - 4 * np.sqrt(1 - r**2) * np.sqrt(1 - (r * cs / cp)**2)
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if equation(middle) < 0 else (low, middle)
    return cp, cs, cs * low
