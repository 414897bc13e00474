"""A plate with a central crack pulled apart at 20 m/s and at 50 m/s (figures 7.7 and 7.13):
straight growth, branching, and no branching with a horizon of one spacing. --quick: 20 m/s only."""
import numpy as np
from common import Case

SPACING, TIP, STEP = 1e-4, 0.005, 1.33666e-8
# Damage beside a straight crack is 0.399 with three spacings (linear volume correction) and one
# bond of four with one spacing; what lies above 0.95 of it is crack
CRACKED, CRACKED_SHORT = 0.38, 0.2375
GROWTH = {750: 4.55e-3, 1000: 9.95e-3, 1250: 16.25e-3}    # of the book's program [m]
RAYLEIGH = 2800.0                                        # [m/s]


def growth(results, output, limit):
    """How far the tip has come from its start: outermost point on the crack line that is crack
    [m].
    """
    x, damage = results.points, results.field("damage", output)
    line = (results.layer == 0) & (np.abs(x[:, 1]) < 0.6 * SPACING) & (damage > limit)
    return x[line, 0].max() - TIP, -x[line, 0].min() - TIP


def bands(results, output, limit):
    """The columns ahead of the first tip that the crack has crossed, and in each the number of
    separate bands of crack: those with more than three spacings of whole material between them."""
    x, damage = results.points, results.field("damage", output)
    crack = (results.layer == 0) & (damage > limit) & (np.abs(x[:, 0]) > TIP)
    column = np.round(x[crack, 0] / SPACING - 0.5).astype(int)
    row = np.round(x[crack, 1] / SPACING - 0.5).astype(int)
    number = {}
    for c in np.unique(column):
        rows = np.unique(row[column == c])
        number[c] = 1 + int(np.sum(np.diff(rows) > 4))
    return number


def branched(results, limit):
    """The part of the crossed columns with two bands or more, and the crack's largest distance from
    y = 0.
    """
    number = bands(results, results.outputs - 1, limit)
    x, damage = results.points, results.field("damage", results.outputs - 1)
    crack = (results.layer == 0) & (damage > limit)
    several = np.mean([n > 1 for n in number.values()]) if number else 0.0
    return float(several), np.abs(x[crack, 1]).max(), len(number)


def main():
    case = Case(__file__, __doc__)
    slow = case.run("slow.nml")
    way = {}
    for step, known in GROWTH.items():
        right, left = growth(slow, slow.output_at(step, STEP), CRACKED)
        way[step] = right
        case.near(f"20 m/s: growth after {step} steps [m]", right, known, absolute=0.4e-3)
        case.near("   left tip against right [m]", left, right, absolute=1.5 * SPACING)
    speed = (way[1250] - way[750]) / (500 * STEP)
    case.near("20 m/s: mean speed of the tip from step 750 to 1250 [m/s]", speed, 1700.0,
              relative=0.06)
    case.below("   below the Rayleigh speed [m/s]", speed, RAYLEIGH)
    part, off, columns = branched(slow, CRACKED)
    case.above("20 m/s: columns that the crack has crossed, regression", columns, 250)
    case.equal("   of them with more than one band", f"{100 * part:.0f} %", "0 %")
    case.below("   largest distance of the crack from its line, in spacings", off / SPACING, 5.0)
    runs = {"slow": slow}
    if not case.options.quick:
        fast = runs["fast"] = case.run("fast.nml")
        part, off, columns = branched(fast, CRACKED)
        case.above("50 m/s, horizon 3 spacings: columns crossed, regression", columns, 200)
        case.above("   part of them with two bands or more, regression", part, 0.25)
        case.above("   largest distance of a branch from the crack's line [m]", off, 2e-3)
        short = runs["short"] = case.run("fast_short_horizon.nml")
        part, off, columns = branched(short, CRACKED_SHORT)
        # Without bonds across the corners one column hardly pulls the next: the crack is straight
        # but slow
        case.above("50 m/s, horizon 1 spacing: columns crossed", columns, 50)
        case.equal("   of them with more than one band", f"{100 * part:.0f} %", "0 %")
        case.below("   largest distance of the crack from its line, in spacings", off / SPACING,
                   5.0)
    if case.options.pictures and not case.options.quick:
        from plot import figure_of_fields
        window = ((-0.025, 0.025), (-0.0125, 0.0125))
        figure_of_fields([(slow, "damage", "20 m/s, $\\delta = 3\\,\\Delta$"),
                          (runs["short"], "damage", "50 m/s, $\\delta = \\Delta$ (figure 7.7 a)"),
                          (runs["fast"], "damage",
                           "50 m/s, $\\delta = 3\\,\\Delta$ (figure 7.7 b)")],
                         case.folder / "cracks.png", width=6.0, window=window, dpi=110)
    case.finish()


main()
