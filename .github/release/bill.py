"""What the program is made of: a CycloneDX bill of materials, and a list of licences with their texts.

The crates are those that cargo resolves for the release's three targets, with default features, without those that only tests
or build scripts of tests use. Usage: bill.py --version V --sbom FILE --licences FILE
"""

import argparse
import datetime
import json
import os
import pathlib
import re
import subprocess
import sys
import uuid

TARGETS = ["x86_64-unknown-linux-gnu", "x86_64-unknown-linux-musl", "x86_64-pc-windows-gnu"]
TEXTS = re.compile(r"^(licen[cs]e|copying|notice|unlicense)", re.IGNORECASE)


def resolved(target):
    """Packages that are compiled into the program for `target`, or used to compile it."""
    command = ["cargo", "metadata", "--locked", "--format-version", "1", "--filter-platform", target]
    told = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    packages = {package["id"]: package for package in told["packages"]}
    nodes = {node["id"]: node for node in told["resolve"]["nodes"]}
    root = next(package["id"] for package in told["packages"] if package["name"] == "holodrive")
    found, links, open_ends = {}, {}, [root]
    while open_ends:
        here = open_ends.pop()
        if here in found:
            continue
        found[here] = packages[here]
        # A dependency of development alone has no kind but "dev".
        used = [
            link["pkg"]
            for link in nodes[here]["deps"]
            if any(kind["kind"] != "dev" for kind in link["dep_kinds"])
        ]
        links[here] = used
        open_ends.extend(used)
    return root, found, links


def purl(package):
    return f"pkg:cargo/{package['name']}@{package['version']}"


def checksums():
    """SHA-256 of each crate's archive, from the lock file."""
    text = pathlib.Path("Cargo.lock").read_text(encoding="utf-8")
    found = {}
    for block in text.split("[[package]]")[1:]:
        values = dict(re.findall(r'^(name|version|checksum) = "(.*)"$', block, re.MULTILINE))
        if "checksum" in values:
            found[values["name"], values["version"]] = values["checksum"]
    return found


def licence_of(package):
    """The licence as an SPDX expression; older crates write a stroke for OR."""
    licence = package["license"]
    return re.sub(r"\s*/\s*", " OR ", licence) if licence else None


def component(package, sums):
    made = {
        "type": "library",
        "bom-ref": purl(package),
        "name": package["name"],
        "version": package["version"],
        "purl": purl(package),
    }
    if licence_of(package):
        made["licenses"] = [{"expression": licence_of(package)}]
    if (package["name"], package["version"]) in sums:
        made["hashes"] = [{"alg": "SHA-256", "content": sums[package["name"], package["version"]]}]
    if package.get("repository"):
        made["externalReferences"] = [{"type": "vcs", "url": package["repository"]}]
    return made


def main():
    parser = argparse.ArgumentParser()
    for name in ["version", "sbom", "licences"]:
        parser.add_argument(f"--{name}", required=True)
    asked = parser.parse_args()
    packages, links, root = {}, {}, None
    for target in TARGETS:
        root, found, used = resolved(target)
        packages.update(found)
        for package, below in used.items():
            links.setdefault(package, set()).update(below)
    sums = checksums()
    own = packages.pop(root)
    assert own["version"] == asked.version, (own["version"], asked.version)
    ordered = sorted(packages.values(), key=lambda package: (package["name"], package["version"]))
    unnamed = [package["name"] for package in ordered if not package["license"] and not package["license_file"]]
    if unnamed:
        sys.exit(f"bill.py: no licence: {', '.join(unnamed)}")

    epoch = int(os.environ.get("SOURCE_DATE_EPOCH", "0"))
    top = component(own, sums) | {"type": "application"}
    bill = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "serialNumber": f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_URL, purl(own) + str(epoch))}",
        "version": 1,
        "metadata": {
            "timestamp": datetime.datetime.fromtimestamp(epoch, datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
            "component": top,
        },
        "components": [component(package, sums) for package in ordered],
        "dependencies": [
            {"ref": purl(every[package]), "dependsOn": sorted(purl(every[below]) for below in links[package])}
            for every in [packages | {root: own}]
            for package in sorted(links, key=lambda package: purl(every[package]))
        ],
    }
    pathlib.Path(asked.sbom).write_text(json.dumps(bill, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")

    lines = [f"holodrive {asked.version}: MIT OR Apache-2.0", "", "It is made of these crates:", ""]
    texts = {}
    for package in ordered:
        licence = licence_of(package) or f"see its file {package['license_file']}"
        lines.append(f"{package['name']} {package['version']}: {licence}")
        folder = pathlib.Path(package["manifest_path"]).parent
        for path in sorted(folder.iterdir()):
            if path.is_file() and TEXTS.match(path.name):
                text = path.read_text(encoding="utf-8", errors="replace").strip()
                texts.setdefault(text, []).append(f"{package['name']} {package['version']}")
    lines += ["", "The texts that they bring, each once:"]
    for text, crates in texts.items():
        lines += ["", "=" * 100, ", ".join(crates), "-" * 100, text]
    pathlib.Path(asked.licences).write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"{len(ordered)} crates, {len(texts)} different texts of licences")


if __name__ == "__main__":
    main()
