"""Packs the wheel of an extension that cargo has built, as ``maturin build`` does in one step.

The tests of the workspace and the extension share one build of the library only where cargo resolves them together, which maturin
does not ask for; so tests/run builds all with one command and packs what came of it::

    cargo build --release --workspace --lib --examples
    python src/python/pack.py target/release/lib_holodrive.so --out target/wheels
"""

from __future__ import annotations

import argparse
import base64
import hashlib
import re
import shutil
import subprocess
import sysconfig
import tempfile
import zipfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
#: What may be installed with it.
EXTRAS = ("progress", "slmsuite", "micromanager")


def stated(text: str, key: str) -> str:
    """The value of a key of TOML that is a string on one line."""
    found = re.search(rf'^{re.escape(key)} = "(.*)"$', text, re.M)
    if found is None:
        raise SystemExit(f"{key} is not stated")
    return found[1]


def listed(text: str, key: str) -> "list[str]":
    """The values of a key of TOML that is a list of strings on one line."""
    found = re.search(rf"^{re.escape(key)} = \[(.*)\]$", text, re.M)
    return re.findall(r'"([^"]*)"', found[1]) if found else []


def files() -> "dict[str, bytes]":
    """The package's own files, links followed, by their names in the wheel."""
    return {
        f"holodrive/{path.name}": path.read_bytes()
        for path in sorted((HERE / "holodrive").iterdir())
        if path.suffix in (".py", ".pyi") or path.name == "py.typed"
    }


def stripped(extension: Path) -> bytes:
    """The extension without its debugging information, where there is a program that takes it away."""
    if shutil.which("strip") is None:
        return extension.read_bytes()
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "extension"
        subprocess.run(["strip", "--strip-unneeded", "-o", str(out), str(extension)], check=True)
        return out.read_bytes()


def pack(extension: Path, out: Path) -> Path:
    """Writes the wheel into the folder and returns its name."""
    project, crate = (HERE / "pyproject.toml").read_text(), (HERE / "Cargo.toml").read_text()
    name, version = stated(project, "name"), stated(crate, "version")
    # abi3 from the Python that the crate's feature names.
    lowest = re.search(r'"abi3-py3(\d+)"', crate)
    if lowest is None or stated(project, "requires-python") != f">=3.{lowest[1]}":
        raise SystemExit("Cargo.toml and pyproject.toml name different Pythons")
    tag = f"cp3{lowest[1]}-abi3-{re.sub(r'[-.]', '_', sysconfig.get_platform())}"
    suffix = ".pyd" if extension.suffix == ".dll" else ".abi3.so"

    about = [
        "Metadata-Version: 2.4",
        f"Name: {name}",
        f"Version: {version}",
        f"Summary: {stated(project, 'description')}",
        f"License-Expression: {stated(project, 'license')}",
        f"Requires-Python: {stated(project, 'requires-python')}",
        *(f"Requires-Dist: {needed}" for needed in listed(project, "dependencies")),
        *(f"Requires-Dist: {needed}; extra == '{extra}'" for extra in EXTRAS for needed in listed(project, extra)),
        *(f"Provides-Extra: {extra}" for extra in EXTRAS),
        *(f"Classifier: {what}" for what in listed(project, "classifiers")),
    ]
    info = f"{name}-{version}.dist-info"
    contents = files()
    contents[f"holodrive/_holodrive{suffix}"] = stripped(extension)
    contents[f"{info}/METADATA"] = ("\n".join(about) + "\n").encode()
    contents[f"{info}/WHEEL"] = f"Wheel-Version: 1.0\nGenerator: pack.py\nRoot-Is-Purelib: false\nTag: {tag}\n".encode()
    contents[f"{info}/entry_points.txt"] = f"[console_scripts]\nholodrive = {stated(project, 'holodrive')}\n".encode()

    def digest(body: bytes) -> str:
        return "sha256=" + base64.urlsafe_b64encode(hashlib.sha256(body).digest()).rstrip(b"=").decode()

    record = [f"{path},{digest(body)},{len(body)}" for path, body in contents.items()]
    contents[f"{info}/RECORD"] = "\n".join([*record, f"{info}/RECORD,,", ""]).encode()

    out.mkdir(parents=True, exist_ok=True)
    wheel = out / f"{name}-{version}-{tag}.whl"
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, body in contents.items():
            # The same bytes from the same files, whenever they are packed.
            entry = zipfile.ZipInfo(path, (1980, 1, 1, 0, 0, 0))
            entry.external_attr = 0o644 << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, body)
    return wheel


def main() -> None:
    """Reads the arguments and packs."""
    arguments = argparse.ArgumentParser(description="Packs the wheel of an extension that cargo has built.")
    arguments.add_argument("extension", type=Path, help="target/release/lib_holodrive.so, .dylib or .dll")
    arguments.add_argument("--out", type=Path, default=Path("dist"), help="folder of the wheel")
    asked = arguments.parse_args()
    print(pack(asked.extension, asked.out))


if __name__ == "__main__":
    main()
