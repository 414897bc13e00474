"""Lays out the pages of the site and calls FORD: guide, theory and cases beside the pages of the sources.

    python doc/site.py FORD BUILD        FORD: the command; BUILD: the folder where everything goes

Called by `./pf docs`. Pages are copies of `doc/*.md`, `README.md` and `cases/*/README.md` with the title
that FORD wants; links between them and to files of the project are turned to where they are on the site.
"""
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ORDER = ["user-guide", "input-reference", "library", "theory", "trade", "extremes", "performance", "reliability",
         "own-law", "architecture", "kernels", "glossary"]
CONFIG = """project: perifort
summary: {summary}
src_dir: {src}
include: {include}
page_dir: {pages}
output_dir: {out}
exclude_dir: {standin}
docmark: !
predocmark: >
display: public
proc_internals: false
source: false
graph: false
search: false
preprocess: false
warn: false
print_creation_date: false
version: {version}
license: by

{text}
"""


def title_of(text):
    """The first heading of a page, without marks."""
    match = re.search(r"^# +(.+)$", text, re.M)
    return re.sub(r"[`*:]", "", match[1]).strip() if match else "perifort"


def source_pages():
    """All pages: their source, and their place below the folder of pages."""
    found = {ROOT / "README.md": Path("readme.md")}
    known = {path.stem: path for path in sorted((ROOT / "doc").glob("*.md"))}
    for name in [n for n in ORDER if n in known] + sorted(set(known) - set(ORDER)):
        found[known[name]] = Path(f"{name}.md")
    found[ROOT / "cases" / "README.md"] = Path("cases/index.md")
    for path in sorted((ROOT / "cases").glob("*/README.md")):
        found[path] = Path("cases") / f"{path.parent.name}.md"
    return found


def with_links(text, source, place, places, faults):
    """Links to pages and files as the site has them; what leads nowhere is a fault."""
    def turned(match):
        label, target = match[1], match[2]
        path, _, anchor = target.partition("#")
        if re.match(r"[a-z]+:", target) or not path:
            return match[0]
        file = (source.parent / path).resolve()
        if not file.exists():
            faults.append(f"{source.relative_to(ROOT)}: a link leads to {target}, which is not there")
            return match[0]
        if file.is_dir() and (file / "README.md") in places:
            file = file / "README.md"
        if file not in places:
            return f"{label} (`{file.relative_to(ROOT)}`)"
        up = "../" * (len(place.parts) - 1)
        return f"[{label}]({up}{places[file].with_suffix('.html')}{'#' + anchor if anchor else ''})"
    return re.sub(r"(?<!!)\[([^\]]*)\]\(([^)\s]+)\)", turned, text)


def main():
    """Pages, settings, FORD, and whether it warned."""
    ford, build = sys.argv[1], Path(sys.argv[2]).resolve()
    work, out = build / "site", build / "docs"
    shutil.rmtree(work, ignore_errors=True)
    shutil.rmtree(out, ignore_errors=True)
    pages = work / "pages"
    places, faults = source_pages(), []
    for source, place in places.items():
        text = source.read_text(encoding="utf-8")
        title = title_of(text)
        body = re.sub(r"^# +.+\n", "", text, count=1, flags=re.M)
        body = with_links(body, source, place, places, faults)
        (pages / place).parent.mkdir(parents=True, exist_ok=True)
        (pages / place).write_text(f"title: {title}\n\n{body}", encoding="utf-8")
    listed = [place for place in places.values() if len(place.parts) == 1]
    contents = "\n".join(f"- [{title_of((ROOT / s).read_text(encoding='utf-8'))}]({p.with_suffix('.html')})"
                         for s, p in places.items())
    order = "\n".join(f"ordered_subpage: {p}" for p in listed)
    (pages / "index.md").write_text(f"title: Documents\n{order}\n\n{contents}\n", encoding="utf-8")
    toml = (ROOT / "fpm.toml").read_text(encoding="utf-8")
    value = lambda key: re.search(rf'^{key} = "(.*)"', toml, re.M)[1]
    settings = work / "site.md"
    settings.write_text(CONFIG.format(
        summary=value("description"), version=value("version"), src=ROOT / "src",
        include=ROOT / "src/perifort/force", pages=pages, out=out, standin=ROOT / "test/standin",
        text="The library's public face is the module [[perifort]]. Guide, theory and cases stand "
             "under [Documents](page/index.html)."), encoding="utf-8")
    run = subprocess.run([ford, str(settings)], capture_output=True, text=True, check=False)
    log = build / "log" / "docs.log"
    log.parent.mkdir(parents=True, exist_ok=True)
    log.write_text(run.stdout + run.stderr, encoding="utf-8")
    said = re.sub(r"\x1b\[[0-9;]*m", "", run.stdout + run.stderr)
    # lines of progress, with a bar, name sources and variables, of which some are called error
    warnings = [line.strip() for line in said.splitlines()
                if "━" not in line and re.search(r"\b(warning|error)\b", line, re.I)]
    for line in faults + warnings[:20]:
        print(line, file=sys.stderr)
    if run.returncode or faults or warnings or not (out / "index.html").exists():
        sys.exit(f"error: the site was not built without faults; see {log}")
    print(f"{out / 'index.html'}")


main()
