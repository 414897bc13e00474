"""Scenes that nobody meant to write: mutations of the shipped ones, the same for the same number.

    bases(program, project, largest)   name -> files of a small scene that is in order
    mutant(bases, seed, number)        name of the base, what was done to it, its files
    keys(program)                      (group, key, type) of every key, as the program declares them

A scene is a dictionary from file names to bytes; the scene itself is `scene.nml`, the others are
the tables that it names. What is tried with keys and groups comes from `perifort reference`, so
that a new key is covered without a word here.
"""
import math
import random
import re
import subprocess

SCENE = "scene.nml"

NUMBERS = ["0", "-1", "1", "2", "1e308", "-1e308", "1e300", "-1e300", "1e150", "1e-150", "1e-300",
           "1e-320", "NaN", "-NaN", "Infinity", "-Infinity", "inf", "2147483647", "-2147483648",
           "2147483648", "4294967296", "9223372036854775807", "9223372036854775808", "1e12", "1e9",
           "1000000000000", "1e400", "1e-400", "1e99999999999", "0x10", "1.0.0", "--1", "+", ".",
           "1d5", "1e", "0.5", "1e-9", "1e6", "3*0", "0*1", "999999999*0", "2147483648*1", "*",
           "1*", "(1,2)", "1:3"]
WORDS = ["''", "'", '"', "'x", "''''", "/", "&", "=", ",", ",,", "!", "!'", "'../../outside'",
         "'/dev/null'", "'/dev/zero'", "'.'", "'-rf'", "'a\x01b'", "'a\x00b'", "'a\tb'",
         "'$(touch pwned)'", "';touch pwned'", ".true.", ".false.", "T", "'größe'", "'点'", "\x00",
         "\x1b[2J", "\ufeff", "'" + 2000 * "a" + "'", 5000 * "9", 300 * "(", "'x_min'", "'z_max'",
         "'relaxation'", "'explicit'", "'box'", "'all'", "'t'", "'x*t'", "'1/x'", "'1/(t-t)'",
         "'sqrt(x-0.01)'", "'if(x>0,1e300*t,-y)'", "'exp(1e9*t)'", "'x +'", "'((x)'", "'sin(x'",
         "'x^y^z^t'", "'0/0'", "'1e999'", "'-'", "'" + 500 * "(" + "x'", "'" + 400 * "-" + "1'"]
PIECES = [b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\r", b"\r\n", b"\t", b"\n\n", b"/", b"&", b"'",
          b'"', b"!", b"=", b",", b"*", b"(", b")", b"&end", b"&scene", b"$", b"\x7f", b"\xc3",
          b" " * 3000, b"\xf0\x9f\x92\xa5", b"1e999", b"9" * 400]


def run(program, *words):
    """What the program prints."""
    return subprocess.run([program, *words], check=True, capture_output=True, text=True).stdout


def keys(program):
    """Group, key and type of every key, from the program's own reference."""
    found, group = [], ""
    for line in run(program, "reference").splitlines():
        if line.startswith("## &"):
            group = line[4:].strip()
        row = re.match(r"\| `(\w+)`\s*\| ([^|]+?)\s*\|", line)
        if row and group:
            found.append((group, row[1], row[2]))
    return found


def small(text, largest):
    """A scene with fewer points, steps and iterations, which shows the same mistakes sooner."""
    def fewer(match):
        counts = [int(word) for word in re.findall(r"\d+", match[2])]
        common = math.gcd(*counts)
        for part in (part for part in range(1, common + 1) if common % part == 0):
            if math.prod(counts) <= largest * part**len(counts):
                counts = [count // part for count in counts]
                break
        return match[1] + ", ".join(map(str, counts))

    text = re.sub(r"^(\s*points\s*=\s*)([\d, ]+)", fewer, text, flags=re.M)
    # The lattice of a shape or a surface has a spacing instead of counts
    text = re.sub(r"^(\s*spacing\s*=\s*)(\S+)", lambda m: m[1] + f"{4 * float(m[2]):g}", text,
                  flags=re.M)
    # Larger cells need a larger horizon
    text = re.sub(r"^&horizon\b.*?^/", lambda m: re.sub(r"^(\s*)length\s*=.*$", r"\1ratio = 3.015", m[0], flags=re.M),
                  text, flags=re.M | re.S)
    text = re.sub(r"^(\s*steps\s*=\s*)(\d+)", lambda m: m[1] + str(min(int(m[2]), 20)), text,
                  flags=re.M)
    text = re.sub(r"^(\s*every\s*=\s*)(\d+)", lambda m: m[1] + str(min(int(m[2]), 5)), text,
                  flags=re.M)
    return re.sub(r"^(\s*maximum_iterations\s*=\s*)(\d+)",
                  lambda m: m[1] + str(min(int(m[2]), 100)), text, flags=re.M)


def points_of(text):
    """The number of points of a scene's first body that has counts; 64, that of the tables, without."""
    counts = re.search(r"^\s*points\s*=\s*([\d, ]+)", text, re.M)
    return math.prod(int(word) for word in re.findall(r"\d+", counts[1])) if counts else 64


def thinned(data, part):
    """A table of an initial state with each `part`-th of its rows; any other as it is."""
    head, *rows = data.splitlines(keepends=True)
    return head + b"".join(rows[::part]) if head[:1].isalpha() else data


def bases(program, project, largest=400):
    """The shipped scenes and templates that can be made small, with the tables they need."""
    table = "".join(f"{0.1 * i:.6g} {0.1 * j:.6g} 0 0.001\n" for j in range(8) for i in range(8))
    found = {}
    paths = [*project.glob("cases/*/*.nml"), *project.glob("test/scenes/*.nml")]
    for path in sorted(paths):
        if path.parent.name in ("fracture", "mesh_plate"):
            continue  # their small regions would be empty, and meshes are not thinned
        if path.match("bracket/lattice.nml"):
            continue  # with so few cells its region at the wall holds none
        if path.match("taylor_bar/impact.nml"):
            continue  # 8, 8 and 25 have no common factor, and a run of so many points takes too long
        whole = path.read_text(encoding="utf-8")
        text = small(whole, largest)
        number = points_of(text)
        if number > 10 * largest:
            continue  # counts without a common factor: too slow for thousands of runs
        files = {SCENE: text.encode()}
        for name in re.findall(r"^\s*surface\s*=\s*'([^']+)'", text, re.M):
            files[name] = (path.parent / name).read_bytes()
        for name in re.findall(r"^\s*file\s*=\s*'([^']+)'", text, re.M):
            # Only initial states stand in tables with a header; one row for each point
            if (path.parent / name).is_file():
                files[name] = thinned((path.parent / name).read_bytes(),
                                      points_of(whole) // number)
            elif re.search(r"&body[^/]*file", text):
                files[name] = table.encode()
            else:
                files[name] = ("velocity_x velocity_y velocity_z\n" + number * "0 0.1 -0.1\n").encode()
        found[str(path.relative_to(project))] = files
    listed = re.search(r"known: ([\w, ]+)|templates?: ([\w, ]+)", run_failing(program, "template", "?"))
    for name in (listed[1] or listed[2]).split(", ") if listed else []:
        found[f"template {name}"] = {SCENE: small(run(program, "template", name), largest).encode()}
    guide = (project / "doc/user-guide.md").read_text(encoding="utf-8")
    for block in re.findall(r"```fortran\n! (\w+\.nml)\n(.*?)```", guide, re.S):
        found[f"user guide {block[0]}"] = {SCENE: small(block[1], largest).encode()}
    return found


def run_failing(program, *words):
    """What the program says of wrong words."""
    return subprocess.run([program, *words], check=False, capture_output=True, text=True).stderr


def groups_of(text):
    """The groups of a scene's text and what stands between them, in order."""
    return re.split(r"(?m)(?=^&)", text)


def swap_values(dice, text):
    """Two keys exchange what stands behind their equals signs."""
    found = list(re.finditer(r"=[^\n=!]*", text))
    if len(found) < 2:
        return text
    first, second = sorted(dice.sample(found, 2), key=lambda match: match.start())
    return (text[:first.start()] + second[0] + text[first.end():second.start()] + first[0] +
            text[second.end():])


def replace_value(dice, text, hostile):
    """One value becomes a hostile one."""
    found = list(re.finditer(r"(?<=[=,\s])[^\s=,!&/()]+(?=\s*(?:,|\n|$))", text))
    if not found:
        return text
    match = dice.choice(found)
    return text[:match.start()] + dice.choice(hostile) + text[match.end():]


def add_key(dice, text, known):
    """A key is added to a group, mostly one that the group has."""
    group, key, _ = dice.choice(known)
    value = dice.choice(NUMBERS + WORDS)
    places = [match.end() for match in re.finditer(r"(?m)^&\w+", text)]
    own = [match.end() for match in re.finditer(rf"(?m)^&{group}\b", text)]
    subscript = dice.choice(["", "", "", "", "(1)", "(0)", "(2:1)", "(:)", "(2147483648)", "(1,1)",
                             "(3,3)", "()", "(-1:4)"])
    line = f"\n  {key}{subscript} = {value}\n"
    if not own and dice.random() < 0.7:
        return text + f"\n&{group}{line}/\n"
    if not places:
        return text + line
    at = dice.choice(own if own and dice.random() < 0.9 else places)
    return text[:at] + line + text[at:]


def move_groups(dice, text):
    """Groups are doubled, left out or put in another order."""
    parts = groups_of(text)
    what = dice.randrange(3)
    if what == 0:
        parts.insert(dice.randrange(len(parts) + 1), dice.choice(parts))
    elif what == 1:
        del parts[dice.randrange(len(parts))]
    else:
        dice.shuffle(parts)
    return "".join(parts)


def move_lines(dice, text):
    """Lines are doubled, left out, joined or swapped."""
    lines = text.split("\n")
    at, other = dice.randrange(len(lines)), dice.randrange(len(lines))
    what = dice.randrange(4)
    if what == 0:
        lines.insert(other, lines[at])
    elif what == 1:
        del lines[at]
    elif what == 2:
        lines[at], lines[other] = lines[other], lines[at]
    else:
        lines[at:at + 2] = ["".join(lines[at:at + 2])]
    return "\n".join(lines)


def drop_mark(dice, text):
    """One quote, comment sign, slash, comma or equals sign is left out."""
    places = [i for i, letter in enumerate(text) if letter in "'\"!/=,&"]
    if not places:
        return text
    at = dice.choice(places)
    return text[:at] + text[at + 1:]


def change_bytes(dice, data):
    """Bytes are flipped, left out, put in, doubled or cut off."""
    if not data:
        return data
    at = dice.randrange(len(data))
    length = dice.choice([1, 1, 1, 2, 5, 40])
    what = dice.randrange(5)
    if what == 0:
        return data[:at] + bytes([data[at] ^ (1 << dice.randrange(8))]) + data[at + 1:]
    if what == 1:
        return data[:at] + data[at + length:]
    if what == 2:
        return data[:at] + dice.choice(PIECES) + data[at:]
    if what == 3:
        return data[:at + length] + data[at:]
    return data[:at]


def mutate_scene(dice, data, known):
    """One mutation of the scene; its name and the new bytes."""
    text = data.decode("utf-8", "surrogateescape")
    what = dice.choices(["bytes", "swap", "number", "word", "key", "groups", "lines", "mark", "ends"],
                        [3, 2, 6, 3, 6, 2, 2, 2, 0.3])[0]
    if what == "bytes":
        return what, change_bytes(dice, data)
    if what == "swap":
        text = swap_values(dice, text)
    elif what == "number":
        text = replace_value(dice, text, NUMBERS)
    elif what == "word":
        text = replace_value(dice, text, WORDS)
    elif what == "key":
        text = add_key(dice, text, known)
    elif what == "groups":
        text = move_groups(dice, text)
    elif what == "lines":
        text = move_lines(dice, text)
    elif what == "mark":
        text = drop_mark(dice, text)
    else:
        text = dice.choice([text.replace("\n", "\r\n"), text.replace("  ", "\t"), text.rstrip("\n"),
                            "\ufeff" + text, text.upper(), text.replace("\n", "\r"), "", "\n"])
    return what, text.encode("utf-8", "surrogateescape")


def mutant(scenes, known, seed, number):
    """Mutant `number`: the name of its base, what was done, and its files."""
    dice = random.Random(f"{seed} {number}")
    name = dice.choice(sorted(scenes))
    files, done = dict(scenes[name]), []
    for _ in range(dice.choice([1, 1, 1, 1, 2, 3, 6])):
        others = [file for file in files if file != SCENE]
        if others and dice.random() < 0.4:
            file = dice.choice(others)
            done.append(f"bytes of {file}")
            files[file] = change_bytes(dice, files[file])
            continue
        what, files[SCENE] = mutate_scene(dice, files[SCENE], known)
        done.append(what)
    return name, ", ".join(done), files
