"""Stress intensity in static equilibrium, and waves: what a crack's load and speed are made of."""
import numpy as np
from common import change
from measures import rayleigh_speed


def centre_crack(case, count=None):
    """K_I of a crack in the middle over the closed form. `count`: points across the width."""
    young, stress, half, width = 1e9, 1e3, 0.25, 1.0
    count = count or (40 if case.options.quick else 80)
    text = change(case.scene("centre_crack.nml"), "body", points=f"{count}, {2 * count}")
    results = case.run(f"centre_crack_{count}.nml", text, threads=case.threads)
    # A cut crack is half a spacing longer at each tip (user guide, "Fracture")
    a = half + width / count / 2
    known = stress * np.sqrt(np.pi * a / np.cos(np.pi * a / width))
    of_given = stress * np.sqrt(np.pi * half / np.cos(np.pi * half / width))
    return (float(results.history["tip_K_I"][-1]), known,
            np.sqrt(results.history["tip_J"][-1] * young), of_given)


def edge_notch(case, count=None):
    """K_I of a single edge notch over the polynomial."""
    young, stress, length, width = 1e9, 1e3, 0.4, 1.0
    count = count or (40 if case.options.quick else 80)
    text = change(case.scene("edge_notch.nml"), "body", points=f"{count}, {3 * count}")
    results = case.run(f"edge_notch_{count}.nml", text, threads=case.threads)
    r = (length + width / count / 2) / width
    shape = 1.12 - 0.231 * r + 10.55 * r**2 - 21.72 * r**3 + 30.39 * r**4
    known = stress * np.sqrt(np.pi * r * width) * shape
    return (float(results.history["tip_K_I"][-1]), known,
            np.sqrt(results.history["tip_J"][-1] * young), None)


def stress_intensity(case):
    """J of both, and of the centre crack at four spacings."""
    for name, compute in (("centre crack", centre_crack), ("edge notch", edge_notch)):
        value, known, of_j, _ = compute(case)
        case.near(f"{name}: K_I by J [Pa m^0.5]", of_j, known, relative=0.02)
        case.show("   K_I by the interaction integral", value, known)
    if case.options.full:
        counts = (40, 60, 80, 120)
        errors = []
        for count in counts:
            _, known, of_j, of_given = centre_crack(case, count)
            errors.append(of_j / of_given - 1)
            case.show(f"centre crack, {count} spacings: error with half a spacing at each tip",
                      of_j / known - 1)
        show_orders(case, "centre crack, length as given", counts, errors)
    return []


def show_orders(case, name, counts, errors):
    """The error at each count, and the order p and limit e of the fit e + C spacing^p. With a horizon
    of so many spacings the limit is that of the lattice's own moduli, and not 0.
    """
    for count, error in zip(counts, errors):
        case.show(f"{name}: error with {count} spacings", error)
    best = None
    for order in np.arange(0.2, 4.01, 0.02):
        columns = np.column_stack([np.ones(len(counts)), (counts[0] / np.array(counts))**order])
        answer = np.linalg.lstsq(columns, np.array(errors), rcond=None)[0]
        misfit = float(np.sum((columns @ answer - errors)**2))
        if best is None or misfit < best[0]:
            best = (misfit, order, answer[0])
    case.show("   observed order", best[1])
    case.show("   limit of the error", best[2])


def rayleigh_wave(case, per_length):
    """Speed of the wave over Rayleigh's less 1, with so many spacings on a wavelength.

    The part of the surface's displacement at the wave number turns by c k t: its phase is the
    wave's, whatever the packet's width.
    """
    cp, cs, c = rayleigh_speed(1e9, 0.25, 1000.0, "strain")
    text = case.scene("rayleigh.nml")
    for name, value in (("c", c), ("q", np.sqrt(1 - (c / cp)**2)), ("s", np.sqrt(1 - (c / cs)**2))):
        text = text.replace(next(line for line in text.splitlines() if f"'{name}' value" in line),
                            f"&define name = '{name}' value = {value:.15g} /")
    text = change(text, "body", points=f"{20 * per_length}, {4 * per_length}")
    results = case.run(f"rayleigh_{per_length}.nml", text, threads=case.threads)
    x = results.points
    surface = x[:, 1] > -0.6 / per_length
    wave = np.exp(-2j * np.pi * x[surface, 0])
    part = [np.sum(np.asarray(results.field("displacement_y", k))[surface] * wave)
            for k in range(results.outputs)]
    turned = -np.unwrap(np.angle(part)) / (2 * np.pi)
    return np.polyfit(results.times, turned, 1)[0] / c - 1


def rayleigh(case):
    """The Rayleigh wave, at four spacings with --full."""
    standard = 20
    error = rayleigh_wave(case, standard)
    case.near("Rayleigh wave of 20 spacings: speed over the classical one", 1 + error, 1.0,
              relative=0.02)
    if case.options.full:
        counts = (10, 14, 20, 28)
        show_orders(case, "Rayleigh wave", counts, [rayleigh_wave(case, n) for n in counts])
    return []


def torsion_bar(case, across, rule="linear"):
    """Frequency of the first torsional vibration of a free square bar over the closed form, less 1.

    f = sqrt(J G/(rho I_p))/(2 L) with Saint-Venant's J = 0.14058 a^4 and I_p = a^4/6.
    """
    length, side, shear, density = 6.0, 1.0, 1e9 / 2.5, 1000.0
    series = 1 / 3 - 64 / np.pi**5 * sum(np.tanh((2 * k + 1) * np.pi / 2) / (2 * k + 1)**5
                                         for k in range(50))
    known = np.sqrt(series * shear / (density * side**2 / 6)) / (2 * length)
    text = change(case.scene("torsion.nml"), "body", points=f"{6 * across}, {across}, {across}")
    text += f"&horizon\n  volume_correction = '{rule}'\n/\n"
    results = case.run(f"torsion_{across}_{rule}.nml", text, threads=case.threads)
    probe = results.probe("corner")
    t, u = np.asarray(probe.time), np.asarray(probe.displacement_y)

    def misfit(f):
        waves = np.column_stack([np.sin(2 * np.pi * f * t), np.cos(2 * np.pi * f * t)])
        return float(np.sum((u - waves @ np.linalg.lstsq(waves, u, rcond=None)[0])**2))

    trial = known * np.linspace(0.7, 1.3, 601)
    best = int(np.argmin([misfit(f) for f in trial]))
    fine = np.linspace(trial[best - 1], trial[best + 1], 201)
    return fine[int(np.argmin([misfit(f) for f in fine]))] / known - 1


def torsion(case):
    """Torsion of a bar, at four spacings with --full."""
    case.near("torsion of a bar 10 points thick: frequency over the closed form",
              1 + torsion_bar(case, 10), 1.0, relative=0.05)
    case.show("   with volume_correction = 'linear_extended'",
              1 + torsion_bar(case, 10, "linear_extended"), 1.0)
    if case.options.full:
        counts = (6, 8, 12, 16)
        show_orders(case, "torsion", counts, [torsion_bar(case, n) for n in counts])
    return []


def closed_form(k, ratio=3.015, young=1e9, nu=0.2, density=1000.0):
    """Squares of the frequencies [1/s2] and polarisations (columns) of plane waves of wave number k
    on the infinite square lattice of spacing 1 m, plane stress, by sums over one family (theory 1
    to 4): rho w^2 = sum 4 b delta Gb n n (1 - cos k.xi)/|xi| V + 2 a t t,
    t = d delta Gd sum n sin k.xi/|xi| V.
    """
    mu, kappa = young / (2 * (1 + nu)), young / (2 * (1 - nu))
    a, b_delta, d_delta = (kappa - 2 * mu) / 2, 6 * mu / (np.pi * ratio**3), 2 / (np.pi * ratio**2)
    reach = int(ratio)
    i, j = np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1))
    xi = np.column_stack([i.ravel(), j.ravel()]).astype(float)
    length = np.linalg.norm(xi, axis=1)
    inside = (length > 0) & (length <= ratio * (1 + 1e-9))
    xi, length = xi[inside], length[inside]
    n = xi / length[:, None]
    weight = np.clip(ratio + 0.5 - length, 0, 1)
    # Surface correction makes the lattice's sums those of the continuum, along both axes alike
    uniaxial = (kappa + mu) / 2
    of_dilatation = 1 / (d_delta * np.sum(n[:, 0]**2 * weight))
    of_energy = (uniaxial - a) / (b_delta * np.sum(n[:, 0]**4 * length * weight))
    phase = xi @ k
    law = 4 * b_delta * of_energy * (1 - np.cos(phase)) / length * weight
    t = d_delta * of_dilatation * np.sum(n * (np.sin(phase) / length * weight)[:, None], axis=0)
    matrix = np.einsum("b,bi,bj->ij", law, n, n) + 2 * a * np.outer(t, t)
    return np.linalg.eigh(matrix / density)


def dispersion(case):
    """Plane waves of several lengths and directions against the sums over the lattice."""
    worst, rows = 0.0, []
    for spacings in (6, 12, 24):
        for angle in (0.0, 30.0, 45.0):
            direction = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
            k = 2 * np.pi / spacings * direction
            squares, shapes = closed_form(k)
            for kind, square, shape in zip(("shear", "longitudinal"), squares, shapes.T):
                text = case.scene("dispersion.nml")
                for name, value in zip(("kx", "ky", "ux", "uy"), (*k, *shape)):
                    line = next(line for line in text.splitlines() if f"'{name}' value" in line)
                    text = text.replace(line, f"&define name = '{name}' value = {value:.17g} /")
                results = case.run("dispersion.nml", text, threads=1)
                probe = results.probe("middle")
                u = np.column_stack([probe.displacement_x, probe.displacement_y]) @ shape
                step = float(results.history["step_size"][-1])
                # The integrator's own dispersion is exact: u'' is a second difference
                second = (u[2:] - 2 * u[1:-1] + u[:-2]) / step**2
                found = -np.sum(second * u[1:-1]) / np.sum(u[1:-1]**2)
                worst = max(worst, abs(np.sqrt(found / square) - 1))
                rows.append((kind, spacings, angle, np.sqrt(found / square) - 1))
                if angle == 0.0:
                    mu, nu, young = 1e9 / 2.4, 0.2, 1e9
                    modulus = mu if kind == "shear" else young / (1 - nu**2)
                    classical = 2 * np.pi / spacings * np.sqrt(modulus / 1000.0)
                    case.show(f"{kind} wave of {spacings} spacings along x: frequency over the "
                              "classical one", np.sqrt(found) / classical, np.sqrt(square) / classical)
    case.below("dispersion: largest relative difference from the closed form, 18 waves", worst, 1e-6)
    return []
