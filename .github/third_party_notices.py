"""Prints name, version, licence and licence texts of every crate that ends up in the binary `quell`, or in another package.

Usage: python3 .github/third_party_notices.py TARGET [PACKAGE] > THIRD-PARTY-NOTICES.txt
Ends with status 1 where a crate ships neither a licence text nor a known licence expression.
"""

import json
import pathlib
import subprocess
import sys

LICENCE_FILES = ("license", "licence", "copying", "notice", "unlicense", "copyright")


def main() -> int:
    target, package = sys.argv[1], (sys.argv[2:] or ["quell-cli"])[0]
    command = ["cargo", "metadata", "--locked", "--format-version", "1", "--filter-platform", target]
    metadata = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
    packages = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    root = next(p["id"] for p in metadata["packages"] if p["name"] == package)

    # What is linked: normal dependencies only, neither those of tests nor those of build scripts.
    linked, waiting = set(), [root]
    while waiting:
        linking = waiting.pop()
        if linking in linked:
            continue
        linked.add(linking)
        for dependency in nodes[linking]["deps"]:
            if any(kind["kind"] is None for kind in dependency["dep_kinds"]):
                waiting.append(dependency["pkg"])

    out = ["quell contains the following works of others, under the licences that each states.", ""]
    missing, texts = [], {}
    foreign = [packages[i] for i in linked if packages[i]["source"]]
    for package in sorted(foreign, key=lambda p: (p["name"], p["version"])):
        title = f"{package['name']} {package['version']}"
        folder = pathlib.Path(package["manifest_path"]).parent
        files = [f for f in sorted(folder.iterdir()) if f.is_file() and f.name.lower().startswith(LICENCE_FILES)]
        if not files and not package["license"]:
            missing.append(title)
        out += [f"{title}: {package['license'] or 'see its licence text'}", f"    {package['repository'] or ''}".rstrip()]
        for file in files:
            text = file.read_text(encoding="utf-8", errors="replace").strip()
            texts.setdefault(text, []).append(f"{title} ({file.name})")
    for text, users in texts.items():
        out += ["", "=" * 80, "For " + ", ".join(users) + ":", "", text]
    sys.stdout.reconfigure(encoding="utf-8")
    print("\n".join(out))
    if missing:
        print("no licence found for: " + ", ".join(missing), file=sys.stderr)
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
